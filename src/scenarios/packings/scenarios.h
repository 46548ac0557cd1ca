// The scenarios of jammed packings in a periodic box.
#pragma once

#include <pliant/run/scenario.h>

namespace pliant {

/// `pack`: packings at given pressures or fractions.
Scenario pack_scenario();
/// `shear`: a packing, and simple shear of it, in quasistatic steps or at a finite rate.
Scenario shear_scenario();

}  // namespace pliant
