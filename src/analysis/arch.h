// The arch that clogs a hopper, and the role of each droplet in the clog [T Fig. 4.1a].
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

/// Links between droplets, and between droplets and the two walls next to the exit.
struct ClogLinks {
  std::vector<std::pair<Index, Index>> pairs;
  std::vector<Index> left, right;  ///< droplets linked to the left and to the right wall
};

/// The lowest chain of linked droplets from the left wall to the right one, in that order; empty if there is none. The
/// chain is chosen by the lowest highest droplet, then by the fewest droplets, then by the lowest sum of heights.
/// position [N · 2], y up.
std::vector<Index> lowest_chain(std::span<const Real> position, const ClogLinks& links);

/// Colours of [T Fig. 4.1a], as numbers in files.
enum class ClogRole : std::uint8_t {
  gone,     ///< has left
  rest,     ///< above the arch (blue)
  arch,     ///< (red)
  attached  ///< below the arch, held by cohesion alone (yellow)
};

/// The role of each droplet, [N], for this arch, which may be empty: then all are `rest`. A droplet is below the arch
/// if the upright line from its centre meets the line through the arch's centres an odd number of times; this line is
/// extended horizontally beyond its ends.
std::vector<ClogRole> clog_roles(std::span<const Real> position, std::span<const std::uint8_t> active,
                                 std::span<const Index> arch);

}  // namespace pliant
