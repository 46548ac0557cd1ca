// The scenario `hopper`: gravity-driven flow of soft or deformable particles through an orifice [H 2].
#pragma once

#include <vector>

#include <pliant/catalogue/catalogue.h>
#include <pliant/run/scenario.h>

namespace pliant {

/// models: further choices of -model, in addition to sp, rough, smooth and disk.
Scenario hopper_scenario(const std::vector<ModelDefinition>& models = {});

}  // namespace pliant
