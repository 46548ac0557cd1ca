// Contact and friction of point pairs in one pass: as PairContact and PairFriction, four pairs at a time.
#pragma once

#include <span>

#include <pliant/geometry/pair_search.h>
#include <pliant/kernels/contact_law.h>

namespace pliant {

/// Coefficients of the terms PairContact and PairFriction.
struct PairContactLaw {
  Real epsilon;  ///< energy scale of a contact, ε
  ContactLaw contact = ContactLaw::harmonic;
};
struct PairFrictionLaw {
  Real mu;                  ///< friction coefficient; 0: velocities are not read and may be null
  bool tangential = false;  ///< friction opposes only the part of v_i − v_j normal to r
};
struct PairLaw : PairContactLaw, PairFrictionLaw {};

/// The points of a pair that receive its force. A pair between two chunks is listed in both, once from each side, and
/// `second` is then only read.
enum class Sides { both, first };

/// Adds the forces of the listed pairs to f [points · D]: i = pair.first gets −V'(d) r/d − μ (v_i − v_j), where
/// r = x_i − x_j and d = |r| < δ, and pair.second the opposite. Coincident points feel friction only. reach: δ of each
/// pair [pairs]; x, v: [points · D], and f must not overlap them. The sums follow the order of the list, which is
/// arbitrary.
template <int D>
void add_pair_forces(const PairLaw& law, std::span<const Pair> pairs, const Real* reach, Sides sides, const Real* x,
                     const Real* v, Real* f);

extern template void add_pair_forces<2>(const PairLaw&, std::span<const Pair>, const Real*, Sides, const Real*,
                                        const Real*, Real*);
extern template void add_pair_forces<3>(const PairLaw&, std::span<const Pair>, const Real*, Sides, const Real*,
                                        const Real*, Real*);

}  // namespace pliant
