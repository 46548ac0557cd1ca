// SUNDIALS' integrators as PETSc TS types.
#pragma once

#include <petscts.h>

namespace pliant {

inline constexpr char ts_cvode[] = "cvode";
inline constexpr char ts_arkode[] = "arkode";

/// Registers the TS types `cvode` and `arkode`; call it after PetscInitialize, as often as you like. What they do and
/// their options: src/ts/sundials/README.md.
PetscErrorCode sundials_register();

}  // namespace pliant
