// The table of scenarios of the program and of the Python module.
#pragma once

#include <vector>

#include <pliant/run/scenario.h>

namespace pliant {

std::vector<Scenario> all_scenarios();

}  // namespace pliant
