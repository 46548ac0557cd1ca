// FIRE: relaxation of an energy by damped dynamics, for packings and rest shapes.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>

#include <pliant/base/types.h>

namespace pliant {

/// Returns the energy at x[n] and writes the force f[n] = −∂E/∂x. The gradient must be continuous.
using EnergyAndForce = std::function<Real(const Real* x, Real* f)>;

struct FireOptions {
  Real dt = 1e-2;                ///< first step, in t0
  Real dt_max = 1e-1;            ///< largest step: below 2/ω of the stiffest mode, about 1/ω works best
  Real dt_min = 0;               ///< smallest step; 0: 0.02 dt
  Real force_tolerance = 1e-10;  ///< stop when no component of the force is larger; 0 switches the test off
  Real energy_tolerance = -std::numeric_limits<Real>::infinity();  ///< stop when |energy| is this or less
  std::function<bool(const Real* x)> done = nullptr;               ///< stops if it returns true; called with the energy
  std::int64_t max_iterations = 100000;
  /// Writes the force alone, if that is cheaper: the energy is then computed in every tenth iteration only.
  std::function<void(const Real* x, Real* f)> force = nullptr;
  Real max_move = 0;                       ///< longest move of a coordinate per iteration; 0: no limit
  int delay = 20;                          ///< downhill steps before dt grows
  Real grow = 1.1, shrink = 0.5;           ///< factors of dt downhill and uphill
  Real alpha = 0.25, alpha_shrink = 0.99;  ///< mixing of the velocity with the direction of the force
};

enum class FireStop { force, energy, done, iterations };

struct FireResult {
  bool converged = false;  ///< for another reason than the number of iterations
  FireStop stop = FireStop::iterations;
  std::string reason;  ///< the same in words
  std::int64_t iterations = 0;
  std::int64_t evaluations = 0;
  Real max_force = 0;  ///< largest |f| of a coordinate at the final x
  Real energy = 0;     ///< at the final x
};

/// Minimises an energy over x[n], in place, from rest. mass[k] with n a multiple of k: n/k coordinates share a mass,
/// e.g. one mass per point of dim coordinates, or one for
/// all, which takes no memory.
///
/// Method: FIRE 2.0 (J. Guénolé et al., Comput. Mater. Sci. 175, 109584 (2020)) of E. Bitzek et al., Phys. Rev. Lett.
/// 97, 170201 (2006): semi-implicit Euler, v ← (1 − α) v + α |v| f/|f|; uphill (f·v ≤ 0) FIRE goes back half a step,
/// stops and shrinks dt, except during the initial delay. Masses only precondition. The result is a local minimum, or a
/// saddle if it starts on a symmetric path to one. Errors: InputError for options or sizes out of range; NumericalError
/// for a force or an energy that is not finite.
FireResult fire(std::span<Real> x, std::span<const Real> mass, const EnergyAndForce& energy_and_force,
                const FireOptions& options = {});

}  // namespace pliant
