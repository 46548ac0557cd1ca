// Mechanical equilibrium in a periodic box: minima of the energy at a fixed box, or of the enthalpy at a fixed
// pressure.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include <pliant/kernels/pair_forces.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// Volume derivatives of the energy of a configuration.
template <int D>
struct BoxStress {
  Mat<D> stress = Mat<D>::Zero();  ///< σ_ab = (1/V) ∂U/∂e_ab, tension positive, in ε/σ_avg^D
  Real pressure() const { return (0 - stress.trace()) / D; }  // never -0
};

/// The stress of the energy terms at x [size of the system], without a kinetic part. Collective. Errors: InputError for
/// a box that is open in a direction.
template <int D>
BoxStress<D> stress_of(ParticleSystem<D>& system, const Real* x);

/// The method that replaces FIRE near the minimum; fire: none.
enum class Minimiser { lbfgs, newton, fire };

struct MinimiserOptions {
  Minimiser minimiser = Minimiser::lbfgs;
  /// Minimum of U + p V over positions and the volume of the box; empty: minimum of U at the present box.
  std::optional<Real> pressure;
  Real force_tolerance = 1e-10;  ///< largest component of the force on a point at the minimum, in ε/σ_avg
  std::int64_t max_iterations = 200000;
  Real energy_per_particle = 1e-20;  ///< at a fixed box: particles with less energy, in ε, do not touch
  /// The law of all forces, if they are contacts of points: few points are then minimised faster.
  std::optional<PairContactLaw> contacts = {};
  Real t = 0;                            ///< at a fixed box: time, for walls that move
  std::function<bool()> stop = nullptr;  ///< ends the minimisation if it returns true; called now and then
};

template <int D>
struct Minimum {
  bool converged = false;
  bool apart = false;    ///< it ended because the particles do not touch
  bool rounded = false;  ///< rounding errors keep forces above the tolerance
  std::string reason;    ///< why the minimisation ended
  std::int64_t iterations = 0, evaluations = 0;
  Real energy = 0;           ///< U, in ε
  Real max_force = 0;        ///< largest component of a force on a point, in ε/σ_avg
  BoxStress<D> stress = {};  ///< zero where stress_of() has an error
};

/// Energy, largest force and stress at x, without a minimisation.
template <int D>
Minimum<D> measure_at(ParticleSystem<D>& system, std::span<const Real> x, Real t = 0);

/// Moves the particles to a minimum by FIRE (fire.h). Near the minimum L-BFGS (quasi_newton.h) replaces it for systems
/// that PointPacking::suits() or Potential::quick() accepts, and Newton's method (trust_region.h) for systems that
/// Potential::suits() accepts. FIRE continues if they find no minimum. x [size of the system]: the own positions;
/// angles remain. At a fixed pressure the box grows and shrinks without change of shape; particles keep their shapes
/// while it does, since only their centres follow the box. On one rank. Errors: InputError for several ranks; at a
/// fixed pressure for a box that is open in a direction, walls, particles that rotate or contacts with history, or a
/// pressure that is not positive; NumericalError where forces are not finite, or where the box at a fixed pressure
/// grows without end.
template <int D>
Minimum<D> minimise(ParticleSystem<D>& system, std::span<Real> x, const MinimiserOptions& options);

}  // namespace pliant
