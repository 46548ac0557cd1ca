// The passes of velocity Verlet over coordinates.
#pragma once

#include <cstddef>

#include <pliant/base/types.h>

namespace pliant {

/// predicted = v + a h, for the end of a step h from (x, v, a). Arrays [n].
void verlet_predict(std::size_t n, Real h, const Real* v, const Real* a, Real* predicted);

/// Positions after a step: x_next = x + h v½ with v½ = (v + predicted)/2. Returns the largest change of a coordinate.
/// Arrays [n]; x_next may be x.
Real verlet_drift(std::size_t n, Real h, const Real* x, const Real* v, const Real* predicted, Real* x_next);

/// Completes a step where a is the acceleration for the prediction: v becomes v½ + a h/2, and the prediction that for
/// the end of the next step. Returns whether a is finite. Arrays [n].
bool verlet_kick(std::size_t n, Real h, Real* v, const Real* a, Real* predicted);

/// verlet_kick, with the next prediction in a separate array, and verlet_drift, with identical bits.
Real verlet_kick_drift(std::size_t n, Real h, const Real* x, Real* v, const Real* a, const Real* predicted,
                       Real* x_next, Real* predicted_next);

/// Sum and largest of the squares of h_i/tol_i, with tol = absolute + relative · max(|y|, |y_old|) and h_i = factor ·
/// (f_i − f_old_i): the error that a method sees in how much f changes within a step. Arrays [n].
struct WeightedSquares {
  Real sum = 0, largest = 0;
};
WeightedSquares weighted_squares(std::size_t n, Real factor, const Real* f, const Real* f_old, const Real* y,
                                 const Real* y_old, const Real* absolute, const Real* relative);

/// The farthest that a point is from its reference; infinite if some x is NaN. x, reference [points · D].
template <int D>
Real farthest(std::size_t points, const Real* x, const Real* reference);

}  // namespace pliant
