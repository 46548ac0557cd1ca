// The passes of velocity Verlet over coordinates.
#pragma once

#include <cstddef>

#include <pliant/base/types.h>

namespace pliant {

/// From (x, v, a) at one time the positions after a step h and the velocities that are predicted for then: with
/// v½ = v + a h/2, x_next = x + h v½ and v_next = v½ + a h/2. Arrays [n]; x_next may be x.
void verlet_predict(std::size_t n, Real h, const Real* x, const Real* v, const Real* a, Real* x_next, Real* v_next);

/// Completes a step at x, where a is the acceleration for the prediction v_predicted: v becomes v½ + a h/2, where
/// v½ = (v + v_predicted)/2 from the step before. Then predicts the next step, to the same bits as verlet_predict.
void verlet_complete(std::size_t n, Real h, const Real* x, Real* v, const Real* a, const Real* v_predicted,
                     Real* x_next, Real* v_next);

/// The same without the next step.
void verlet_complete(std::size_t n, Real h, Real* v, const Real* a, const Real* v_predicted);

/// Sum and largest of the squares of h_i/tol_i, with tol = absolute + relative · max(|y|, |y_old|) and h_i = factor ·
/// (f_i − f_old_i): the error that a method sees in how much f changes within a step. Arrays [n].
struct WeightedSquares {
  Real sum = 0, largest = 0;
};
WeightedSquares weighted_squares(std::size_t n, Real factor, const Real* f, const Real* f_old, const Real* y,
                                 const Real* y_old, const Real* absolute, const Real* relative);

/// Whether no point has moved by more than `limit` from its reference; false for NaN. x, reference [points · D].
template <int D>
bool all_within(std::size_t points, Real limit, const Real* x, const Real* reference);

}  // namespace pliant
