#include <pliant/jamming/minimise.h>

#include <catch2/catch.hpp>

#include <limits>

#include <pliant/jamming/point_packing.h>
#include <pliant/jamming/potential.h>
#include <pliant/jamming/quasi_newton.h>
#include <pliant/jamming/trust_region.h>
#include <pliant/model/polygon.h>
#include <pliant/setup/particles.h>
#include <pliant/system/stress.h>

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
    const bool surfaces = D == 3 && kind != ModelKind::sp;
    topology = make_particles(kind, D, draw_diameters({}, n, seed), {.vertices = surfaces ? 42 : 16});
    Real content = 0;
    for (Index m = 0; m < n; ++m) content += topology.a0[m];
    const Real length = std::pow(content / phi, Real(1) / D);
    box = Box<D>(Vec<D>::Zero(), Vec<D>::Constant(length));
    Random random(static_cast<int>(seed));
    x.resize(static_cast<std::size_t>(topology.points()) * D);
    for (Index m = 0; m < n; ++m) {
      Vec<D> centre;
      for (Real& a : centre) a = random(0, length);
      if (surfaces)
        place_surface(topology, m, Vec<3>(centre[0], centre[1], centre[D - 1]), Mat<3>::Identity(), x.data());
      else
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
    CHECK(m.max_force <= 1e-6 * pressure);  // in the present box, which may be smaller than the one at the start
    CHECK(m.stress.pressure() == Approx(pressure).epsilon(1e-5));
  };
  check(std::integral_constant<int, 2>(), ModelKind::sp, 32, 0.9, 1e-2);
  check(std::integral_constant<int, 2>(), ModelKind::sp, 32, 0.9, 1e-4);
  check(std::integral_constant<int, 3>(), ModelKind::sp, 32, 0.7, 1e-3);
  check(std::integral_constant<int, 2>(), ModelKind::rough, 3, 0.6, 1);
  check(std::integral_constant<int, 2>(), ModelKind::smooth, 3, 0.6, 1);
}

TEST_CASE("forces on images give the virial of centres") {
  const auto check = [&]<int D>(std::integral_constant<int, D>, ModelKind kind, Index n, Real phi) {
    INFO(to_string(kind) << " " << D << "D, " << n << " particles");
    const RandomCell<D> cell(kind, n, 7, phi);
    auto system = cell.system(kind);
    StateView<D> s = system.view(cell.x.data(), nullptr);
    s.ghosts_feel = true;
    REQUIRE(s.neighbours.chunks() == 1);
    std::vector<Real> f(static_cast<std::size_t>(s.topology.points()) * D), on_particles;
    system.field().forces(s, f.data());
    Real virial = 0;  // of all points, then without their motion relative to their centres
    for (const TermVirial<D>& term : system.field().virials(s)) virial += term.virial.trace();
    const Real of_points = virial;
    for (Index m = 0; m < s.topology.particles(); ++m) {
      Vec<D> sum = Vec<D>::Zero();
      const Vec<D> centre = mean_of_points<D>(s.x, s.topology, m);
      for (Index i = s.topology.offset[m]; i < s.topology.offset[m + 1]; ++i) {
        const Vec<D> own = point<D>(f.data(), i);
        sum += own;
        if (m < s.topology.owned()) virial += own.dot(s.position(i) - centre);
      }
      on_particles.insert(on_particles.end(), sum.begin(), sum.end());
    }
    CHECK(std::abs(virial) > 1e-3);
    CHECK(std::abs(virial - of_points) > 1e-3);
    CHECK(virial_of_centres<D>(s, on_particles.data()) == Approx(virial).epsilon(1e-10));
  };
  for (const ModelKind kind : {ModelKind::rough, ModelKind::smooth}) {
    check(std::integral_constant<int, 2>(), kind, 12, 0.8);
    check(std::integral_constant<int, 3>(), kind, 3, 0.6);
  }
  check(std::integral_constant<int, 2>(), ModelKind::rough, 1, 1);  // touches its own images
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

TEST_CASE("a few points have the energy and the forces of their system, and their Hessian is near the exact one") {
  const auto check = [&]<int D>(std::integral_constant<int, D>, Index n, Real phi) {
    INFO(n << " points in " << D << "D");
    RandomCell<D> cell(ModelKind::sp, n, 5, phi);
    auto system = cell.system(ModelKind::sp);
    REQUIRE(PointPacking<D>::suits(system));
    constexpr Real pressure = 0.01;
    const std::size_t numbers = cell.x.size();
    for (const bool pressed : {false, true}) {
      PointPacking<D> packing(system, {1, ContactLaw::harmonic}, pressed ? std::optional(pressure) : std::nullopt);
      std::vector<Real> y = cell.x, x(numbers), f(numbers + 1), changed(numbers + 1), of_system(4000);
      if (pressed) y.push_back(0.03 * packing.factor());
      Random random(1);
      // The lists of the points follow their moves and the box.
      for (int step = 0; step < 20; ++step) {
        for (Real& a : y) a += random(-0.05, 0.05);
        const Real energy = packing(y.data(), f.data()), scale = packing.scale(y.data());
        packing.place(y.data(), x.data());
        auto moved = cell.system(ModelKind::sp);
        moved.set_box(cell.box.deformed(Mat<D>(scale * Mat<D>::Identity())));
        const StateView<D> s = moved.view(x.data(), nullptr);
        of_system.resize(static_cast<std::size_t>(s.topology.points()) * D);
        const Real work = pressed ? pressure * moved.box().volume() : 0;
        CHECK(energy == Approx(moved.field().energy(s, of_system.data()) + work).epsilon(1e-12));
        for (std::size_t k = 0; k < numbers; ++k) CHECK(f[k] == Approx(scale * of_system[k]).margin(1e-12));
        if (pressed) {
          const Real stretched = D * moved.box().volume() * (stress_of(moved, x.data()).pressure() - pressure);
          CHECK(f[numbers] == Approx(stretched / packing.factor()).epsilon(1e-9));
        }
      }
    }
    // At a minimum.
    std::vector<Real> x = cell.x;
    MinimiserOptions o;
    o.contacts = PairContactLaw{1, ContactLaw::harmonic};
    o.force_tolerance = 1e-12;
    CHECK(minimise<D>(system, x, o).max_force < 1.2e-12);
    o.pressure = pressure;
    Minimum<D> m = minimise<D>(system, x, o);
    CHECK(m.max_force < 1.2e-12);
    CHECK(m.stress.pressure() == Approx(pressure).epsilon(1e-8));
    PointPacking<D> packing(system, *o.contacts, pressure);
    std::vector<Real> y = x, f(numbers + 1);
    y.push_back(0);
    Random random(2);
    Eigen::VectorXd direction(static_cast<Eigen::Index>(numbers) + 1), solved;
    for (Real& a : direction) a = random(-1, 1);
    (void)packing(y.data(), f.data());
    REQUIRE(packing.factorise(y.data()));
    constexpr Real h = 1e-7;
    const auto force = [&](Real by) {
      std::vector<Real> z = y, at(numbers + 1);
      for (std::size_t k = 0; k <= numbers; ++k) z[k] += by * direction[static_cast<Eigen::Index>(k)];
      (void)packing(z.data(), at.data());
      return Eigen::VectorXd(Eigen::Map<Eigen::VectorXd>(at.data(), static_cast<Eigen::Index>(at.size())));
    };
    const Eigen::VectorXd by_hessian = (force(-h) - force(h)) / (2 * h);
    solved = by_hessian;
    packing.solve(solved);
    // H d is near H⁻ d up to the pre-stress, pairs near contact and rattlers.
    CHECK(solved.dot(by_hessian) == Approx(direction.dot(by_hessian)).epsilon(0.15));
  };
  check(std::integral_constant<int, 2>(), 40, 0.95);
  check(std::integral_constant<int, 2>(), 4, 0.9);  // several images of a point
  check(std::integral_constant<int, 3>(), 40, 0.75);
}

TEST_CASE("the Hessian of the enthalpy of polygons is the change of their forces, also by the box") {
  for (const ModelKind kind : {ModelKind::rough, ModelKind::smooth}) {
    INFO(to_string(kind));
    RandomCell<2> cell(kind, 3, 3, 0.6);
    auto system = cell.system(kind);
    REQUIRE(Potential<2>::quick(system));
    std::vector<Real> x = cell.x;
    MinimiserOptions o;
    o.pressure = 1;
    o.force_tolerance = 1e-10;
    const Minimum<2> m = minimise<2>(system, x, o);
    REQUIRE(m.converged);
    Potential<2> potential(system, o.pressure);
    std::vector<Real> y = x;
    y.push_back(0);
    REQUIRE(potential.factorise(y.data()));
    // Moves on which no contact opens or closes.
    constexpr Real h = 1e-8;
    const auto n = static_cast<Eigen::Index>(y.size());
    for (const bool box_alone : {false, true}) {
      Random random(3);
      Eigen::VectorXd direction(n), forward(n), back(n);
      for (Real& a : direction) a = box_alone ? 0 : random(-1, 1);
      direction[n - 1] = 1;
      const auto force = [&](Real by, Eigen::VectorXd& f) {
        std::vector<Real> z = y;
        for (std::size_t k = 0; k < z.size(); ++k) z[k] += by * direction[static_cast<Eigen::Index>(k)];
        potential(z.data(), f.data(), true);
      };
      force(h, forward);
      force(-h, back);
      const Eigen::VectorXd by_hessian = (back - forward) / (2 * h);
      Eigen::VectorXd solved = by_hessian;
      potential.solve(solved);
      CHECK(solved.dot(by_hessian) == Approx(direction.dot(by_hessian)).epsilon(1e-5));
    }
  }
}

TEST_CASE("L-BFGS gives up where a step is less than the rounding errors") {
  struct Unit final : ApproximateHessian {
    bool factorise(const Real* /*x*/) override { return true; }
    void solve(Eigen::VectorXd& /*b*/) override {}
  } unit;
  std::vector<Real> x = {1, 2};
  const auto flat = [](const Real* /*x*/, Real* f) {
    f[0] = f[1] = 1e-20;
    return Real(1);
  };
  const DescentResult result = quasi_newton(x, flat, unit, {.force_tolerance = 1e-30});
  CHECK(!result.converged);
  CHECK(result.evaluations < 100);
}

TEST_CASE("the three minimisers end in the same minimum, in a box and with it") {
  const auto check = [&]<int D>(std::integral_constant<int, D>, ModelKind kind, Index n, Real phi, Real pressure) {
    INFO(to_string(kind) << " " << D << "D");
    const RandomCell<D> cell(kind, n, 3, phi);
    MinimiserOptions o;
    o.force_tolerance = 1e-7 * pressure;
    auto system = cell.system(kind);
    std::vector<Real> start = cell.x;
    o.pressure = pressure;
    REQUIRE(minimise<D>(system, start, o).converged);
    const Box<D> box = system.box();
    Random random(4);
    for (Real& a : start) a += random(-1e-3, 1e-3);
    o.force_tolerance = 1e-10;
    for (const bool pressed : {false, true}) {
      o.pressure = pressed ? std::optional(pressure) : std::nullopt;
      const auto minimum = [&](Minimiser minimiser) {
        auto other = cell.system(kind);
        other.set_box(box);
        std::vector<Real> x = start;
        o.minimiser = minimiser;
        const Minimum<D> m = minimise<D>(other, x, o);
        CHECK(m.converged);
        CHECK(m.max_force <= o.force_tolerance);
        if (!pressed) CHECK(other.box().length() == box.length());
        return m;
      };
      const Minimum<D> by_fire = minimum(Minimiser::fire), newton = minimum(Minimiser::newton),
                       lbfgs = minimum(Minimiser::lbfgs);
      for (const Minimum<D>& m : {newton, lbfgs}) {
        CHECK(m.energy == Approx(by_fire.energy).epsilon(1e-7));
        CHECK(m.stress.pressure() == Approx(by_fire.stress.pressure()).epsilon(1e-7));
      }
      CHECK(newton.evaluations < by_fire.evaluations);
      if (kind != ModelKind::sp) CHECK(lbfgs.evaluations < by_fire.evaluations);
    }
  };
  check(std::integral_constant<int, 2>(), ModelKind::rough, 3, 0.6, 1);
  check(std::integral_constant<int, 2>(), ModelKind::smooth, 3, 0.6, 1);
  check(std::integral_constant<int, 2>(), ModelKind::sp, 32, 0.9, 1e-2);
  check(std::integral_constant<int, 3>(), ModelKind::sp, 32, 0.7, 1e-2);
}

namespace {

/// The energy (x² − 1)²/4 + y²/2, with a saddle point at x = 0.
struct TwoWells final : ExactHessian {
  std::vector<Real> at;
  bool positive = true;
  int most = 1000;    ///< number of evaluations that succeed
  Real farthest = 0;  ///< evaluation from the place of the Hessian

  bool factorise(const Real* x) override {
    at.assign(x, x + 2);
    return positive;
  }
  void solve(Eigen::VectorXd& b) override { b[0] /= std::max(Real(0.1), 3 * at[0] * at[0] - 1); }
  void fill(::Mat matrix) const override {
    const PetscInt start[] = {0, 1, 2}, column[] = {0, 1};
    const Real values[] = {3 * at[0] * at[0] - 1, 1};
    petsc_check(MatSeqAIJSetPreallocationCSR(matrix, start, column, values));
  }
  EnergyAndForce energy_and_force() {
    return [this](const Real* x, Real* f) {
      if (--most < 0) throw NumericalError("the energy has no value");
      for (std::size_t k = 0; k < at.size(); ++k) farthest = std::max(farthest, std::abs(x[k] - at[k]));
      f[0] = x[0] * (1 - x[0] * x[0]);
      f[1] = -x[1];
      return square(x[0] * x[0] - 1) / 4 + square(x[1]) / 2;
    };
  }
};

}  // namespace

TEST_CASE("Newton's method goes downhill where the Hessian has a negative eigenvalue") {
  TwoWells wells;
  std::vector<Real> x = {0.1, 1};
  const DescentResult result =
      trust_region(x, wells.energy_and_force(), wells, {.force_tolerance = 1e-12, .max_move = 0.2});
  CHECK(result.converged);
  CHECK(x[0] == Approx(1));
  CHECK(x[1] == Approx(0).margin(1e-11));
  CHECK(result.iterations < 30);
  CHECK(wells.farthest < 0.201);
}

TEST_CASE("Newton's method ends at limits, stop requests and exceptions") {
  const auto run = [](TwoWells wells, const DescentOptions& o) {
    std::vector<Real> x = {0.1, 1};
    return trust_region(x, wells.energy_and_force(), wells, o);
  };
  CHECK(!run({}, {.max_evaluations = 3}).converged);
  const DescentResult stopped = run({}, {.stop = [] { return true; }});
  CHECK((stopped.stopped && !stopped.converged && stopped.evaluations == 1));
  TwoWells wells;
  wells.positive = false;
  CHECK(!run(wells, {}).converged);
  wells.positive = true;
  wells.most = 4;
  CHECK_THROWS_WITH(run(wells, {}), "the energy has no value");
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
