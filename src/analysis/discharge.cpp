#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <vector>

#include <pliant/analysis/discharge.h>
#include <pliant/base/errors.h>

namespace pliant {
namespace {

constexpr std::size_t parts = 10;
constexpr std::size_t min_samples = 3;
constexpr std::size_t min_counts = 3;              // different numbers, one more than the parameters of the line
constexpr Real first_part = 0.2, last_part = 0.2;  // of the particles, not fitted

void check(std::span<const Real> time, std::span<const std::int64_t> count) {
  if (time.size() != count.size())
    throw InputError("discharge: {} times but {} counts; give one count per time", time.size(), count.size());
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (!std::isfinite(time[i]) || (i > 0 && time[i] <= time[i - 1]))
      throw InputError("discharge: time {} of sample {} is not finite or does not increase; sort the samples", time[i],
                       i);
    if (count[i] < 0) throw InputError("discharge: count {} of sample {} is negative", count[i], i);
  }
}

/// First sample with at most n particles.
std::size_t first_at_most(std::span<const std::int64_t> count, Real n) {
  return static_cast<std::size_t>(
      std::ranges::find_if(count, [n](std::int64_t c) { return static_cast<Real>(c) <= n; }) - count.begin());
}

/// How many different counts there are.
std::size_t different(std::span<const std::int64_t> count) { return std::set(count.begin(), count.end()).size(); }

/// First sample after the last change of the count.
std::size_t last_change(std::span<const std::int64_t> count) {
  std::size_t i = count.size() - 1;
  while (i > 0 && count[i - 1] == count.back()) --i;
  return i;
}

std::int64_t residue(std::span<const Real> time, std::span<const std::int64_t> count, std::size_t stop) {
  const std::int64_t first = count.front(), last = count.back();
  if (4 * last > first) return 0;
  const std::size_t tenth = first_at_most(count, static_cast<Real>(last) + 0.1 * static_cast<Real>(first - last));
  return 4 * (time[stop] - time[tenth]) > time[stop] - time.front() ? last : 0;
}

struct Line {
  Real slope = 0;
  Real start = 0;  ///< at the first time
};

/// Regression of root on time.
Line regression(std::span<const Real> time, std::span<const Real> root) {
  const Real n = static_cast<Real>(time.size());
  Real mean_t = 0, mean_s = 0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    mean_t += time[i] / n;
    mean_s += root[i] / n;
  }
  Real tt = 0, ts = 0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    tt += square(time[i] - mean_t);
    ts += (time[i] - mean_t) * (root[i] - mean_s);
  }
  return {ts / tt, mean_s - ts / tt * (mean_t - time.front())};
}

/// Where each of the equal parts of the time begins, and the end; none if a part has too few samples.
std::optional<std::array<std::size_t, parts + 1>> cut(std::span<const Real> time) {
  std::array<std::size_t, parts + 1> edges{};
  edges[parts] = time.size();
  for (std::size_t p = 1; p < parts; ++p) {
    const Real edge = std::lerp(time.front(), time.back(), static_cast<Real>(p) / parts);
    edges[p] = static_cast<std::size_t>(std::ranges::lower_bound(time, edge) - time.begin());
  }
  for (std::size_t p = 0; p < parts; ++p)
    if (edges[p + 1] < edges[p] + min_samples) return std::nullopt;
  return edges;
}

}  // namespace

DischargeFit fit_discharge(std::span<const Real> time, std::span<const std::int64_t> count) {
  check(time, count);
  DischargeFit fit;
  if (count.empty()) return fit;
  if (const std::size_t empty = first_at_most(count, 0); empty < count.size())
    fit.total_time = time[empty] - time.front();

  // The time after the last departure does not follow the law.
  const std::size_t stop = last_change(count);
  fit.residue = residue(time, count, stop);
  const Real left_behind = static_cast<Real>(fit.residue), all = static_cast<Real>(count.front()) - left_behind;
  fit.begin = first_at_most(count, left_behind + (1 - first_part) * all);
  fit.end = std::min(first_at_most(count, left_behind + last_part * all), stop + 1);
  if (fit.end < fit.begin + min_samples || different(count.subspan(fit.begin, fit.end - fit.begin)) < min_counts) {
    fit.end = fit.begin;
    return fit;
  }

  const auto t = time.subspan(fit.begin, fit.end - fit.begin);
  const auto n = count.subspan(fit.begin, t.size());
  std::vector<Real> root(t.size());
  std::ranges::transform(n, root.begin(),
                         [&](std::int64_t c) { return std::sqrt(static_cast<Real>(c) - left_behind); });
  const Line line = regression(t, root);
  fit.c0 = -2 * line.slope;
  fit.start_count = square(line.start);

  const auto edges = cut(t);
  if (!edges) return fit;
  const auto law = [&](std::size_t i) { return square(line.start + line.slope * (t[i] - t.front())); };
  std::array<Real, parts> slopes{};
  Real chi2 = 0, mean = 0, squares = 0;
  for (std::size_t p = 0; p < parts; ++p) {
    const std::size_t from = (*edges)[p], to = (*edges)[p + 1], next = std::min(to, t.size() - 1);
    slopes[p] = regression(t.subspan(from, to - from), std::span(root).subspan(from, to - from)).slope;
    mean += slopes[p] / parts;
    const Real expected = law(from) - law(next);
    chi2 += square(static_cast<Real>(n[from] - n[next]) - expected) / expected;
  }
  for (const Real slope : slopes) squares += square(slope - mean);
  fit.error = 2 * std::sqrt(squares / (parts * (parts - 1)));
  fit.chi2_per_dof = chi2 / (parts - 2);
  return fit;
}

}  // namespace pliant
