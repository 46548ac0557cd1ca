// CVODE as a PETSc TS type.
#pragma once

#include <petscts.h>

namespace pliant::sundials {

/// For TSRegister. Solves y' = f(t, y), given by TSSetRHSFunction, by the variable-order Adams and BDF methods of
/// CVODE, one step of which is one step of the TS. Where CVODE is ahead of the TS (events, time spans), the TS walks in
/// its dense output. Errors at set-up: no right-hand side, or an IFunction.
PetscErrorCode cvode_create(TS ts);

}  // namespace pliant::sundials
