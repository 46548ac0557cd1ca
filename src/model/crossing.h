// Detects vertices that have crossed the outline of another particle: an error state of the deformable models.
#pragma once

#include <optional>

#include <pliant/model/term.h>

namespace pliant {

struct Crossing {
  Index vertex, particle, other;  ///< vertex (a point) of particle, inside other
};

/// First vertex, by index, that lies inside the polygon of a neighbour. Needs valid neighbour lists.
std::optional<Crossing> find_crossing(const StateView<2>& s);

}  // namespace pliant
