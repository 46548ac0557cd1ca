#include <pliant/domain/partition.h>

#include <limits>

namespace pliant {
namespace {

/// Ranks first … last−1, and the box of their particles.
template <int D>
struct Group {
  int first, last;
  Vec<D> low = Vec<D>::Zero(), high = Vec<D>::Zero();
  int axis() const {
    int k = 0;
    (high - low).maxCoeff(&k);
    return k;
  }
  int middle() const { return (first + last) / 2; }
};

}  // namespace

template <int D>
std::vector<int> bisect(const Ranks& ranks, const std::vector<Real>& centres, const std::vector<Real>& weights) {
  const std::size_t n = weights.size();
  std::vector<int> group_of(n, 0);
  if (!ranks.several()) return group_of;
  std::vector<Group<D>> groups{{0, ranks.size()}};
  while (groups.size() < static_cast<std::size_t>(ranks.size())) {
    const std::size_t g = groups.size();
    // low and −high, so that one reduction finds both.
    std::vector<Real> box(2 * D * g, -std::numeric_limits<Real>::max()), total(g), below(g);
    for (std::size_t m = 0; m < n; ++m) {
      Real* b = &box[2 * D * static_cast<std::size_t>(group_of[m])];
      for (int k = 0; k < D; ++k) {
        b[k] = std::max(b[k], -centres[m * D + k]);
        b[D + k] = std::max(b[D + k], centres[m * D + k]);
      }
      total[group_of[m]] += weights[m];
    }
    ranks.max(box);
    ranks.sum(total);
    std::vector<Real> low(g), high(g), cut(g);
    for (std::size_t i = 0; i < g; ++i) {
      for (int k = 0; k < D; ++k) {
        groups[i].low[k] = -box[2 * D * i + k];
        groups[i].high[k] = box[2 * D * i + D + k];
      }
      low[i] = groups[i].low[groups[i].axis()];
      high[i] = groups[i].high[groups[i].axis()];
    }
    for (int step = 0; step < 50; ++step) {
      std::fill(below.begin(), below.end(), 0);
      for (std::size_t i = 0; i < g; ++i) cut[i] = (low[i] + high[i]) / 2;
      for (std::size_t m = 0; m < n; ++m) {
        const int i = group_of[m];
        if (centres[m * D + groups[i].axis()] < cut[i]) below[i] += weights[m];
      }
      ranks.sum(below);
      for (std::size_t i = 0; i < g; ++i) {
        const Real share = Real(groups[i].middle() - groups[i].first) / (groups[i].last - groups[i].first);
        (below[i] < share * total[i] ? low[i] : high[i]) = cut[i];
      }
    }
    // Both halves of a group replace it; a group of one rank is not divided.
    std::vector<Group<D>> halves;
    std::vector<int> place(g);
    for (std::size_t i = 0; i < g; ++i) {
      const Group<D>& whole = groups[i];
      place[i] = static_cast<int>(halves.size());
      if (whole.last - whole.first == 1) {
        halves.push_back(whole);
        continue;
      }
      halves.push_back({whole.first, whole.middle()});
      halves.push_back({whole.middle(), whole.last});
    }
    for (std::size_t m = 0; m < n; ++m) {
      const Group<D>& whole = groups[group_of[m]];
      const bool upper =
          whole.last - whole.first > 1 && !(centres[m * D + whole.axis()] < cut[static_cast<std::size_t>(group_of[m])]);
      group_of[m] = place[group_of[m]] + (upper ? 1 : 0);
    }
    groups = std::move(halves);
  }
  return group_of;
}

template std::vector<int> bisect<2>(const Ranks&, const std::vector<Real>&, const std::vector<Real>&);
template std::vector<int> bisect<3>(const Ranks&, const std::vector<Real>&, const std::vector<Real>&);

}  // namespace pliant
