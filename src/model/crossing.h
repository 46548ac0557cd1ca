// Detects vertices that have crossed the outline of another particle, outlines that cross themselves, and outlines that
// meet walls: error states of the deformable models.
#pragma once

#include <optional>

#include <pliant/model/polygon.h>
#include <pliant/model/term.h>

namespace pliant {

struct Crossing {
  Index vertex, particle, other;  ///< vertex (a point) of particle, inside other
};

/// A vertex near the outline of another particle, or near a wall; a lip near an edge.
struct Approach {
  Index vertex;   ///< a point; the first one of the edge
  Index other;    ///< particle; −1: wall
  Real distance;  ///< over the contact distance
};

/// Distances over the contact distance below which contacts are too near.
struct LeastDistances {
  Real outlines = 0;  ///< smallest distance of vertices from outlines
  Real walls = -1;    ///< of vertices from walls, and of edges from lips; negative: not looked for
};

/// Result of a check of all outlines. Distances in σ_avg, of vertices to the outlines of other particles.
struct OutlineLook {
  std::optional<Crossing> crossing;  ///< first vertex, by index, that lies inside another polygon, up to `depth`
  Real gap;    ///< bound: no contact gets too near, and no outline is met, before a point has moved by half of this
  Real depth;  ///< a vertex that is less deep inside a polygon is found
  std::optional<Approach> closest;  ///< the closest of the contacts that are too near
};

/// The lists must be valid. Finds vertices that are up to `deepest` inside, if not deeper. Costs about as much as the
/// contact forces of the listed pairs; if the lists lack vertices and edges, or pairs at such depths, as much as a
/// rebuild of the lists. Threads divide the pairs; the result does not depend on their number.
OutlineLook look_at_outlines(const StateView<2>& s, const LeastDistances& least = {}, Real deepest = 0);

/// A particle whose outline crosses itself, or has turned inside out.
struct SelfCrossing {
  Index particle;
  std::optional<EdgePair> edges;  ///< two edges that meet; none where the outline is only inside out
};

/// How the outlines of all own active particles lie to themselves.
struct SelfLook {
  std::optional<SelfCrossing> crossing;  ///< crossing of the first particle that crosses itself
  Index count = 0;                       ///< particles that cross themselves
  Real gap;  ///< bound for the other particles: no particle crosses itself before a point has moved by half of this
};

/// Costs a few ns per vertex for outlines that are star-shaped about their centres, about ten times as much for other
/// outlines. Threads divide the particles; the result does not depend on their number.
SelfLook look_at_own_outlines(const StateView<2>& s);

/// First vertex, by index, that lies inside the polygon of another particle, at any depth.
std::optional<Crossing> find_crossing(const StateView<2>& s);

/// Whether the closed segment from a to b meets the wall, or one of the segments of the walls at time t.
bool meets(const Vec<2>& a, const Vec<2>& b, const WallSegment& wall);
bool meets(const Vec<2>& a, const Vec<2>& b, const Walls<2>& walls, Real t);

/// Whether an edge of polygon m meets the wall, or one of the segments of the walls. x [points · 2].
bool outline_meets(const Real* x, const Topology& topology, Index m, const WallSegment& wall);
bool outline_meets(const Real* x, const Topology& topology, Index m, const Walls<2>& walls, Real t);

}  // namespace pliant
