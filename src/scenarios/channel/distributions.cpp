#include <pliant/scenarios/channel/distributions.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include <pliant/base/errors.h>
#include <pliant/base/text.h>
#include <pliant/setup/polylines.h>

namespace pliant {
namespace {

constexpr Real eighth_inch = 0.3175;  ///< a, an eighth of an inch, in cm [T 3.2.2]

struct Named {
  std::string name;
  std::vector<SizeClass> sizes;  ///< radii in units of a
};

const std::vector<Named>& table() {
  static const std::vector<Named> all{
      {"bidisperse", {{3, 1}, {2, 1}}},
      {"T1", {{4, 1}, {3, 8}, {2, 8}}},
      {"T2a", {{6, 1}, {3, 24}, {2, 24}}},
      {"T2b", {{6, 1}, {3, 18}, {2, 18}}},
      {"T2c", {{6, 1}, {3, 11}, {2, 11}}},
      {"T2d", {{6, 1}, {3, 9}, {2, 9}}},
      {"T3", {{8, 1}, {3, 26}, {2, 26}}},
      {"T4", {{10, 1}, {3, 28}, {2, 28}}},
      // n(R) ∝ R^−p from 3 a on, rounded up, and as many disks of 2 a as of 3 a.
      {"C1", {{6, 1}, {5, 3}, {4, 7}, {3, 25}, {2, 25}}},
      {"C2", {{8, 1}, {7, 2}, {6, 4}, {5, 7}, {4, 16}, {3, 50}, {2, 50}}},
      {"C3", {{10, 1}, {9, 2}, {8, 3}, {7, 4}, {6, 6}, {5, 11}, {4, 22}, {3, 55}, {2, 55}}},
  };
  return all;
}

Real disk(Real radius) { return pi * square(radius); }

}  // namespace

const std::vector<std::string>& size_distribution_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Named& n : table()) all.push_back(n.name);
    return all;
  }();
  return names;
}

std::vector<SizeClass> size_distribution(const std::string& name) {
  for (const Named& n : table()) {
    if (n.name != name) continue;
    std::vector<SizeClass> sizes = n.sizes;
    for (SizeClass& s : sizes) s.radius *= eighth_inch;
    return sizes;
  }
  throw InputError("-distribution {}: unknown distribution; use one of {}", printable(name),
                   fmt::join(size_distribution_names(), ", "));
}

std::vector<SizeClass> parse_sizes(const std::string& radii, const std::string& counts) {
  const auto read = [](const char* option, const std::string& text) {
    const auto values = parse_numbers(text, ", \t");
    if (!values || values->empty())
      throw InputError("-{} {}: not a list of numbers; write them with commas between them", option, printable(text));
    for (const Real a : *values)
      if (!(a > 0)) throw InputError("-{} {}: {} is not positive", option, printable(text), a);
    return *values;
  };
  if (radii.empty() || counts.empty())
    throw InputError("-{} needs -{} too: a number for each", radii.empty() ? "counts" : "radii",
                     radii.empty() ? "radii" : "counts");
  const std::vector<Real> r = read("radii", radii), n = read("counts", counts);
  if (r.size() != n.size())
    throw InputError("-radii has {} numbers, -counts {}; give one of each for every size", r.size(), n.size());
  std::vector<SizeClass> sizes;
  for (std::size_t k = 0; k < r.size(); ++k) sizes.push_back({r[k], n[k]});
  return sizes;
}

std::vector<Index> disks_for_area(const std::vector<SizeClass>& sizes, Real area) {
  constexpr Real most = 1e6;
  std::vector<std::size_t> order(sizes.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return sizes[a].count < sizes[b].count; });
  std::vector<Index> disks(sizes.size(), 0);
  Real left = area;
  for (std::size_t k = 0; k < order.size();) {
    Real set = 0;  // area of one set of this size and all more frequent sizes
    for (std::size_t i = k; i < order.size(); ++i) set += sizes[order[i]].count * disk(sizes[order[i]].radius);
    const Real count = sizes[order[k]].count, exact = std::max(left, Real(0)) / set * count;
    if (exact > most)
      throw InputError("more than {:g} disks are asked for; use larger ones, or a smaller channel", most);
    for (; k < order.size() && sizes[order[k]].count == count; ++k) {
      disks[order[k]] = static_cast<Index>(std::lround(exact));
      left -= disks[order[k]] * disk(sizes[order[k]].radius);
    }
  }
  if (std::accumulate(disks.begin(), disks.end(), Index{0}) == 0)
    throw InputError("an area of {:.4g} cm² has no room for a disk; raise -area_fraction, or use smaller disks", area);
  return disks;
}

Real covered_area(const std::vector<SizeClass>& sizes, const std::vector<Index>& disks) {
  Real sum = 0;
  for (std::size_t k = 0; k < sizes.size(); ++k) sum += disks[k] * disk(sizes[k].radius);
  return sum;
}

Real polydispersity(const std::vector<SizeClass>& sizes) {
  Real n = 0, first = 0, second = 0;
  for (const SizeClass& s : sizes) {
    n += s.count;
    first += s.count * s.radius;
  }
  for (const SizeClass& s : sizes) second += s.count * square(s.radius - first / n);
  return std::sqrt(second / n) / (first / n);
}

}  // namespace pliant
