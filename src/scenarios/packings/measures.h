// Measurements of particles in a periodic box that the scenarios of packings share.
#pragma once

#include <string_view>
#include <vector>

#include <pliant/system/particle_system.h>

namespace pliant {

/// The upper triangle of a symmetric matrix: xx, xy, yy; in 3D xx, xy, xz, yy, yz, zz.
template <int D>
std::vector<Real> upper_triangle(const Mat<D>& m) {
  std::vector<Real> values;
  for (int a = 0; a < D; ++a)
    for (int b = a; b < D; ++b) values.push_back((m(a, b) + m(b, a)) / 2);
  return values;
}

/// A square or cube with this packing fraction of particles in their rest shapes.
template <int D>
Box<D> box_of_fraction(const Topology& particles, Real fraction);

/// Σ a0/V of soft particles, which counts overlaps twice; Σ of the present areas over V for polygons. x [size of the
/// system].
template <int D>
Real packing_fraction(const ParticleSystem<D>& system, const Real* x);

/// Errors: NumericalError where the outline of a polygon crosses itself, or a vertex lies inside another polygon. The
/// message contains `when`, for example "at the minimum", and `cure`, the advice to the user.
template <int D>
void check_outlines(ParticleSystem<D>& system, const Real* x, std::string_view when, std::string_view cure);

/// Errors: InputError where soft particles overlap by more than the smaller radius: their contacts then reach beyond
/// the neighbours.
template <int D>
void check_overlaps(ParticleSystem<D>& system, const Real* x);

extern template Box<2> box_of_fraction<2>(const Topology&, Real);
extern template Box<3> box_of_fraction<3>(const Topology&, Real);
extern template Real packing_fraction<2>(const ParticleSystem<2>&, const Real*);
extern template Real packing_fraction<3>(const ParticleSystem<3>&, const Real*);
extern template void check_overlaps<2>(ParticleSystem<2>&, const Real*);
extern template void check_overlaps<3>(ParticleSystem<3>&, const Real*);
extern template void check_outlines<2>(ParticleSystem<2>&, const Real*, std::string_view, std::string_view);
extern template void check_outlines<3>(ParticleSystem<3>&, const Real*, std::string_view, std::string_view);

}  // namespace pliant
