// The terms of the bubble model: derivatives, numbers of the thesis, laws of conservation, errors, moving walls.
#include <catch2/catch.hpp>
#include <set>

#include <pliant/base/errors.h>
#include <pliant/catalogue/catalogue.h>
#include <pliant/model/depletion.h>
#include <pliant/model/wall_depletion.h>
#include <pliant/model/wall_repulsion.h>

#include "support/configurations.h"
#include "support/derivatives.h"
#include "support/model_parameters.h"

namespace pliant::test::droplets_test {

namespace {

constexpr Real f0 = 10, phi_c = 1e-4, a_s = 0.05;  // [T 2.2.2]
constexpr Real scale = 0.01;                       // scale of energies of pairs and walls

template <int D>
std::unique_ptr<ForceField<D>> contact() {
  return alone<D>(BubbleContact<D>{{f0}});
}
template <int D>
std::unique_ptr<ForceField<D>> depletion() {
  return alone<D>(Depletion<D>{{{phi_c, a_s}}, {f0}});
}
template <int D>
std::unique_ptr<ForceField<D>> droplets(const Vec<D>& gravity = Vec<D>::Zero()) {
  return make_force_field<D>(ModelKind::bubble, {}, gravity);
}

/// Two droplets whose centres are at R_i + R_j + gap.
template <int D>
Configuration<D> pair(Random& random, Real gap) {
  Configuration<D> c;
  const Real a = random(0.7, 1.3), b = random(0.7, 1.3);
  c.add_droplet(a, Vec<D>::Zero());
  c.add_droplet(b, (a + b + gap) * random.unit<D>());
  return c;
}

/// Six droplets along a winding line, each in contact with the next or bound to it at a distance.
template <int D>
Configuration<D> chain(Random& random) {
  Configuration<D> c;
  Vec<D> at = Vec<D>::Zero();
  for (int k = 0; k < 6; ++k) {
    const Real radius = random(0.7, 1.3);
    if (k > 0) {
      const Real last = c.topology.diameter[k - 1] / 2;
      Vec<D> step = random.unit<D>() * 0.6;
      step[0] += 2;
      at += (last + radius + (k % 2 == 0 ? random(-0.06, -0.02) : random(0.02, 0.08))) * step.normalized();
    }
    c.add_droplet(radius, at);
  }
  return c;
}

/// Where a droplet is at a solid. The last four are boundaries: touch and the end of the attraction, over a face or
/// over the tip, and the place where the tip becomes the nearest point of a wedge.
enum class At { face, far, tip, far_tip, touch, onset, tip_touch, tip_onset, tip_side };

/// A droplet at a wall at random, which is a half-space or a wedge.
template <int D>
Configuration<D> at_wall(Random& random, bool wedge, At where) {
  Configuration<D> c;
  const Vec<D> origin = 3 * random.unit<D>(), along = random.unit<D>();
  Vec<D> other = random.unit<D>();
  other = (other - other.dot(along) * along).normalized();
  const Real opening = random(0.5, 2.3), radius = random(0.7, 1.3);
  const Solid<D> solid =
      wedge ? Solid<D>::wedge(origin, along, Vec<D>(std::cos(opening) * along - std::sin(opening) * other))
            : Solid<D>::half_space(origin, other);
  const bool tip = where == At::tip || where == At::far_tip || where == At::tip_touch || where == At::tip_onset;
  Real h = radius - random(0.02, 0.15);
  if (where == At::far || where == At::far_tip) h = radius + random(0.02, 0.08);
  if (where == At::touch || where == At::tip_touch) h = radius;
  if (where == At::onset || where == At::tip_onset) h = radius + 2 * a_s;
  // Over the tip: between the normals of the faces.
  const Real angle = tip ? pi / 2 + random(0.2, 0.8) * (pi - opening) : pi / 2;
  const Real x = tip || where == At::tip_side ? 0 : random(0.2, 2);
  const Vec<D> centre = origin + solid.lift(Vec<2>(x + h * std::cos(angle), h * std::sin(angle)));
  c.walls = Walls<D>(std::vector{solid});
  c.add_droplet(radius, centre);
  return c;
}

template <int D>
void check_pairs() {
  const auto make = [](Real gap) { return [gap](Random& r) { return pair<D>(r, gap); }; };
  check_smooth<D>(*contact<D>(), make(-0.05), 1e-4, false, scale);
  check_smooth<D>(*depletion<D>(), make(-0.05), 1e-4, false, scale);
  check_smooth<D>(*depletion<D>(), make(0.05), 1e-4, false, scale);
  check_smooth<D>(*droplets<D>(Vec<D>::LinSpaced(-0.01, 0.02)), chain<D>, 1e-4, false, scale);
  check_boundary<D>(*contact<D>(), make(0), 1e-4, scale);
  check_boundary<D>(*droplets<D>(), make(0), 1e-4, scale);
  check_boundary<D>(*depletion<D>(), make(2 * a_s), 1e-4, scale);
}

template <int D>
void check_walls() {
  const auto repulsion = alone<D>(WallRepulsion<D>{{f0}});
  const auto attraction = alone<D>(WallDepletion<D>{{phi_c, a_s}});
  const auto both = droplets<D>();
  for (const bool wedge : {false, true}) {
    const auto make = [wedge](At where) { return [wedge, where](Random& r) { return at_wall<D>(r, wedge, where); }; };
    INFO("wedge " << wedge);
    check_smooth<D>(*repulsion, make(At::face), 1e-4, false, scale);
    check_smooth<D>(*attraction, make(At::face), 1e-4, false, scale);
    check_smooth<D>(*attraction, make(At::far), 1e-4, false, scale);
    check_smooth<D>(*both, make(At::face), 1e-4, false, scale);
    check_boundary<D>(*repulsion, make(At::touch), 1e-4, scale);
    check_boundary<D>(*attraction, make(At::onset), 1e-4, scale);
    check_boundary<D>(*both, make(At::touch), 1e-4, scale);
    if (!wedge) continue;
    check_smooth<D>(*repulsion, make(At::tip), 1e-4, false, scale);
    check_smooth<D>(*attraction, make(At::tip), 1e-4, false, scale);
    check_smooth<D>(*attraction, make(At::far_tip), 1e-4, false, scale);
    check_smooth<D>(*attraction, make(At::tip_side), 1e-4, false, scale);  // the volume is smooth at this border
    check_boundary<D>(*repulsion, make(At::tip_touch), 1e-4, scale);
    check_boundary<D>(*repulsion, make(At::tip_side), 1e-4, scale);
    check_boundary<D>(*attraction, make(At::tip_onset), 1e-4, scale);
  }
}

/// Root of a function that is negative at `low` and positive at `high`.
template <class F>
Real root(F&& f, Real low, Real high) {
  for (int k = 0; k < 80; ++k) (f((low + high) / 2) < 0 ? low : high) = (low + high) / 2;
  return (low + high) / 2;
}

/// Energy, attraction and stiffness of the last droplet along the first axis, when it is at x.
template <int D>
struct Along {
  Configuration<D> c;
  std::unique_ptr<ForceField<D>> field = droplets<D>();

  std::size_t place() const { return c.x.size() - D; }
  Real energy(Real x) { return field->energy(at(x)); }
  Real pull(Real x) {
    std::vector<Real> f(c.x.size());
    field->forces(at(x), f.data());
    return -f[place()];
  }
  Real stiffness(Real x) {
    DenseSink<D> sink(c.topology.points());
    field->hessian(at(x), sink);
    return sink.matrix(place(), place());
  }
  StateView<D> at(Real x) {
    c.x[place()] = x;
    return c.view();
  }
};

}  // namespace

TEST_CASE("derivatives of contact and depletion") {
  check_pairs<2>();
  check_pairs<3>();
}

TEST_CASE("derivatives of the forces of walls and tips") {
  check_walls<2>();
  check_walls<3>();
}

TEST_CASE("two droplets have the distance, stiffness and bond energy of the thesis") {
  Along<2> two;
  two.c.add_droplet(1, {0, 0});
  two.c.add_droplet(1, {2, 0});
  const Real d = root([&](Real r) { return two.pull(r); }, 1.9, 2.05);
  CHECK(d == Approx(1.993).margin(5e-4));                 // [T 2.16]
  CHECK(two.stiffness(d) == Approx(4.69).margin(0.01));   // [T 2.18]
  CHECK(-two.energy(d) == Approx(0.00173).margin(5e-6));  // [T 2.23]
  CHECK(two.energy(2.1) == 0);
}

TEST_CASE("a droplet at a wall has the stiffness and bond energy of the thesis") {
  Along<2> one;
  one.c.walls = Walls<2>(std::vector{Solid<2>::half_space({0, 5}, {1, 0})});
  one.c.add_droplet(1, {1, 0});
  const Real h = root([&](Real x) { return one.pull(x); }, 0.95, 1.05);
  CHECK(one.stiffness(h) == Approx(9.541).margin(5e-4));  // [T 2.24] prints 9.57, of a linear wall
  CHECK(-one.energy(h) == Approx(0.00340).margin(5e-6));  // [T 2.25]
  // [T 2.7, 2.8] as printed.
  for (const Real x : {0.93, 0.99, 1.04}) {
    const Real repulsion = x < 1 ? f0 * (1 / x - 1) : 0;
    const Real attraction = pi * phi_c / (8 * a_s * a_s * a_s) * (1 + 2 * a_s - x) * (1 + x);
    CHECK(one.pull(x) == Approx(attraction - repulsion).epsilon(1e-12));
  }
}

TEST_CASE("droplets weigh ρ g R³") {
  Configuration<3> c;
  c.add_droplet(0.8, {0, 0, 0});
  std::vector<Real> f(3);
  droplets<3>({0, 0, -0.3})->forces(c.view(), f.data());
  CHECK(f == std::vector<Real>{0, 0, -0.3 * (0.8 * square(0.8))});
}

TEST_CASE("internal forces sum to zero, and walls feel the opposite of what they do") {
  Random random(3);
  for (int k = 0; k < 10; ++k) {
    Random same = random;
    Configuration<2> free = chain<2>(random), c = chain<2>(same);
    std::vector<Real> f(c.x.size());
    const auto field = droplets<2>();
    const auto sum = [&](Configuration<2>& of) {
      Vec<2> total(0, 0);
      field->forces(of.view(), f.data());
      for (Index i = 0; i < 6; ++i) total += point<2>(f.data(), i);
      return total;
    };
    CHECK(sum(free).norm() < 1e-14);
    REQUIRE(Eigen::Map<const VectorXd>(f.data(), f.size()).norm() > 0.1);
    const Vec<2> normal = random.unit<2>();
    Real least = 1e9;
    for (Index i = 0; i < 6; ++i) least = std::min(least, normal.dot(c.position(i)) - c.topology.diameter[i] / 2);
    const Vec<2> tip = c.position(5) + 1.05 * c.topology.diameter[5] / 2 * Vec<2>(1, 0);
    c.walls = Walls<2>(
        std::vector{Solid<2>::half_space((least + 0.02) * normal, normal), Solid<2>::wedge(tip, {1, 0.5}, {1, -0.5})});
    std::vector<Real> on_walls(4);
    field->add_wall_forces(c.view(), on_walls.data());
    CHECK(point<2>(on_walls.data(), 0).norm() > 0.01);
    CHECK(point<2>(on_walls.data(), 1).norm() > 1e-4);
    CHECK((sum(c) + point<2>(on_walls.data(), 0) + point<2>(on_walls.data(), 1)).norm() < 1e-14);
  }
}

TEST_CASE("bonds carry contact and depletion together") {
  Random random(4);
  for (const Real gap : {-0.03, -0.004, 0.05}) {
    Configuration<3> c = pair<3>(random, gap);
    std::vector<Real> f(6);
    const auto field = droplets<3>();
    field->forces(c.view(), f.data());
    int bonds = 0;
    field->for_each_contact(c.view(), [&](const Contact<3>& bond) {
      ++bonds;
      CHECK((bond.force - point<3>(f.data(), bond.first)).norm() < 1e-15);
      CHECK(bond.force.dot(bond.normal) * (gap < -0.01 ? 1 : -1) > 0);  // pressed, or under tension
      CHECK(bond.overlap * bond.reach == Approx(-gap));
      CHECK((bond.position - c.position(bond.second)).norm() ==
            Approx((1 - bond.overlap) * c.topology.diameter[bond.second] / 2));
    });
    CHECK(bonds == 1);
  }
  Configuration<3> apart = pair<3>(random, 2 * a_s + 1e-9);
  droplets<3>()->for_each_contact(apart.view(), [&](const Contact<3>&) { FAIL("out of range"); });
}

TEST_CASE("droplets within each other or within walls are errors that name them") {
  Configuration<2> c;
  c.topology.dim = 2;
  for (const Real x : {0.0, 10.0, 20.0}) c.add_droplet(1, {x, 0});
  c.add_droplet(0.7, {15, 0});
  c.topology.id = {7, 8, 9, 4};
  c.walls = Walls<2>(std::vector{Solid<2>::half_space({-3, 0}, {1, 0}), Solid<2>::wedge({0, -3}, {1, -1}, {-1, -1})});
  const auto field = droplets<2>();
  std::vector<Real> f(8);
  const auto put = [&](Index i, const Vec<2>& r) { point<2>(c.x.data(), i) = r; };
  CHECK_NOTHROW(field->forces(c.view(), f.data()));
  const auto refused = [&](const std::string& what) {
    CHECK_THROWS_WITH(field->forces(c.view(), f.data()), Catch::Contains(what));
    CHECK_THROWS_AS(field->energy(c.view()), NumericalError);
  };
  SECTION("one on top of the other") {
    put(2, c.position(1));
    refused("droplets 8 and 9 have run into each other");
  }
  SECTION("a small one in a large one") {
    put(3, c.position(1) + Vec<2>(0.29, 0));
    refused("droplets 8 and 4");
    put(3, c.position(1) + Vec<2>(0.31, 0));
    CHECK_NOTHROW(field->forces(c.view(), f.data()));
  }
  SECTION("on and behind a wall") {
    put(0, {-3, 1});
    refused("droplet 7 has run into wall 0");
    put(0, {-4, 1});
    refused("droplet 7 has run into wall 0");
  }
  SECTION("on the tip, and within its layer") {
    put(1, {0, -3});
    refused("droplet 8 has run into wall 1");
    put(1, {0, -2.96});
    refused("droplet 8 has run into wall 1");
    put(1, {0, -2.94});
    CHECK_NOTHROW(field->forces(c.view(), f.data()));
    CHECK(std::isfinite(f[3]));
  }
}

TEST_CASE("a depletant without a size is refused") {
  CHECK_THROWS_AS(make_force_field<2>(ModelKind::bubble, {.a_s = 0}, Vec<2>::Zero()), InputError);
}

TEST_CASE("droplets meet segments where there is no attraction") {
  const auto repulsion = alone<2>(WallRepulsion<2>{{f0}});
  const auto seen = [&](const Walls<2>& walls, const Vec<2>& at) {
    Configuration<2> c;
    c.walls = walls;
    c.add_droplet(1, at);
    VectorXd f(3);
    f[2] = repulsion->energy(c.view(), f.data());
    return f;
  };
  WallParts pieces;
  for (Index k = 0; k < 100; ++k) {
    const Vec<2> from(0.1 * k - 5, 0);
    if (k > 0) pieces.joints.push_back({from, k, k - 1, true});
    pieces.segments.push_back(WallSegment::between(from, from + Vec<2>(0.1, 0)));
  }
  const Walls<2> one({WallSegment::between({-5, 0}, {5, 0})}), many(pieces),
      solid(std::vector{Solid<2>::half_space({0, 0}, {0, 1})});
  for (const Vec<2>& at : {Vec<2>(0.03, 0.8), Vec<2>(5.2, 0.6), Vec<2>(1, 0.95)}) {
    CAPTURE(at[0]);
    CHECK(seen(one, at)[2] > 0);
    CHECK((seen(one, at) - seen(many, at)).norm() < 1e-9);
    if (at[0] < 5) CHECK(seen(one, at) == seen(solid, at));
  }
  CHECK(seen(one, {0, -0.8})[1] == -seen(one, {0, 0.8})[1]);
  CHECK_NOTHROW(droplets<2>()->check_walls(solid));
  CHECK_THROWS_WITH(droplets<2>()->check_walls(one), Catch::Contains("wall 0 is a segment"));
  CHECK_NOTHROW(make_force_field<2>(ModelKind::bubble, {.phi_c = 0}, Vec<2>::Zero())->check_walls(one));
}

TEST_CASE("no pair or wall within the attraction's range is ever missing from the lists") {
  Random random(6);
  const NeighbourNeeds needs = needs_of<2>(ModelKind::bubble);
  CHECK(needs.beyond_contact == 2 * a_s);
  Configuration<2> c;
  for (int k = 0; k < 80; ++k) c.add_droplet(random(0.3, 1.2), {random(-8, 8), random(-8, 8)});
  c.walls.add(Solid<2>::half_space({-8, 0}, {1, 0.2}), {.velocity = {1, 0}});
  c.walls.add(Solid<2>::wedge({0, -9}, {1, -1}, {-1, -1}));
  std::vector<Vec<2>> drift;  // towards each other, as far as the lists allow before they are rebuilt
  for (int k = 0; k < 80; ++k) drift.push_back(0.008 * random.unit<2>());
  Neighbours<2> lists(needs, 0.2);
  int in_range = 0, beyond_contact = 0, at_walls = 0, missing = 0;
  Real t = 0;
  for (int step = 0; step < 300; ++step) {
    t += 0.004;  // so that now the wall, now a droplet moves far enough for a rebuild
    for (Index i = 0; i < 80; ++i) point<2>(c.x.data(), i) += drift[i] + random(0, 0.002) * random.unit<2>();
    lists.ensure(c.topology, c.walls, c.x.data(), t);
    std::set<Pair> listed(lists.point_pairs.begin(), lists.point_pairs.end());
    std::set<Pair> listed_walls(lists.walls.begin(), lists.walls.end());
    for (Index i = 0; i < 80; ++i) {
      const Real radius = c.topology.diameter[i] / 2;
      for (Index j = 0; j < i; ++j) {
        const Real gap = (c.position(i) - c.position(j)).norm() - radius - c.topology.diameter[j] / 2;
        if (gap >= 2 * a_s) continue;
        ++in_range;
        beyond_contact += gap > 0;
        missing += !listed.contains({i, j}) && !listed.contains({j, i});
      }
      for (Index k = 0; k < 2; ++k) {
        if (c.walls.distance(c.position(i), k, t) >= radius + 2 * a_s) continue;
        ++at_walls;
        missing += !listed_walls.contains({i, k});
      }
    }
  }
  CHECK(missing == 0);
  CHECK(in_range > 1000);
  CHECK(beyond_contact > 500);
  CHECK(at_walls > 500);
  CHECK(lists.rebuilds() > 5);
  CHECK(lists.rebuilds() < 150);
}

}  // namespace pliant::test::droplets_test
