// Whether particles are where contacts keep them: not within walls, not through each other.
#pragma once

#include <string>

#include <pliant/base/ranks.h>
#include <pliant/model/term.h>

namespace pliant {

/// Overlap of two particles, over their contact distance, from which on their centres have met: they pass through each
/// other, and no contact law means anything.
constexpr Real passing_overlap = 0.95;

/// For samples. Errors: NumericalError on all ranks where a particle overlaps a wall by more than its radius (its
/// centre, or a vertex of a polygon, is within a solid or a disk), or goes farther than its radius in a step dt, so
/// that it may pass through particles and walls unseen. `cure` ends the message. s: with valid lists. Collective.
template <int D>
void check_walls_hold(const StateView<D>& s, Real dt, const Ranks& ranks, const std::string& cure);

}  // namespace pliant
