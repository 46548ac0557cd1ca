// The scenarios of jammed packings in a periodic box.
#pragma once

#include <pliant/run/scenario.h>

namespace pliant {

/// `pack`: packings at given pressures or fractions.
Scenario pack_scenario();
/// `shear`: a packing, and quasistatic simple shear of it.
Scenario shear_scenario();

}  // namespace pliant
