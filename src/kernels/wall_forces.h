// Contact of points with walls: as WallContact, four points at a time.
#pragma once

#include <span>

#include <pliant/geometry/pair_search.h>
#include <pliant/geometry/walls.h>
#include <pliant/kernels/contact_law.h>

namespace pliant {

/// Coefficients of the term WallContact.
struct WallLaw {
  Real epsilon;  ///< energy scale of a contact, ε
  ContactLaw contact = ContactLaw::harmonic;
};

/// Adds −w V'(d) n to f [points · D] for each listed (point, part of the walls): d the distance of the point from the
/// part, n the direction from there, w the weight of the part, V a law with the scale ε and half the point's diameter
/// as its range. Points on a wall feel nothing. diameter: [points]; x: [points · D], and f must not overlap it. The
/// sums follow the order of the list, which is arbitrary. The walls must be resting segments.
template <int D>
void add_wall_forces(const WallLaw& law, std::span<const Pair> pairs, const Walls<D>& walls, const Real* diameter,
                     const Real* x, Real* f);

extern template void add_wall_forces<2>(const WallLaw&, std::span<const Pair>, const Walls<2>&, const Real*,
                                        const Real*, Real*);
extern template void add_wall_forces<3>(const WallLaw&, std::span<const Pair>, const Walls<3>&, const Real*,
                                        const Real*, Real*);

}  // namespace pliant
