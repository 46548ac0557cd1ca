// SUNDIALS' ARKODE: explicit, diagonally implicit, additive and multirate Runge–Kutta methods as a TS type.
#pragma once

#include <petscts.h>

#include <pliant/ts/sundials/sundials.h>

namespace pliant::sundials {

/// Makes a TS one of type "arkode" (for TSRegister).
PetscErrorCode arkode_create(TS ts);

/// As arkode_explicit_table in sundials.h.
PetscErrorCode explicit_table(TS ts, ArkodeTable* table);

}  // namespace pliant::sundials
