// The scenario `hopper`: gravity-driven flow of soft or deformable particles through an orifice [H 2].
#pragma once

#include <pliant/run/scenario.h>

namespace pliant {

Scenario hopper_scenario();

}  // namespace pliant
