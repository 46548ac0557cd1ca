// A deformable polygon that bounces on the floor of a hopper: energy is conserved to the order of the method.
#include <catch2/catch.hpp>

#include <pliant/catalogue/catalogue.h>
#include <pliant/model/crossing.h>
#include <pliant/ts/verlet.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::bounce_test {

namespace {

/// m ẍ = F of a force field.
class ForceSystem final : public SecondOrderSystem {
 public:
  ForceSystem(const ForceField<2>& field, Configuration<2>& c) : field_(field), c_(c) {}
  std::size_t size() const override { return c_.x.size(); }
  void acceleration(Real, const Real* x, const Real* v, Real* a) override {
    StateView<2> s = c_.view(x);
    s.v = v;
    field_.forces(s, a);
    for (Index i = 0; i < c_.topology.points(); ++i) point<2>(a, i) *= c_.topology.inverse_mass(i);
  }

 private:
  const ForceField<2>& field_;
  Configuration<2>& c_;
};

/// Largest deviation of the energy during one bounce of a 16-gon with these contacts, in units of the kinetic energy of
/// its fall.
Real energy_error(ModelKind kind, Real dt) {
  const Vec<2> g(0, -1);
  const auto field =
      make_force_field<2>(kind, {.epsilon = 20, .epsilon_wall = 20, .k_a = 50, .k_l = 5, .k_b = 0.02}, g);
  const Real l0 = 2 * 0.5 * std::sin(pi / 16), delta = kind == ModelKind::smooth ? 0.1 * l0 : l0, speed = 0.6;
  Configuration<2> c;
  c.walls = test_hopper(90).walls<2>();
  c.add_polygon(regular_polygon(16, 0.5, {3, 0.5 + 0.5 * delta + 0.05}, 0.1), delta);
  c.topology.a0[0] = polygon_area(c.x.data(), c.topology, 0);
  c.topology.l0[0] = l0;

  State state(c.topology.points(), 2);
  std::copy(c.x.begin(), c.x.end(), state.x().begin());
  for (Index i = 0; i < 16; ++i) point<2>(state.v().data(), i) = Vec<2>(0.1, -speed);
  const Real mass = 16 * c.topology.mass(0);
  const auto energy = [&] {
    Real kinetic = 0;
    for (Index i = 0; i < 16; ++i) kinetic += c.topology.mass(i) / 2 * point<2>(state.v().data(), i).squaredNorm();
    return kinetic + field->energy(c.view(state.x().data()));
  };
  const auto wall_energy = [&] {
    Real sum = 0;
    for (const TermReport& r : field->report(c.view(state.x().data())))
      if (r.name == "wall") sum += r.energy;
    return sum;
  };
  const auto mean_speed = [&] { return mean_of_points<2>(state.v().data(), c.topology, 0)[1]; };

  const Real start = energy();
  Real worst = 0, pressed = 0, rising = 0;
  ForceSystem system(*field, c);
  FixedStepVerlet(dt).run(system, state, 1.2, true, [&](State&) {
    worst = std::max(worst, std::abs(energy() - start));
    pressed = std::max(pressed, wall_energy());
    rising = std::max(rising, mean_speed());
    return AfterStep::proceed;
  });
  REQUIRE(pressed > 1e-2 * mass * square(speed) / 2);  // the particle did touch the floor …
  REQUIRE(rising > 0.3 * speed);                       // … and bounced
  return worst / (mass * square(speed) / 2);
}

}  // namespace

// Limit of the order at the onset of a contact: the force is continuous but its slope jumps by ε/δ², so the
// trapezoidal rule of the one step that holds the kink errs by up to h² ε v/(8 δ²) in the impulse, as against h³ in a
// smooth step. A bounce has a fixed number of onsets, hence order 2 again, with a factor that depends on where in its
// step each kink falls: the slope scatters about 2. An energy that jumped there would leave an error that does not fall
// with h.
TEST_CASE("a bouncing polygon keeps its energy to second order in the step") {
  const auto [kind, dt] = GENERATE(std::pair(ModelKind::rough, 4e-3), std::pair(ModelKind::smooth, 3e-4));
  INFO(to_string(kind));
  const OrderFit fit = fit_order([kind = kind](Real h) { return energy_error(kind, h); }, dt, 6);
  INFO(fit.text());
  CHECK(fit.slope() > 1.7);
  CHECK(fit.errors.front() < 0.1);
  CHECK(fit.errors.back() < 2e-3);
  CHECK(fit.errors.back() > 1e-12);
}

}  // namespace pliant::test::bounce_test
