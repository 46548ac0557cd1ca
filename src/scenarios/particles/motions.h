// The fastest motions of particles, from which scenarios find stable steps.
#pragma once

#include <vector>

#include <pliant/catalogue/model_choice.h>
#include <pliant/model/drag.h>
#include <pliant/ts/integrator.h>

namespace pliant {

/// The rate at which drag damps every oscillation, in 1/t0; 0 for particles with spins, which drag does not damp.
template <int D>
Real drag_rate(const ModelChoice& model, const ForceField<D>& field, const Topology& all) {
  return !field.rotates() && model.value(Role::drag) > 0 ? model.term(Drag<D>{}).min_damping(all) : 0;
}

/// The fastest motions of a dense packing of these particles; critical: the limits of the field.
template <int D>
std::vector<FastestRates> motions_of(const CriticalStep& critical, const ModelChoice& model, const ForceField<D>& field,
                                     const Topology& all) {
  return fastest_motions(critical, drag_rate<D>(model, field, all));
}

}  // namespace pliant
