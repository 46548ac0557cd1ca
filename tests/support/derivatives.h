// Gradient against energy and Hessian against gradient of a force field, over generated configurations.
#pragma once

#include <catch2/catch.hpp>

#include <cmath>
#include <functional>
#include <limits>

#include "configurations.h"

namespace pliant::test {

inline constexpr int derivative_repeats = 25;

template <int D>
using Make = std::function<Configuration<D>(Random&)>;

/// Inside a region of smoothness. `h0` is small compared with the distance to the region's boundary.
/// parts: see Functional.
template <int D>
void check_smooth(const ForceField<D>& field, const Make<D>& make, Real h0, bool hessian_vanishes = false,
                  Real parts = 1e3) {
  for (int k = 0; k < derivative_repeats; ++k) {
    Random random(k);
    Configuration<D> c = make(random);
    const Functional f = functional(field, c, parts);
    const VectorXd x = c.positions(), p = random_direction(random, x.size());
    INFO("state " << k);
    // Not trivial: the term acts.
    REQUIRE(f.energy(x) != 0);
    REQUIRE(f.gradient(x).norm() > 0);
    const MatrixXd hessian = f.hessian(x);
    REQUIRE((hessian.norm() == 0) == hessian_vanishes);
    CHECK(gradient_order(f, x, p, h0) > 1.9);
    CHECK(hessian_order(f, x, p, h0) > 1.9);
    CHECK((hessian - hessian.transpose()).norm() <= 1e-13 * hessian.norm());
  }
}

/// The smaller of two orders. On one side of a boundary there may be nothing to see; NaN where there is nothing on
/// both.
inline Real least_seen(Real a, Real b) { return std::fmin(a, b); }

/// On a boundary between regions: U is C¹ and its Hessian jumps.
template <int D>
void check_boundary(const ForceField<D>& field, const Make<D>& make, Real h0, Real parts = 1e3) {
  for (int k = 0; k < derivative_repeats; ++k) {
    Random random(k);
    Configuration<D> c = make(random);
    const Functional f = functional(field, c, parts);
    const VectorXd x = c.positions();
    VectorXd p;
    // Along a boundary there may be nothing to see: then in another direction.
    Real order = std::numeric_limits<Real>::quiet_NaN();
    for (int attempt = 0; attempt < 5 && std::isnan(order); ++attempt) {
      p = random_direction(random, x.size());
      order = least_seen(gradient_order(f, x, p, h0), gradient_order(f, x, -p, h0));
    }
    INFO("state " << k);
    // Still second order for the energy, and only first for the gradient on the side that the Hessian at x does not
    // belong to.
    CHECK(order > 1.9);
    CHECK(least_seen(hessian_order(f, x, p, h0), hessian_order(f, x, -p, h0)) > 0.9);
    const Sides sides = compare_sides(f, x, p, h0);
    REQUIRE(sides.hessian_jump > 1e-3);  // not trivial: the point lies on a boundary
    CHECK(sides.gradient_jump_order > 0.9);
    CHECK(sides.forward < 1e-6);
    CHECK(sides.backward < 1e-6);
  }
}

}  // namespace pliant::test
