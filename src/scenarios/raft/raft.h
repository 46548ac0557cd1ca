// The scenario `raft`: a raft of droplets between two walls, compressed or pulled apart until it breaks [T ch. 2].
#pragma once

#include <array>
#include <vector>

#include <pliant/run/scenario.h>
#include <pliant/scenarios/raft/options.h>

namespace pliant {

Scenario raft_scenario();

/// Places of the droplets of these radii [2 · n], around the origin, rows perpendicular to x: where large droplets of a
/// hexagonal raft rest, `spacing` apart; or disordered: each droplet in contact with two earlier ones, at the free
/// place nearest to the axis, in a strip as wide as p rows.
std::vector<Real> raft_places(const RaftOptions& p, const std::vector<Real>& radii, Real spacing);

/// Rows of a raft, ordered or not: from each droplet at the first wall, the number of droplets in the shortest chain of
/// bonds to the other wall; the median of these, or 0 where no chain reaches. bonds: pairs of droplets.
Index count_rows(Index droplets, const std::vector<std::array<Index, 2>>& bonds, const std::vector<Index>& at_first,
                 const std::vector<Index>& at_second);

}  // namespace pliant
