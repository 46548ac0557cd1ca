// Order of accuracy by step halving.
#pragma once

#include <catch2/catch.hpp>

#include <cmath>
#include <cstddef>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

namespace pliant::test {

/// Errors of a method at the steps h, h/2, h/4 … and the slope of log(error) over log(h).
struct OrderFit {
  std::vector<double> steps, errors;

  /// Least-squares slope.
  double slope() const {
    const auto n = static_cast<double>(steps.size());
    double x = 0, y = 0, xx = 0, xy = 0;
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const double a = std::log(steps[i]), b = std::log(errors[i]);
      x += a, y += b, xx += a * a, xy += a * b;
    }
    return (n * xy - x * y) / (n * xx - x * x);
  }
  std::string text() const {
    std::ostringstream out;
    for (std::size_t i = 0; i < steps.size(); ++i) out << "  h " << steps[i] << " error " << errors[i] << '\n';
    out << "  slope " << slope();
    return out.str();
  }
};

/// error(h) for `levels` steps from h on, each half the one before.
inline OrderFit fit_order(const std::function<double(double)>& error, double h, int levels = 4) {
  OrderFit fit;
  for (int level = 0; level < levels; ++level, h /= 2) {
    fit.steps.push_back(h);
    fit.errors.push_back(error(h));
  }
  return fit;
}

/// Fails where the slope is below order − 0.3, or where the errors could not show it: larger than `coarse` at the first
/// step (not yet asymptotic) or smaller than `rounding` at the last.
inline void require_order(const std::string& what, const std::function<double(double)>& error, double h, double order,
                          double rounding = 1e-13, double coarse = 0.1, int levels = 4) {
  const OrderFit fit = fit_order(error, h, levels);
  INFO(what << ", expected order " << order << '\n' << fit.text());
  REQUIRE(levels >= 4);
  CHECK(fit.errors.front() < coarse);
  CHECK(fit.errors.back() > rounding);
  CHECK(fit.slope() > order - 0.3);
}

}  // namespace pliant::test
