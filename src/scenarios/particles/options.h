// Options of particles that scenarios share.
#pragma once

#include <optional>
#include <string>

#include <pliant/base/options.h>
#include <pliant/catalogue/model_choice.h>
#include <pliant/run/start_particles.h>
#include <pliant/setup/particles.h>

namespace pliant {

/// -size_distribution and the numbers that it reads.
void bind_sizes(Options& options, SizeDistribution& sizes);
/// -n_vertices, -shape_parameter and -edge_width. Where shape.vertices is 0, the default follows from the dimension:
/// resolve_shape.
void bind_shape(Options& options, PolygonShape& shape);
/// -mesh; mesh: text of an OFF file.
void bind_mesh(Options& options, std::string& mesh);
/// Sets a number of vertices that is 0, and the mesh of which `mesh` is the text, if it is not empty. Errors:
/// InputError for a shape that the particles of the model cannot have.
void resolve_shape(PolygonShape& shape, const std::string& mesh, ModelKind particles, int dim);
/// Errors: InputError if the shape parameter is below the shape parameter of the regular polygon.
void check_regular_shape(const PolygonShape& shape);
/// Errors: InputError for an option of shapes or sizes that neither the model nor the distribution of sizes reads.
void refuse_unread_particles(const Options& options, const ModelChoice& model, const SizeDistribution& sizes);

/// -pack_fraction and -pack_tolerance, of the packing without overlaps at the start of a run.
void bind_packing(Options& options, std::optional<Real>& fraction, Real& tolerance);
/// Automatic value of -pack_fraction.
Real default_pack_fraction(int dim);

/// Particles that a run of this model, in units of σ_avg, takes from -start.
StartNeeds start_needs(const ModelChoice& model, int dim, const PolygonShape& shape);
/// The particles of -start or, without this option, n particles with random diameters.
Topology start_topology(const StartOption& start, const ModelChoice& model, int dim, const SizeDistribution& sizes,
                        Index n, std::int64_t seed, const PolygonShape& shape);

/// Explains names that users try for quantities that are 1 in the units σ_avg = g = ρ = 1.
void explain_gravitational_units(Options& options);

/// Errors: InputError if no force of the model dissipates energy. run, source: subject and cause of the message ("a
/// vibrated container", "the walls add"); otherwise: another cure, or empty.
void check_dissipation(const ModelChoice& model, const std::string& run, const std::string& source,
                       const std::string& otherwise);

}  // namespace pliant
