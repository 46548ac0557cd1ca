// Measurements of particles in a periodic box that the scenarios of packings share.
#pragma once

#include <string_view>
#include <utility>

#include <pliant/scenarios/packings/options.h>
#include <pliant/system/stress.h>

namespace pliant {

/// All particles of a run, and the system that they will join in a box of the fraction of the start. Errors: InputError
/// on several ranks.
template <int D>
std::pair<Topology, ParticleSystem<D>> particles_in_box(const PackingOptions& p, const Ranks& ranks);

/// Σ a0/V of soft particles, which counts overlaps twice; Σ of the present areas over V for polygons. x [size of the
/// system].
template <int D>
Real packing_fraction(const ParticleSystem<D>& system, const Real* x);

/// Errors: NumericalError where the outline of a polygon crosses itself, or a vertex lies inside another polygon. The
/// message contains `when`, for example "at the minimum", and `cure`, the advice to the user.
template <int D>
void check_outlines(ParticleSystem<D>& system, const Real* x, std::string_view when, std::string_view cure);

/// Errors: InputError, with the advice `cure`, where soft particles overlap by more than the smaller radius: their
/// contacts then reach beyond the neighbours.
template <int D>
void check_overlaps(ParticleSystem<D>& system, const Real* x, std::string_view cure);

extern template std::pair<Topology, ParticleSystem<2>> particles_in_box<2>(const PackingOptions&, const Ranks&);
extern template std::pair<Topology, ParticleSystem<3>> particles_in_box<3>(const PackingOptions&, const Ranks&);
extern template Real packing_fraction<2>(const ParticleSystem<2>&, const Real*);
extern template Real packing_fraction<3>(const ParticleSystem<3>&, const Real*);
extern template void check_overlaps<2>(ParticleSystem<2>&, const Real*, std::string_view);
extern template void check_overlaps<3>(ParticleSystem<3>&, const Real*, std::string_view);
extern template void check_outlines<2>(ParticleSystem<2>&, const Real*, std::string_view, std::string_view);
extern template void check_outlines<3>(ParticleSystem<3>&, const Real*, std::string_view, std::string_view);

}  // namespace pliant
