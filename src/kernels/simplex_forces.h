// Contact and friction of the vertices, edges and faces of closed surfaces: as the terms VertexFaceContact,
// EdgePairContact and SimplexFriction, four elements at a time.
#pragma once

#include <array>
#include <span>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

/// A vertex and a face, or two edges, of two closed surfaces.
struct SimplexPair {
  std::array<Index, 4> points;  ///< of the first simplex, then of the second one
  Index element;                ///< its number in the neighbour list
  Real delta;                   ///< contact distance
  /// Vertex and face: 1/(2k) for each corner of the face, where k faces meet. Edges: first s0 of the mollifier.
  std::array<Real, 3> factors;
};

struct SimplexLaw {
  Real epsilon;             ///< energy scale of a contact, ε
  Real mu;                  ///< friction coefficient; 0: velocities are not read and may be null
  bool tangential = false;  ///< friction opposes only the part of the relative velocity along the surfaces
  Real s0 = 0;              ///< s0 of the mollifier; 0: from the pairs
};

/// The points that receive forces: f is neither read nor written elsewhere.
struct PointRange {
  Index first, last;
};

/// Adds the forces of vertices and faces to f. x, v and f are [points · 3]. A pair that does not touch adds nothing;
/// the order of the list is the order of the sums. Friction acts here only where the nearest place is inside the face;
/// the other touching pairs are appended to `on_rim`, if there is friction.
void add_vertex_face_forces(const SimplexLaw& law, std::span<const SimplexPair> pairs, PointRange own, const Real* x,
                            const Real* v, Real* f, std::vector<Index>& on_rim);
/// The same for pairs of edges, which have friction where the nearest places are inside both edges.
void add_edge_pair_forces(const SimplexLaw& law, std::span<const SimplexPair> pairs, PointRange own, const Real* x,
                          const Real* v, Real* f);

/// Appends to `near` the vertices and faces, in their order, that are nearer to each other than delta + range, and
/// perhaps a few of the others.
void add_near_vertex_faces(std::span<const SimplexPair> pairs, Real range, const Real* x,
                           std::vector<SimplexPair>& near);
void add_near_edge_pairs(std::span<const SimplexPair> pairs, Real range, const Real* x, std::vector<SimplexPair>& near);

}  // namespace pliant
