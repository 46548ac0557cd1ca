#include <algorithm>
#include <cmath>
#include <numeric>

#include <pliant/analysis/block_average.h>
#include <pliant/base/errors.h>

namespace pliant {
namespace {

constexpr std::size_t min_blocks = 8;

Real mean_of(std::span<const Real> values) {
  return std::accumulate(values.begin(), values.end(), Real{0}) / static_cast<Real>(values.size());
}

Real variance_of(std::span<const Real> values) {
  const Real mean = mean_of(values);
  Real sum = 0;
  for (const Real value : values) sum += square(value - mean);
  return sum / static_cast<Real>(values.size() - 1);
}

/// Then the variance of a constant series is exactly 0.
std::vector<Real> relative_to_first(std::span<const Real> series) {
  std::vector<Real> values(series.begin(), series.end());
  for (Real& value : values) value -= series.front();
  return values;
}

/// Means of neighbouring pairs, in place; an odd last value is dropped.
void halve(std::vector<Real>& values) {
  const std::size_t pairs = values.size() / 2;
  for (std::size_t i = 0; i < pairs; ++i) values[i] = (values[2 * i] + values[2 * i + 1]) / 2;
  values.resize(pairs);
}

/// Square of the standard error of the mean, from so many equal stretches; remaining samples at the end are dropped.
Real squared_error(std::span<const Real> values, std::size_t stretches) {
  const std::size_t length = values.size() / stretches;
  std::vector<Real> means;
  for (std::size_t k = 0; k < stretches; ++k) means.push_back(mean_of(values.subspan(k * length, length)));
  return variance_of(means) / static_cast<Real>(stretches);
}

void check_cumulative(std::span<const Real> time, std::span<const Real> cumulative) {
  if (time.size() != cumulative.size())
    throw InputError("rate of a cumulative series: {} times but {} values; give one value per time", time.size(),
                     cumulative.size());
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (!std::isfinite(time[i]) || !std::isfinite(cumulative[i]))
      throw InputError("rate of a cumulative series: sample {} is not finite (time {}, value {}); drop it", i, time[i],
                       cumulative[i]);
    if (i > 0 && time[i] <= time[i - 1])
      throw InputError(
          "rate of a cumulative series: time {} of sample {} does not exceed {} before it; sort the samples", time[i],
          i, time[i - 1]);
  }
}

/// Rates of the piecewise linear curve in equal bins.
std::vector<Real> binned_rates(std::span<const Real> time, std::span<const Real> cumulative, std::size_t bins) {
  const Real width = (time.back() - time.front()) / static_cast<Real>(bins);
  std::vector<Real> rates(bins);
  Real before = cumulative.front();
  std::size_t i = 0;  // interval [time[i], time[i+1]] that holds the edge
  for (std::size_t b = 0; b < bins; ++b) {
    const Real edge = time.front() + width * static_cast<Real>(b + 1);
    while (i + 2 < time.size() && time[i + 1] <= edge) ++i;
    const Real part = std::min(Real{1}, (edge - time[i]) / (time[i + 1] - time[i]));
    const Real here = b + 1 == bins ? cumulative.back() : std::lerp(cumulative[i], cumulative[i + 1], part);
    rates[b] = (here - before) / width;
    before = here;
  }
  return rates;
}

}  // namespace

BlockAverage block_average(std::span<const Real> series) {
  BlockAverage result;
  result.samples = series.size();
  if (series.empty()) return result;

  // Relative to the first value: then the variance of a constant series is exactly 0.
  std::vector<Real> values(series.begin(), series.end());
  for (Real& value : values) value -= series.front();
  result.mean = series.front() + mean_of(values);
  if (series.size() < 2) return result;

  const Real n = static_cast<Real>(series.size());
  const Real naive_squared = variance_of(values) / n;
  result.naive_error = std::sqrt(naive_squared);
  if (!std::isfinite(naive_squared)) return result;
  for (std::size_t size = 1; values.size() >= min_blocks; size *= 2, halve(values)) {
    const Real block = static_cast<Real>(size);
    const Real error_squared = variance_of(values) * block / n;
    const Real error = std::sqrt(error_squared);
    result.lower_bound = std::fmax(result.lower_bound, error);
    const Real inefficiency = naive_squared == 0 ? Real{1} : error_squared / naive_squared;
    if (!result.plateau && block * block * block > 2 * n * square(std::fmax(Real{1}, inefficiency))) {
      result.plateau = true;
      result.error = error;
      result.error_of_error = error / std::sqrt(2 * static_cast<Real>(values.size() - 1));
      result.inefficiency = inefficiency;
      result.block_size = size;
      result.blocks = values.size();
    }
  }
  return result;
}

BlockAverage slow_average(std::span<const Real> series) {
  const BlockAverage blocks = block_average(series);
  BlockAverage result;
  result.samples = blocks.samples;
  result.mean = blocks.mean;
  result.naive_error = result.lower_bound = blocks.naive_error;
  if (series.size() < BlockAverage::least_samples || !std::isfinite(blocks.naive_error)) return result;
  const std::vector<Real> values = relative_to_first(series);
  const Real few = squared_error(values, min_blocks), many = squared_error(values, 3 * min_blocks);
  // Correlations between neighbouring stretches make both too small, `many` three times as much as `few`.
  const Real error_squared = many + 2 * std::fmax(Real{0}, few - many);
  result.lower_bound = std::fmax(result.naive_error, std::sqrt(error_squared));
  result.plateau = few <= 3 * many;
  if (!result.plateau) return result;
  result.error = std::sqrt(error_squared);
  result.error_of_error = 0.3 * result.error;
  result.inefficiency = error_squared == 0 ? Real{1} : error_squared / square(result.naive_error);
  result.blocks = min_blocks;
  result.block_size = series.size() / min_blocks;
  return result;
}

BlockAverage block_ratio(std::span<const Real> numerator, std::span<const Real> denominator) {
  if (numerator.size() != denominator.size())
    throw InputError("ratio of two series: {} numerators but {} denominators; give one pair per sample",
                     numerator.size(), denominator.size());
  BlockAverage result;
  result.samples = numerator.size();
  const Real sum = std::accumulate(denominator.begin(), denominator.end(), Real{0});
  if (sum == 0) return result;
  const Real ratio = std::accumulate(numerator.begin(), numerator.end(), Real{0}) / sum;
  result.mean = ratio;
  // The deviation of a single sample with weight is 0.
  if (std::ranges::count_if(denominator, [](Real d) { return d != 0; }) < 2) return result;
  const Real scale = static_cast<Real>(numerator.size()) / sum;
  std::vector<Real> deviation(numerator.size());
  for (std::size_t i = 0; i < deviation.size(); ++i) deviation[i] = (numerator[i] - ratio * denominator[i]) * scale;
  result = block_average(deviation);
  result.mean = ratio;
  return result;
}

std::vector<Real> rate_series(std::span<const Real> time, std::span<const Real> cumulative) {
  check_cumulative(time, cumulative);
  std::vector<Real> rates;
  for (std::size_t i = 1; i < time.size(); ++i)
    rates.push_back((cumulative[i] - cumulative[i - 1]) / (time[i] - time[i - 1]));
  return rates;
}

FlowRate flow_rate(std::span<const Real> time, std::span<const Real> crossed) {
  check_cumulative(time, crossed);
  FlowRate result;
  if (time.size() < 2) return result;
  Real longest = 0;
  for (std::size_t i = 1; i < time.size(); ++i) {
    if (crossed[i] < crossed[i - 1])
      throw InputError("flow rate: the crossed area falls from {} to {} at sample {}; give the cumulative area",
                       crossed[i - 1], crossed[i], i);
    longest = std::max(longest, time[i] - time[i - 1]);
  }
  const Real duration = time.back() - time.front();
  // Equidistant times carry rounding errors: a millionth of a bin must not cost a bin.
  const auto bins = static_cast<std::size_t>(std::max(Real{1}, std::floor(duration / longest + 1e-6)));
  result.value = (crossed.back() - crossed.front()) / duration;
  result.bin = duration / static_cast<Real>(bins);
  result.blocks = block_average(binned_rates(time, crossed, bins));
  if (crossed.back() > crossed.front()) {
    result.error = result.blocks.error;
    result.correlation_time = result.blocks.inefficiency * result.bin / 2;
  }
  return result;
}

}  // namespace pliant
