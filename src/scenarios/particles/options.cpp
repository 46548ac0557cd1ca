#include <pliant/scenarios/particles/options.h>

#include <pliant/base/errors.h>

namespace pliant {

void bind_sizes(Options& options, SizeDistribution& sizes) {
  constexpr auto fixed = OnRestart::fixed;
  options.bind(
      "size_distribution", sizes.kind,
      {.help = "distribution of diameters, mean 1", .choices = {"bidisperse", "normal", "mono"}, .on_restart = fixed});
  options.bind(
      "size_ratio", sizes.ratio,
      {.help = "bidisperse: large diameter divided by small diameter", .min = 1, .max = 10, .on_restart = fixed});
  options.bind("size_fraction", sizes.fraction,
               {.help = "bidisperse: fraction of large particles by number", .min = 0, .max = 1, .on_restart = fixed});
  options.bind("size_deviation", sizes.deviation,
               {.help = "normal: standard deviation of the diameter",
                .unit = "sigma_avg",
                .min = 0,
                .max = 0.3,
                .cures = {Cure::equal_sizes},
                .on_restart = fixed});
}

void bind_shape(Options& options, PolygonShape& shape) {
  constexpr auto fixed = OnRestart::fixed;
  const bool by_dimension = shape.vertices == 0;
  options.bind("n_vertices", shape.vertices,
               {.help = by_dimension ? "vertices of a deformable particle; 0: 16 in 2D, 42 in 3D (12, 42, 162 or 642)"
                                     : "vertices of a deformable particle",
                .min = by_dimension ? 0.0 : 3.0,
                .max = 10000,
                .cures = {Cure::even_vertices, Cure::more_vertices},
                .on_restart = fixed});
  options.bind("shape_parameter", shape.shape_parameter,
               {.help = "A0 = perimeter^2/(4 pi area), 3D area^1.5/(6 sqrt(pi) volume); 0: regular",
                .min = 0,
                .cures = {Cure::rounder_shape},
                .on_restart = fixed});
  options.bind("edge_width", shape.edge_width,
               {.help = "smooth particles: width of an edge, divided by its rest length",
                .min = 0,
                .max = 1,
                .min_open = true,
                .on_restart = fixed});
}

void resolve_vertices(PolygonShape& shape, int dim) {
  if (shape.vertices == 0) shape.vertices = dim == 2 ? 16 : 42;
  if (shape.vertices < 3) throw InputError("-n_vertices {}: a particle needs at least 3 vertices", shape.vertices);
}

}  // namespace pliant
