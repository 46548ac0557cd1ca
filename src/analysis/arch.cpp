#include <pliant/analysis/arch.h>

#include <algorithm>
#include <limits>

#include <pliant/analysis/graph.h>

namespace pliant {
namespace {

constexpr Index no_particle = -1;

/// Droplets, their links, and which of them are at a wall.
struct Heap {
  Graph graph;
  std::vector<std::uint8_t> left, right;

  Heap(std::size_t n, const ClogLinks& links)
      : graph(make_graph(static_cast<Index>(n), links.pairs)), left(n), right(n) {
    for (const Index i : links.left) left[i] = 1;
    for (const Index i : links.right) right[i] = 1;
  }
};

/// The chain with the fewest droplets among those with allowed[i]; if several are equal, the chain with the lowest sum
/// of heights: breadth-first search, by increasing length.
std::vector<Index> shortest_chain(const Heap& heap, const std::vector<Real>& height,
                                  const std::vector<std::uint8_t>& allowed) {
  const auto n = static_cast<Index>(height.size());
  std::vector<Index> before(n, no_particle);
  std::vector<Real> sum(n, std::numeric_limits<Real>::infinity());
  std::vector<std::uint8_t> reached(n);
  std::vector<Index> front;
  for (Index i = 0; i < n; ++i)
    if (allowed[i] && heap.left[i]) {
      sum[i] = height[i];
      front.push_back(i);
    }
  while (!front.empty()) {
    for (const Index i : front) reached[i] = 1;
    Index last = no_particle;
    for (const Index i : front)
      if (heap.right[i] && (last == no_particle || sum[i] < sum[last])) last = i;
    if (last != no_particle) {
      std::vector<Index> chain;
      for (Index i = last; i != no_particle; i = before[i]) chain.push_back(i);
      std::reverse(chain.begin(), chain.end());
      return chain;
    }
    std::vector<Index> next;
    for (const Index i : front)
      for (const Index j : heap.graph[i]) {
        if (!allowed[j] || reached[j] || sum[i] + height[j] >= sum[j]) continue;
        if (before[j] == no_particle) next.push_back(j);
        before[j] = i;
        sum[j] = sum[i] + height[j];
      }
    front = std::move(next);
  }
  return {};
}

}  // namespace

std::vector<Index> lowest_chain(std::span<const Real> position, const ClogLinks& links) {
  const std::size_t n = position.size() / 2;
  const Heap heap(n, links);
  std::vector<Real> height(n);
  for (std::size_t i = 0; i < n; ++i) height[i] = position[2 * i + 1];
  const auto chain_below = [&](Real limit) {
    std::vector<std::uint8_t> allowed(n);
    for (std::size_t i = 0; i < n; ++i) allowed[i] = height[i] <= limit;
    return shortest_chain(heap, height, allowed);
  };
  std::vector<Real> limits = height;
  std::sort(limits.begin(), limits.end());
  const auto lowest =
      std::partition_point(limits.begin(), limits.end(), [&](Real limit) { return chain_below(limit).empty(); });
  return lowest == limits.end() ? std::vector<Index>() : chain_below(*lowest);
}

std::vector<ClogRole> clog_roles(std::span<const Real> position, std::span<const std::uint8_t> active,
                                 std::span<const Index> arch) {
  const auto at = [&](Index i) { return point<2>(position.data(), i); };
  const auto below = [&](Index i) {
    const Vec<2> r = at(i);
    bool odd = false;
    const auto cross = [&](Real x0, Real x1, const auto& height) {
      if ((x0 <= r[0]) != (x1 <= r[0]) && height() > r[1]) odd = !odd;
    };
    constexpr Real far = std::numeric_limits<Real>::infinity();
    cross(-far, at(arch.front())[0], [&] { return at(arch.front())[1]; });
    for (std::size_t k = 1; k < arch.size(); ++k) {
      const Vec<2> a = at(arch[k - 1]), b = at(arch[k]);
      cross(a[0], b[0], [&] { return a[1] + (r[0] - a[0]) / (b[0] - a[0]) * (b[1] - a[1]); });
    }
    cross(at(arch.back())[0], far, [&] { return at(arch.back())[1]; });
    return odd;
  };
  std::vector<ClogRole> roles(active.size(), ClogRole::gone);
  for (std::size_t i = 0; i < active.size(); ++i) {
    if (!active[i]) continue;
    roles[i] = !arch.empty() && below(static_cast<Index>(i)) ? ClogRole::attached : ClogRole::rest;
  }
  for (const Index i : arch) roles[i] = ClogRole::arch;
  return roles;
}

}  // namespace pliant
