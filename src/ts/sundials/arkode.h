// SUNDIALS' ARKODE: explicit, diagonally implicit, additive and multirate Runge–Kutta methods as a TS type.
#pragma once

#include <petscts.h>

namespace pliant::sundials {

/// Makes a TS one of type "arkode" (for TSRegister).
PetscErrorCode arkode_create(TS ts);

}  // namespace pliant::sundials
