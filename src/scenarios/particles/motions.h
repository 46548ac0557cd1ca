// The fastest motions of particles, from which scenarios find stable steps.
#pragma once

#include <vector>

#include <pliant/catalogue/model_choice.h>
#include <pliant/model/drag.h>
#include <pliant/ts/integrator.h>

namespace pliant {

/// Of a dense packing of these particles. Drag damps every oscillation, unless particles have spins, which it does not
/// damp.
template <int D>
std::vector<FastestRates> motions_of(const ModelChoice& model, const ForceField<D>& field, const Topology& all) {
  const bool damped = !field.rotates() && model.value(Role::drag) > 0;
  return fastest_motions(field.critical_step(all), damped ? model.term(Drag<D>{}).min_damping(all) : 0);
}

}  // namespace pliant
