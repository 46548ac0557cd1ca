#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Core>

#include <pliant/analysis/steady_state.h>
#include <pliant/base/errors.h>

namespace pliant {
namespace {

constexpr std::size_t mser_batch = 5;
constexpr std::size_t least_samples = 50;
constexpr std::size_t later_starts = 3;

std::vector<Real> means_of_batches(std::span<const Real> values, std::size_t batches) {
  const std::size_t size = values.size() / batches, skipped = (values.size() - batches * size) / 2;
  std::vector<Real> means(batches);
  for (std::size_t j = 0; j < batches; ++j) {
    for (const Real value : values.subspan(skipped + j * size, size)) means[j] += value;
    means[j] /= static_cast<Real>(size);
  }
  return means;
}

Real average_of(std::span<const Real> values) { return means_of_batches(values, 1).front(); }

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

/// How much a series must change to count as drifting.
struct Strictness {
  std::array<Real, 3> quantiles;  ///< of Student's t, for the numbers of batches
  Real spread;                    ///< factor
};

/// The degrees of freedom are the numbers of batches less one and less the degree of the polynomial.
constexpr std::array<std::size_t, 3> batch_numbers{18, 36, 72};
constexpr std::size_t degree = 4;
/// Two-sided probabilities of 2·10⁻⁴ and 10⁻² for each power.
constexpr Strictness usual{{5.111, 4.216, 3.935}, 1.25}, strict{{3.012, 2.744, 2.651}, 1.1};

using Powers = std::array<bool, degree + 1>;
using Column = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
using Basis = Eigen::Matrix<Real, Eigen::Dynamic, degree + 1>;

/// Orthonormal polynomials at n equidistant places [n · (degree + 1)].
Basis polynomials(std::size_t n) {
  const auto rows = static_cast<Eigen::Index>(n);
  const Column x = Column::LinSpaced(rows, -1, 1);
  Basis basis(rows, degree + 1);
  for (int power = 0; power <= static_cast<int>(degree); ++power) {
    Column p = x.array().pow(power);
    for (int lower = 0; lower < power; ++lower) p -= p.dot(basis.col(lower)) * basis.col(lower);
    basis.col(power) = p.normalized();
  }
  return basis;
}

/// The powers of time that are significant in the best-fitting polynomial of a series, with each number of batches.
Powers significant_powers(std::span<const Real> values, const Strictness& strictness) {
  static const std::array bases{polynomials(batch_numbers[0]), polynomials(batch_numbers[1]),
                                polynomials(batch_numbers[2])};
  Powers significant;
  significant.fill(true);
  for (std::size_t k = 0; k < bases.size() && values.size() >= batch_numbers[k]; ++k) {
    const std::vector<Real> means = means_of_batches(values, batch_numbers[k]);
    Column rest = Eigen::Map<const Column>(means.data(), bases[k].rows());
    rest.array() -= means.front();  // a constant series leaves exactly nothing
    const Eigen::Matrix<Real, degree + 1, 1> part = bases[k].transpose() * rest;
    rest -= bases[k] * part;
    const Real variance = rest.squaredNorm() / static_cast<Real>(batch_numbers[k] - degree - 1);
    for (std::size_t power = 1; power <= degree; ++power)
      significant[power] &= square(part[static_cast<Eigen::Index>(power)]) > square(strictness.quantiles[k]) * variance;
  }
  return significant;
}

/// Between the ends of a series, or between its lowest and highest part; none: 0.
struct Drift {
  Real before = 0, after = 0;
  bool ends = false;
  Real size() const { return std::abs(after - before); }
};

Drift significant_change(std::span<const Real> values, const Strictness& strictness) {
  const Powers powers = significant_powers(values, strictness);
  if (std::none_of(powers.begin() + 1, powers.end(), [](bool power) { return power; })) return {};
  const std::size_t third = values.size() / 3;
  const Drift ends{average_of(values.first(third)), average_of(values.last(third)), true};
  const std::vector<Real> sixths = means_of_batches(values, 6);
  const auto [low, high] = std::minmax_element(sixths.begin(), sixths.end());
  const Drift swing{*low, *high, false};
  return powers[1] && 2 * ends.size() > swing.size() ? ends : swing;
}

/// Distances from the mean of the third that a value belongs to.
std::vector<Real> deviations(std::span<const Real> values) {
  const std::size_t third = values.size() / 3;
  std::vector<Real> deviations;
  for (const std::span<const Real> part :
       {values.first(third), values.subspan(third, values.size() - 2 * third), values.last(third)}) {
    const Real mean = average_of(part);
    for (const Real value : part) deviations.push_back(std::abs(value - mean));
  }
  return deviations;
}

std::string text_of(std::string_view what, const Drift& change) {
  return change.ends ? fmt::format("{} changes from {:.4g} in the first third to {:.4g} in the last", what,
                                   change.before, change.after)
                     : fmt::format("{} varies between {:.4g} and {:.4g}", what, change.before, change.after);
}

bool finite(std::span<const Real> values) {
  return std::ranges::all_of(values, [](Real value) { return std::isfinite(value); });
}

std::string drift_of(const NamedSeries& series, const Strictness& strictness) {
  if (series.values.size() < batch_numbers.front())
    return fmt::format("the {} has {} samples, too few to see a drift", series.name, series.values.size());
  if (!finite(series.values)) return fmt::format("the {} is not finite", series.name);
  const Real least_change = series.tolerance * std::abs(average_of(series.values));
  if (const Drift change = significant_change(series.values, strictness); change.size() > least_change)
    return text_of(fmt::format("the mean of the {}", series.name), change);
  const Drift change = significant_change(deviations(series.values), strictness);
  const auto [narrow, wide] = std::minmax(change.before, change.after);
  if (change.size() > least_change && wide > strictness.spread * narrow)
    return text_of(fmt::format("the spread of the {}", series.name), change);
  return "";
}

}  // namespace

std::size_t mser5(std::span<const Real> values) {
  const std::size_t batches = values.size() / mser_batch;
  if (values.size() < least_samples) return 0;
  std::vector<Real> means(batches);
  for (std::size_t j = 0; j < batches; ++j) means[j] = average_of(values.subspan(j * mser_batch, mser_batch));
  return mser_batch * best_truncation(means);
}

std::string drift(const NamedSeries& series) { return drift_of(series, usual); }

SteadyState steady_state(std::span<const Real> time, std::span<const NamedSeries> series) {
  if (series.empty()) throw InputError("steady state: no series given; give at least the flow rate");
  const std::size_t samples = time.size();
  SteadyState result;
  for (const NamedSeries& one : series) {
    if (one.values.size() != samples)
      throw InputError("steady state of the {}: {} times but {} values; give one value per time", one.name, samples,
                       one.values.size());
    if (one.finds_start_up && finite(one.values)) result.index = std::max(result.index, mser5(one.values));
  }
  if (samples < least_samples) {
    if (samples > 0) result.time = time.front();
    result.explanation =
        fmt::format("{} samples are too few to find a steady state (at least {})", samples, least_samples);
    return result;
  }
  // A drift would be lost in the noise of a short rest: a third is dropped at most, and not more than half of the run.
  const std::size_t first = result.index,
                    latest = std::max(first, std::min(samples / 2, first + (samples - first) / 3));
  std::string drifts;
  for (std::size_t k = 0; k <= (latest == first ? 0 : later_starts) && !result.steady; ++k) {
    result.index = first + (latest - first) * k / later_starts;
    drifts.clear();
    for (const NamedSeries& one : series) {
      NamedSeries kept = one;
      kept.values = one.values.subspan(result.index);
      if (const std::string text = drift_of(kept, k == 0 ? usual : strict); !text.empty())
        drifts += (drifts.empty() ? "" : "; ") + text;
    }
    result.steady = drifts.empty();
  }
  result.time = time[result.index];
  result.explanation =
      result.steady ? fmt::format("steady from t = {:.6g} on (sample {} of {})", result.time, result.index, samples)
                    : fmt::format("not steady: from t = {:.6g} to {:.6g} {}", result.time, time.back(), drifts);
  return result;
}

}  // namespace pliant
