#include <catch2/catch.hpp>

#include <pliant/analysis/arch.h>

namespace pliant::test::arch_test {

namespace {

/// Droplets at given places, linked to those that are nearer than `reach`.
struct Heap {
  std::vector<Real> x;
  ClogLinks links;

  Index add(Real px, Real py) {
    x.push_back(px);
    x.push_back(py);
    return static_cast<Index>(x.size() / 2) - 1;
  }
  void link(Real reach) {
    const auto n = static_cast<Index>(x.size() / 2);
    for (Index i = 0; i < n; ++i)
      for (Index j = 0; j < i; ++j)
        if ((point<2>(x.data(), i) - point<2>(x.data(), j)).norm() < reach) links.pairs.emplace_back(i, j);
  }
  std::vector<ClogRole> roles(const std::vector<Index>& arch) const {
    return clog_roles(x, std::vector<std::uint8_t>(x.size() / 2, 1), arch);
  }
};

/// An arch of five over an exit from x = −4 to 4, a row of six on it, and two droplets that hang from it.
struct Clog : Heap {
  std::vector<Index> arch, above, hanging;
  Clog() {
    // Not in the order of the chain.
    const Index right = add(4.4, 1), middle = add(0, 3.2), left = add(-4.4, 1);
    const Index half_left = add(-2, 2.6), half_right = add(2, 2.6);
    arch = {left, half_left, middle, half_right, right};
    for (const Real px : {-5., -3., -1., 1., 3., 5.}) above.push_back(add(px, 4.8));
    hanging = {add(0.8, 1), add(0.4, -0.8)};
    link(2.95);
    links.left = {left, above.front()};
    links.right = {right, above.back()};
  }
};

}  // namespace

TEST_CASE("the arch is the lowest chain between the walls") {
  const Clog clog;
  CHECK(lowest_chain(clog.x, clog.links) == clog.arch);
}

TEST_CASE("a chain that is longer and lower wins over a short one above") {
  Heap heap;
  const Index top_left = heap.add(-1, 5), top_right = heap.add(1, 5);
  std::vector<Index> low;
  for (const Real px : {-3., -1., 1., 3.}) low.push_back(heap.add(px, 1));
  heap.link(2.1);
  heap.links.left = {top_left, low.front()};
  heap.links.right = {top_right, low.back()};
  CHECK(lowest_chain(heap.x, heap.links) == low);
  SECTION("until it is broken") {
    std::erase_if(heap.links.pairs, [&](const auto& p) { return p == std::pair(low[2], low[1]); });
    CHECK(lowest_chain(heap.x, heap.links) == std::vector{top_left, top_right});
  }
}

TEST_CASE("of chains with the same highest droplet the shortest, then the lowest one") {
  Heap heap;
  const Index left = heap.add(-2, 2), right = heap.add(2, 2);
  const Index high = heap.add(0, 1.5), low = heap.add(0, 0.5);
  const Index one = heap.add(-1, -1), other = heap.add(1, -1);
  heap.links = {{{left, high}, {high, right}, {left, low}, {low, right}, {left, one}, {one, other}, {other, right}},
                {left},
                {right}};
  CHECK(lowest_chain(heap.x, heap.links) == std::vector{left, low, right});
}

TEST_CASE("one droplet between both walls is an arch, two at either wall are none") {
  Heap heap;
  const Index one = heap.add(-3, 1), other = heap.add(3, 1);
  heap.links.left = {one};
  heap.links.right = {other};
  CHECK(lowest_chain(heap.x, heap.links).empty());
  heap.links.right.push_back(one);
  CHECK(lowest_chain(heap.x, heap.links) == std::vector{one});
  CHECK(lowest_chain({}, {}).empty());
}

TEST_CASE("what is below the arch is attached, what is above it is the rest") {
  const Clog clog;
  const std::vector<ClogRole> roles = clog.roles(clog.arch);
  for (const Index i : clog.arch) CHECK(roles[i] == ClogRole::arch);
  for (const Index i : clog.above) CHECK(roles[i] == ClogRole::rest);
  for (const Index i : clog.hanging) CHECK(roles[i] == ClogRole::attached);
}

TEST_CASE("roles beyond the ends of the arch, of droplets that have gone, and without an arch") {
  Clog clog;
  const Index under = clog.add(-7, 0), over = clog.add(7, 1.5);
  std::vector<std::uint8_t> active(clog.x.size() / 2, 1);
  active[clog.hanging[0]] = 0;
  const std::vector<ClogRole> roles = clog_roles(clog.x, active, clog.arch);
  CHECK(roles[under] == ClogRole::attached);
  CHECK(roles[over] == ClogRole::rest);
  CHECK(roles[clog.hanging[0]] == ClogRole::gone);
  for (const ClogRole role : clog.roles({})) CHECK(role == ClogRole::rest);
}

TEST_CASE("an arch that folds back: between its branches is not below") {
  Heap heap;
  // The upright line at x = 0 meets the arch at heights 4, 3 and 1.
  const std::vector<Index> arch{heap.add(-3, 1), heap.add(2, 1),  heap.add(2, 3),
                                heap.add(-2, 3), heap.add(-2, 4), heap.add(3, 4)};
  const Index low = heap.add(0, 0), between = heap.add(0, 2), fold = heap.add(0, 3.5), top = heap.add(0, 5);
  const std::vector<ClogRole> roles = heap.roles(arch);
  CHECK(roles[low] == ClogRole::attached);
  CHECK(roles[between] == ClogRole::rest);
  CHECK(roles[fold] == ClogRole::attached);
  CHECK(roles[top] == ClogRole::rest);
}

}  // namespace pliant::test::arch_test
