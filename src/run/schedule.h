// Samples and frames: what is done at the first step that ends at or after each multiple of an interval.
#pragma once

#include <cstdint>
#include <string>

#include <pliant/io/checkpoint.h>

namespace pliant {

/// An interval that is shorter than the steps makes every step due.
class Schedule {
 public:
  /// Positive, of any size.
  explicit Schedule(Real interval) : interval_(interval) {}

  bool due(Real t) const { return t >= time_of(next_); }
  /// It is done at time t >= 0, due or not. Takes no longer where it has been due many times since.
  void done(Real t);
  bool done_at(Real t) const { return last_ >= t; }

  void save(CheckpointWriter& checkpoint, const std::string& name) const { checkpoint.add(name, last_); }
  /// Errors: InputError, as of Checkpoint, also where it ought to have been done again before the checkpoint.
  void load(const Checkpoint& checkpoint, const std::string& name);

 private:
  /// A little earlier, for the rounding of times.
  Real time_of(std::int64_t k) const { return static_cast<Real>(k) * interval_ * (1 - 1e-12); }

  Real interval_;
  std::int64_t next_ = 0;
  Real last_ = -1;  ///< −1: not yet
};

}  // namespace pliant
