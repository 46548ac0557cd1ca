// A deformable particle falls on a floor and bounces: how well do integrators conserve its energy, and at which cost?
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <pliant/base/petsc.h>
#include <pliant/catalogue/catalogue.h>
#include <pliant/catalogue/parameter_values.h>
#include <pliant/model/polygon.h>
#include <pliant/setup/particles.h>
#include <pliant/system/particle_system.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

namespace {

using namespace pliant;

constexpr Real fall_height = 1;  // of the lowest point over the floor, in σ_avg

/// One rough polygon above a floor at y = 0.
ParticleSystem<2> particle_and_floor() {
  ParameterValues parameters{{"e_c", 100.0}, {"e_w", 200.0}, {"k_a", 300.0}, {"k_l", 20.0}, {"k_b", 0.1}};
  return ParticleSystem<2>(make_particles(ModelKind::rough, 2, {1.0}, {.vertices = 16}),
                           Walls<2>({WallSegment::between({-5, 0}, {5, 0})}),
                           make_force_field<2>(ModelKind::rough, parameters, {.gravity = {0, -1}}), 0.1);
}

struct Bounce {
  Real energy_error = 0;    ///< largest deviation, over the energy of the fall
  Real squeeze = 1;         ///< least area over the rest area
  Real rebound_height = 0;  ///< height of the centre above its height at touch
  IntegratorStatistics cost;
};

Bounce bounce(Integrator& integrator) {
  ParticleSystem<2> system = particle_and_floor();
  const Topology& topology = system.topology();
  State state(topology.points(), 2);
  const Real radius = outer_radius(topology, 0);
  const Real centre[] = {0, radius + fall_height};
  place_particle(topology, 0, centre, 0.1, state.x().data());

  const auto energy = [&] {
    Real kinetic = 0;
    for (Index i = 0; i < topology.points(); ++i)
      kinetic += topology.mass(i) / 2 * point<2>(state.v().data(), i).squaredNorm();
    return kinetic + system.field().energy(system.view(state.x().data(), state.v().data()));
  };
  const Real start = energy(), of_the_fall = topology.a0[0] * fall_height;
  bool touched = false;
  Bounce result;
  // The fall takes sqrt(2) t0, the contact about 0.3 t0; the highest point of the rebound follows before 3.5 t0.
  integrator.run(system, state, 3.5, true, [&](State& s) {
    result.energy_error = std::max(result.energy_error, std::abs(energy() - start) / of_the_fall);
    result.squeeze = std::min(result.squeeze, polygon_area(s.x().data(), topology, 0) / topology.a0[0]);
    const Real height = mean_of_points<2>(s.x().data(), topology, 0)[1] - radius;
    touched = touched || height < 0;
    if (touched) result.rebound_height = std::max(result.rebound_height, height);
    return AfterStep::proceed;
  });
  result.cost = integrator.statistics();
  return result;
}

void print(const std::string& method, const std::string& control, const Bounce& b) {
  fmt::print("{:<10} {:<12} {:>7} {:>12} {:>14.2e} {:>10.4f} {:>9.4f}\n", method, control, b.cost.steps,
             b.cost.force_evaluations, b.energy_error, b.squeeze, b.rebound_height);
}

bool run() {
  const ParticleSystem<2> system = particle_and_floor();
  fmt::print("largest stable step of velocity Verlet: {:.2g} t0\n\n",
             system.field().critical_step(system.topology()).limit());
  fmt::print("{:<10} {:<12} {:>7} {:>12} {:>14} {:>10} {:>9}\n", "method", "control", "steps", "evaluations",
             "energy error", "least a/a0", "rebound");

  std::vector<Bounce> verlet;
  for (const Real dt : {2e-3, 1e-3, 5e-4, 2.5e-4}) {
    FixedStepVerlet integrator(dt);
    verlet.push_back(bounce(integrator));
    print("verlet", fmt::format("dt {:g}", dt), verlet.back());
  }
  std::vector<Bounce> adaptive;
  for (const Real tolerance : {1e-4, 1e-6, 1e-8}) {
    TsIntegrator integrator({.rtol = tolerance, .atol_x = tolerance, .atol_v = tolerance});
    adaptive.push_back(bounce(integrator));
    print(integrator.name(), fmt::format("rtol {:g}", tolerance), adaptive.back());
  }

  const Real order = std::log2(verlet.front().energy_error / verlet.back().energy_error) / 3;
  fmt::print("\norder of the energy error of velocity Verlet: {:.2f}\n", order);
  const bool good = order > 1.6 && verlet.back().energy_error < 2e-3 && adaptive.back().energy_error < 3e-5 &&
                    std::abs(verlet.back().squeeze - adaptive.back().squeeze) < 1e-3;
  if (!good) fmt::print("the energy is not kept as it should be\n");
  return good;
}

}  // namespace

int main() {
  try {
    pliant::PetscSession petsc;
    return run() ? 0 : 1;
  } catch (const pliant::Error& error) {
    fmt::print(stderr, "bouncing_polygon: error: {}\n", error.what());
    return static_cast<int>(error.code());
  }
}
