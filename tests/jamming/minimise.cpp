#include <pliant/jamming/minimise.h>

#include <catch2/catch.hpp>

#include <limits>

#include <pliant/setup/particles.h>

#include "support/model_parameters.h"
#include "support/random.h"

namespace pliant::test::minimise_test {

namespace {

/// Particles at random in a square or cubic box, without gravity.
template <int D>
struct RandomCell {
  Topology topology;
  Box<D> box;
  std::vector<Real> x;

  RandomCell(ModelKind kind, Index n, std::uint64_t seed, Real phi) {
    topology = make_particles(kind, D, draw_diameters({}, n, seed), {});
    Real content = 0;
    for (Index m = 0; m < n; ++m) content += topology.a0[m];
    const Real length = std::pow(content / phi, Real(1) / D);
    box = Box<D>(Vec<D>::Zero(), Vec<D>::Constant(length));
    Random random(static_cast<int>(seed));
    x.resize(static_cast<std::size_t>(topology.points()) * D);
    for (Index m = 0; m < n; ++m) {
      Vec<D> centre;
      for (Real& a : centre) a = random(0, length);
      place_particle(topology, m, centre.data(), random(0, 6), x.data());
    }
  }
  ParticleSystem<D> system(ModelKind kind) const {
    return ParticleSystem<D>(topology, {}, make_force_field<D>(kind, frictionless()), 0.3, Ranks(), box);
  }
  static ParameterValues frictionless() {
    return ParameterValues{{Role::contact_energy, 1.0}, {Role::wall_energy, 1.0}};
  }
};

}  // namespace

TEST_CASE("a packing at a fixed pressure has this pressure and no forces") {
  const auto check = [&]<int D>(std::integral_constant<int, D>, ModelKind kind, Index n, Real phi, Real pressure) {
    INFO(to_string(kind) << " " << D << "D");
    RandomCell<D> cell(kind, n, 3, phi);
    auto system = cell.system(kind);
    std::vector<Real> x = cell.x;
    MinimiserOptions o;
    o.pressure = pressure;
    o.force_tolerance = 1e-6 * pressure;
    const Minimum<D> m = minimise<D>(system, x, o);
    CHECK(m.converged);
    CHECK(m.max_force < 1.2e-6 * pressure);
    CHECK(m.stress.pressure() == Approx(pressure).epsilon(1e-5));
  };
  check(std::integral_constant<int, 2>(), ModelKind::sp, 32, 0.9, 1e-2);
  check(std::integral_constant<int, 2>(), ModelKind::sp, 32, 0.9, 1e-4);
  check(std::integral_constant<int, 3>(), ModelKind::sp, 32, 0.7, 1e-3);
  check(std::integral_constant<int, 2>(), ModelKind::rough, 3, 0.6, 1);
  check(std::integral_constant<int, 2>(), ModelKind::smooth, 3, 0.6, 1);
}

TEST_CASE("a packing in a fixed box, and lists that follow a box") {
  RandomCell<2> cell(ModelKind::sp, 40, 4, 0.95);
  auto system = cell.system(ModelKind::sp);
  std::vector<Real> x = cell.x;
  const Minimum<2> first = minimise<2>(system, x, {});
  CHECK(first.converged);
  CHECK(first.max_force < 1.001e-10);
  CHECK(first.stress.pressure() > 1e-2);
  // The derivative of the energy of minima by the volume.
  const auto energy = [&](Real strain) {
    std::vector<Real> moved = x;
    auto other = cell.system(ModelKind::sp);
    const Mat<2> f = Mat<2>((1 + strain) * Mat<2>::Identity());
    other.view(moved.data(), nullptr);
    other.deform(f);
    for (Real& a : moved) a *= 1 + strain;
    return minimise<2>(other, moved, {}).energy;
  };
  constexpr Real step = 1e-5;
  const Real volume = cell.box.volume();
  CHECK((energy(-step) - energy(step)) / (4 * step * volume) == Approx(first.stress.pressure()).epsilon(1e-5));
  // Lists that have followed the box give the forces of new lists.
  auto followed = cell.system(ModelKind::sp);
  Index same = 0;
  for (int k = 1; k <= 30; ++k) {
    followed.view(x.data(), nullptr);
    const std::int64_t rebuilds = followed.neighbours().rebuilds();
    Mat<2> f;
    f << 0.99, 0.005, 0, 1.003;
    followed.deform(f);
    for (std::size_t i = 0; i < x.size(); i += 2) point<2>(&x[i], 0) = f * point<2>(&x[i], 0);
    ParticleSystem<2> fresh(cell.topology, {}, make_force_field<2>(ModelKind::sp, RandomCell<2>::frictionless()), 0.3,
                            Ranks(), followed.box());
    const StateView<2> s = followed.view(x.data(), nullptr);
    same += followed.neighbours().rebuilds() == rebuilds ? 1 : 0;
    std::vector<Real> a(static_cast<std::size_t>(s.topology.points()) * 2), b(a.size() + 400);
    const Real u = followed.field().energy(s, a.data());
    CHECK(fresh.field().energy(fresh.view(x.data(), nullptr), b.data()) == Approx(u).epsilon(1e-12));
    for (std::size_t i = 0; i < x.size(); ++i) CHECK(a[i] == Approx(b[i]).margin(1e-12));
  }
  CHECK((same > 20 && same < 30));
}

TEST_CASE("packings that there are not") {
  const auto pack = [](const Box<2>& box, const MinimiserOptions& o) {
    Topology t;
    t.add_soft(1, 1);
    ParticleSystem<2> system(t, {}, make_force_field<2>(ModelKind::sp, RandomCell<2>::frictionless()), 0.3, Ranks(),
                             box);
    std::vector<Real> x(2);
    minimise<2>(system, x, o);
  };
  const Box<2> box({0, 0}, {3, 3});
  CHECK_NOTHROW(pack(box, {}));
  CHECK_NOTHROW(pack({}, {}));
  MinimiserOptions pressed;
  pressed.pressure = 1;
  CHECK_THROWS_WITH(pack({}, pressed), Catch::Contains("direction 0 of the box is open"));
  for (const Real p : {0.0, -1.0, std::nan(""), std::numeric_limits<Real>::infinity()}) {
    MinimiserOptions o;
    o.pressure = p;
    CHECK_THROWS_WITH(pack(box, o), Catch::Contains("it must be positive"));
  }
}

}  // namespace pliant::test::minimise_test
