// A reinserted particle lies on top of the other particles, touches one of them, and keeps its shape.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/base/rng.h>
#include <pliant/geometry/simplex_distance.h>
#include <pliant/model/polygon.h>
#include <pliant/model/surface_parts.h>
#include <pliant/setup/packing.h>
#include <pliant/setup/particles.h>
#include <pliant/setup/reinsertion.h>

#include "support/random.h"

namespace pliant::test::reinsertion_test {
namespace {

/// Distance of two closed segments that do not cross.
Real segment_distance(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, const Vec<2>& d) {
  const auto from = [](const Vec<2>& p, const Vec<2>& q, const Vec<2>& r) {
    const Real t = std::clamp((p - q).dot(r - q) / (r - q).squaredNorm(), 0.0, 1.0);
    return (p - (q + t * (r - q))).norm();
  };
  return std::min({from(a, c, d), from(b, c, d), from(c, a, b), from(d, a, b)});
}

/// A packed hopper at random velocities, of which one particle has fallen out.
template <int D>
struct Flow {
  ModelKind kind;
  Topology topology;
  Hopper hopper;
  Walls<D> walls;
  State state;
  Index fallen;
  std::vector<Vec<D>> shape;  ///< the fallen one's points about their mean

  Flow(ModelKind k, Index n, const Hopper& h, Real distortion = 0, Index who = 5)
      : kind(k),
        topology(make_particles(k, D, draw_diameters({}, n, 2), {.vertices = D == 3 ? 42 : 16})),
        hopper(h),
        walls(h.walls<D>()),
        state(topology.points(), D),
        fallen(who) {
    pack<D>(topology, hopper, {.fraction = D == 2 ? 0.8 : 0.55, .seed = 2}, state.x().data());
    test::Random random(3);
    for (Real& v : state.v()) v = random(-1, 1);
    for (Real& x : state.x()) x += distortion * random(-1, 1);
    const Vec<D> shift = -centre(fallen) - Vec<D>::Unit(D - 1) * 2.5;
    for (Index i = topology.offset[fallen]; i < topology.offset[fallen + 1]; ++i) at(i) += shift;
    shape = points();
  }

  auto at(Index i) { return point<D>(state.x().data(), i); }
  Vec<D> at(Index i) const { return point<D>(state.x().data(), i); }
  Vec<D> centre(Index m) const { return mean_of_points<D>(state.x().data(), topology, m); }

  std::vector<Vec<D>> points() const {
    std::vector<Vec<D>> r;
    for (Index i = topology.offset[fallen]; i < topology.offset[fallen + 1]; ++i) r.push_back(at(i) - centre(fallen));
    return r;
  }

  void reinsert_one(std::uint64_t count = 0, std::uint64_t seed = 1, const Reinsertion& rule = {}) {
    reinsert<D>(Ranks(), topology, hopper, walls, kind == ModelKind::smooth, seed,
                {topology.id[fallen], 0, fallen, static_cast<std::int64_t>(count)}, state, rule);
  }

  /// Distance of the rims of the fallen particle and n, by brute force.
  Real gap(Index n) const {
    Real least = 1e9;
    for (Index i = topology.offset[fallen]; i < topology.offset[fallen + 1]; ++i)
      for (Index j = topology.offset[n]; j < topology.offset[n + 1]; ++j) {
        if constexpr (D == 2) {
          if (kind == ModelKind::smooth) {
            least = std::min(least, segment_distance(at(i), at(topology.next[i]), at(j), at(topology.next[j])));
            continue;
          }
        }
        least = std::min(least, (at(i) - at(j)).norm());
      }
    if constexpr (D == 3)
      if (kind == ModelKind::smooth) least = std::sqrt(std::min({least * least, parts(fallen, n), parts(n, fallen)}));
    return least - (topology.diameter[topology.offset[fallen]] + topology.diameter[topology.offset[n]]) / 2;
  }

  /// Least squared distance of the vertices of m and the faces of n, and of their edges.
  Real parts(Index m, Index n) const requires(D == 3) {
    const Surface &first = topology.surfaces->of(topology, m), &second = topology.surfaces->of(topology, n);
    Real least = 1e9;
    for (std::size_t f = 0; f < second.faces.size(); ++f) {
      const auto [a, b, c] = points_of_face(topology, first_face(topology, n) + static_cast<Index>(f));
      for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) {
        const FourPoints r{at(i), at(a), at(b), at(c)};
        least = std::min(least, VertexOnFace(r).d2());
      }
    }
    for (std::size_t k = 0; k < first.hinges.size(); ++k)
      for (std::size_t l = 0; l < second.hinges.size(); ++l) {
        const auto [a, b] = points_of_edge(topology, first_edge(topology, m) + static_cast<Index>(k));
        const auto [c, d] = points_of_edge(topology, first_edge(topology, n) + static_cast<Index>(l));
        const FourPoints r{at(a), at(b), at(c), at(d)};
        least = std::min(least, EdgeOnEdge(r).d2());
      }
    return least;
  }

  void check() const {
    Index touched = -1, touching = 0;
    for (Index n = 0; n < topology.particles(); ++n) {
      if (n == fallen) continue;
      const Real g = gap(n);
      CHECK(g > -1e-12);
      if (g < 1e-5) {
        ++touching;
        touched = n;
      }
    }
    REQUIRE(touching == 1);
    const Vec<D> velocity = mean_of_points<D>(state.v().data(), topology, touched);
    for (Index i = topology.offset[fallen]; i < topology.offset[fallen + 1]; ++i) {
      CHECK((point<D>(state.v().data(), i) - velocity).norm() < 1e-14);
      const Vec<D> r = at(i);
      CHECK((D == 2 ? std::abs(r[0]) : std::hypot(r[0], r[1])) < hopper.half_width(r[D - 1]));
      for (Index s = 0; s < walls.size(); ++s) CHECK(walls.distance(r, s, 0) > topology.diameter[i] / 2 * (1 - 1e-8));
    }
    const auto now = points();
    Real change = 0;
    for (std::size_t k = 0; k < now.size(); ++k) change = std::max(change, (now[k] - shape[k]).norm());
    CHECK(change < 1e-13);
    // Above the one it touches, and free to be lowered no further.
    CHECK(centre(fallen)[D - 1] > centre(touched)[D - 1]);
  }
};

constexpr Hopper flat{.wall_distance = 8, .orifice = 3, .angle = 90};
constexpr Hopper sloped{.wall_distance = 12, .orifice = 3, .angle = 30};

template <int D>
void check_many(Flow<D> flow) {
  std::vector<Real> lateral;
  for (std::uint64_t count = 0; count < 20; ++count) {
    CAPTURE(count);
    Flow<D> trial = flow;
    trial.reinsert_one(count);
    trial.check();
    lateral.push_back(trial.centre(trial.fallen)[0]);
  }
  // Anywhere across the hopper.
  const auto [least, most] = std::minmax_element(lateral.begin(), lateral.end());
  CHECK(*most - *least > 0.4 * flow.hopper.wall_distance);
}

}  // namespace

TEST_CASE("a soft particle is reinserted onto a bulk particle", "[reinsertion]") {
  const Hopper hopper = GENERATE(flat, sloped);
  CAPTURE(hopper.angle);
  check_many(Flow<2>(ModelKind::sp, 40, hopper));
}

TEST_CASE("a smooth surface is reinserted onto the faces, edges and vertices of a bulk particle", "[reinsertion]") {
  const Flow<3> flow(ModelKind::smooth, 30, Hopper{.wall_distance = 5, .orifice = 2, .angle = 90}, 0.02);
  for (std::uint64_t count = 0; count < 5; ++count) {
    CAPTURE(count);
    Flow<3> trial = flow;
    trial.reinsert_one(count);
    trial.check();
  }
}

TEST_CASE("a sphere is reinserted onto a bulk particle", "[reinsertion]") {
  check_many(Flow<3>(ModelKind::sp, 60, {.wall_distance = 5, .orifice = 2, .angle = 90}));
}

TEST_CASE("a polygon is reinserted as it is shaped", "[reinsertion]") {
  const ModelKind kind = GENERATE(ModelKind::rough, ModelKind::smooth);
  const Real distortion = GENERATE(0.0, 0.04);
  const Hopper hopper = GENERATE(flat, sloped);
  CAPTURE(to_string(kind), distortion, hopper.angle);
  check_many(Flow<2>(kind, 40, hopper, distortion));
}

TEST_CASE("a small hopper filled over its slope only takes particles back", "[reinsertion]") {
  // The filling ends below the upright walls: places above the sloped walls are refused, other places are found.
  Flow<2> flow(ModelKind::sp, 20, {.wall_distance = 12, .orifice = 3, .angle = 30});
  Real top = 0;
  for (Index m = 0; m < 20; ++m) top = std::max(top, flow.centre(m)[1]);
  REQUIRE(top < flow.hopper.slope_height());
  flow.reinsert_one();
  flow.check();
}

TEST_CASE("where a particle is reinserted depends on seed, particle and count only", "[reinsertion]") {
  const Flow<2> start(ModelKind::rough, 30, flat);
  const auto positions = [&](std::uint64_t count, std::uint64_t seed) {
    Flow<2> flow = start;
    flow.reinsert_one(count, seed);
    return std::vector<Real>(flow.state.x().begin(), flow.state.x().end());
  };
  const auto reference = positions(3, 8);
  CHECK(positions(3, 8) == reference);
  CHECK(positions(4, 8) != reference);
  CHECK(positions(3, 9) != reference);

  // Nothing else moves.
  const Topology& topology = start.topology;
  for (Index i = 0; i < topology.points(); ++i) {
    if (topology.particle[i] == start.fallen) continue;
    CHECK(point<2>(reference.data(), i) == start.at(i));
  }
}

TEMPLATE_TEST_CASE_SIG("a gap raises what is reinserted, with a lateral velocity of its own", "[reinsertion]",
                       ((int D), D), 2, 3) {
  const ModelKind kind = D == 2 ? GENERATE(ModelKind::sp, ModelKind::rough) : ModelKind::sp;
  const Flow<D> start(kind, 40, {.wall_distance = 6, .orifice = 2, .angle = 90});
  Real most = 0;
  std::array<Real, 2> mean{};
  for (std::uint64_t count = 0; count < 40; ++count) {
    CAPTURE(count);
    Flow<D> touching = start, raised = start;
    touching.reinsert_one(count);
    raised.reinsert_one(count, 1, {.gap = 0.8, .lateral_speed = 0.05});
    const Index first = start.topology.offset[start.fallen], last = start.topology.offset[start.fallen + 1];
    const Vec<D> before = point<D>(touching.state.v().data(), first), after = point<D>(raised.state.v().data(), first);
    for (Index i = first; i < last; ++i) {
      CHECK((raised.at(i) - touching.at(i) - 0.8 * Vec<D>::Unit(D - 1)).norm() < 1e-13);
      CHECK(point<D>(raised.state.v().data(), i) == after);
    }
    CHECK(after[D - 1] == before[D - 1]);
    for (int k = 0; k < D - 1; ++k) {
      CHECK(std::abs(after[k]) <= 0.05);
      most = std::max(most, std::abs(after[k]));
      mean[k] += after[k] / 40;
    }
    CHECK(std::abs(before[0]) > 0);
  }
  CHECK(most > 0.045);
  for (const Real m : mean) CHECK(std::abs(m) < 0.02);  // 0.029/√40 is one standard deviation
  if constexpr (D == 3) CHECK(mean[0] != mean[1]);
}

TEST_CASE("particles with large ids have random numbers of their own", "[reinsertion]") {
  const Flow<2> start(ModelKind::sp, 30, flat);
  const auto lateral = [&](Index id) {
    Flow<2> flow = start;
    flow.topology.id[flow.fallen] = id;
    flow.reinsert_one(3, 8);
    return flow.centre(flow.fallen)[0];
  };
  // As it has always been below 2^24: stream 5, two numbers for each of 64 attempts.
  const Real range = flat.wall_distance / 2 - start.topology.diameter[start.fallen] / 2;
  for (const Index id : {5, 12345, (1 << 24) - 1})
    CHECK(lateral(id) == Approx(range * (2 * rng::uniform(8, 5, (std::uint64_t(id) << 40) + 2 * 64 * 3) - 1)));
  std::vector<Real> places;
  for (const Index high : {0, 1, 2, 64, 127})
    for (const Index low : {0, 1, 5}) places.push_back(lateral((high << 24) + low));
  std::sort(places.begin(), places.end());
  CHECK(std::adjacent_find(places.begin(), places.end()) == places.end());
}

TEST_CASE("particles that are out of the run or below the orifice are no place to be put on", "[reinsertion]") {
  Flow<2> flow(ModelKind::sp, 30, flat);
  Index highest = 0;
  for (Index m = 1; m < 30; ++m)
    if (m != flow.fallen && flow.centre(m)[1] > flow.centre(highest)[1]) highest = m;
  const Real height = flow.centre(highest)[1];
  for (Index m = 0; m < 30; ++m) {
    if (m == highest || m == flow.fallen) continue;
    if (m % 2 == 0)
      flow.topology.deactivate(m);
    else
      flow.at(m)[1] = -0.1;
  }
  flow.reinsert_one();
  CHECK(flow.gap(highest) == Approx(0).margin(1e-12));
  CHECK(flow.centre(flow.fallen)[1] > height);

  flow.at(highest)[1] = -0.1;
  CHECK_THROWS_AS(flow.reinsert_one(), NumericalError);
  CHECK_THROWS_WITH(flow.reinsert_one(),
                    Catch::Contains("particle 5") && Catch::Contains("0 particles are above the orifice"));
}

TEST_CASE("what is reinserted keeps clear of walls", "[reinsertion]") {
  const Flow<2> start(ModelKind::sp, 40, {.wall_distance = 6, .orifice = 2, .angle = 90});
  const auto nearest = [&](const Reinsertion& rule) {
    Real least = 1e9;
    for (std::uint64_t count = 0; count < 60; ++count) {
      Flow<2> flow = start;
      flow.reinsert_one(count, 1, rule);
      least = std::min(least, 3 - std::abs(flow.centre(flow.fallen)[0]) - flow.topology.sigma[flow.fallen] / 2);
    }
    return least;
  };
  CHECK(nearest({}) < 0.2);
  CHECK(nearest({.clearance = 0.25}) >= 0.25);
}

}  // namespace pliant::test::reinsertion_test
