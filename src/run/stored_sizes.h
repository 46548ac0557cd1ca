// Particles in a checkpoint whose sizes and masses do not follow from options.
#pragma once

#include <string>

#include <pliant/io/checkpoint.h>
#include <pliant/model/topology.h>
#include <pliant/run/shared_checkpoint.h>

namespace pliant {

/// Writes numbers of points, diameters, masses and rest shapes of all particles, in the order of their ids, under names
/// that begin with `prefix`. Collective.
void save_sizes(const std::string& prefix, const Topology& all, SharedCheckpoint& to);

/// The same particles, to the last bit. Errors: InputError, as of Checkpoint.
Topology read_sizes(const std::string& prefix, int dim, const Checkpoint& from);

}  // namespace pliant
