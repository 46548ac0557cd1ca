// Measurements of particles in a periodic box that the scenarios of packings share.
#pragma once

#include <string_view>
#include <utility>

#include <pliant/run/surface_check.h>
#include <pliant/scenarios/packings/options.h>
#include <pliant/system/stress.h>

namespace pliant {

/// All particles of a run, and the system that they will join in a box of the fraction of the start.
template <int D>
std::pair<Topology, ParticleSystem<D>> particles_in_box(const PackingOptions& p, const Ranks& ranks);

/// Σ a0/V of soft particles, which counts overlaps twice; Σ of the present areas (volumes) over V for deformable
/// particles. x [size of the system]. Collective.
template <int D>
Real packing_fraction(const ParticleSystem<D>& system, const Real* x);

/// The same with the rims of deformable particles: of rough particles the parts of the disks (spheres) around vertices
/// that are outside the particle, of smooth particles all places that are nearer than half a width. Collective.
template <int D>
Real rim_fraction(const ParticleSystem<D>& system, const Real* x, ModelKind particles);

/// Errors: NumericalError, on all ranks, for deformable particles that cross each other or themselves, and surfaces
/// without a meaning. The message of polygons contains `when`, for example "at the minimum". Collective.
template <int D>
void check_crossings(ParticleSystem<D>& system, const Real* x, std::string_view when, const SurfaceCures& cures);

/// Errors: InputError, with the advice `cure`, where soft particles overlap by more than the smaller radius: their
/// contacts then reach beyond the neighbours. On one rank.
template <int D>
void check_overlaps(ParticleSystem<D>& system, const Real* x, std::string_view cure);

extern template std::pair<Topology, ParticleSystem<2>> particles_in_box<2>(const PackingOptions&, const Ranks&);
extern template std::pair<Topology, ParticleSystem<3>> particles_in_box<3>(const PackingOptions&, const Ranks&);
extern template Real packing_fraction<2>(const ParticleSystem<2>&, const Real*);
extern template Real packing_fraction<3>(const ParticleSystem<3>&, const Real*);
extern template Real rim_fraction<2>(const ParticleSystem<2>&, const Real*, ModelKind);
extern template Real rim_fraction<3>(const ParticleSystem<3>&, const Real*, ModelKind);
extern template void check_overlaps<2>(ParticleSystem<2>&, const Real*, std::string_view);
extern template void check_overlaps<3>(ParticleSystem<3>&, const Real*, std::string_view);
extern template void check_crossings<2>(ParticleSystem<2>&, const Real*, std::string_view, const SurfaceCures&);
extern template void check_crossings<3>(ParticleSystem<3>&, const Real*, std::string_view, const SurfaceCures&);

}  // namespace pliant
