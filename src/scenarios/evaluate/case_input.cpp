#include <pliant/geometry/container.h>
#include <pliant/model/polygon.h>
#include <pliant/scenarios/evaluate/case_input.h>

#include <algorithm>
#include <array>

namespace pliant {
namespace {

using Keys = std::vector<std::string_view>;

const std::array<std::string_view, 5> model_names{"SP", "DP", "DP-rough", "DP-smooth", "bubble"};
const std::array<ModelKind, 5> model_kinds{ModelKind::sp, ModelKind::shape, ModelKind::rough, ModelKind::smooth,
                                           ModelKind::bubble};

Keys keys_of(ModelKind kind) {
  Keys polygon{"dim", "vertices", "a0", "l0", "ka", "kl", "kb", "area_energy", "bending_edges"};
  if (kind == ModelKind::shape) return polygon;
  if (kind == ModelKind::bubble)
    return {"dim",    "positions", "R",   "f0",    "phi_c", "a_s",          "b",
            "R_mean", "g",         "rho", "walls", "wedge", "wall_friction"};
  Keys keys{"velocities", "mass", "rho",  "eps_w",   "wall_diameter", "mu",
            "friction",   "zeta", "drag", "gravity", "hopper"};
  const auto add = [&](const Keys& more) { keys.insert(keys.end(), more.begin(), more.end()); };
  if (kind == ModelKind::sp) {
    add({"dim", "positions", "sigma", "eps_sp", "hopper3d", "contact_law"});
  } else {
    add(polygon);
    add({"delta", "eps_c", "shape_terms", "friction_point", "lip_contact", "self_contact"});
    if (kind == ModelKind::rough) add({"rough_contact"});
    if (kind == ModelKind::smooth) add({"contact_law", "edge_force"});
  }
  return keys;
}

/// One of these.
ContactLaw contact_law(const CaseValue& inputs, std::initializer_list<std::string_view> names) {
  const CaseValue law = inputs["contact_law"];
  const std::vector<std::string_view> laws(names);
  const std::string_view name = law.present() ? laws[law.choice(laws)] : "harmonic";
  for (const ContactLaw known : {ContactLaw::hertz, ContactLaw::barrier, ContactLaw::linear})
    if (name == to_string(known)) return known;
  return ContactLaw::harmonic;
}

/// The value that a key names; the first one where it is absent.
template <class E>
E one_of(const CaseValue& key, const std::array<std::string_view, 2>& names, const std::array<E, 2>& values) {
  return values[key.present() ? key.choice(names) : 0];
}

/// A key of another model may stand there as null.
void check_keys(const CaseValue& inputs, std::size_t model) {
  Keys all;
  for (const ModelKind kind : model_kinds)
    for (const std::string_view key : keys_of(kind))
      if (std::find(all.begin(), all.end(), key) == all.end()) all.push_back(key);
  inputs.check_keys(all);
  const Keys own = keys_of(model_kinds[model]);
  for (const std::string& key : inputs.keys())
    if (inputs[key].present() && std::find(own.begin(), own.end(), key) == own.end())
      inputs[key].fail("means nothing to model {}; remove it or set it to null", model_names[model]);
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

/// What all models with contacts share.
template <int D>
void read_surroundings(const CaseValue& inputs, EvaluatedCase<D>& c) {
  c.parameters.epsilon_wall = inputs["eps_w"].number_or(c.parameters.epsilon_wall, Sign::not_negative);
  c.parameters.wall_diameter = inputs["wall_diameter"].number_or(0, Sign::not_negative);
  c.parameters.mu = inputs["mu"].number_or(0, Sign::not_negative);
  c.parameters.friction =
      one_of(inputs["friction"], {"whole", "tangential"}, std::array{Friction::whole, Friction::tangential});
  c.parameters.zeta = inputs["zeta"].number_or(0, Sign::not_negative);
  c.parameters.drag =
      one_of(inputs["drag"], {"per_particle", "per_mass"}, std::array{DragLaw::per_particle, DragLaw::per_mass});
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
  if (self_intersects(x, c.topology, m)) vertices.fail("is an outline that meets itself");
  if (const Real area = polygon_area(x, c.topology, m); !(area > 0))
    vertices.fail("has the signed area {}; give the vertices counter-clockwise", area);
}

}  // namespace

ModelKind read_model(const CaseValue& model, const CaseValue& inputs) {
  const std::size_t i = model.choice(model_names);
  check_keys(inputs, i);
  return model_kinds[i];
}

template <int D>
EvaluatedCase<D> read_soft(const CaseValue& inputs) {
  EvaluatedCase<D> c;
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
  c.parameters.epsilon = inputs["eps_sp"].number(Sign::not_negative);
  c.parameters.law = contact_law(inputs, {"harmonic", "hertz", "linear"});
  read_surroundings(inputs, c);
  return c;
}

template EvaluatedCase<2> read_soft<2>(const CaseValue&);
template EvaluatedCase<3> read_soft<3>(const CaseValue&);

template <int D>
EvaluatedCase<D> read_droplets(const CaseValue& inputs) {
  EvaluatedCase<D> c;
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
  ModelParameters& p = c.parameters;
  p.f0 = inputs["f0"].number_or(p.f0, Sign::not_negative);
  p.phi_c = inputs["phi_c"].number_or(p.phi_c, Sign::not_negative);
  p.a_s = inputs["a_s"].number_or(p.a_s, Sign::positive);
  p.mean_radius = inputs["R_mean"].number_or(p.mean_radius, Sign::positive);
  c.gravity = -inputs["g"].number_or(0) * Vec<D>::Unit(D - 1);
  c.walls = read_solids<D>(inputs);
  c.mobility.b = inputs["b"].number_or(c.mobility.b, Sign::positive);
  c.mobility.beyond_contact = 2 * p.a_s;
  c.mobility.walls = inputs["wall_friction"].flag_or(false);
  return c;
}

template EvaluatedCase<2> read_droplets<2>(const CaseValue&);
template EvaluatedCase<3> read_droplets<3>(const CaseValue&);

EvaluatedCase<2> read_polygons(const CaseValue& inputs, ModelKind kind) {
  EvaluatedCase<2> c;
  c.kind = kind;
  ModelParameters& p = c.parameters;
  if (const CaseValue dim = inputs["dim"]; dim.number_or(2) != 2) dim.fail("must be 2 for polygons");

  const CaseValue vertices = inputs["vertices"], velocities = inputs["velocities"];
  const CaseValue a0 = inputs["a0"], l0 = inputs["l0"], delta = inputs["delta"], mass = inputs["mass"];
  const std::size_t n = vertices.size();
  for (const CaseValue* required : {&a0, &l0}) required->check_size(n, "particle");
  for (const CaseValue* optional : {&delta, &mass, &velocities})
    if (optional->present()) optional->check_size(n, "particle");
  const Real rho = inputs["rho"].number_or(1, Sign::positive);
  const Real width = kind == ModelKind::smooth ? 0.1 : 1;  // δ/l0 of [H 9, App. A]
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

  if (inputs["shape_terms"].flag_or(true)) {
    p.k_a = inputs["ka"].number(Sign::not_negative);
    p.k_l = inputs["kl"].number(Sign::not_negative);
    p.k_b = inputs["kb"].number(Sign::not_negative);
  }
  p.area_energy =
      one_of(inputs["area_energy"], {"absolute", "relative"}, std::array{AreaEnergy::absolute, AreaEnergy::relative});
  p.bending_edges = one_of(inputs["bending_edges"], {"unit", "full"}, std::array{EdgeVectors::unit, EdgeVectors::full});
  p.edge_force = one_of(inputs["edge_force"], {"single", "twofold"}, std::array{EdgeForce::single, EdgeForce::twofold});
  p.epsilon = inputs["eps_c"].number_or(1e4, Sign::not_negative);
  p.law = contact_law(inputs, {"harmonic", "hertz", "barrier"});
  p.friction_point = one_of(inputs["friction_point"], {"vertex", "contact"},
                            std::array{FrictionPoint::vertex, FrictionPoint::contact});
  p.lip_edges = one_of(inputs["lip_contact"], {"literal", "edge"}, std::array{false, true});
  p.self_contact = inputs["self_contact"].flag_or(false);
  p.rough_edges = one_of(inputs["rough_contact"], {"literal", "edge"}, std::array{false, true});
  read_surroundings(inputs, c);
  return c;
}

}  // namespace pliant
