// Contact of points with walls, against the element form.
#include <pliant/kernels/wall_forces.h>

#include <algorithm>
#include <catch2/catch.hpp>

#include <pliant/model/wall_contact.h>

#include "support/random.h"

namespace pliant::test::wall_forces_test {

namespace {

/// Points among walls, all of them listed with all walls.
template <int D>
struct Room {
  Topology topology;
  std::vector<Real> x;
  Walls<D> walls;
  std::vector<Pair> pairs;

  Room(Random& random, bool plain) {
    WallParts parts{{WallSegment::between({0.5, 0.3}, {1.7, 1.1}), WallSegment::ray({0.5, 0.3}, {0, -1}),
                     WallSegment::ray({1.7, 1.1}, {0, 1}), WallSegment::between({0, 2}, {1.7, 2})}};
    if (!plain) {
      parts.joints = {{{0.5, 0.3}, 0, 1, true}, {{1.7, 1.1}, 2, 0, true}};
      parts.segments.push_back(WallSegment::disk({-1, -1}, 0.3));
      parts.segments.push_back(WallSegment::disk({0, -1}, 0.4));
    }
    walls = Walls<D>(parts);
    REQUIRE(walls.plain() == plain);
    topology.dim = D;
    for (int k = 0; k < 40; ++k) {
      Vec<D> r;
      for (int d = 0; d < D; ++d) r[d] = random(-2, 2.5);
      add(r, random);
    }
    // On an end of a wall, in the middle of one, and on the axis, away from walls and on one.
    // And near the axis, where a ring is touched.
    for (const Vec<2>& p : {Vec<2>(0.5, 0.3), Vec<2>(1.25, 2), Vec<2>(0, 1.8), Vec<2>(0, 2), Vec<2>(0, 0.4),
                            Vec<2>(0.02, 0.4), Vec<2>(0.049, 0.3), Vec<2>(0.03, -0.6)}) {
      Vec<D> r = Vec<D>::Zero();
      r[0] = p[0], r[D - 1] = p[1];
      add(r, random);
    }
    for (Index i = 0; i < topology.points(); ++i)
      for (Index part = 0; part < static_cast<Index>(walls.parts().size()); ++part) pairs.push_back({i, part});
    for (std::size_t n = pairs.size(); n-- > 1;) std::swap(pairs[n], pairs[random.below(static_cast<Index>(n + 1))]);
  }
  void add(const Vec<D>& r, Random& random) {
    topology.add_soft(random(0.4, 1.5), 1);
    x.insert(x.end(), r.data(), r.data() + D);
  }
  std::vector<Real> forces(Real epsilon, std::size_t n, ContactLaw law) const {
    std::vector<Real> f(x.size(), 0.25);  // earlier values stay
    const std::vector<Pair> list(pairs.begin(), pairs.begin() + static_cast<std::ptrdiff_t>(n));
    add_wall_forces<D>({epsilon, law}, list, walls, topology.diameter.data(), x.data(), f.data());
    return f;
  }
  std::vector<Real> element_forces(Real epsilon, std::size_t n, ContactLaw law) const {
    Neighbours<D> neighbours({}, 0);
    neighbours.walls.pairs = pairs;
    const StateView<D> s{x.data(), nullptr, topology, neighbours, walls};
    std::vector<Real> f(x.size(), 0.25);
    Scatter<D, -1> minus{f.data()};
    const WallContact<D> contact{.epsilon = epsilon, .law = law};
    for (std::size_t e = 0; e < n; ++e) contact.add_gradient(s, static_cast<Index>(e), minus);
    return f;
  }
};

}  // namespace

TEMPLATE_TEST_CASE_SIG("wall forces are those of the element form", "", ((int D), D), 2, 3) {
  Random random(11 + D);
  const ContactLaw law =
      GENERATE(ContactLaw::harmonic, ContactLaw::hertz, ContactLaw::barrier, ContactLaw::spring, ContactLaw::linear);
  const bool plain = GENERATE(true, false);
  CAPTURE(plain);
  for (int trial = 0; trial < 10; ++trial) {
    const Room<D> room(random, plain);
    const std::size_t all = room.pairs.size();
    const std::vector<Real> whole = room.element_forces(1e3, all, law);
    const Real scale = *std::max_element(whole.begin(), whole.end());
    REQUIRE(scale > 100);
    REQUIRE(std::count(whole.begin(), whole.end(), 0.25) > 0);
    for (const std::size_t n : {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{3}, std::size_t{4},
                                std::size_t{5}, std::size_t{30}, all - 1, all}) {
      CAPTURE(trial, n);
      const std::vector<Real> f = room.forces(1e3, n, law), expected = room.element_forces(1e3, n, law);
      for (std::size_t k = 0; k < f.size(); ++k) {
        CAPTURE(k);
        CHECK(f[k] == Approx(expected[k]).epsilon(0).margin(1e-12 * scale));
      }
    }
  }
}

}  // namespace pliant::test::wall_forces_test
