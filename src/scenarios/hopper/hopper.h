// The scenario `hopper`: gravity-driven flow of soft or deformable particles through an orifice [H 2].
#pragma once

#include <pliant/base/ranks.h>
#include <pliant/scenarios/hopper/options.h>

namespace pliant {

/// Runs the scenario, new or continued, and writes its folder. `options` is the registry that `p` is bound to: it is
/// stored with the run. Returns done, or stopped where a checkpoint was written and the same command goes on. Errors:
/// InputError before any work; NumericalError and OutputError with what was written so far intact. Collective; errors
/// are the same on all ranks.
ExitCode run_hopper(HopperOptions& p, Options& options, const Ranks& ranks);

}  // namespace pliant
