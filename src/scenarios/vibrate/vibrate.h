// Scenario `vibrate`: particles in a container that is shaken.
#pragma once

#include <pliant/run/scenario.h>

namespace pliant {

Scenario vibrate_scenario();

}  // namespace pliant
