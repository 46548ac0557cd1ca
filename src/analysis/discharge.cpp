#include <algorithm>
#include <cmath>
#include <vector>

#include <pliant/analysis/discharge.h>
#include <pliant/base/errors.h>

namespace pliant {
namespace {

constexpr std::size_t parts = 10;
constexpr std::size_t min_samples = 3;

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

/// Regression of sqrt(count) on time.
struct Line {
  Real slope = 0;
  Real rounding_error = 0;  ///< of the slope, from rounding each count
};

Line regression(std::span<const Real> time, std::span<const std::int64_t> count) {
  const Real n = static_cast<Real>(time.size());
  Real mean_t = 0, mean_s = 0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    mean_t += time[i] / n;
    mean_s += std::sqrt(static_cast<Real>(count[i])) / n;
  }
  Real tt = 0, ts = 0, rounding = 0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    const Real t = time[i] - mean_t;
    tt += t * t;
    ts += t * (std::sqrt(static_cast<Real>(count[i])) - mean_s);
    rounding += t * t / (48 * static_cast<Real>(count[i]));
  }
  return {ts / tt, std::sqrt(rounding) / tt};
}

/// Standard error of the mean slope of equal parts of the time; NaN if a part has too few samples.
Real slope_error(std::span<const Real> time, std::span<const std::int64_t> count) {
  std::vector<Real> slopes;
  auto first = time.begin();
  for (std::size_t p = 1; p <= parts; ++p) {
    const Real edge = std::lerp(time.front(), time.back(), static_cast<Real>(p) / parts);
    const auto last = p == parts ? time.end() : std::lower_bound(first, time.end(), edge);
    const auto samples = static_cast<std::size_t>(last - first);
    if (samples < min_samples) return DischargeFit::unknown;
    const auto offset = static_cast<std::size_t>(first - time.begin());
    slopes.push_back(regression(time.subspan(offset, samples), count.subspan(offset, samples)).slope);
    first = last;
  }
  Real mean = 0, squares = 0;
  for (const Real slope : slopes) mean += slope / parts;
  for (const Real slope : slopes) squares += square(slope - mean);
  return std::sqrt(squares / (parts * (parts - 1)));
}

}  // namespace

DischargeFit fit_discharge(std::span<const Real> time, std::span<const std::int64_t> count) {
  check(time, count);
  DischargeFit fit;
  if (count.empty()) return fit;
  const auto empty = std::ranges::find(count, 0);
  if (empty != count.end()) fit.total_time = time[static_cast<std::size_t>(empty - count.begin())] - time.front();

  fit.excluded = count.front() < 1000 ? (count.front() + 9) / 10 : 100;
  const auto begin = std::ranges::find_if(count, [&](std::int64_t n) { return n <= count.front() - fit.excluded; });
  auto end = std::find_if(begin, count.end(), [&](std::int64_t n) { return n < fit.excluded; });
  // Nothing leaves any more: the flat tail is a clog, not part of the law.
  if (end == count.end())
    while (end - begin > 1 && *(end - 2) == *(end - 1)) --end;
  fit.begin = static_cast<std::size_t>(begin - count.begin());
  fit.end = static_cast<std::size_t>(end - count.begin());
  const std::size_t samples = fit.end - fit.begin;
  if (samples < min_samples) return fit;

  const auto t = time.subspan(fit.begin, samples);
  const auto n = count.subspan(fit.begin, samples);
  const Line line = regression(t, n);
  fit.c0 = -2 * line.slope;
  fit.rounding_error = 2 * line.rounding_error;
  fit.error = 2 * slope_error(t, n);
  return fit;
}

}  // namespace pliant
