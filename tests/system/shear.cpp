// Boxes that are sheared at a rate (Lees and Edwards): velocities of images, drag relative to the flow, lattice shifts,
// particles that cross the border. Run on one rank with all tests of the folder, on several by those with the tag.
#include <petscsys.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include <pliant/ts/verlet.h>

#include "support/model_parameters.h"
#include "support/twins.h"

namespace pliant::test::shear_test {

namespace {

constexpr Real rate = 0.3;

const Box<2> box_of_polygons({-1.575, 0}, {3.15, 3.15}), box_of_disks({-1.9, 0}, {3.8, 3.8});

template <int D>
ParticleSystem<D> sheared(const Configuration<D>& c, ModelKind kind, const Box<D>& box,
                          const ModelParameters& p = parameters, Real of_rate = rate) {
  ParticleSystem<D> system = system_of<D>(c, kind, Ranks(), p, box, pliant::Vec<D>::Zero());
  system.shear_at(of_rate);
  return system;
}

template <int D>
VectorXd forces(ParticleSystem<D>& system, const Configuration<D>& c, Real t) {
  const StateView<D> s = system.view(c.x.data(), c.v.data(), t);
  VectorXd f(s.topology.points() * D);
  system.field().forces(s, f.data());
  return f.head(static_cast<Index>(c.x.size()));
}

/// Moves particle m to image n at the time of the box, with the velocity of that image.
template <int D>
void move_to_image(Configuration<D>& c, Index m, const Box<D>& box, const Image& n) {
  for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i) {
    point<D>(c.x.data(), i) += box.shift(n);
    point<D>(c.v.data(), i) += box.shift_velocity(n);
  }
}

/// Disks that fill the box, without walls.
Configuration<2> disks(Random& random) {
  Configuration<2> c;
  for (Index m = 0; m < 16; ++m)
    c.add_soft(random(0.9, 1.1), {-1.9 + 0.95 * (m % 4) + random(-0.1, 0.1), 0.95 * (m / 4) + random(-0.1, 0.1)});
  c.random_velocities(random);
  return c;
}

Configuration<2> polygons(Random& random) {
  Configuration<2> c;
  for (Index m = 0; m < 9; ++m) {
    c.add_polygon(regular_polygon(8, 0.5, {-1.575 + 1.05 * (m % 3), 1.05 * (m / 3)}, random(0, 1)), 0.2);
    c.topology.a0[m] /= 0.9;
    c.topology.l0[m] /= 0.9;
  }
  c.random_velocities(random);
  return c;
}

}  // namespace

TEST_CASE("a sheared box has the tilt of its strain and the flow of its rate", "[shear]") {
  const Box<2> square({-1, 2}, {4, 3});
  const Box<2> box = square.sheared(2.6, 0.1, 2);
  CHECK(box.tilt()[0] == Approx(2.6 * 3 - 2 * 4));
  CHECK((box.flow().at({7, 5}) - pliant::Vec<2>(0.1 * 3, 0)).norm() < 1e-15);
  CHECK((box.shift_velocity({5, -2, 0}) - pliant::Vec<2>(-0.1 * 2 * 3, 0)).norm() < 1e-15);
  CHECK((square.shift_velocity({5, -2, 0})).norm() == 0);
  const Box<3> cube({0, 0, 0}, {4, 3, 2}, {0, 0, 0.5});  // edge z leans along y, and so moves along x
  CHECK((cube.sheared(1, 0.1, 0).shift_velocity({0, 0, 1}) - pliant::Vec<3>(0.05, 0, 0)).norm() < 1e-15);
  CHECK_THROWS_AS(Box<2>({0, 0}, {4, Box<2>::infinite}).sheared(1, 0.1, 0), InputError);
}

TEST_CASE("two disks across the border of a sheared box", "[shear]") {
  Configuration<2> c;
  c.add_soft(1, {1, 0.2});
  c.add_soft(1, {1.3, 3.4});  // touches the first from below, as an image
  c.v = {0.4, 0.1, -0.2, 0.3};
  ModelParameters p = parameters;
  p.zeta = 0;
  const Box<2> box({0, 0}, {4, 4});
  const Real t = 0.5;
  auto system = sheared<2>(c, ModelKind::sp, box, p);
  const VectorXd f = forces(system, c, t);
  const pliant::Vec<2> image(1.3 - rate * t * 4, 3.4 - 4), velocity(-0.2 - rate * 4, 0.3),
      r = pliant::Vec<2>(1, 0.2) - image;
  REQUIRE(r.norm() < 1);
  const pliant::Vec<2> expected =
      p.epsilon * (1 - r.norm()) * r.normalized() - p.mu * (pliant::Vec<2>(0.4, 0.1) - velocity);
  CHECK((f.head<2>() - expected).norm() < 1e-12 * expected.norm());
  CHECK((f.tail<2>() + expected).norm() < 1e-12 * expected.norm());
}

TEST_CASE("forces in a sheared box do not depend on images, nor on the choice of the lattice", "[shear]") {
  Random random(3);
  const auto check = [&](Configuration<2> c, ModelKind kind, const Box<2>& box) {
    const Real t = 4.1;  // strain 1.23
    auto system = sheared<2>(c, kind, box);
    const VectorXd before = forces(system, c, t);
    CHECK(before.norm() > 1);
    Real energy = system.field().energy(system.view(c.x.data(), c.v.data(), t));
    const Real power = system.field().power(system.view(c.x.data(), c.v.data(), t));
    for (Index m = 0; m < c.topology.particles(); ++m)
      move_to_image<2>(c, m, system.box(), {static_cast<int>(random(-3, 3)), static_cast<int>(random(-3, 3)), 0});
    auto other = sheared<2>(c, kind, box);
    CHECK((forces(other, c, t) - before).norm() < 1e-10 * before.norm());
    State state(c.topology.points(), 2);
    state.assign(c.x, c.v);
    state.t = t;
    CHECK(other.shift_lattice(state) == 1);
    CHECK(std::abs(other.box().tilt()[0]) <= box.length()[0] / 2);
    CHECK((forces(other, c, t) - before).norm() < 1e-10 * before.norm());
    other.wrap(state);
    std::copy(state.x().begin(), state.x().end(), c.x.begin());
    std::copy(state.v().begin(), state.v().end(), c.v.begin());
    CHECK((forces(other, c, t) - before).norm() < 1e-10 * before.norm());
    const StateView<2> s = other.view(c.x.data(), c.v.data(), t);
    CHECK(other.field().energy(s) == Approx(energy));
    CHECK(other.field().power(s) == Approx(power));
  };
  check(disks(random), ModelKind::sp, box_of_disks);
  check(polygons(random), ModelKind::rough, box_of_polygons);
  check(polygons(random), ModelKind::smooth, box_of_polygons);
}

TEST_CASE("drag in a sheared box is relative to the flow", "[shear]") {
  Configuration<2> c;
  c.add_soft(1, {1, 1.2});
  c.v = {0.5, -0.2};
  auto system = sheared<2>(c, ModelKind::sp, Box<2>({0, 0}, {4, 4}));
  CHECK((forces(system, c, 3) - -parameters.zeta * pliant::Vec<2>(0.5 - rate * 1.2, -0.2)).norm() < 1e-14);
  const StateView<2> s = system.view(c.x.data(), c.v.data(), 3);
  CHECK(system.field().power(s) == Approx(parameters.zeta * pliant::Vec<2>(0.5 - rate * 1.2, -0.2).squaredNorm()));
  // ∂F/∂x, by which implicit methods find their steps.
  struct Sum final : BlockSink<2> {
    pliant::Mat<2> sum = pliant::Mat<2>::Zero();
    void add(Index, Index, const pliant::Mat<2>& block) override { sum += block; }
  } by_x, by_v;
  system.field().derivatives(s, TermGroup::all, by_x, by_v);
  CHECK(by_x.sum(0, 1) == Approx(parameters.zeta * rate));
  CHECK(by_v.sum(0, 0) == Approx(-parameters.zeta));
}

TEST_CASE("a particle that crosses the border of a sheared box keeps its velocity relative to the flow", "[shear]") {
  // w = v − u obeys ẇ_y = −γ w_y and ẇ_x = −γ w_x − rate w_y, wherever the particle is.
  Configuration<2> c;
  c.add_soft(1, {1, 1});
  const pliant::Vec<2> w0(0.2, 3);
  c.v = {w0[0] + rate * 1, w0[1]};
  const Real gamma = parameters.zeta / c.topology.point_mass[0], dt = 1e-3;
  const Box<2> box({0, 0}, {4, 4});
  auto system = sheared<2>(c, ModelKind::sp, box);
  State state(1, 2);
  state.assign(c.x, c.v);
  FixedStepVerlet verlet(dt);
  bool fresh = true;
  while (state.t < 12) {
    verlet.run(system, state, state.t + 0.5, fresh, {});
    fresh = false;
    system.shift_lattice(state);
    std::vector<Real> predicted(verlet.carried().begin(), verlet.carried().end());
    system.sort(state, predicted);
    verlet.set_carried(predicted);
    const pliant::Vec<2> r = point<2>(state.x().data(), 0), v = point<2>(state.v().data(), 0);
    CHECK((r.array() >= 0).all());
    CHECK((r.array() < 4).all());
    const Real decay = std::exp(-gamma * state.t);
    const pliant::Vec<2> w = decay * pliant::Vec<2>(w0[0] - rate * w0[1] * state.t, w0[1]);
    CHECK((v - system.box().flow().at(r) - w).norm() < 1e-5);
    const Real y = 1 + w0[1] * (1 - decay) / gamma;
    const pliant::Vec<2> home = r + system.box().shift(state.images[0]);
    CHECK(home[1] == Approx(y).epsilon(1e-6));
    // ∫ (w_x + rate y) dt
    const Real with_w =
                   w0[0] * (1 - decay) / gamma - rate * w0[1] * (1 - decay * (1 + gamma * state.t)) / square(gamma),
               with_flow = rate * (state.t + w0[1] / gamma * (state.t - (1 - decay) / gamma));
    CHECK(home[0] == Approx(1 + with_w + with_flow).epsilon(1e-5));
  }
  CHECK(state.images[0][1] >= 1);
  CHECK(system.box().tilt()[0] != Approx(rate * state.t * 4));
}

TEST_CASE("sorting and lattice shifts do not change a trajectory", "[shear]") {
  Random random(5);
  const auto check = [&](const Configuration<2>& c, ModelKind kind, const Box<2>& box) {
    // Once with wrapped particles in a lattice with small tilts, once from image to image in an ever longer edge.
    std::vector<Real> ends[2];
    for (const bool tidy : {false, true}) {
      auto system = sheared<2>(c, kind, box, parameters, 2.0);
      State state(c.topology.points(), 2);
      state.assign(c.x, c.v);
      FixedStepVerlet verlet(1e-3);
      bool fresh = true;
      for (int k = 0; k < 5; ++k) {
        verlet.run(system, state, state.t + 0.1, fresh, {});
        fresh = false;
        if (!tidy) continue;
        system.shift_lattice(state);
        std::vector<Real> predicted(verlet.carried().begin(), verlet.carried().end());
        const Migration migration = system.sort(state, predicted);
        migration.move_points(predicted, 2);
        verlet.set_carried(predicted);
      }
      CHECK((system.box().tilt()[0] == Approx(box.length()[1])) != tidy);
      ends[tidy].resize(state.size());
      std::vector<Index> offset;
      for (Index m = 0; m < c.topology.particles(); ++m) {
        const Topology& t = system.topology();
        const pliant::Vec<2> shift = tidy ? system.box().shift(state.images[m]) : pliant::Vec<2>::Zero();
        for (Index i = 0; i < t.points_of(m); ++i)
          point<2>(ends[tidy].data(), c.topology.offset[t.id[m]] + i) =
              point<2>(state.x().data(), t.offset[m] + i) + shift;
      }
    }
    Real most = 0;
    for (std::size_t k = 0; k < ends[0].size(); ++k) most = std::max(most, std::abs(ends[0][k] - ends[1][k]));
    INFO(to_string(kind));
    CHECK(most < 1e-9);  // rounding, which grows
    CHECK(std::abs(ends[0][0] - c.x[0]) > 0.01);
  };
  check(disks(random), ModelKind::sp, box_of_disks);
  check(polygons(random), ModelKind::rough, box_of_polygons);
  check(polygons(random), ModelKind::smooth, box_of_polygons);
}

TEST_CASE("ranks share a sheared box", "[ranks][shear]") {
  Random random(6);
  Configuration<2> c = disks(random);
  Twins<2> twins(c, ModelKind::sp, box_of_disks);
  twins.whole.shear_at(rate);
  twins.shared.shear_at(rate);
  for (const Real t : {0.0, 0.3, 0.35, 2.9}) {
    std::vector<Real> all(c.x.size()), own(twins.state.size());
    twins.whole.acceleration(t, c.x.data(), c.v.data(), all.data());
    twins.shared.acceleration(t, twins.state.x().data(), twins.state.v().data(), own.data());
    CHECK(twins.difference(own, all) < 1e-10);
  }
}

TEST_CASE("lists in a sheared box hold up to the same displacement on every rank", "[ranks][shear]") {
  // One wide disk, too far from the disks of most ranks to be their ghost.
  Configuration<2> c;
  for (Index m = 0; m < 12; ++m) c.add_soft(m == 0 ? 3 : 1, {4.0 * m + 2, 2});
  c.v.resize(c.x.size());
  const Box<2> box({0, 0}, {48, 4});
  Twins<2> twins(c, ModelKind::sp, box);
  twins.shared.shear_at(rate);
  twins.sort();
  std::vector<Real> a(twins.state.size());
  for (const Real t : {0.0, 0.02})
    twins.shared.acceleration(t, twins.state.x().data(), twins.state.v().data(), a.data());
  const Real limit = twins.shared.neighbours().limit();
  CHECK(limit < skin / 2);
  CHECK(limit > 0);
  CHECK(twins.ranks.max(limit) == twins.ranks.min(limit));
}

TEST_CASE("a box that is sheared at a rate cannot be set", "[shear]") {
  Configuration<2> c;
  c.add_soft(1, {1, 1});
  auto system = sheared<2>(c, ModelKind::sp, Box<2>({0, 0}, {4, 4}));
  CHECK_THROWS_WITH(system.shear_at(0.1), Catch::Contains("sheared at the rate 0.3"));
  CHECK_THROWS_AS(system.set_box(Box<2>({0, 0}, {4, 4})), InputError);
  CHECK_THROWS_AS(system.deform(pliant::Mat<2>::Identity()), InputError);
  auto open = system_of<2>(c, ModelKind::sp, Ranks(), parameters, Box<2>({0, 0}, {4, Box<2>::infinite}));
  CHECK_THROWS_AS(open.shear_at(0.1), InputError);
  CHECK_THROWS_AS(open.shear_at(NAN), InputError);
}

}  // namespace pliant::test::shear_test
