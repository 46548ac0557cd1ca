// Options of sizes and shapes that scenarios share.
#pragma once

#include <pliant/base/options.h>
#include <pliant/setup/particles.h>

namespace pliant {

/// -size_distribution and the numbers that it reads.
void bind_sizes(Options& options, SizeDistribution& sizes);
/// -n_vertices, -shape_parameter and -edge_width.
void bind_shape(Options& options, PolygonShape& shape);

}  // namespace pliant
