// Checks that particles are not within walls and have not passed through each other.
#pragma once

#include <limits>
#include <string>

#include <pliant/base/errors.h>
#include <pliant/base/ranks.h>
#include <pliant/model/term.h>

namespace pliant {

/// Overlap of two particles over their contact distance at which their centres meet, and of a particle with a wall over
/// the radius at which its centre is on the wall. Beyond, they pass through each other, and contact laws are undefined.
constexpr Real passing_overlap = 0.95;

/// Two points and their overlap. gap: the distance by which they may approach before they overlap by passing_overlap;
/// negative beyond.
struct PassingPair {
  Real gap = std::numeric_limits<Real>::infinity();
  Pair points{};
  Real overlap = 0;
};

/// The pair in the neighbour list with the smallest gap, now or in the step of length h that ends here: with its
/// velocities at the end, as if the particles had moved on straight lines. For disks, spheres and droplets. s: with
/// valid lists.
template <int D>
PassingPair nearest_passing_pair(const StateView<D>& s, Real h = 0);

/// The error of point i at a distance d < 0 from a wall: its centre is within a solid or a disk.
NumericalError within_wall(const Topology& topology, Index i, Index wall, Real d, const std::string& cure);

/// For samples, of polygons. Errors: NumericalError on all ranks if a wall segment crosses an outline. `cure` ends the
/// message. Collective.
void check_outlines_meet_no_wall(const StateView<2>& s, const Ranks& ranks, const std::string& cure);

/// For samples. Returns the largest overlap of a point with a wall, over the point's radius, of all ranks; 0 without
/// any. A thin wall has no inside, therefore its overlap is one radius at most. Errors: NumericalError on all ranks if
/// a particle overlaps a wall by more than its radius (its centre, or a vertex of a polygon, is within a solid or a
/// disk), or goes farther than its radius in a step dt, so that it may pass through particles and walls unseen. `cure`
/// ends the message. s: with valid lists. Collective.
template <int D>
Real check_walls_hold(const StateView<D>& s, Real dt, const Ranks& ranks, const std::string& cure);

}  // namespace pliant
