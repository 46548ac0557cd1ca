// Recursive coordinate bisection: a box of space for every rank.
#pragma once

#include <vector>

#include <pliant/base/ranks.h>

namespace pliant {

/// The destination rank of each particle of this rank. The box around all centres [n · D] is cut across its longer side
/// so that the weights [n] of the two parts are as the numbers of ranks on either side, and so on. Collective.
template <int D>
std::vector<int> bisect(const Ranks& ranks, const std::vector<Real>& centres, const std::vector<Real>& weights);

}  // namespace pliant
