// The scenario `hopper`: gravity-driven flow of soft or deformable particles through an orifice [H 2].
#pragma once

#include <vector>

#include <pliant/catalogue/own_model.h>
#include <pliant/run/scenario.h>

namespace pliant {

/// models: what -model can name beside sp, rough and smooth.
Scenario hopper_scenario(std::vector<OwnModel> models = {});

}  // namespace pliant
