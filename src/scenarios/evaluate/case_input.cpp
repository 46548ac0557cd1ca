#include <pliant/catalogue/parameter_table.h>
#include <pliant/geometry/container.h>
#include <pliant/model/depletion.h>
#include <pliant/model/polygon.h>
#include <pliant/model/surface_crossing.h>
#include <pliant/model/surface_terms.h>
#include <pliant/scenarios/evaluate/case_input.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

namespace pliant {
namespace {

using Keys = std::vector<std::string_view>;

/// A model as files name it.
struct ModelName {
  std::string_view name;
  ModelKind kind;
  bool old = false;    ///< an older name: rules that have a form printed in [H] have it by default
  bool space = false;  ///< an older name of a model of surfaces
};
constexpr std::array<ModelName, 12> model_names{{{"sp", ModelKind::sp},
                                                 {"shape", ModelKind::shape},
                                                 {"rough", ModelKind::rough},
                                                 {"smooth", ModelKind::smooth},
                                                 {"bubble", ModelKind::bubble},
                                                 {"SP", ModelKind::sp, true},
                                                 {"DP", ModelKind::shape, true},
                                                 {"DP-rough", ModelKind::rough, true},
                                                 {"DP-smooth", ModelKind::smooth, true},
                                                 {"DP3", ModelKind::shape, false, true},
                                                 {"DP3-rough", ModelKind::rough, false, true},
                                                 {"DP3-smooth", ModelKind::smooth, false, true}}};

bool deformable(ModelKind kind) {
  return kind == ModelKind::shape || kind == ModelKind::rough || kind == ModelKind::smooth;
}

/// A kind of particles: surfaces are deformable particles in space.
struct Particles {
  ModelKind kind;
  bool surfaces = false;
  bool operator==(const Particles&) const = default;
};
constexpr std::array<Particles, 8> all_particles{{{ModelKind::sp},
                                                  {ModelKind::shape},
                                                  {ModelKind::rough},
                                                  {ModelKind::smooth},
                                                  {ModelKind::bubble},
                                                  {ModelKind::shape, true},
                                                  {ModelKind::rough, true},
                                                  {ModelKind::smooth, true}}};

/// Keys that are not parameters of terms.
Keys keys_of(const Particles& particles) {
  const ModelKind kind = particles.kind;
  if (particles.surfaces) {
    Keys keys{"dim", "positions", "faces", "V0", "a0", "edges", "l0", "theta0"};
    if (kind != ModelKind::shape)
      for (const std::string_view key : {"delta", "velocities", "mass", "rho", "gravity", "shape_terms", "hopper3d"})
        keys.push_back(key);
    if (kind == ModelKind::smooth) keys.push_back("rubbing");  // the touching places, a remark for readers
    return keys;
  }
  const Keys polygon{"dim", "vertices", "a0", "l0"};
  if (kind == ModelKind::shape) return polygon;
  if (kind == ModelKind::bubble) return {"dim", "positions", "R", "b", "g", "rho", "walls", "wedge", "wall_friction"};
  Keys keys{"velocities", "mass", "rho", "gravity", "hopper"};
  const auto add = [&](const Keys& more) { keys.insert(keys.end(), more.begin(), more.end()); };
  if (kind == ModelKind::sp) {
    add({"dim", "positions", "sigma", "hopper3d"});
  } else {
    add(polygon);
    add({"delta", "shape_terms"});
  }
  return keys;
}

ParameterTable parameters_of(const Particles& particles) {
  ParameterTable table;
  table.declare(catalogue_model(particles.kind), !deformable(particles.kind) ? 0 : particles.surfaces ? 3 : 2);
  return table;
}

/// Includes the keys of the parameters.
Keys all_keys(const Particles& particles, const ParameterTable& table) {
  Keys keys = keys_of(particles);
  for (const ParameterTable::Entry& entry : table.entries()) {
    keys.push_back(entry.name);
    if (!entry.alias.empty()) keys.push_back(entry.alias);
  }
  return keys;
}

/// A key of another model is allowed if its value is null.
void check_keys(const CaseValue& inputs, const ModelName& model, const Particles& particles) {
  std::vector<ParameterTable> tables;
  Keys all, own;
  for (const Particles& one : all_particles) tables.push_back(parameters_of(one));
  for (std::size_t k = 0; k < tables.size(); ++k) {
    const Keys keys = all_keys(all_particles[k], tables[k]);
    if (all_particles[k] == particles) own = keys;
    for (const std::string_view key : keys)
      if (std::find(all.begin(), all.end(), key) == all.end()) all.push_back(key);
  }
  inputs.check_keys(all);
  for (const std::string& key : inputs.keys())
    if (inputs[key].present() && std::find(own.begin(), own.end(), key) == own.end())
      inputs[key].fail("is not used by model {}{}; remove it or set it to null", model.name,
                       particles.surfaces && !model.space ? " with dim 3" : "");
}

Real number_in_range(const CaseValue& value, const ParameterTable::Entry& entry) {
  const Real number = value.number(entry.min_open ? Sign::positive : Sign::not_negative);
  if (number > entry.max) value.fail("is {}, but must be at most {}", number, entry.max);
  return number;
}

ParameterValues::Value value_of(const CaseValue& value, const ParameterTable::Entry& entry) {
  switch (entry.kind) {
    case ParameterTable::Kind::flag:
      return value.flag_or(entry.flag) ? 1.0 : 0.0;
    case ParameterTable::Kind::choice: {
      const std::vector<std::string> names = entry.choices();
      return names[value.choice(Keys(names.begin(), names.end()))];
    }
    default:
      return number_in_range(value, entry);
  }
}

/// old_names: gets "ka (k_a)" for each key that is an alias.
ParameterValues read_parameters(const CaseValue& inputs, const ModelName& model, const Particles& particles,
                                std::vector<std::string>& old_names) {
  ParameterValues values;
  const ParameterTable table = parameters_of(particles);
  // Rough surfaces have the rules of the published model: neither faces nor lips touch them unless a case asks for it.
  const bool printed = model.old || (particles.surfaces && particles.kind == ModelKind::rough);
  for (const ParameterTable::Entry& entry : table.entries()) {
    CaseValue value = inputs[entry.name];
    if (!entry.alias.empty())
      if (const CaseValue alias = inputs[entry.alias]; alias.present()) {
        if (value.present()) alias.fail("is an older name of {}, which the file also contains; remove it", entry.name);
        old_names.push_back(fmt::format("{} ({})", entry.alias, entry.name));
        value = alias;
      }
    if (value.present())
      values.set(entry.name, value_of(value, entry));
    else if (printed && !entry.printed.empty())
      values.set(entry.name, entry.printed);
  }
  return values;
}

template <int D>
Walls<D> read_walls(const CaseValue& inputs) {
  const CaseValue hopper = inputs[D == 2 ? "hopper" : "hopper3d"], other = inputs[D == 2 ? "hopper3d" : "hopper"];
  if (other.present()) other.fail("is for another dimension than {}", D);
  if (!hopper.present()) return {};
  Keys keys{"W", "w"};
  if (D == 2) keys.push_back("theta_deg");
  hopper.check_keys(keys);
  Hopper measures;
  measures.wall_distance = hopper["W"].number(Sign::positive);
  measures.orifice = hopper["w"].number(Sign::positive);
  if (!(measures.orifice < measures.wall_distance))
    hopper["w"].fail("is {}, but must be less than W = {}", measures.orifice, measures.wall_distance);
  if (D == 2) {
    measures.angle = hopper["theta_deg"].number(Sign::positive);
    if (measures.angle > 90) hopper["theta_deg"].fail("is {}, but must be at most 90 degrees", measures.angle);
  }
  return Container(measures, {}, CornerRule::literal).walls<D>();
}

/// δ/l0 of [H 9, App. A].
Real usual_width(ModelKind kind) { return kind == ModelKind::smooth ? 0.1 : 1; }

/// Input common to all models with contacts.
template <int D>
void read_surroundings(const CaseValue& inputs, EvaluatedCase<D>& c) {
  if (const CaseValue gravity = inputs["gravity"]; gravity.present()) c.gravity = gravity.vector<D>();
  c.walls = read_walls<D>(inputs);
}

template <int D>
void append(std::vector<Real>& out, const Vec<D>& r) {
  out.insert(out.end(), r.begin(), r.end());
}

template <int D>
Walls<D> read_solids(const CaseValue& inputs) {
  Walls<D> all;
  if (const CaseValue walls = inputs["walls"]; walls.present())
    for (std::size_t k = 0; k < walls.size(); ++k) {
      walls[k].check_keys(std::array<std::string_view, 3>{"point", "normal", "velocity"});
      const CaseValue normal = walls[k]["normal"], velocity = walls[k]["velocity"];
      if (normal.vector<D>().norm() == 0) normal.fail("has no direction");
      all.add(Solid<D>::half_space(walls[k]["point"].vector<D>(), normal.vector<D>()),
              {.velocity = velocity.present() ? velocity.vector<D>() : Vec<D>(Vec<D>::Zero())});
    }
  if (const CaseValue wedge = inputs["wedge"]; wedge.present()) {
    wedge.check_keys(std::array<std::string_view, 3>{"tip", "dir1", "dir2"});
    try {
      all.add(Solid<D>::wedge(wedge["tip"].vector<D>(), wedge["dir1"].vector<D>(), wedge["dir2"].vector<D>()));
    } catch (const InputError& error) {
      wedge.fail("is no corner: {}", error.what());
    }
  }
  return all;
}

void check_outline(const CaseValue& vertices, const EvaluatedCase<2>& c, Index m) {
  const Real* x = c.x.data();
  const Index first = c.topology.offset[m];
  for (Index i = first; i < c.topology.offset[m + 1]; ++i)
    if (point<2>(x, i) == point<2>(x, c.topology.next[i]))
      vertices[i - first].fail("and the next vertex are the same point; an edge must have a length");
  if (self_intersects(x, c.topology, m)) vertices.fail("is an outline that crosses or touches itself");
  if (const Real area = polygon_area(x, c.topology, m); !(area > 0))
    vertices.fail("has the signed area {}; give the vertices counter-clockwise", area);
}

}  // namespace

CaseModel read_model(const CaseValue& model, const CaseValue& inputs) {
  Keys names;
  for (const ModelName& one : model_names) names.push_back(one.name);
  const ModelName& own = model_names[model.choice(names)];
  Particles particles{own.kind, own.space};
  if (const CaseValue dim = inputs["dim"]; !own.old && dim.present() && dim.number() == 3)
    particles.surfaces |= deformable(own.kind);
  check_keys(inputs, own, particles);
  std::vector<std::string> old_names;
  CaseModel result{own.kind, read_parameters(inputs, own, particles, old_names), particles.surfaces};
  if (own.space) old_names.push_back(fmt::format("{} ({} with dim 3)", own.name, to_string(own.kind)));
  if (own.old) {
    const bool other_defaults = own.kind == ModelKind::rough || own.kind == ModelKind::smooth;
    old_names.push_back(
        fmt::format("{} ({}{})", own.name, to_string(own.kind),
                    other_defaults ? ", whose default contacts and friction are not as printed in [H]" : ""));
  }
  if (!old_names.empty())
    result.remark = fmt::format("{}: has names of older versions; the present names are in brackets: {}", model.path(),
                                fmt::join(old_names, ", "));
  return result;
}

template <int D>
EvaluatedCase<D> read_soft(const CaseValue& inputs, const ParameterValues& parameters) {
  EvaluatedCase<D> c;
  c.parameters = parameters;
  c.kind = ModelKind::sp;
  c.topology.dim = D;
  const CaseValue positions = inputs["positions"], velocities = inputs["velocities"], sigma = inputs["sigma"],
                  mass = inputs["mass"];
  const std::size_t n = positions.size();
  sigma.check_size(n, "particle");
  if (mass.present()) mass.check_size(n, "particle");
  if (velocities.present()) velocities.check_size(n, "particle");
  const Real rho = inputs["rho"].number_or(1, Sign::positive);
  for (std::size_t m = 0; m < n; ++m) {
    const Real diameter = sigma[m].number(Sign::positive);
    const Real volume = D == 2 ? pi * square(diameter) / 4 : pi * diameter * square(diameter) / 6;
    c.topology.add_soft(diameter, mass.present() ? mass[m].number(Sign::positive) : rho * volume);
    append<D>(c.x, positions[m].vector<D>());
    append<D>(c.v, velocities.present() ? velocities[m].vector<D>() : Vec<D>(Vec<D>::Zero()));
  }
  read_surroundings(inputs, c);
  return c;
}

template EvaluatedCase<2> read_soft<2>(const CaseValue&, const ParameterValues&);
template EvaluatedCase<3> read_soft<3>(const CaseValue&, const ParameterValues&);

template <int D>
EvaluatedCase<D> read_droplets(const CaseValue& inputs, const ParameterValues& parameters) {
  EvaluatedCase<D> c;
  c.parameters = parameters;
  c.kind = ModelKind::bubble;
  c.topology.dim = D;
  const CaseValue positions = inputs["positions"], radius = inputs["R"];
  const std::size_t n = positions.size();
  radius.check_size(n, "particle");
  const Real rho = inputs["rho"].number_or(1, Sign::positive);
  for (std::size_t m = 0; m < n; ++m) {
    const Real r = radius[m].number(Sign::positive);
    c.topology.add_soft(2 * r, rho * r * square(r));
    append<D>(c.x, positions[m].vector<D>());
  }
  c.v.resize(c.x.size());
  c.gravity = -inputs["g"].number_or(0) * Vec<D>::Unit(D - 1);
  c.walls = read_solids<D>(inputs);
  c.mobility.b = inputs["b"].number_or(c.mobility.b, Sign::positive);
  c.mobility.beyond_contact = configured(c.parameters, Depletion<D>{}).range();
  c.mobility.walls = inputs["wall_friction"].flag_or(false);
  return c;
}

template EvaluatedCase<2> read_droplets<2>(const CaseValue&, const ParameterValues&);
template EvaluatedCase<3> read_droplets<3>(const CaseValue&, const ParameterValues&);

EvaluatedCase<2> read_polygons(const CaseValue& inputs, const CaseModel& model) {
  EvaluatedCase<2> c;
  c.kind = model.kind;
  c.parameters = model.parameters;
  if (const CaseValue dim = inputs["dim"]; dim.number_or(2) != 2) dim.fail("must be 2 for polygons");

  const CaseValue vertices = inputs["vertices"], velocities = inputs["velocities"];
  const CaseValue a0 = inputs["a0"], l0 = inputs["l0"], delta = inputs["delta"], mass = inputs["mass"];
  const std::size_t n = vertices.size();
  for (const CaseValue* required : {&a0, &l0}) required->check_size(n, "particle");
  for (const CaseValue* optional : {&delta, &mass, &velocities})
    if (optional->present()) optional->check_size(n, "particle");
  const Real rho = inputs["rho"].number_or(1, Sign::positive);
  const Real width = usual_width(model.kind);
  for (std::size_t m = 0; m < n; ++m) {
    const std::size_t count = vertices[m].size();
    if (count < 3) vertices[m].fail("has {} vertices, but a polygon needs at least 3", count);
    const Real area = a0[m].number(Sign::positive), length = l0[m].number(Sign::positive);
    c.topology.add_polygon(static_cast<Index>(count), area, length,
                           delta.present() ? delta[m].number(Sign::positive) : width * length,
                           mass.present() ? mass[m].number(Sign::positive) : rho * area);
    if (velocities.present()) velocities[m].check_size(count, "vertex");
    for (std::size_t i = 0; i < count; ++i) {
      append<2>(c.x, vertices[m][i].vector<2>());
      append<2>(c.v, velocities.present() ? velocities[m][i].vector<2>() : Vec<2>(0, 0));
    }
    check_outline(vertices[m], c, static_cast<Index>(m));
  }

  const ParameterTable table = parameters_of({model.kind});
  if (!inputs["shape_terms"].flag_or(true))
    for (const ParameterTable::Entry& entry : table.entries())
      for (const Role role : {Role::area, Role::perimeter, Role::bending})
        if (entry.role == role) c.parameters.set(entry.name, 0.0);
  read_surroundings(inputs, c);
  return c;
}

namespace {

/// A number for all particles, or an array with one per particle.
Real of_particle(const CaseValue& value, std::size_t m) {
  return (value.is_array() ? value[m] : value).number(Sign::positive);
}

TriangleMesh read_surface(const CaseValue& positions, const CaseValue& faces) {
  TriangleMesh mesh;
  for (std::size_t i = 0; i < positions.size(); ++i) mesh.vertices.push_back(positions[i].vector<3>());
  const auto vertices = static_cast<Index>(mesh.vertices.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    faces[f].check_size(3, "vertex");
    Face face;
    for (int k = 0; k < 3; ++k) face[k] = faces[f][k].index(vertices, "vertices");
    mesh.faces.push_back(face);
  }
  return mesh;
}

/// Puts values that the file lists edge by edge in the order of the hinges.
void read_per_edge(const CaseValue& edges, const CaseValue& values, Sign sign, const Surface& surface,
                   std::vector<Real>& out) {
  edges.check_size(surface.hinges.size(), "edge of the faces");
  values.check_size(surface.hinges.size(), "edge");
  std::vector<bool> known(surface.hinges.size());
  for (std::size_t k = 0; k < surface.hinges.size(); ++k) {
    edges[k].check_size(2, "vertex");
    const std::pair<Index, Index> edge =
        std::minmax({edges[k][0].index(surface.points(), "vertices"), edges[k][1].index(surface.points(), "vertices")});
    const auto found =
        std::ranges::find_if(surface.hinges, [&](const Hinge& h) { return h.a == edge.first && h.b == edge.second; });
    if (found == surface.hinges.end()) edges[k].fail("is not an edge of a face; remove it");
    const auto at = static_cast<std::size_t>(found - surface.hinges.begin());
    if (known[at]) edges[k].fail("is an edge that is listed twice; list each edge once");
    known[at] = true;
    out[at] = values[k].number(sign);
  }
}

}  // namespace

EvaluatedCase<3> read_surfaces(const CaseValue& inputs, const CaseModel& model) {
  EvaluatedCase<3> c;
  c.kind = model.kind;
  c.parameters = model.parameters;
  c.topology.dim = 3;
  if (const CaseValue dim = inputs["dim"]; dim.number_or(3) != 3)
    dim.fail("must be 3 for models DP3, DP3-rough and DP3-smooth");
  const CaseValue positions = inputs["positions"], faces = inputs["faces"], velocities = inputs["velocities"];
  const CaseValue volumes = inputs["V0"], areas = inputs["a0"], edges = inputs["edges"], lengths = inputs["l0"],
                  angles = inputs["theta0"], delta = inputs["delta"], mass = inputs["mass"];
  const bool rest = model.kind == ModelKind::shape || volumes.present() || areas.present() || edges.present() ||
                    lengths.present() || angles.present();
  c.shape_terms = rest && inputs["shape_terms"].flag_or(true);
  const bool rest_angles = configured(c.parameters, HingeBending{}).with_rest;
  const std::size_t n = positions.size();
  faces.check_size(n, "particle");
  if (rest)
    for (const CaseValue* required : {&areas, &edges, &lengths}) required->check_size(n, "particle");
  if (rest_angles || angles.present()) angles.check_size(n, "particle");
  for (const CaseValue* optional : {&mass, &velocities})
    if (optional->present()) optional->check_size(n, "particle");
  for (const CaseValue* numbers : {&volumes, &delta})
    if (numbers->is_array()) numbers->check_size(n, "particle");
  const Real rho = inputs["rho"].number_or(1, Sign::positive);

  const auto surfaces = std::make_shared<Surfaces>();
  for (std::size_t m = 0; m < n; ++m) {
    const TriangleMesh mesh = read_surface(positions[m], faces[m]);
    Surface surface;
    try {
      surface = relaxed_surface(mesh);
    } catch (const InputError& error) {
      faces[m].fail("and inputs.positions[{}] do not form a closed surface: {}", m, error.what());
    }
    if (rest) {
      surface.volume = of_particle(volumes, m);
      surface.sigma = sphere_diameter(surface.volume);
      areas[m].check_size(surface.faces.size(), "face");
      for (std::size_t f = 0; f < surface.faces.size(); ++f) surface.rest_area[f] = areas[m][f].number(Sign::positive);
      read_per_edge(edges[m], lengths[m], Sign::positive, surface, surface.rest_length);
      if (angles.present()) read_per_edge(edges[m], angles[m], Sign::any, surface, surface.rest_angle);
    }
    const Real width = delta.present() ? of_particle(delta, m) : usual_width(model.kind) * surface.mean_rest_length();
    const Real own_mass = mass.present() ? mass[m].number(Sign::positive) : rho * surface.volume;
    surfaces->kinds.push_back(surface);
    surfaces->add_particle(c.topology, static_cast<Index>(m), surface.volume, width, own_mass);
    if (velocities.present()) velocities[m].check_size(mesh.vertices.size(), "vertex");
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
      append<3>(c.x, mesh.vertices[i]);
      append<3>(c.v, velocities.present() ? velocities[m][i].vector<3>() : Vec<3>(0, 0, 0));
    }
    if (const SurfaceShape shape = look_at_surface(c.x.data(), c.topology, *surfaces, static_cast<Index>(m));
        shape.least_area < least_face_area)
      faces[m][static_cast<std::size_t>(shape.smallest_face)].fail(
          "has {} of its rest area, but needs at least {}; move one of its vertices", shape.least_area,
          least_face_area);
  }
  c.topology.surfaces = surfaces;
  read_surroundings(inputs, c);
  return c;
}

}  // namespace pliant
