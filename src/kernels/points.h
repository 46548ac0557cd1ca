// Loops over the points of particles, with one value per particle.
#pragma once

#include <pliant/base/types.h>

namespace pliant {

/// f_i = values[m] g for the points i of particles m = first … last−1, which are offset[m] … offset[m+1]−1.
/// f [points · D].
template <int D>
void set_points(const Index* offset, const Real* values, Index first, Index last, const Vec<D>& g, Real* f);

/// f_i ← values[m] f_i. Returns whether all results are finite. f [points · D]; D = 1 for numbers.
template <int D>
bool scale_points(const Index* offset, const Real* values, Index first, Index last, Real* f);

}  // namespace pliant
