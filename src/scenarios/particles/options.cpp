#include <pliant/scenarios/particles/options.h>

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <vector>

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>
#include <pliant/geometry/mesh.h>
#include <pliant/geometry/off_text.h>
#include <pliant/run/options.h>

namespace pliant {

void bind_sizes(Options& options, SizeDistribution& sizes) {
  constexpr auto fixed = OnRestart::fixed;
  options.bind("size_distribution", sizes.kind,
               {.help = "distribution of diameters, mean about 1",
                .choices = {"bidisperse", "normal", "mono"},
                .on_restart = fixed});
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
               {.help = by_dimension ? "vertices of a deformable particle; 0: 16 in 2D, 42 in 3D (3D: 12, 42, 162, 642)"
                                     : "vertices of a deformable particle",
                .min = by_dimension ? 0.0 : 3.0,
                .max = 10000,
                .cures = {Cure::even_vertices, Cure::more_vertices},
                .on_restart = fixed});
  options.bind("shape_parameter", shape.shape_parameter,
               {.help = by_dimension ? "A0 = perimeter^2/(4 pi area), 3D area^1.5/(6 sqrt(pi) volume); 0: regular"
                                     : "A0 = perimeter^2/(4 pi area); 0: regular",
                .min = 0,
                .cures = {Cure::rounder_shape},
                .on_restart = fixed});
  options.bind("edge_width", shape.edge_width,
               {.help = "smooth particles: width of an edge over its rest length (3D: at most 0.5)",
                .min = 0,
                .max = 1,
                .min_open = true,
                .on_restart = fixed});
}

void bind_mesh(Options& options, std::string& mesh) {
  options.bind("mesh", mesh,
               {.help = "3D: OFF or OBJ file with the shape of particles, instead of an icosphere",
                .on_restart = OnRestart::fixed,
                .read = [](const std::string& file, const std::filesystem::path& folder) {
                  return off_text(read_mesh(path_from(folder, file)));
                }});
}

void resolve_shape(PolygonShape& shape, const std::string& mesh, ModelKind particles, int dim) {
  if (!mesh.empty()) {
    shape.mesh = std::make_shared<TriangleMesh>(mesh_of_off(mesh, "-mesh"));
    shape.vertices = static_cast<Index>(shape.mesh->vertices.size());
  }
  if (shape.vertices == 0) shape.vertices = dim == 2 ? 16 : 42;
  if (shape.vertices < 3) throw InputError("-n_vertices {}: a particle needs at least 3 vertices", shape.vertices);
  // sin²θ = 1 of two edges is 4 edge_width² then (Mollifier).
  constexpr Real widest_edge_of_surface = 0.5;
  if (dim == 3 && particles == ModelKind::smooth && shape.edge_width > widest_edge_of_surface)
    throw InputError(
        "-edge_width {} with -dim 3: contacts of edges that are wider than half their length count less at all angles; "
        "use at most {}",
        shape.edge_width, widest_edge_of_surface);
}

void check_regular_shape(const PolygonShape& shape) {
  if (shape.shape_parameter > 0 && shape.shape_parameter < regular_shape_parameter(shape.vertices))
    throw InputError(
        "-shape_parameter {}: no polygon of {} vertices has less than {:.6g}, the regular one's; raise it or leave it "
        "out",
        shape.shape_parameter, shape.vertices, regular_shape_parameter(shape.vertices));
}

void refuse_unread_particles(const Options& options, const ModelChoice& model, const SizeDistribution& sizes) {
  const std::string by_model = "-model " + model.name, by_sizes = "-size_distribution " + sizes.kind;
  if (!model.deformable()) refuse_unread_by(by_model, options, {"n_vertices", "shape_parameter"});
  if (model.particles() != ModelKind::smooth) refuse_unread_by(by_model, options, {"edge_width"});
  if (sizes.kind != "bidisperse") refuse_unread_by(by_sizes, options, {"size_ratio", "size_fraction"});
  if (sizes.kind != "normal") refuse_unread_by(by_sizes, options, {"size_deviation"});
}

void bind_packing(Options& options, std::optional<Real>& fraction, Real& tolerance) {
  constexpr auto fixed = OnRestart::fixed;
  options.bind("pack_fraction", fraction,
               {.help = "initial packing fraction; deformable: of the disks (spheres) around them",
                .min = 0,
                .max = 0.9,
                .min_open = true,
                .automatic = fmt::format("{} in 2D, {} in 3D", default_pack_fraction(2), default_pack_fraction(3)),
                .on_restart = fixed});
  options.bind("pack_tolerance", tolerance,
               {.help = "largest overlap in the initial packing, divided by the contact distance",
                .min = 1e-12,
                .max = 0.1,
                .on_restart = fixed});
}

Real default_pack_fraction(int dim) { return dim == 2 ? 0.84 : 0.64; }

StartNeeds start_needs(const ModelChoice& model, int dim, const PolygonShape& shape) {
  return {.dim = dim,
          .model = model.name,
          .polygons = model.deformable(),
          .rotates = model.particles() == ModelKind::disk,
          .length = "sigma_avg",
          .edge_width = model.particles() == ModelKind::smooth ? std::optional(shape.edge_width) : std::nullopt};
}

Topology start_topology(const StartOption& start, const ModelChoice& model, int dim, const SizeDistribution& sizes,
                        Index n, std::int64_t seed, const PolygonShape& shape) {
  if (start.given()) return start.particles().topology;
  return make_particles(model.particles(), dim, draw_diameters(sizes, n, static_cast<std::uint64_t>(seed)), shape);
}

void explain_gravitational_units(Options& o) {
  const auto unit = [](const char* name, const char* of) {
    return fmt::format(
        "{} is the unit of {}, as sigma_avg = g = rho = 1 and t0 = sqrt(sigma_avg/g): leave it out, and give the other "
        "options in these units",
        name, of);
  };
  const std::string g = unit("g", "acceleration"), rho = unit("rho", "density"),
                    sigma = unit("sigma_avg, the mean diameter,", "length");
  o.explain_units({{"g", g},
                   {"gravity", g},
                   {"rho", rho},
                   {"density", rho},
                   {"sigma_avg", sigma},
                   {"sigma", sigma},
                   {"diameter", sigma},
                   {"t0", unit("t0", "time")}});
}

void check_dissipation(const ModelChoice& model, const std::string& run, const std::string& source,
                       const std::string& otherwise) {
  const std::vector<const ParameterTable::Entry*> restitution = model.parameters(Role::restitution);
  std::vector<std::string> all, raised;
  for (const ParameterTable::Entry* entry : restitution) {
    if (entry->value() < 1) return;
    all.push_back(fmt::format("-{} {:g}", entry->name, entry->value()));
  }
  for (const Role role : {Role::friction, Role::kinetic_friction, Role::drag})
    for (const ParameterTable::Entry* entry : model.parameters(role)) {
      if (entry->value() > 0) return;
      all.push_back(fmt::format("-{} 0", entry->name));
      raised.push_back(fmt::format("-{}", entry->name));
    }
  throw InputError("{} with {}: nothing dissipates the energy that {}, so it grows without limit; {}set {}{}", run,
                   fmt::join(all, ", "), source,
                   restitution.empty() ? "" : fmt::format("lower -{}, or ", restitution[0]->name), alternatives(raised),
                   otherwise);
}

}  // namespace pliant
