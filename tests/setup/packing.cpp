// The start of a run: dense, without overlaps, inside the hopper.
#include <catch2/catch.hpp>

#include <cmath>
#include <numeric>

#include <pliant/base/errors.h>
#include <pliant/model/polygon.h>
#include <pliant/setup/packing.h>
#include <pliant/setup/particles.h>

namespace pliant::test::packing_test {
namespace {

template <int D>
struct Packed {
  Topology topology;
  Hopper hopper;
  Packing packing;
  std::vector<Real> x;

  Packed(ModelKind kind, Index n, const Hopper& h, const PackingParameters& p = {})
      : topology(make_particles(kind, D, draw_diameters({}, n, p.seed), {})), hopper(h) {
    x.resize(static_cast<std::size_t>(topology.points()) * D);
    packing = pack<D>(topology, hopper, p, x.data());
  }

  Vec<D> centre(Index m) const { return mean_of_points<D>(x.data(), topology, m); }

  /// Largest 1 − distance/contact distance of two outer disks.
  Real largest_overlap() const {
    Real largest = 0;
    for (Index m = 0; m < topology.particles(); ++m)
      for (Index n = 0; n < m; ++n)
        largest = std::max(
            largest, 1 - (centre(m) - centre(n)).norm() / (outer_radius(topology, m) + outer_radius(topology, n)));
    return largest;
  }

  /// Smallest distance of an outer disk's centre to a wall, floor or lid, over its radius; negative outside.
  Real least_wall_gap() const {
    Real least = 1e9;
    const Walls<D> walls = Container(hopper).closed<D>(packing.height);
    for (Index m = 0; m < topology.particles(); ++m) {
      const Vec<D> r = centre(m);
      const Real lateral = D == 2 ? std::abs(r[0]) : std::hypot(r[0], r[1]);
      const bool inside = r[D - 1] > 0 && r[D - 1] < packing.height && lateral < hopper.half_width(r[D - 1]);
      for (Index s = 0; s < walls.size(); ++s)
        least = std::min(least, (inside ? 1 : -1) * walls.distance(r, s, 0) / outer_radius(topology, m));
    }
    return least;
  }

  /// The distance to the walls only, without their radius, not divided by it.
  Real least_wall_distance() const {
    Real least = 1e9;
    const Walls<D> walls = Container(hopper).closed<D>(packing.height);
    for (Index m = 0; m < topology.particles(); ++m)
      for (Index s = 0; s < walls.size(); ++s)
        least = std::min(least, walls.distance(centre(m), s, 0) - outer_radius(topology, m));
    return least;
  }

  /// Area (volume) that the outer disks (spheres) cover, over the area (volume) of the hopper below the lid, by
  /// quadrature.
  Real filled() const {
    Real content = 0, room = 0;
    for (Index m = 0; m < topology.particles(); ++m)
      content += D == 2 ? pi * square(outer_radius(topology, m)) : 4 * pi / 3 * std::pow(outer_radius(topology, m), 3);
    const int slices = 200000;
    for (int k = 0; k < slices; ++k) {
      const Real half = hopper.half_width((k + 0.5) / slices * packing.height);
      room += (D == 2 ? 2 * half : pi * square(half)) * packing.height / slices;
    }
    return content / room;
  }
};

// FIRE's tolerance, and rounding.
const Real limit = PackingParameters().tolerance * (1 + 1e-6);

template <int D>
void check(const Packed<D>& packed) {
  CHECK(packed.largest_overlap() < limit);
  CHECK(std::max(packed.largest_overlap(), 1 - packed.least_wall_gap()) ==
        Approx(packed.packing.max_overlap).margin(1e-9));
  CHECK(packed.least_wall_gap() > 1 - limit);
  CHECK(packed.filled() == Approx(packed.packing.fraction).epsilon(1e-4));
}

}  // namespace

TEST_CASE("a packing has no overlaps and stays in the hopper", "[packing]") {
  const Real angle = GENERATE(90.0, 45.0, 10.0);
  CAPTURE(angle);
  check<2>(Packed<2>(ModelKind::sp, 60, {.wall_distance = 8, .orifice = 3, .angle = angle}));
}

TEST_CASE("a packing in a cylinder has no overlaps", "[packing]") {
  const Real angle = GENERATE(90.0, 45.0);
  CAPTURE(angle);
  check<3>(Packed<3>(ModelKind::sp, 80, {.wall_distance = 5, .orifice = 2, .angle = angle}, {.fraction = 0.6}));
}

TEST_CASE("polygons are packed by the disks around them", "[packing]") {
  const ModelKind kind = GENERATE(ModelKind::rough, ModelKind::smooth);
  const Packed<2> packed(kind, 30, {.wall_distance = 7, .orifice = 2, .angle = 60});
  check<2>(packed);
  const Topology& topology = packed.topology;
  for (Index m = 0; m < topology.particles(); ++m)
    CHECK(polygon_area(packed.x.data(), topology, m) == Approx(topology.a0[m]).epsilon(1e-12));
  // Turned at random: first vertices point in all directions.
  Vec<2> sum(0, 0);
  for (Index m = 0; m < topology.particles(); ++m)
    sum += (point<2>(packed.x.data(), topology.offset[m]) - packed.centre(m)).normalized();
  CHECK(sum.norm() < 0.5 * topology.particles());
}

TEST_CASE("a packing is a function of the seed", "[packing]") {
  const ModelKind kind = GENERATE(ModelKind::sp, ModelKind::rough);
  const Topology topology = make_particles(kind, 2, draw_diameters({}, 20, 1), {});
  const auto positions = [&](std::uint64_t seed) {
    std::vector<Real> x(2 * topology.points());
    pack<2>(topology, Hopper{.wall_distance = 6, .orifice = 2}, {.seed = seed}, x.data());
    return x;
  };
  CHECK(positions(4) == positions(4));
  CHECK(positions(4) != positions(5));
}

TEST_CASE("many disks start evenly, and are packed quickly", "[packing]") {
  const Topology topology = make_particles(ModelKind::sp, 2, draw_diameters({}, 100000, 1), {});
  std::vector<Real> x(2 * topology.points());
  const PackingParameters parameters;
  const Packing packing = pack<2>(topology, Hopper{.wall_distance = 3125, .orifice = 5}, parameters, x.data());
  CHECK(packing.max_overlap <= parameters.tolerance);
  CHECK(packing.fraction > 0.8);
  CHECK(packing.iterations < 500);  // from random places more than 2000
}

TEST_CASE("disks beyond walls get other places at the same fraction", "[packing]") {
  const Topology topology = make_particles(ModelKind::sp, 2, draw_diameters({}, 100000, 1), {});
  std::vector<Real> x(2 * topology.points());
  const Hopper hopper{.wall_distance = 3125, .orifice = 5};
  CHECK(pack<2>(topology, hopper, {.fraction = 0.8}, x.data()).fraction == 0.8);
}

TEST_CASE("particles that jam do not use all iterations", "[packing]") {
  const std::uint64_t seed = GENERATE(1, 2, 3, 4);
  const Packed<2> packed(ModelKind::sp, 400, {.wall_distance = 50, .orifice = 5}, {.seed = seed});
  check<2>(packed);
  CHECK(packed.packing.iterations < 1600);  // two rounds at fractions at which the disks jam: 600 iterations
  CHECK(packed.packing.fraction > 0.77);
}

TEST_CASE("a loose packing keeps the fraction that was asked for", "[packing]") {
  const Packed<2> packed(ModelKind::sp, 50, {.wall_distance = 8, .orifice = 3}, {.fraction = 0.4});
  CHECK(packed.packing.fraction == 0.4);
  check<2>(packed);
}

TEST_CASE("the lid is higher than the particles, however few they are", "[packing]") {
  const Index n = GENERATE(1, 2, 3);
  const Packed<2> packed(ModelKind::sp, n, {.wall_distance = 6, .orifice = 2});
  CHECK(packed.packing.height > *std::max_element(packed.topology.sigma.begin(), packed.topology.sigma.end()));
  check<2>(packed);
}

TEST_CASE("a particle wider than the hopper is refused", "[packing]") {
  CHECK_THROWS_AS(Packed<2>(ModelKind::sp, 6, {.wall_distance = 1.1, .orifice = 0.5}), InputError);
  CHECK_THROWS_WITH(Packed<2>(ModelKind::sp, 6, {.wall_distance = 1.1, .orifice = 0.5}),
                    Catch::Contains("1.17") && Catch::Contains("1.1") && Catch::Contains("use a wider container"));
  // Wide enough for its largest particle, it takes them one above the other.
  check<2>(Packed<2>(ModelKind::sp, 6, {.wall_distance = 1.25, .orifice = 0.5}));
}

TEST_CASE("a packing keeps clear of walls", "[packing]") {
  const Packed<2> close(ModelKind::rough, 40, {.wall_distance = 8, .orifice = 3, .angle = 45});
  const Packed<2> clear(ModelKind::rough, 40, {.wall_distance = 8, .orifice = 3, .angle = 45}, {.clearance = 0.1});
  const Packed<3> space(ModelKind::sp, 60, {.wall_distance = 5, .orifice = 2, .angle = 90},
                        {.fraction = 0.55, .clearance = 0.1});
  CHECK(close.least_wall_distance() < 0.001);
  for (const Real gap : {clear.least_wall_distance(), space.least_wall_distance()}) {
    CHECK(gap > 0.1 - 0.001);
    CHECK(gap < 0.1 + 0.01);
  }
}

TEMPLATE_TEST_CASE_SIG("a packing in a periodic box", "", ((int D), D), 2, 3) {
  const Topology topology = make_particles(ModelKind::sp, D, draw_diameters({}, 60, 1), {});
  const auto volume = [&](Real fraction) {
    return Vec<D>(Vec<D>::Constant(
        std::pow(std::accumulate(topology.a0.begin(), topology.a0.end(), Real(0)) / fraction, Real(1) / D)));
  };
  const Box<D> box(Vec<D>::Constant(3), volume(D == 2 ? 0.78 : 0.56));
  std::vector<Real> x(static_cast<std::size_t>(topology.points()) * D);
  const Packing packing = pack<D>(topology, box, {}, x.data());
  CHECK(packing.fraction == Approx(D == 2 ? 0.78 : 0.56));
  CHECK(packing.max_overlap <= 1e-4);
  Real largest = 0;
  for (Index m = 0; m < topology.particles(); ++m)
    for (Index n = 0; n < m; ++n) {
      Vec<D> d = point<D>(x.data(), m) - point<D>(x.data(), n);
      for (int k = 0; k < D; ++k) d[k] -= box.length()[k] * std::round(d[k] / box.length()[k]);
      largest = std::max(largest, 1 - 2 * d.norm() / (topology.diameter[m] + topology.diameter[n]));
    }
  CHECK(largest <= 1.0001e-4);
  CHECK(largest > 0);
  const Box<D> small(Vec<D>::Zero(), volume(0.97));
  CHECK_THROWS_AS(pack<D>(topology, small, {}, x.data()), NumericalError);
  Vec<D> open = box.length();
  open[D - 1] = Box<D>::infinite;
  CHECK_THROWS_AS(pack<D>(topology, Box<D>(Vec<D>::Zero(), open), {}, x.data()), InputError);
  CHECK_THROWS_AS(pack<D>(topology, Box<D>(Vec<D>::Zero(), Vec<D>::Constant(0.9)), {}, x.data()), InputError);
}

}  // namespace pliant::test::packing_test
