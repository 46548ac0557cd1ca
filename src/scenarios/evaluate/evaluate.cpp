#include <pliant/base/console.h>
#include <pliant/base/text.h>
#include <pliant/model/crossing.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/polygon.h>
#include <pliant/model/simplex_contact.h>
#include <pliant/model/surface_crossing.h>
#include <pliant/scenarios/evaluate/case_input.h>
#include <pliant/scenarios/evaluate/evaluate.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>

namespace pliant {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

/// Refuses places where a force has no direction, which a run never reaches.
template <int D>
void check_directions(const StateView<D>& s, bool lip_edges, const std::string& file) {
  const Topology& topology = s.topology;
  const auto named = [&](Index i) {
    const Index m = topology.particle[i];
    if (!topology.deformable()) return fmt::format("inputs.positions[{}]", m);
    return fmt::format("inputs.{}[{}][{}]", D == 2 ? "vertices" : "positions", m, i - topology.offset[m]);
  };
  const auto refuse = [&](Index i, const std::string& place) {
    throw InputError("{}: {} is at no distance from {}, where the force has no direction; move it", file, named(i),
                     place);
  };
  for (const auto [i, j] : s.neighbours.point_pairs)
    if ((s.position(i) - s.position(j)).squaredNorm() == 0) refuse(std::max(i, j), named(std::min(i, j)));
  for (const auto [i, wall] : s.neighbours.walls)
    if (!s.walls.solid(wall, s.t) && s.walls.distance(s.position(i), wall, s.t) == 0) refuse(i, "a wall of the hopper");
  if constexpr (D == 2) {
    const auto on_edge = [&](const Vec<2>& r, Index a) {
      return segment_foot(r, s.position(a), s.position(topology.next[a])).d2 == 0;
    };
    for (const auto [i, a] : s.neighbours.vertex_edges)
      if (on_edge(s.position(i), a)) refuse(i, "the edge from " + named(a));
    for (const auto [lip, a] : s.neighbours.lips)
      if (lip_edges && on_edge(s.walls.lip(lip, s.t), a))
        throw InputError(
            "{}: a lip of inputs.hopper lies on the edge from {}, where the force has no direction; move it", file,
            named(a));
  }
  if constexpr (D == 3) {
    for (Index e = 0; e < s.neighbours.vertex_faces.size(); ++e)
      if (const VertexFace pair(s, e); VertexOnFace(pair.r).d2() == 0)
        refuse(pair.points[0], fmt::format("face {} of particle {}", pair.face, pair.particle));
    for (Index e = 0; e < s.neighbours.edge_pairs.size(); ++e)
      if (const EdgeEdge pair(s, e, 0); EdgeOnEdge(pair.r).d2() == 0)
        refuse(pair.points[0], fmt::format("the edge between {} and {}", named(pair.points[2]), named(pair.points[3])));
    for (const auto [lip, edge] : s.neighbours.lips) {
      const auto [a, b] = points_of_edge(topology, edge);
      if (lip_edges &&
          foot_on_segment<3>(s.walls.lip(lip, s.position(a), s.position(b), s.t), s.position(a), s.position(b)).d2 == 0)
        refuse(a, "the lip of inputs.hopper3d on an edge");
    }
  }
}

/// Distances to an outline are unsigned: inside it the force of a contact with an edge would pull further in.
void check_crossing(const EvaluatedCase<2>& c, const std::string& file) {
  const Neighbours<2> none({}, 0);
  const auto crossing = find_crossing({c.x.data(), c.v.data(), c.topology, none, c.walls});
  if (crossing)
    throw InputError(
        "{}: inputs.vertices[{}][{}] lies inside particle {}, where contacts with edges have no meaning; move it "
        "outside",
        file, crossing->particle, crossing->vertex - c.topology.offset[crossing->particle], crossing->other);
}

void check_piercing(const EvaluatedCase<3>& c, const std::string& file) {
  const Neighbours<3> none({}, 0);
  const auto piercing = look_at_surfaces({c.x.data(), c.v.data(), c.topology, none, c.walls}).piercing;
  if (piercing)
    throw InputError(
        "{}: the edge between inputs.positions[{}][{}] and [{}] pierces face {} of particle {}, where contacts have no "
        "meaning; move them apart",
        file, piercing->particle, piercing->a, piercing->b, piercing->face, piercing->other);
}

/// Vectors per point in the layout of the positions; vectors per vertex grouped by particle.
template <int D>
ordered_json rows(const Topology& topology, const std::vector<Real>& f) {
  const auto row = [&](Index i) {
    const auto r = point<D>(f.data(), i);
    return ordered_json(std::vector<Real>(r.begin(), r.end()));
  };
  ordered_json all = ordered_json::array();
  for (Index m = 0; m < topology.particles(); ++m) {
    if (!topology.deformable()) {
      all.push_back(row(m));
      continue;
    }
    ordered_json outline = ordered_json::array();
    for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) outline.push_back(row(i));
    all.push_back(std::move(outline));
  }
  return all;
}

ordered_json per_particle(const std::vector<Real>& values) {
  return values.size() == 1 ? ordered_json(values[0]) : ordered_json(values);
}

/// Neighbours of each droplet, and the velocities for these forces.
template <int D>
void add_motion(const EvaluatedCase<D>& c, const StateView<D>& s, const std::vector<Real>& force,
                ordered_json& result) {
  std::vector<std::vector<Index>> near(c.topology.particles());
  for (Index e = 0; e < s.neighbours.point_pairs.size(); ++e) {
    const auto [i, j] = s.neighbours.point_pairs[e];
    if ((s.position(i) - s.position(j)).norm() >= s.neighbours.point_pairs.reach[e] + c.mobility.beyond_contact)
      continue;
    near[i].push_back(j);
    near[j].push_back(i);
  }
  for (auto& list : near) std::sort(list.begin(), list.end());
  result["neighbours"] = near;
  std::vector<Real> velocity(force.size());
  std::vector<Index> numbers(c.topology.points());
  std::iota(numbers.begin(), numbers.end(), 0);
  NeighbourDrag<D> mobility(c.mobility);
  mobility.set_numbers(std::move(numbers));
  mobility.solve(s, force.data(), velocity.data());
  result["velocity"] = rows<D>(c.topology, velocity);
}

void check_finite(const std::vector<Real>& values, std::string_view term, const std::string& file) {
  if (!std::all_of(values.begin(), values.end(), [](Real a) { return std::isfinite(a); }))
    throw NumericalError("{}: {} is beyond the range of numbers; check the sizes and coefficients", file, term);
}

Surroundings<2> surroundings_of(const EvaluatedCase<2>& c) { return {.gravity = c.gravity}; }
Surroundings<3> surroundings_of(const EvaluatedCase<3>& c) {
  return {.gravity = c.gravity, .shape_terms = c.shape_terms};
}

/// Vertices and edges of smooth surfaces have terms of their own, "contact_vertex" and "contact_edge": adds "contact",
/// their sum.
void add_sums(ordered_json& terms) {
  const auto sum = [](const auto& self, const ordered_json& a, const ordered_json& b) -> ordered_json {
    if (!a.is_array()) return a.get<Real>() + b.get<Real>();
    ordered_json all = ordered_json::array();
    for (std::size_t k = 0; k < a.size(); ++k) all.push_back(self(self, a[k], b[k]));
    return all;
  };
  for (const std::string name : {"contact", "friction"})
    if (terms.contains(name + "_vertex")) terms[name] = sum(sum, terms[name + "_vertex"], terms[name + "_edge"]);
}

template <int D>
ordered_json results(const EvaluatedCase<D>& c, const std::string& file) {
  ParameterValues parameters = c.parameters;
  const auto model = make_force_field<D>(c.kind, parameters, surroundings_of(c));
  Neighbours<D> neighbours(model->needs(), 0);
  neighbours.rebuild(c.topology, c.walls, c.x.data());
  const StateView<D> s{c.x.data(), c.v.data(), c.topology, neighbours, c.walls};
  check_directions(s, configured(parameters, LipContact{}).with_edges, file);

  ordered_json energy = ordered_json::object(), force = ordered_json::object();
  for (const TermReport& term : model->report(s)) {
    if (term.is_energy) {
      check_finite({term.energy}, fmt::format("the energy \"{}\"", term.name), file);
      energy[term.name] = term.particle_energy.empty() ? ordered_json(term.energy) : per_particle(term.particle_energy);
    }
    check_finite(term.force, fmt::format("the force \"{}\"", term.name), file);
    force[term.name] = rows<D>(c.topology, term.force);
  }
  add_sums(energy);
  add_sums(force);
  std::vector<Real> total(c.x.size());
  model->forces(s, total.data());
  check_finite(total, "the total force", file);
  force["total"] = rows<D>(c.topology, total);

  ordered_json result = ordered_json::object();
  if (c.topology.surfaces) {
    std::vector<Real> volumes;
    for (Index m = 0; m < c.topology.particles(); ++m)
      volumes.push_back(surface_volume(s.x, c.topology, c.topology.surfaces->of(c.topology, m), m));
    check_finite(volumes, "the volume", file);
    result["volume"] = per_particle(volumes);
  }
  if constexpr (D == 2) {
    if (c.topology.deformable()) {
      std::vector<Real> areas;
      for (Index m = 0; m < c.topology.particles(); ++m) areas.push_back(polygon_area(s.x, c.topology, m));
      check_finite(areas, "the area", file);
      result["area"] = per_particle(areas);
    }
  }
  result["energy"] = std::move(energy);
  result["force"] = std::move(force);
  if (c.kind == ModelKind::bubble) add_motion(c, s, total, result);
  return result;
}

void write(const ordered_json& value, const std::string& indent, std::string& out) {
  const auto list = [&](char open, char close, bool lines, auto&& item) {
    const std::string inner = indent + "  ";
    out += open;
    bool first = true;
    for (auto it = value.begin(); it != value.end(); ++it, first = false) {
      if (!first) out += lines ? "," : ", ";
      if (lines) out += "\n" + inner;
      item(it, inner);
    }
    if (lines && !first) out += "\n" + indent;
    out += close;
  };
  if (value.is_object()) {
    list('{', '}', true, [&](auto it, const std::string& inner) {
      out += ordered_json(it.key()).dump() + ": ";
      write(*it, inner, out);
    });
  } else if (value.is_array()) {
    const bool nested =
        std::any_of(value.begin(), value.end(), [](const ordered_json& a) { return a.is_structured(); });
    list('[', ']', nested, [&](auto it, const std::string& inner) { write(*it, inner, out); });
  } else {
    out += value.is_number_float() ? fmt::format("{:.17g}", value.get<Real>()) : value.dump();
  }
}

}  // namespace

json read_case(const std::string& file) {
  constexpr std::size_t largest = 64 << 20;
  constexpr int deepest = 64;
  const std::string text = read_text_file(file, largest, "case file");
  std::string last_key;
  std::vector<std::set<std::string>> keys;  // keys of the open objects
  const auto look = [&](int depth, json::parse_event_t event, json& parsed) {
    if (depth > deepest) throw InputError("{}: is nested deeper than {} levels", file, deepest);
    if (event == json::parse_event_t::object_start) keys.emplace_back();
    if (event == json::parse_event_t::object_end) keys.pop_back();
    if (event == json::parse_event_t::key) {
      last_key = parsed.get<std::string>();
      if (!keys.back().insert(last_key).second)
        throw InputError("{}: the key \"{}\" occurs twice in one object", file, printable(last_key));
    }
    return true;
  };
  try {
    return json::parse(text, look);
  } catch (const json::exception& e) {
    const std::string_view what = e.what();  // "[json.exception.kind.id] error and place"
    const auto start = what.find("] ");
    throw InputError("{}: {}{}", file, printable(what.substr(start == what.npos ? 0 : start + 2)),
                     last_key.empty() ? "" : fmt::format(" (after key \"{}\")", printable(last_key)));
  }
}

ordered_json evaluate(const json& document, const std::string& file, std::string* remark) {
  const CaseValue root(document, file);
  root.check_keys(std::array<std::string_view, 6>{"name", "model", "note", "inputs", "expected", "alternatives"});
  const CaseValue inputs = root["inputs"];
  CaseModel model = read_model(root["model"], inputs);
  if (remark != nullptr) *remark = model.remark;
  const auto in_dimension = [&](Real dim, auto&& in_plane, auto&& in_space) {
    if (dim == 2) return results(in_plane(inputs, model.parameters), file);
    if (dim == 3) return results(in_space(inputs, model.parameters), file);
    inputs["dim"].fail("is {}, but must be 2 or 3", dim);
  };
  if (model.kind == ModelKind::sp) return in_dimension(inputs["dim"].number(), read_soft<2>, read_soft<3>);
  if (model.kind == ModelKind::bubble)
    return in_dimension(inputs["dim"].number_or(2), read_droplets<2>, read_droplets<3>);
  if (model.surfaces) {
    const EvaluatedCase<3> c = read_surfaces(inputs, model);
    if (model.kind == ModelKind::smooth) check_piercing(c, file);
    return results(c, file);
  }
  const EvaluatedCase<2> c = read_polygons(inputs, model);
  if (model.kind == ModelKind::smooth ||
      (model.kind == ModelKind::rough && configured(model.parameters, EdgeContact{0, Edges::bare}).on))
    check_crossing(c, file);
  return results(c, file);
}

std::string to_text(const ordered_json& value) {
  std::string out;
  write(value, "", out);
  return out + "\n";
}

Scenario evaluate_scenario() {
  Scenario s{
      .name = "evaluate",
      .help = "energies and forces of one configuration",
      .arguments = "CASE.json",
      .run = [](const Arguments& arguments, const Ranks& ranks) {
        const std::string usage =
            fmt::format("usage: {} evaluate CASE.json (docs/scenarios/evaluate.md describes the file)", program_name());
        ranks.on_root([&] {
          if (arguments == Arguments{"-help"} || arguments == Arguments{"-h"} || arguments == Arguments{"--help"})
            return print_result(usage + "\n");
          if (arguments.size() != 1) throw InputError("{}", usage);
          const std::string& file = arguments[0];
          if (file.starts_with('-')) throw InputError("unknown option {}; {}", file, usage);
          std::string remark;
          print_result(to_text(evaluate(read_case(file), file, &remark)) + "\n");
          if (!remark.empty()) warn("{}", remark);
        });
        return ExitCode::done;
      }};
  return s;
}

}  // namespace pliant
