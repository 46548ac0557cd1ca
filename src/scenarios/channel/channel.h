// Scenario `channel`: disks pushed through a channel by plungers, back and forth [T ch. 3].
#pragma once

#include <pliant/run/scenario.h>

namespace pliant {

Scenario channel_scenario();

}  // namespace pliant
