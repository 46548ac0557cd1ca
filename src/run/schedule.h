// Samples and frames: actions at the first step that ends at or after each multiple of an interval.
#pragma once

#include <cstdint>
#include <string>

#include <pliant/io/run_writer.h>
#include <pliant/run/archive.h>

namespace pliant {

/// An interval that is shorter than the steps makes every step due.
class Schedule {
 public:
  /// Positive, of any size.
  explicit Schedule(Real interval) : interval_(interval), longest_(interval) {}

  bool due(Real t) const { return t >= time_of(next_); }
  /// Records the event at time t >= 0, due or not. Takes no longer if it has been due many times since.
  void done(Real t);
  bool done_at(Real t) const { return last_ >= t; }
  /// Whether a restart has changed the interval, and the longest one since the start of the run.
  bool changed() const { return changed_; }
  Real longest() const { return longest_; }

  /// The interval may be another than the checkpoint's. Errors: InputError, as of Checkpoint, also where it ought to
  /// have been done again before the checkpoint.
  void visit(Archive& archive, const std::string& name);

 private:
  /// A little earlier, for the rounding of times.
  Real time_of(std::int64_t k) const { return static_cast<Real>(k) * interval_ * (1 - 1e-12); }
  void restore(const Checkpoint& from, const std::string& name, Real last, Real interval);

  Real interval_, longest_;
  bool changed_ = false;
  std::int64_t next_ = 0;
  Real last_ = -1;  ///< −1: not yet
};

/// Picks samples that are evenly spaced, so that averages give each the same weight: all of a run whose interval never
/// changed, otherwise those that are due by the longest one.
class EvenSamples {
 public:
  explicit EvenSamples(const Schedule& samples) : all_(!samples.changed()), due_(samples.longest()) {}
  /// Whether to take the next sample, of this time.
  bool take(Real t);
  Real interval() const { return due_.longest(); }

 private:
  bool all_;
  Schedule due_;
};

/// The rows of a series that `even` takes; its columns "time" and "dt" have their times and the steps that led to them.
/// A state that lasts for a long step has few rows if error control makes steps longer than the interval. Then the
/// result has as many rows at equal distances in time, each the first at or after its time.
Series even_rows(const Series& series, EvenSamples even);

}  // namespace pliant
