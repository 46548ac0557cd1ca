// The laws of contacts: derivatives, smoothness, bounds.
#include <catch2/catch.hpp>

#include <array>

#include <pliant/catalogue/catalogue.h>
#include <pliant/model/crossing.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/pair_contact.h>
#include <pliant/model/wall_contact.h>

#include "support/configurations.h"
#include "support/derivatives.h"
#include "support/model_parameters.h"

namespace pliant::test::contact_law_test {

namespace {

constexpr Real epsilon = 1e3, delta = 0.1;

}  // namespace

TEMPLATE_TEST_CASE("derivatives of a law", "", HarmonicOverlap, HertzOverlap, BarrierOverlap, SpringOverlap,
                   LinearOverlap) {
  const TestType v{epsilon, delta};
  const Overlap same{TestType::kind, epsilon, delta};
  CHECK(Overlap::stiffness(TestType::kind) == TestType::stiffness);
  CHECK(Overlap::scale(TestType::kind, delta) == TestType::scale(delta));
  for (Real s = 0.01; s < 1.2; s += 0.0173) {
    INFO("d/range " << s);
    const Real d = s * delta, h = 1e-4 * d;
    if (std::abs(d - delta) < 2 * h) continue;
    const auto difference = [&](auto&& f) {
      return (8 * (f(d + h) - f(d - h)) - f(d + 2 * h) + f(d - 2 * h)) / (12 * h);
    };
    CHECK(v.slope(d) == Approx(difference([&](Real r) { return v.value(r); })).epsilon(1e-7).margin(1e-7));
    CHECK(v.curvature(d) == Approx(difference([&](Real r) { return v.slope(r); })).epsilon(1e-7).margin(1e-4));
    CHECK(std::array{same.value(d), same.slope(d), same.curvature(d)} ==
          std::array{v.value(d), v.slope(d), v.curvature(d)});
    CHECK(v.touches(d) == (s < 1));
    CHECK((v.value(d) > 0) == (s < 1));
    if (s < 1) CHECK(TestType::push(epsilon, delta, d) == Approx(-v.slope(d) / d).epsilon(1e-12));
  }
}

TEST_CASE("the barrier is C2 at touch, where the harmonic law is C1") {
  const HarmonicOverlap spring{epsilon, delta};
  const BarrierOverlap barrier{epsilon, delta};
  const Real stiff = epsilon / square(delta);
  for (const Real x : {1e-4, 1e-6, 1e-8}) {
    const Real d = delta * (1 - x);
    CHECK(spring.curvature(d) == stiff);
    CHECK(barrier.curvature(d) / stiff == Approx(2 * x / BarrierOverlap::onset).epsilon(0.02));
    CHECK(-barrier.slope(d) * delta / epsilon == Approx(square(x) / BarrierOverlap::onset).epsilon(0.02));
  }
  CHECK(barrier.curvature(delta) == 0);
}

TEST_CASE("the barrier follows the harmonic law at small overlaps and grows without bound") {
  const HarmonicOverlap spring{epsilon, delta};
  const BarrierOverlap barrier{epsilon, delta};
  for (const Real x : {0.03, 0.05, 0.1, 0.15}) {
    const Real d = delta * (1 - x);
    CHECK(barrier.slope(d) / spring.slope(d) == Approx(1).margin(0.25));
    CHECK(barrier.curvature(d) / spring.curvature(d) == Approx(1.1).margin(0.3));
  }
  CHECK(barrier.curvature(delta * BarrierOverlap::stiff_distance) * square(delta) / epsilon ==
        Approx(BarrierOverlap::stiffness));
  Real before = barrier.value(0.1 * delta);
  for (int k = 2; k < 12; ++k) {
    const Real s = std::pow(10, -k);
    CHECK(barrier.value(s * delta) - before > 2 * epsilon);  // ln 10 each
    CHECK(-barrier.slope(s * delta) > 0.85 * epsilon / (s * delta));
    before = barrier.value(s * delta);
  }
  CHECK(spring.value(0) < epsilon);
  CHECK(std::isinf(barrier.value(0)));
}

TEST_CASE("derivatives of contacts with the barrier") {
  const auto edge = alone<2>(EdgeContact{.epsilon = epsilon, .law = ContactLaw::barrier});
  for (const Place place : interior_places) {
    INFO("place " << static_cast<int>(place));
    check_smooth<2>(
        *edge, [&](Random& r) { return touching_polygons(r, place); }, 1e-6);
  }
  // Where the nearest place changes from an edge to a corner, distances are C1.
  for (const Place place : {Place::edge_end, Place::notch_edge_end}) {
    INFO("place " << static_cast<int>(place));
    check_boundary<2>(
        *edge, [&](Random& r) { return touching_polygons(r, place); }, 1e-6);
  }
  const auto wall = alone<2>(WallContact<2>{.epsilon = epsilon, .law = ContactLaw::barrier});
  for (const WallPlace place : interior_wall_places) {
    INFO("wall, place " << static_cast<int>(place));
    check_smooth<2>(
        *wall, [&](Random& r) { return polygon_at_wall(r, 45, place, smooth_width); }, 1e-6);
  }
  const auto lip = alone<2>(LipContact{{epsilon}, ContactLaw::barrier});
  for (const LipPlace place : {LipPlace::edge, LipPlace::notch}) {
    INFO("lip, place " << static_cast<int>(place));
    check_smooth<2>(
        *lip, [&](Random& r) { return polygon_at_lip(r, 45, place, smooth_width); }, 1e-6);
  }
}

TEST_CASE("second derivatives of the barrier do not jump at touch") {
  const auto jump = [](const ForceField<2>& field, Configuration<2>& c, const VectorXd& p, Real h) {
    const Functional f = functional(field, c);
    const VectorXd x = c.positions();
    return (f.hessian(x + h * p) - f.hessian(x - h * p)).norm();
  };
  for (const Place place : {Place::edge_onset, Place::corner_onset})
    for (int k = 0; k < 20; ++k) {
      INFO("place " << static_cast<int>(place) << ", state " << k);
      Random random(k);
      Configuration<2> c = touching_polygons(random, place);
      const VectorXd p = random_direction(random, c.positions().size());
      const auto smooth = alone<2>(EdgeContact{.epsilon = epsilon, .law = ContactLaw::barrier}),
                 kinked = alone<2>(EdgeContact{epsilon});
      REQUIRE(jump(*smooth, c, p, 1e-5) > 0);
      CHECK(jump(*smooth, c, p, 1e-7) < 0.02 * jump(*smooth, c, p, 1e-5));
      CHECK(jump(*kinked, c, p, 1e-7) > 0.9 * jump(*kinked, c, p, 1e-5));
    }
}

TEST_CASE("no load presses a vertex through the barrier of an outline or a wall") {
  // A wedge above the top edge of a square, and above the floor.
  const auto tip_force = [](const ForceField<2>& field, bool at_wall, Real d) {
    Configuration<2> c;
    if (at_wall) c.walls = test_hopper(90).walls<2>();
    c.add_polygon({{3, -1}, {4, -1}, {4, at_wall ? -0.5 : 0}, {3, at_wall ? -0.5 : 0}}, delta);
    c.add_polygon(wedge({3.4, d}, {0, 1}), delta);
    std::vector<Real> f(c.x.size());
    field.forces(c.view(), f.data());
    return f[2 * 4 + 1];
  };
  for (const bool at_wall : {false, true}) {
    ModelParameters p{.epsilon = epsilon, .epsilon_wall = epsilon};
    const auto spring = make_force_field<2>(ModelKind::smooth, p, Vec<2>(0, 0));
    p.law = ContactLaw::barrier;
    const auto barrier = make_force_field<2>(ModelKind::smooth, p, Vec<2>(0, 0));
    const Real range = at_wall ? delta / 2 : delta;
    Real before = range;
    for (Real load = 0.1 * epsilon / range; load < 1e9 * epsilon / range; load *= 10) {
      INFO("load " << load);
      // The spring gives way; the barrier balances each load, ever nearer.
      if (load > epsilon / range) CHECK(tip_force(*spring, at_wall, 1e-12) < load);
      Real near = 0, far = range;
      for (int k = 0; k < 200; ++k)
        (tip_force(*barrier, at_wall, (near + far) / 2) > load ? near : far) = (near + far) / 2;
      CHECK(near > 0);
      CHECK(far < before);
      before = far;
    }
  }
}

TEST_CASE("Hertz' contact goes with the power 3/2 of the overlap") {
  const HertzOverlap v{epsilon, delta};
  CHECK(v.value(0.75 * delta) == Approx(0.4 * epsilon / 32));
  CHECK(v.slope(0.75 * delta) == Approx(-epsilon / delta / 8));
  CHECK(v.curvature(0.75 * delta) == Approx(0.75 * epsilon / square(delta)));
  CHECK(v.curvature(delta) == 0);  // C2
  CHECK(v.curvature(1e-9 * delta) == Approx(HertzOverlap::stiffness * epsilon / square(delta)));
}

TEST_CASE("a spring is as stiff for large particles as for small ones, in the stability limit too") {
  constexpr Real k = 50;
  for (const Real size : {0.1, 1.0, 7.0}) {
    const SpringOverlap v{k, size};
    CHECK(v.curvature(0.99 * size) == k);
    CHECK(v.slope(size - 0.01) == Approx(-k * 0.01));
    CHECK(v.value(0.9 * size) == Approx(HarmonicOverlap{k * square(size), size}.value(0.9 * size)));
  }
  // The lighter of two pairs, and of two disks at walls, sets the limit, for any size: 2 k/m and k/m.
  Topology disks;
  disks.add_soft(0.5, 3);
  disks.add_soft(4, 2);
  const PairContact<2> pair{k, "pair", ContactLaw::spring};
  const WallContact<2> wall{.epsilon = k, .law = ContactLaw::spring};
  CHECK(pair.max_rate(disks) == Approx(std::sqrt(2 * k / 2)));
  CHECK(wall.max_rate(disks) == Approx(std::sqrt(k / 2)));
}

TEMPLATE_TEST_CASE_SIG("the linear law gives pairs and walls E (1 - r/sigma), whatever their size", "", ((int D), D), 2,
                       3) {
  ModelParameters p{.epsilon = 50, .epsilon_wall = 70, .law = ContactLaw::linear};
  const auto field = make_force_field<D>(ModelKind::sp, p, Vec<D>::Zero());
  for (const Real size : {0.5, 1.0, 4.0}) {
    Configuration<D> c;
    c.add_soft(1.2 * size, 0.9 * size * Vec<D>::Unit(0));
    c.add_soft(0.8 * size, Vec<D>::Zero());  // 10 %
    std::vector<Real> f(c.x.size());
    field->forces(c.view(), f.data());
    CHECK(f[0] == Approx(50 * 0.1));
    CHECK(f[D] == Approx(-50 * 0.1));
    CHECK(field->energy(c.view()) == Approx(50 * size / 2 * 0.01));
    Configuration<D> w;
    w.walls = test_hopper(90).walls<D>();
    Vec<D> place = Vec<D>::Zero();
    place[0] = test_hopper(90).wall_distance / 2 - 0.4 * size;
    place[D - 1] = 100;
    w.add_soft(size, place);  // 20 % at the upright wall
    f.resize(D);
    field->forces(w.view(), f.data());
    CHECK(f[0] == Approx(-70 * 0.2));
    CHECK(field->energy(w.view()) == Approx(70 * size / 4 * 0.04));
    // Two like pairs: ω² = 2 V''/m.
    Topology two;
    two.add_soft(size, 3);
    CHECK(field->critical_step(two).elastic == Approx(2 / std::sqrt(std::max(2 * 50 / size, 70 / (size / 2)) / 3)));
  }
}

TEST_CASE("derivatives of the linear contact") {
  const auto field2 = alone<2>(PairContact<2>{epsilon, "pair", ContactLaw::linear});
  const auto field3 = alone<3>(PairContact<3>{epsilon, "pair", ContactLaw::linear});
  check_smooth<2>(
      *field2, [](Random& r) { return soft_cluster<2>(r); }, 1e-5);
  check_smooth<3>(
      *field3, [](Random& r) { return soft_cluster<3>(r); }, 1e-5);
  check_boundary<2>(*field2, touching_soft<2>, 1e-4);
  check_boundary<3>(*field3, touching_soft<3>, 1e-4);
}

TEST_CASE("frictional disks with springs have limits of stability that do not depend on their size") {
  const auto limits = [](ContactLaw law, Real size) {
    Topology disk;
    disk.add_soft(size, 2);
    disk.set_inertia(0, 2 * square(size) / 8);
    const BaseParameters base{.gravity = 10};
    return make_force_field<2>(ModelKind::disk, {.epsilon = 50, .epsilon_wall = 50, .law = law, .base = base},
                               Vec<2>::Zero())
        ->critical_step(disk);
  };
  const CriticalStep small = limits(ContactLaw::spring, 0.5), large = limits(ContactLaw::spring, 4);
  CHECK(std::isfinite(small.limit()));
  CHECK(large.elastic == Approx(small.elastic));
  CHECK(large.damping == Approx(small.damping));
  CHECK(limits(ContactLaw::harmonic, 4).elastic == Approx(8 * limits(ContactLaw::harmonic, 0.5).elastic));
  CHECK_THROWS_AS(make_force_field<2>(ModelKind::sp, {.law = ContactLaw::spring}, Vec<2>(0, -1)), InputError);
}

TEST_CASE("a law is refused by models that do not have it") {
  for (const ModelKind kind : {ModelKind::rough})
    CHECK_THROWS_AS(make_force_field<2>(kind, {.law = ContactLaw::hertz}, Vec<2>(0, -1)), InputError);
  for (const ModelKind kind : {ModelKind::rough, ModelKind::smooth, ModelKind::disk})
    CHECK_THROWS_AS(make_force_field<2>(kind, {.law = ContactLaw::linear}, Vec<2>(0, -1)), InputError);
  for (const ModelKind kind : {ModelKind::sp, ModelKind::rough})
    CHECK_THROWS_AS(make_force_field<2>(kind, {.law = ContactLaw::barrier}, Vec<2>(0, -1)), InputError);
}

TEST_CASE("a look finds contacts that are too near: of edges, of walls and of lips") {
  Configuration<2> c;
  c.walls = test_hopper(90).walls<2>();
  c.add_polygon({{3, 0.02}, {4, 0.03}, {4, 1}, {3, 1}}, 0.1);
  c.add_polygon(wedge({3.5, 1.04}, {0, 1}), 0.1);
  OutlineLook seen = look_at_outlines(c.view(), {0.3, 0.3});
  CHECK(!seen.closest);
  CHECK(seen.gap == Approx(0.01));  // 0.04 − 0.3 · 0.1 at the edge, 2 (0.02 − 0.3 · 0.05) at the wall
  seen = look_at_outlines(c.view(), {0.45, 0.45});
  REQUIRE(seen.closest);
  CHECK(seen.closest->other == -1);
  CHECK(seen.closest->vertex == 0);
  CHECK(seen.closest->distance == Approx(0.4));
  c.x[1] = 0.5;
  seen = look_at_outlines(c.view(), {0.45, 0.45});
  REQUIRE(seen.closest);
  CHECK(seen.closest->vertex == 4);
  CHECK(seen.closest->other == 0);
  CHECK(seen.closest->distance == Approx(0.4));

  Configuration<2> lip;
  lip.walls = test_hopper(90).walls<2>();  // a lip at (1.5, 0)
  lip.add_polygon({{1.48, -1}, {1.48, 1}, {1, 1}, {1, -1}}, 0.1);
  seen = look_at_outlines(lip.view(), {0.45, 0.45});
  REQUIRE(seen.closest);
  CHECK(seen.closest->other == -1);
  CHECK(seen.closest->distance == Approx(0.4));
}

}  // namespace pliant::test::contact_law_test
