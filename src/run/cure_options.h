// Which option is the cure that a message advises.
#pragma once

#include <string>

#include <pliant/base/cure.h>
#include <pliant/base/options.h>

namespace pliant {

/// The first option in the table of cures that the scenario has; empty without one.
std::string option_for(Cure cure, const Options& options);

}  // namespace pliant
