#include <pliant/jamming/minimise.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <pliant/jamming/point_packing.h>
#include <pliant/jamming/potential.h>
#include <pliant/jamming/quasi_newton.h>
#include <pliant/jamming/trust_region.h>
#include <pliant/model/polygon.h>
#include <pliant/system/fire.h>
#include <pliant/system/stress.h>

namespace pliant {
namespace {

/// The reason why the stress is undefined; empty if it is defined.
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

/// Whether the model has dissipative forces, which do not affect minima.
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

/// The result of FIRE after earlier iterations.
FireResult after(const FireResult& earlier, FireResult result) {
  result.iterations += earlier.iterations;
  result.evaluations += earlier.evaluations;
  return result;
}

/// A minimisation by FIRE and by a method with a Hessian in turn, with one limit of iterations.
class Iterations {
 public:
  Iterations(const MinimiserOptions& o, FireOptions fire_options)
      : o_(o), fire_(std::move(fire_options)), most_(fire_.max_iterations) {}

  const FireResult& result() const { return result_; }

  /// done: see FireOptions, besides the stop function.
  void fire(std::span<Real> y, const std::vector<Real>& mass, const EnergyAndForce& energy_and_force, Real tolerance,
            std::function<void(const Real*, Real*)> force, const std::function<bool(const Real*)>& done = nullptr) {
    fire_.force_tolerance = tolerance;
    fire_.force = std::move(force);
    fire_.done = [&](const Real* at) { return (o_.stop && o_.stop()) || (done && done(at)); };
    fire_.max_iterations = left();
    result_ = after(result_, pliant::fire(y, mass, energy_and_force, fire_));
    if (result_.stop == FireStop::iterations)
      result_.reason =
          fmt::format("limit of {} iterations reached with largest force {:.3g}", o_.max_iterations, result_.max_force);
  }
  /// By quasi_newton() or trust_region(), to the tolerance of the options. False if FIRE has to continue.
  template <class Hessian>
  bool descend(DescentResult (&method)(std::span<Real>, const EnergyAndForce&, Hessian&, const DescentOptions&),
               std::span<Real> y, const EnergyAndForce& energy_and_force, Hessian& hessian,
               std::int64_t most_evaluations, Real max_move) {
    const DescentResult found = method(y, energy_and_force, hessian,
                                       {.force_tolerance = o_.force_tolerance,
                                        .max_evaluations = std::clamp<std::int64_t>(left(), 0, most_evaluations),
                                        .max_move = max_move,
                                        .stop = o_.stop});
    result_.iterations += found.iterations;
    result_.evaluations += found.evaluations;
    if (found.converged) {
      result_.stop = FireStop::force;
      result_.reason = fmt::format("largest force {:.3g} within {:.3g}", found.max_force, o_.force_tolerance);
    }
    return found.converged || found.stopped;
  }

 private:
  std::int64_t left() const { return most_ - result_.iterations; }

  const MinimiserOptions& o_;
  FireOptions fire_;
  std::int64_t most_;
  FireResult result_;
};

/// Particles with less energy may come apart, which FIRE notices.
template <int D>
Real least_energy(const ParticleSystem<D>& system) {
  return 1e-14 * system.topology().owned();
}

/// From a place in the valley of the minimum, with the exact Hessian. False if FIRE has to continue.
template <int D>
bool descend_with_hessian(ParticleSystem<D>& system, std::span<Real> x, const MinimiserOptions& o,
                          Iterations& iterations) {
  constexpr std::int64_t most_evaluations = 50000;
  Potential<D> potential(system, o.pressure);
  std::vector<Real> y(x.begin(), x.end());
  if (o.pressure) y.push_back(0);
  const auto energy_and_force = [&](const Real* at, Real* f) { return potential(at, f, true); };
  // Longer steps could carry a vertex through an edge.
  const Real max_move = 0.1 * *std::ranges::min_element(system.topology().diameter);
  const bool found =
      o.minimiser == Minimiser::newton
          ? iterations.descend<ExactHessian>(trust_region, y, energy_and_force, potential, most_evaluations, max_move)
          : iterations.descend<ApproximateHessian>(quasi_newton, y, energy_and_force, potential, most_evaluations,
                                                   max_move);
  std::ranges::copy(potential.place(y.data()), x.begin());
  return found;
}

/// Minimises the energy or enthalpy of few points, in the present box or with the box.
template <int D>
void minimise_points(ParticleSystem<D>& system, std::span<Real> x, const std::vector<Real>& mass,
                     const MinimiserOptions& o, Iterations& iterations, bool alone = false) {
  PointPacking<D> packing(system, *o.contacts, o.pressure);
  std::vector<Real> y(x.begin(), x.end());
  if (o.pressure) y.push_back(0);
  // FIRE finds the valley of the minimum, in which the other methods are faster.
  constexpr Real part_in_valley = 0.1;
  const bool quick = !alone && (!o.pressure || o.force_tolerance < part_in_valley * *o.pressure);
  bool in_valley = false;
  const EnergyAndForce energy_and_force = [&](const Real* at, Real* f) {
    const Real energy = packing(at, f);
    if (!o.pressure)
      in_valley = energy > least_energy(system) && largest({f, y.size()}) <= part_in_valley * packing.pressure();
    return energy;
  };
  const auto relax = [&](Real tolerance, const std::function<bool(const Real*)>& done = nullptr) {
    iterations.fire(
        y, mass, energy_and_force, tolerance, [&](const Real* at, Real* f) { packing(at, f); }, done);
  };
  if (quick && o.pressure)
    relax(part_in_valley * *o.pressure);
  else if (quick)
    relax(o.force_tolerance, [&](const Real*) { return in_valley; });
  else
    relax(o.force_tolerance);
  const FireStop stop = iterations.result().stop;
  const bool descends = quick && (o.pressure ? stop == FireStop::force : in_valley && stop == FireStop::done);
  if (descends && o.minimiser == Minimiser::lbfgs &&
      !iterations.descend<ApproximateHessian>(quasi_newton, y, energy_and_force, packing,
                                              std::numeric_limits<std::int64_t>::max(), 0.1))
    relax(o.force_tolerance);
  if (o.pressure) system.deform(Mat<D>(packing.scale(y.data()) * Mat<D>::Identity()));
  packing.place(y.data(), x.data());
  if (descends && o.minimiser == Minimiser::newton && !descend_with_hessian<D>(system, x, o, iterations))
    minimise_points<D>(system, x, mass, o, iterations, true);
}

/// Minimises the enthalpy over positions and box. part_in_valley: see the function of this name.
template <int D>
void minimise_with_box(ParticleSystem<D>& system, std::span<Real> x, const std::vector<Real>& mass, bool only_energies,
                       const MinimiserOptions& o, Iterations& iterations, Real part_in_valley) {
  const bool quick = o.force_tolerance < part_in_valley * *o.pressure;
  const auto relax = [&](Real tolerance) {
    Potential<D> potential(system, o.pressure);
    std::vector<Real> y(x.begin(), x.end());
    y.push_back(0);
    // FIRE stops by the force here. Where the model has dissipative terms, too, the energy comes with the forces of the
    // energy terms alone.
    const auto evaluate = [&](const Real* at, Real* f) { return potential(at, f, !only_energies); };
    iterations.fire(y, mass, evaluate, tolerance, only_energies ? evaluate : std::function<void(const Real*, Real*)>());
    std::ranges::copy(potential.place(y.data()), x.begin());
  };
  relax(quick ? part_in_valley * *o.pressure : o.force_tolerance);
  if (quick && iterations.result().stop == FireStop::force && !descend_with_hessian<D>(system, x, o, iterations))
    relax(o.force_tolerance);
}

/// Minimises the energy in the present box, at the time of walls that move.
template <int D>
void minimise_in_box(ParticleSystem<D>& system, std::span<Real> x, const std::vector<Real>& mass, bool only_energies,
                     const MinimiserOptions& o, Iterations& iterations, Real part_in_valley) {
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
    return system.view(n < all.size() ? all.data() : at, rest.empty() ? nullptr : rest.data(), o.t);
  };
  Real energy = 0;
  const auto energy_and_force = [&](const Real* at, Real* f) {
    const StateView<D> s = view_at(at);
    energy = system.field().energy(s, room(s));
    std::copy_n(force.begin(), n, f);
    return energy;
  };
  std::function<void(const Real*, Real*)> force_alone;
  if (only_energies)
    force_alone = [&](const Real* at, Real* f) {
      const StateView<D> s = view_at(at);
      system.field().forces(s, room(s));
      std::copy_n(force.begin(), n, f);
    };
  // The pressure takes as long as an evaluation, and is computed where the largest force has fallen by half.
  Real tested = std::numeric_limits<Real>::infinity();
  bool in_valley = false;
  const auto valley = [&](const Real* at) {
    const Real most = largest({force.data(), n});
    if (!(most < tested / 2) || energy < least_energy(system)) return false;
    tested = most;
    in_valley = most <= part_in_valley * stress_of(system, at).pressure();
    return in_valley;
  };
  const auto relax = [&](const std::function<bool(const Real*)>& done) {
    iterations.fire(x.first(n), mass, energy_and_force, o.force_tolerance, force_alone, done);
  };
  relax(part_in_valley > 0 ? valley : std::function<bool(const Real*)>());
  if (in_valley && !descend_with_hessian<D>(system, x, o, iterations)) relax(nullptr);
}

/// The part of the pressure below which the largest force shows that FIRE has found the valley of the minimum; 0 if
/// FIRE has to find the minimum.
template <int D>
Real part_in_valley(const ParticleSystem<D>& system, const MinimiserOptions& o) {
  constexpr Real of_points = 0.1, of_polygons = 0.003;  // polygons still rearrange
  const bool descends = o.minimiser == Minimiser::newton  ? Potential<D>::suits(system)
                        : o.minimiser == Minimiser::lbfgs ? Potential<D>::quick(system)
                                                          : false;
  if (!descends || without_stress(system)) return 0;
  return system.topology().deformable() ? of_polygons : of_points;
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
  const std::vector<Real> mass = masses(t, o.pressure.has_value());
  if (!o.pressure) fire_options.energy_tolerance = o.energy_per_particle * t.owned();
  const auto once = [&] {
    Iterations iterations(o, fire_options);
    if (o.contacts && PointPacking<D>::suits(system))
      minimise_points<D>(system, x, mass, o, iterations, o.minimiser == Minimiser::fire);
    else if (o.pressure)
      minimise_with_box<D>(system, x, mass, only_energies, o, iterations, part_in_valley(system, o));
    else
      minimise_in_box<D>(system, x, mass, only_energies, o, iterations, part_in_valley(system, o));
    return iterations.result();
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
    minimum.rounded = true;
    break;
  }
  // Coordinates are rounded in proportion to their size, and a force by this error times the stiffness.
  const Real rounding =
      std::numeric_limits<Real>::epsilon() * stiffness * *std::ranges::min_element(t.point_mass) * largest(x);
  if (result.stop == FireStop::iterations && minimum.max_force > o.force_tolerance && minimum.max_force <= rounding)
    minimum.rounded = true;
  if (minimum.rounded)
    result.reason = fmt::format("rounding errors keep the largest force at {:.3g}, above the tolerance {:.3g}",
                                minimum.max_force, o.force_tolerance);
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
