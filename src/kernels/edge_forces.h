// Contact and friction of smooth deformable particles in one pass over the vertex–edge pairs.
#pragma once

#include <span>
#include <vector>

#include <pliant/base/types.h>
#include <pliant/geometry/pair_search.h>
#include <pliant/kernels/contact_law.h>

namespace pliant {

/// Coefficients of the terms EdgeContact and EdgeFriction.
struct EdgeContactLaw {
  Real epsilon;  ///< energy scale of a contact, ε
  ContactLaw contact = ContactLaw::harmonic;
  Real edge_weight = 1, vertex_weight = 1;  ///< weights of the two parts of the contact
};
struct EdgeFrictionLaw {
  Real mu;                  ///< friction coefficient; 0: velocities are not read and may be null
  bool at_contact;          ///< friction acts at the point of the contact; false: at the edge's first vertex
  bool tangential = false;  ///< friction opposes only the part of the relative velocity along the outline
};
struct EdgeLaw : EdgeContactLaw, EdgeFrictionLaw {};

/// Adds the forces of all pairs to f. pairs[n] is (vertex, first vertex of the edge), reach[n] its δ_mn; next [points]
/// is the cyclic successor; x, v and f are [points · 2]. Every pair that does not touch adds nothing, so lists may be
/// as generous as they like; the order of the list is the order of the sums.
void add_edge_forces(const EdgeLaw& law, std::span<const Pair> pairs, const Real* reach, const Index* next,
                     const Real* x, const Real* v, Real* f);

/// The same for a part of the points: only points own_first … own_last−1 receive forces, f is neither read nor written
/// elsewhere.
void add_edge_forces(const EdgeLaw& law, std::span<const Pair> pairs, const Real* reach, const Index* next,
                     Index own_first, Index own_last, const Real* x, const Real* v, Real* f);

/// Adds to `near` and `near_reach` the pairs, in their order, whose vertex is nearer to the edge than reach[n] + range,
/// and perhaps a few of the others.
void add_near_pairs(std::span<const Pair> pairs, const Real* reach, Real range, const Index* next, const Real* x,
                    std::vector<Pair>& near, std::vector<Real>& near_reach);

}  // namespace pliant
