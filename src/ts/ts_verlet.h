// Damped velocity Verlet as a PETSc TS type, for any y = [x; v].
#pragma once

#include <petscts.h>

namespace pliant {

/// Name of the type: TSSetType(ts, ts_verlet) or -ts_type verlet.
inline constexpr char ts_verlet[] = "verlet";

/// Registers the type with TSRegister; call it after PetscInitialize, any number of times.
///
/// Solves ẋ = v, v̇ = a(t, x, v) given as a TSRHSFunction of y = [x; v] (on each rank the first half of the local
/// entries is x, the second v) by the method of FixedStepVerlet, with the same operations in the same order:
///
///     v½ = v + a h/2,   x' = x + h v½,   a' = A(t + h, x', v + a h),   v' = v½ + a' h/2
///
/// One evaluation per step: a is carried on, and dropped after TSRestartStep or TSRollBack. Order 2, symplectic where a
/// does not depend on v, stable for a damping rate γ with γ h < 1. The step is fixed (TSADAPTNONE is the default); with
/// -ts_adapt_type basic it is controlled by how much the acceleration changes in a step. TSInterpolate is cubic Hermite
/// in x and v. The type has no options. Errors (at set-up): no right-hand-side function, an IFunction, or an odd local
/// length.
PetscErrorCode ts_verlet_register();

}  // namespace pliant
