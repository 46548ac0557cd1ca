// Time steps of a hopper: the default step, and the rates that limit the step of each integrator.
#pragma once

#include <functional>
#include <vector>

#include <pliant/model/crossing.h>
#include <pliant/model/force_field.h>
#include <pliant/scenarios/hopper/options.h>
#include <pliant/ts/stability.h>

namespace pliant {

/// All times in t0.
struct HopperSteps {
  Real dt = 0;                        ///< -dt, or its automatic value
  Real critical = 0;                  ///< limit of velocity Verlet
  std::vector<FastestRates> motions;  ///< rates of positions and of angles
  /// Contacts of a barrier that are stiff enough to make a fixed step dt critical.
  std::function<LeastDistances(Real dt)> least_distances;
  Real bending_rate = 0;  ///< rate of bending with unit vectors, edges at rest length; it grows as edges shrink
};

/// all: the particles of the run.
template <int D>
HopperSteps hopper_steps(const HopperOptions& options, const Topology& all, const ForceField<D>& field);

}  // namespace pliant
