#include <pliant/run/step_check.h>

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>

namespace pliant {

void check_stable_step(Real dt, const StepLimit& limit) {
  if (above(dt, limit.longest))
    throw InputError(
        "{} {:g} is {:.3g} times the limit of stability, {:.3g} {}: a dense packing would be unstable; {}, or override "
        "with -allow_unstable_dt",
        limit.given ? "-dt" : "the step", dt, dt / limit.longest, limit.longest, limit.unit,
        limit.given ? "shorten it or leave it out" : "give a shorter -dt");
}

void check_stable(const Integrator& integrator, const StepLimit& limit) {
  if (const Real least = integrator.shortest_controlled_step(); above(least, limit.longest))
    throw InputError(
        "-ts_adapt_dt_min {:g} is {:.3g} times the limit of stability, {:.3g} {}: it keeps error control from making "
        "the step stable; lower it, leave it out, or override with -allow_unstable_dt",
        least, least / limit.longest, limit.longest, limit.unit);
  if (!integrator.explicit_fixed_step()) return;
  if (limit.longest == 0)
    throw InputError(
        "{}: no step is stable, as the method makes undamped oscillations grow; use {}, use -ts_rk_type 3 or 4, or "
        "override with -allow_unstable_dt",
        integrator.name(), limit.rotates ? cures({Cure::verlet}) : cures({Cure::verlet, Cure::drag}));
  check_stable_step(integrator.next_dt(), limit);
}

}  // namespace pliant
