#include <pliant/jamming/minimise.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <pliant/jamming/point_packing.h>
#include <pliant/model/polygon.h>
#include <pliant/system/fire.h>
#include <pliant/system/stress.h>

namespace pliant {
namespace {

/// Why there is no stress, or nothing.
template <int D>
std::optional<std::string> without_stress(const ParticleSystem<D>& system) {
  for (int k = 0; k < D; ++k)
    if (!system.box().periodic(k))
      return fmt::format(
          "direction {} of the box is open; stress and pressure need a box that is periodic in all directions", k);
  if (system.rotates_or_remembers())
    return "particles that rotate and contacts with history have no energy under strain; use a model without friction";
  return {};
}

template <int D>
void check(const ParticleSystem<D>& system, const MinimiserOptions& o) {
  if (system.ranks().several())
    throw InputError("energies are minimised on one rank; start the program without mpiexec");
  if (!o.pressure) return;
  if (const auto reason = without_stress(system)) throw InputError("{}", *reason);
  if (!(*o.pressure > 0 && std::isfinite(*o.pressure)))
    throw InputError(
        "the pressure is {}; it must be positive and finite, because repulsive particles have no other pressure",
        *o.pressure);
  if (system.walls().size() > 0) throw InputError("walls do not follow a box at a fixed pressure; leave them out");
}

Real largest(std::span<const Real> values) {
  Real most = 0;
  for (const Real a : values) most = std::max(most, std::abs(a));
  return most;
}

/// Zeros where contacts read velocities; else nothing.
template <int D>
std::vector<Real> velocities_at_rest(const ParticleSystem<D>& system) {
  return std::vector<Real>(system.rotates_or_remembers() ? system.size() : 0);
}

/// Whether the model has forces that depend on velocities, of which a minimum is independent.
template <int D>
bool dissipates(ParticleSystem<D>& system, std::span<const Real> x) {
  const std::vector<Real> rest(x.size());
  return std::ranges::any_of(system.field().report(system.view(x.data(), rest.data())),
                             [](const TermReport& term) { return !term.is_energy; });
}

Real total_mass(const Topology& t) {
  Real sum = 0;
  for (Index m = 0; m < t.owned(); ++m) sum += t.point_mass[m] * t.points_of(m);
  return sum;
}

/// Masses of the coordinates in FIRE: of each point, at a pressure the mean mass of a point for all and for the box.
std::vector<Real> masses(const Topology& t, bool at_pressure) {
  if (at_pressure) return {total_mass(t) / t.owned_points()};
  std::vector<Real> all;
  for (Index i = 0; i < t.owned_points(); ++i) all.push_back(t.mass(i));
  return all;
}

/// Energy or enthalpy of a system as a function of its positions, in the present box, and of the logarithm of the box
/// length over the present one, which is the last coordinate, times a factor.
template <int D>
class Enthalpy {
 public:
  Enthalpy(ParticleSystem<D>& system, Real pressure) : system_(system), pressure_(pressure) {
    const Topology& t = system.topology();
    volume_ = system.box().volume();
    origin_ = system.box().origin();
    // A crowded particle has contacts whose stiffness adds up to about ω² m, ω the frequency that limits the steps.
    // With this factor the stiffness of the box over the mass is about the same ω².
    factor_ = std::sqrt(static_cast<Real>(t.owned_points()) / 2);
    x_.resize(static_cast<std::size_t>(t.owned_points()) * D);
  }

  /// Positions for y [own positions, box], and the box of the system with them.
  const std::vector<Real>& place(const Real* y) {
    const Real log_length = y[x_.size()] / factor_, f = std::exp(log_length - log_length_);
    if (!(std::abs(log_length) < 3))
      throw NumericalError("the box has changed its length by a factor of {:.3g}; is the pressure right?",
                           std::exp(log_length));
    if (f != 1) system_.deform(Mat<D>(f * Mat<D>::Identity()));
    log_length_ = log_length;
    const Real scale = std::exp(log_length);
    const Topology& t = system_.topology();
    for (Index m = 0; m < t.owned(); ++m) {
      const Vec<D> shift = (scale - 1) * (mean_of_points<D>(y, t, m) - origin_);
      for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i) point<D>(x_.data(), i) = point<D>(y, i) + shift;
    }
    return x_;
  }

  /// Energy and force at y; the energy only where it is asked for.
  Real operator()(const Real* y, Real* f, bool with_energy) {
    const std::vector<Real>& x = place(y);
    StateView<D> s = system_.view(x.data(), nullptr);
    s.ghosts_feel = s.topology.deformable() && s.neighbours.chunks() == 1;
    Real energy = 0;
    if (with_energy)
      energy = system_.field().energy(s, forces(s));
    else
      system_.field().forces(s, forces(s));
    const Topology& t = system_.topology();
    on_particles_.resize(static_cast<std::size_t>(t.particles()) * D);
    for (Index m = 0; m < t.particles(); ++m)
      point<D>(on_particles_.data(), m) = t.points_of(m) * mean_of_points<D>(force_.data(), t, m);
    const Real scale = std::exp(log_length_),
               virial = s.ghosts_feel ? virial_of_centres<D>(s, on_particles_.data()) : virial_of_terms(s);
    for (Index m = 0; m < t.owned(); ++m) {
      const Vec<D> mean = point<D>(on_particles_.data(), m) / t.points_of(m);
      for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i)
        point<D>(f, i) = point<D>(force_.data(), i) + (scale - 1) * mean;
    }
    const Real volume = volume_ * std::pow(scale, D);
    f[x.size()] = -(virial + D * pressure_ * volume) / factor_;
    return energy + pressure_ * volume;
  }

 private:
  /// Space for the forces on all points, zero on ghosts.
  Real* forces(const StateView<D>& s) {
    force_.resize(static_cast<std::size_t>(s.topology.points()) * D);
    std::fill(force_.begin() + static_cast<std::ptrdiff_t>(x_.size()), force_.end(), 0);
    return force_.data();
  }

  /// As virial_of_centres, without the forces on ghosts.
  Real virial_of_terms(const StateView<D>& s) const {
    Real virial = 0;
    for (const TermVirial<D>& term : system_.field().virials(s)) virial += term.virial.trace();
    const Topology& t = s.topology;
    for (Index m = 0; m < t.owned(); ++m) {
      const Vec<D> centre = mean_of_points<D>(s.x, t, m);
      for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i)
        virial += point<D>(force_.data(), i).dot(s.position(i) - centre);  // shapes do not follow the box
    }
    return virial;
  }

  ParticleSystem<D>& system_;
  Real pressure_, volume_ = 0, factor_ = 1, log_length_ = 0;
  Vec<D> origin_;
  std::vector<Real> x_, force_, on_particles_;
};

/// The result of FIRE after earlier iterations.
FireResult after(const FireResult& earlier, FireResult result) {
  result.iterations += earlier.iterations;
  result.evaluations += earlier.evaluations;
  return result;
}

/// Minimises the energy or enthalpy of few points, in the present box or with the box.
template <int D>
FireResult minimise_points(ParticleSystem<D>& system, std::span<Real> x, const std::vector<Real>& mass,
                           const MinimiserOptions& o, FireOptions fire_options) {
  const std::int64_t most_iterations = fire_options.max_iterations;
  PointPacking<D> packing(system, *o.contacts, o.pressure);
  std::vector<Real> y(x.begin(), x.end());
  if (o.pressure) y.push_back(0);
  // FIRE finds the valley of the minimum, in which the quasi-Newton method is faster.
  constexpr Real part_in_valley = 0.1;
  bool quick = !o.pressure || o.force_tolerance < part_in_valley * *o.pressure, in_valley = false;
  const Real least_energy = 1e-14 * system.topology().owned();  // with less the particles may come apart
  const EnergyAndForce energy_and_force = [&](const Real* at, Real* f) {
    const Real energy = packing(at, f);
    if (!o.pressure) in_valley = energy > least_energy && largest({f, y.size()}) <= part_in_valley * packing.pressure();
    return energy;
  };
  fire_options.force = [&](const Real* at, Real* f) { packing(at, f); };
  if (!o.pressure) fire_options.done = [&](const Real*) { return (o.stop && o.stop()) || (quick && in_valley); };
  FireResult result;
  const auto relax = [&](Real tolerance) {
    fire_options.force_tolerance = tolerance;
    fire_options.max_iterations = most_iterations - result.iterations;
    result = after(result, fire(y, mass, energy_and_force, fire_options));
    if (result.stop == FireStop::iterations)
      result.reason =
          fmt::format("limit of {} iterations reached with largest force {:.3g}", o.max_iterations, result.max_force);
  };
  relax(quick && o.pressure ? part_in_valley * *o.pressure : o.force_tolerance);
  if (quick && (o.pressure ? result.stop == FireStop::force : in_valley && result.stop == FireStop::done)) {
    const QuasiNewtonResult quasi =
        quasi_newton(y, energy_and_force, packing,
                     {.force_tolerance = o.force_tolerance,
                      .max_evaluations = std::max<std::int64_t>(0, most_iterations - result.iterations),
                      .stop = o.stop});
    result.iterations += quasi.iterations;
    result.evaluations += quasi.evaluations;
    quick = false;
    if (quasi.converged) {
      result.stop = FireStop::force;
      result.reason = fmt::format("largest force {:.3g} within {:.3g}", quasi.max_force, o.force_tolerance);
    } else if (!quasi.stopped) {
      relax(o.force_tolerance);
    }
  }
  if (o.pressure) system.deform(Mat<D>(packing.scale(y.data()) * Mat<D>::Identity()));
  packing.place(y.data(), x.data());
  return result;
}

/// Minimises the enthalpy over positions and box.
template <int D>
FireResult minimise_with_box(ParticleSystem<D>& system, std::span<Real> x, const std::vector<Real>& mass, Real pressure,
                             bool only_energies, FireOptions fire_options) {
  Enthalpy<D> enthalpy(system, pressure);
  std::vector<Real> y(x.begin(), x.end());
  y.push_back(0);
  // FIRE stops by the force here. Where the model has dissipative terms, too, the energy comes with the forces of the
  // energy terms alone.
  const auto evaluate = [&](const Real* at, Real* f) { return enthalpy(at, f, !only_energies); };
  if (only_energies) fire_options.force = evaluate;
  FireResult result = fire(y, mass, evaluate, fire_options);
  std::ranges::copy(enthalpy.place(y.data()), x.begin());
  return result;
}

/// Minimises the energy in the present box, at the time t of walls that move.
template <int D>
FireResult minimise_in_box(ParticleSystem<D>& system, std::span<Real> x, const std::vector<Real>& mass, Real t,
                           bool only_energies, FireOptions fire_options) {
  std::vector<Real> force;
  const auto room = [&](const StateView<D>& s) {
    force.resize(static_cast<std::size_t>(s.topology.points()) * (D + rotations<D>));
    return force.data();
  };
  const std::size_t n = system.positions_in(x).size();
  std::vector<Real> all(x.begin(), x.end());  // with angles, where particles rotate
  const std::vector<Real> rest = velocities_at_rest(system);
  const auto view_at = [&](const Real* at) {
    if (n < all.size()) std::copy_n(at, n, all.begin());
    return system.view(n < all.size() ? all.data() : at, rest.empty() ? nullptr : rest.data(), t);
  };
  if (only_energies)
    fire_options.force = [&](const Real* at, Real* f) {
      const StateView<D> s = view_at(at);
      system.field().forces(s, room(s));
      std::copy_n(force.begin(), n, f);
    };
  return fire(
      x.first(n), mass,
      [&](const Real* at, Real* f) {
        const StateView<D> s = view_at(at);
        const Real energy = system.field().energy(s, room(s));
        std::copy_n(force.begin(), n, f);
        return energy;
      },
      fire_options);
}

}  // namespace

template <int D>
BoxStress<D> stress_of(ParticleSystem<D>& system, const Real* x) {
  if (const auto reason = without_stress(system)) throw InputError("{}", *reason);
  BoxStress<D> result;
  for (const TermVirial<D>& term : system.field().virials(system.view(x, nullptr))) result.stress += term.virial;
  result.stress /= system.box().volume();
  return result;
}

template <int D>
Minimum<D> measure_at(ParticleSystem<D>& system, std::span<const Real> x, Real t) {
  Minimum<D> measured;
  const std::vector<Real> rest = velocities_at_rest(system);
  const StateView<D> s = system.view(x.data(), rest.empty() ? nullptr : rest.data(), t);
  std::vector<Real> force(static_cast<std::size_t>(s.topology.points()) * (D + rotations<D>));
  measured.energy = system.field().energy(s, force.data());
  measured.max_force = largest(std::span(force).first(system.positions_in(x).size()));
  if (!without_stress(system)) measured.stress = stress_of(system, x.data());
  return measured;
}

template <int D>
Minimum<D> minimise(ParticleSystem<D>& system, std::span<Real> x, const MinimiserOptions& o) {
  check(system, o);
  const Topology& t = system.topology();
  const bool only_energies = !dissipates<D>(system, x);  // their forces alone are cheaper than with the energy
  FireOptions fire_options;
  const Real stiffness = system.field().critical_step(t).crowded.translation.stiffness;
  // Polygons are far softer than the bound of the stiffness, because they have fewer contacts than fit around them.
  const Real longest = D == 2 && t.deformable() ? 1.5 : 1;
  fire_options.dt_max = stiffness > 0 ? longest / std::sqrt(stiffness) : 0.1;
  fire_options.dt = fire_options.dt_max / 5;
  fire_options.force_tolerance = o.force_tolerance;
  fire_options.max_iterations = o.max_iterations;
  fire_options.max_move = 0.1;
  if (o.stop) fire_options.done = [&](const Real*) { return o.stop(); };
  const std::vector<Real> mass = masses(t, o.pressure.has_value());
  if (!o.pressure) fire_options.energy_tolerance = o.energy_per_particle * t.owned();
  const auto once = [&] {
    if (o.contacts && PointPacking<D>::suits(system)) return minimise_points<D>(system, x, mass, o, fire_options);
    return o.pressure ? minimise_with_box<D>(system, x, mass, *o.pressure, only_energies, fire_options)
                      : minimise_in_box<D>(system, x, mass, o.t, only_energies, fire_options);
  };
  FireResult result = once();
  Minimum<D> minimum = measure_at<D>(system, x, o.t);
  // FIRE stops by the force on coordinates in the box at the start, below the force on a point if the box has shrunk.
  while (o.pressure && result.stop == FireStop::force && minimum.max_force > o.force_tolerance) {
    fire_options.max_iterations = o.max_iterations - result.iterations;
    const std::int64_t iterations = result.iterations;
    result = after(result, once());
    minimum = measure_at<D>(system, x, o.t);
    if (result.iterations > iterations || minimum.max_force <= o.force_tolerance) continue;
    result.converged = false;
    result.reason = fmt::format("rounding errors keep the largest force at {:.3g}, above the tolerance {:.3g}",
                                minimum.max_force, o.force_tolerance);
    break;
  }
  minimum.converged = result.converged;
  minimum.apart =
      result.stop == FireStop::energy || (!o.pressure && std::abs(minimum.energy) <= o.energy_per_particle * t.owned());
  minimum.reason = std::move(result.reason);
  minimum.iterations = result.iterations;
  minimum.evaluations = result.evaluations;
  return minimum;
}

template BoxStress<2> stress_of(ParticleSystem<2>&, const Real*);
template BoxStress<3> stress_of(ParticleSystem<3>&, const Real*);
template Minimum<2> measure_at(ParticleSystem<2>&, std::span<const Real>, Real);
template Minimum<3> measure_at(ParticleSystem<3>&, std::span<const Real>, Real);
template Minimum<2> minimise(ParticleSystem<2>&, std::span<Real>, const MinimiserOptions&);
template Minimum<3> minimise(ParticleSystem<3>&, std::span<Real>, const MinimiserOptions&);

}  // namespace pliant
