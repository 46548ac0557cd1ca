// The scenario `clog`: droplets that attract each other leave a hopper, or clog it [T ch. 4].
#pragma once

#include <vector>

#include <pliant/run/scenario.h>
#include <pliant/scenarios/clog/options.h>

namespace pliant {

Scenario clog_scenario();

/// Random places without overlap [2 · n] for droplets of these radii in the wedge above the closed exit, whose middle
/// is the origin, up to the height at which they cover -fill_fraction of the wedge (or higher if necessary).
std::vector<Real> fill_wedge(const ClogOptions& p, const std::vector<Real>& radii);

/// The granular capillary length δ = sqrt(F_c/(π R ρ g)) of two droplets of the mean radius, in ⟨R⟩; F_c is the force
/// of the depletion at their equilibrium distance [T 4.9, 4.10].
Real capillary_length(const Depletion<2>& depletion, Real g);

}  // namespace pliant
