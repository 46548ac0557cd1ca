// L-BFGS with an approximate Hessian: minima of an energy, near which it needs fewer evaluations than FIRE.
#pragma once

#include <pliant/jamming/descent.h>

namespace pliant {

/// Minimises an energy over x, in place. The method does not converge where the energy is too rough or its Hessian
/// fails, and then leaves x at the lowest energy found. Method: limited-memory BFGS (D. C. Liu and J. Nocedal, Math.
/// Program. 45, 503 (1989)), which begins with the approximate Hessian and replaces it after a number of iterations.
DescentResult quasi_newton(std::span<Real> x, const EnergyAndForce& energy_and_force, ApproximateHessian& hessian,
                           const DescentOptions& options);

}  // namespace pliant
