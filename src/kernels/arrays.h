// Loops over whole arrays of numbers.
#pragma once

#include <cstddef>

#include <pliant/base/types.h>

namespace pliant {

/// Index of the first inf or NaN in a[n]; n if there is none.
std::size_t first_non_finite(const Real* a, std::size_t n);

/// Σ a_i b_i over n numbers, in their order.
Real dot(const Real* a, const Real* b, std::size_t n);

/// difference_i = a_i − b_i of n numbers.
void subtract(const Real* a, const Real* b, std::size_t n, Real* __restrict__ difference);

}  // namespace pliant
