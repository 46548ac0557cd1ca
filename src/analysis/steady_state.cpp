#include <algorithm>
#include <cmath>
#include <vector>

#include <pliant/analysis/steady_state.h>
#include <pliant/base/errors.h>

namespace pliant {
namespace {

constexpr std::size_t batch = 5;
constexpr std::size_t min_batches = 10;

std::vector<Real> batch_means(std::span<const Real> values) {
  std::vector<Real> means(values.size() / batch);
  for (std::size_t j = 0; j < means.size(); ++j) {
    for (const Real value : values.subspan(j * batch, batch)) means[j] += value;
    means[j] /= batch;
  }
  return means;
}

/// Number of batches to drop, at most half of them.
std::size_t best_truncation(const std::vector<Real>& means) {
  // From the back, by Welford's update: a constant tail has exactly no variance.
  Real mean = 0, squares = 0, best = 0;
  std::size_t drop = means.size();
  for (std::size_t kept = 1; kept <= means.size(); ++kept) {
    const std::size_t d = means.size() - kept;
    const Real delta = means[d] - mean;
    mean += delta / static_cast<Real>(kept);
    squares += delta * (means[d] - mean);
    if (d > means.size() / 2) continue;
    const Real statistic = squares / square(static_cast<Real>(kept));
    if (drop == means.size() || statistic <= best) {
      best = statistic;
      drop = d;
    }
  }
  return drop;
}

}  // namespace

SteadyState mser5(std::span<const Real> time, const NamedSeries& series) {
  const std::size_t samples = series.values.size();
  if (time.size() != samples)
    throw InputError("steady state of the {}: {} times but {} values; give one value per time", series.name,
                     time.size(), samples);
  SteadyState result;
  if (samples > 0) result.time = time.front();
  if (samples < batch * min_batches) {
    result.explanation = fmt::format("{}: {} samples are too few to find a steady state (at least {})", series.name,
                                     samples, batch * min_batches);
    return result;
  }
  const auto bad = std::ranges::find_if_not(series.values, [](Real value) { return std::isfinite(value); });
  if (bad != series.values.end()) {
    result.explanation = fmt::format("{}: not steady, sample {} is {}", series.name, bad - series.values.begin(), *bad);
    return result;
  }

  const std::vector<Real> means = batch_means(series.values);
  const std::size_t half = means.size() / 2;
  const std::size_t drop = best_truncation(means);
  result.index = drop * batch;
  result.time = time[result.index];
  result.steady = 10 * drop < 9 * half;
  result.explanation =
      result.steady
          ? fmt::format("{}: steady from t = {:.6g} on (sample {} of {}, MSER-5)", series.name, result.time,
                        result.index, samples)
          : fmt::format("{}: not steady, it still changes at t = {:.6g}, the middle of the run (MSER-5): run longer",
                        series.name, result.time);
  return result;
}

SteadyState steady_state(std::span<const Real> time, std::span<const NamedSeries> series) {
  if (series.empty()) throw InputError("steady state: no series given; give at least the flow rate");
  SteadyState result;
  std::string unsteady;
  for (std::size_t s = 0; s < series.size(); ++s) {
    SteadyState one = mser5(time, series[s]);
    if (!one.steady) unsteady += (unsteady.empty() ? "" : "; ") + one.explanation;
    if (s == 0 || one.index > result.index) result = std::move(one);
  }
  result.steady = unsteady.empty();
  if (!result.steady) result.explanation = unsteady;
  return result;
}

}  // namespace pliant
