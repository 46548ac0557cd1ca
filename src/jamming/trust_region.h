// Newton's method with a trust region, by TAO of PETSc: minima of an energy whose exact Hessian is known.
#pragma once

#include <pliant/jamming/descent.h>

namespace pliant {

/// Reads the options -tao_… as trust_region() does, so that they do not count as unused. Errors: InputError for values
/// that TAO refuses, other methods, and limits that the minimisation sets.
void check_trust_region_options();

/// As quasi_newton(), by TAO's method ntr or bntr (-tao_type). In each iteration conjugate gradients, preconditioned by
/// the factors of the Hessian, find the minimum of the quadratic expansion of the energy within a radius, which TAO
/// adapts to the agreement of the expansion with the energy. Errors: as of the functions and of PETSc.
DescentResult trust_region(std::span<Real> x, const EnergyAndForce& energy_and_force, ExactHessian& hessian,
                           const DescentOptions& options);

}  // namespace pliant
