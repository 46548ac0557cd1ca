// Scenario `channel`: disks that plungers push through a channel, back and forth [T 3].
#pragma once

#include <pliant/run/scenario.h>

namespace pliant {

Scenario channel_scenario();

}  // namespace pliant
