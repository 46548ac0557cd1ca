// When a hopper counts as clogged.
#pragma once

#include <cstdint>
#include <limits>

#include <pliant/base/errors.h>
#include <pliant/base/types.h>

namespace pliant {

/// Clogged: for the time `duration` no particle has crossed the orifice, every speed was below `speed_limit`, and
/// particles are left above the orifice. Judged at the samples that are fed in; motion that starts and stops between
/// two of them is not seen, so sample more often than a particle needs to fall one diameter.
class ClogDetector {
 public:
  /// State for checkpoints.
  struct State {
    Real quiet_since = std::numeric_limits<Real>::quiet_NaN();  ///< start of the quiet time; NaN while droplets move
    std::int64_t crossed = -1;  ///< crossings up to the last sample; −1: no sample yet
  };

  /// duration in t0, > 0; speed_limit in σ_avg/t0, > 0. Throws InputError otherwise.
  ClogDetector(Real duration, Real speed_limit) : duration_(duration), speed_limit_(speed_limit) {
    if (!(duration > 0) || !(speed_limit > 0))
      throw InputError("clog detection: duration {} and speed limit {} must be positive", duration, speed_limit);
  }

  /// One sample: time, crossings since the start, particles above the orifice, their largest speed. The times must not
  /// decrease. Returns whether the hopper is clogged.
  bool update(Real t, std::int64_t crossed, std::int64_t in_hopper, Real max_speed) {
    const bool at_rest = in_hopper > 0 && max_speed < speed_limit_;  // false for NaN
    if (!at_rest)
      state_.quiet_since = std::numeric_limits<Real>::quiet_NaN();
    else if (crossed != state_.crossed || !(state_.quiet_since <= t))
      state_.quiet_since = t;
    state_.crossed = crossed;
    return t - state_.quiet_since >= duration_;
  }

  const State& state() const { return state_; }
  void restore(const State& state) { state_ = state; }

 private:
  Real duration_, speed_limit_;
  State state_;
};

}  // namespace pliant
