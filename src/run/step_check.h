// Refuses steps with which an explicit method is unstable.
#pragma once

#include <string_view>

#include <pliant/ts/integrator.h>

namespace pliant {

/// Whether a number is above a limit by more than rounding.
inline bool above(Real number, Real limit) { return number > limit * (1 + 1e-9); }

struct StepLimit {
  Real longest;  ///< stable step
  std::string_view unit;
  bool given = true;     ///< the user gave -dt
  bool rotates = false;  ///< particles have spins, which drag does not damp
};

/// Errors: InputError for a fixed step dt above the limit.
void check_stable_step(Real dt, const StepLimit& limit);

/// Errors: InputError for an explicit method with a fixed step, or a shortest controlled step (-ts_adapt_dt_min), above
/// the limit; also where the limit is 0, as no step is stable.
void check_stable(const Integrator& integrator, const StepLimit& limit);

}  // namespace pliant
