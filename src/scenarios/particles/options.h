// Options of sizes and shapes that scenarios share.
#pragma once

#include <pliant/base/options.h>
#include <pliant/setup/particles.h>

namespace pliant {

/// -size_distribution and the numbers that it reads.
void bind_sizes(Options& options, SizeDistribution& sizes);
/// -n_vertices, -shape_parameter and -edge_width. Where shape.vertices is 0, the default follows from the dimension:
/// resolve_vertices.
void bind_shape(Options& options, PolygonShape& shape);
/// Sets a number of vertices that is 0. Errors: InputError for fewer than 3 vertices.
void resolve_vertices(PolygonShape& shape, int dim);

}  // namespace pliant
