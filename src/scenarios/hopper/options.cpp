#include <pliant/scenarios/hopper/options.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include <pliant/base/console.h>
#include <pliant/base/errors.h>
#include <pliant/model/drag.h>
#include <pliant/scenarios/hopper/shapes.h>
#include <pliant/scenarios/particles/options.h>

namespace pliant {
namespace {

constexpr Real slow_part = 0.1;  ///< part of the speed of a slow flow below which particles rest

std::vector<ModelDefinition> models_with(const std::vector<ModelDefinition>& own) {
  std::vector<ModelDefinition> all;
  for (const ModelKind kind : {ModelKind::sp, ModelKind::rough, ModelKind::smooth, ModelKind::disk})
    all.push_back(catalogue_model(kind));
  all.insert(all.end(), own.begin(), own.end());
  return all;
}

template <class Values, class Value>
bool contains(const Values& values, const Value& value) {
  return std::find(values.begin(), values.end(), value) != values.end();
}

}  // namespace

HopperOptions::HopperOptions(const std::vector<ModelDefinition>& own) : model(models_with(own)) {
  shape.vertices = 0;
  model.make_automatic(Role::drag, "0; 0.316 (drag only of [H]) for sp, rough or smooth without friction");
}

void HopperOptions::bind(Options& o) {
  constexpr auto fixed = OnRestart::fixed;
  explain_gravitational_units(o);
  model.bind(o, UnitSystem::gravitational(), true);
  o.bind("dim", dim,
         {.help = "dimension; 3 for sp, disk, and rough and smooth (closed surfaces)",
          .min = 2,
          .max = 3,
          .cures = {{Cure::two_dimensions, "2"}, {Cure::three_dimensions, "3"}},
          .on_restart = fixed});
  o.bind("corner_contact", corner_contact, {{"once", CornerRule::once}, {"literal", CornerRule::literal}},
         {.help = "concave corners of walls: contact counts once, or both walls push [H 10]", .on_restart = fixed});
  o.bind(
      "self_crossing", self_crossing, {{"stop", OnSelfCrossing::stop}, {"count", OnSelfCrossing::count}},
      {.help = "outline that crosses itself: stop with exit code 3, or count it in each sample", .on_restart = fixed});

  o.group("Particles");
  start.bind(o);
  o.bind("n", particles,
         {.help = "number of particles; 0: 1600 in 2D, 6400 in 3D",
          .min = 0,
          .max = 1e8,
          .cures = {Cure::more_particles},
          .on_restart = fixed});
  o.bind("seed", seed, {.help = "seed of all random numbers", .min = 0, .on_restart = fixed});
  bind_sizes(o, sizes);
  bind_shape(o, shape);
  bind_mesh(o, mesh);

  o.group("Hopper");
  o.bind("hopper_width", hopper.orifice,
         {.help = "width w of the orifice",
          .unit = "sigma_avg",
          .min = 0,
          .min_open = true,
          .cures = {Cure::narrower_orifice, Cure::wider_orifice},
          .on_restart = fixed});
  o.bind("hopper_angle", hopper.angle,
         {.help = "angle of the sloped walls to gravity; 90: flat bottom",
          .unit = "degrees",
          .min = 10,
          .max = 90,
          .cures = {Cure::other_angle},
          .on_restart = fixed});
  o.bind("hopper_angle_left", left_angle,
         {.help = "2D: angle of the left wall if different; 0: vertical from the orifice upwards",
          .unit = "degrees",
          .min = 0,
          .max = 90,
          .automatic = "as -hopper_angle",
          .on_restart = fixed});
  o.bind("hopper_wall_distance", wall_distance,
         {.help = "distance W of the vertical walls (3D: diameter)",
          .unit = "sigma_avg",
          .min = 0,
          .min_open = true,
          .cures = {Cure::wider_container},
          .automatic = "50 in 2D, 25 in 3D",
          .on_restart = fixed});
  o.bind("outline", outline,
         {.help = "file with the walls of a container: lines x y in sigma_avg, from the orifice up",
          .cures = {Cure::own_outline},
          .on_restart = fixed,
          .read = read_outline});
  o.bind("obstacle", obstacle,
         {.help = "obstacles: disk:x,y,r, polygon:FILE or polygon:x,y,x,y,…; commas between several",
          .cures = {Cure::wider_obstacles},
          .on_restart = fixed,
          .read = read_obstacles});
  o.bind("flow", flow, {{"continuous", FlowKind::continuous}, {"discharge", FlowKind::discharge}},
         {.help = "reinsert particles at the top, or let the hopper run empty",
          .cures = {{Cure::no_reinsertion, "discharge"}},
          .on_restart = fixed});
  o.bind("count", counting, {{"crossing", Counting::crossing}, {"removal", Counting::removal}},
         {.help = "continuous flow: count at the orifice line, or at reinsertion", .on_restart = fixed});
  o.bind("removal_depth", removal_depth,
         {.help = "distance below the orifice line at which particles are reinserted",
          .unit = "sigma_avg",
          .min = 0,
          .min_open = true,
          .automatic = "two diameters of the largest particle",
          .on_restart = fixed});
  o.bind("reinsertion_gap", reinsertion.gap,
         {.help = "continuous flow: gap below a reinserted particle; 0: in contact",
          .unit = "sigma_avg",
          .min = 0,
          .on_restart = fixed});
  o.bind("reinsertion_lateral_speed", reinsertion.lateral_speed,
         {.help = "continuous flow: largest random lateral velocity of reinserted particles",
          .unit = "sigma_avg/t0",
          .min = 0,
          .automatic = "the velocity of the particle below the reinserted one",
          .on_restart = fixed});
  bind_packing(o, pack_fraction, pack_tolerance);
  o.bind("clog_time", clog_time,
         {.help = "time without crossings and without fast particles after which the run ends",
          .unit = "t0",
          .min = 0,
          .min_open = true});
  o.bind("clog_speed", clog_speed,
         {.help = "speed below which a particle is slow",
          .unit = "sigma_avg/t0",
          .min = 0,
          .min_open = true,
          .automatic = "1e-3, or 0.1 m g/(zeta + mu) of the lightest particle if smaller"});

  o.group("Integration");
  o.bind("dynamics", dynamics, {{"inertial", Dynamics::inertial}, {"overdamped", Dynamics::overdamped}},
         {.help = "Newton's equations, or overdamped: velocity = force / drag coefficient", .on_restart = fixed});
  o.bind("integrator", integrator, {{"verlet", IntegratorKind::verlet}, {"ts", IntegratorKind::ts}},
         {.help = "velocity Verlet with a fixed step, or PETSc TS (-ts_type, -ts_rtol, ...)",
          .cures = {{Cure::verlet, "verlet"}, {Cure::ts, "ts"}},
          .on_restart = fixed});
  o.bind("implicit", implicit, {{"all", TermGroup::all}, {"shape", TermGroup::shape}},
         {.help = "forces that the integrator treats implicitly: all, or shape energies alone",
          .cures = {{Cure::split_forces, "shape"}, {Cure::whole_forces, "all"}},
          .on_restart = fixed});
  o.bind("jacobian", jacobian, {{"assembled", JacobianKind::assembled}, {"matrix_free", JacobianKind::matrix_free}},
         {.help = "Jacobian of an implicit -ts_type: sparse matrix, or matrix-free products", .on_restart = fixed});
  o.bind("dt", dt,
         {.help = "fixed step, or first step of an adaptive method",
          .unit = "t0",
          .min = 0,
          .min_open = true,
          .cures = {Cure::shorter_step},
          .automatic = "0.05 to 0.4 of the elastic limit, at most 0.5 of the damping limit, 0.7 of dt_critical, 1e-3",
          .on_restart = fixed});
  bind_allowed(o);
  o.bind("t_end", t_end,
         {.help = "end of the run",
          .unit = "t0",
          .min = 0,
          .extends = {"t_end", "LATER"},
          .automatic = "100; 10000 with -hopper_q_rtol"});
  o.bind("hopper_q_rtol", q_rtol,
         {.help = "continuous flow: end when Q has this relative standard error; 0: never",
          .min = 0,
          .max = 1,
          .max_open = true,
          .extends = {"q_rtol", "LESS"}});
  bind_threads(o);
  o.bind("skin", skin,
         {.help = "skin of the neighbour lists",
          .unit = "sigma_avg",
          .min = 0,
          .min_open = true,
          .automatic = "tuned to the motion during the run",
          .on_restart = fixed});

  bind_output(o);
}

void HopperOptions::take_start(const std::optional<Checkpoint>& checkpoint) {
  start.take(start_needs(model, dim, shape), checkpoint);
  if (start.given()) particles = start.particles().topology.particles();
}

void HopperOptions::resolve() {
  resolve_shape(shape, mesh, model.particles(), dim);
  if (dim == 2)
    model.resolve<2>({});
  else
    model.resolve<3>({});
  if (particles == 0) particles = dim == 2 ? 1600 : 6400;
  if (!wall_distance) wall_distance = dim == 2 ? 50 : 25;
  hopper.wall_distance = *wall_distance;
  std::optional<Vessel> vessel;
  if (!outline.empty()) {
    vessel = outline_vessel(outline, dim);
    hopper.orifice = vessel->orifice();
    hopper.wall_distance = vessel->right() - vessel->left();
    wall_distance = hopper.wall_distance;
  } else {
    hopper.check();
    if (left_angle && dim == 3)
      throw InputError("-hopper_angle_left with -dim 3: a cone has one angle; leave it out, or use -dim 2");
    if (left_angle && *left_angle != hopper.angle) vessel = uneven_hopper(hopper, *left_angle);
  }
  const auto with = [&](std::vector<Obstacle> all) {
    return vessel ? Container(*vessel, std::move(all), corner_contact)
                  : Container(hopper, std::move(all), corner_contact);
  };
  container = with({});
  if (!obstacle.empty()) {
    std::vector<Obstacle> all = parse_obstacles(obstacle, dim);
    check_obstacles(*container, all, dim);
    container = with(std::move(all));
  }
  if (!pack_fraction) pack_fraction = default_pack_fraction(dim);
  if (dim == 2) check_regular_shape(shape);
  if (integrator == IntegratorKind::verlet && implicit != TermGroup::all)
    throw InputError("-implicit shape with -integrator verlet, which is explicit; use -integrator ts -ts_type arkimex");
  resolve_dissipation();
  resolve_clog_speed();
  if (dynamics == Dynamics::overdamped) {
    if (model.particles() == ModelKind::disk)
      throw InputError("-dynamics overdamped with -model disk, which needs inertia; use -dynamics inertial");
    if (integrator != IntegratorKind::ts)
      throw InputError("-dynamics overdamped with -integrator verlet, which needs inertia; use -integrator ts");
    if (!(drag() > 0))
      throw InputError(
          "-dynamics overdamped with {0} {1}: velocities come from drag, which must be positive; use {0} 1",
          drag_option(), drag());
    if (kinetic_friction() > 0)
      throw InputError("-dynamics overdamped with {0} {1}: velocities come from drag alone; use {0} 0",
                       model.option(Role::kinetic_friction), kinetic_friction());
  }
  if (q_rtol > 0 && flow != FlowKind::continuous)
    throw InputError(
        "-hopper_q_rtol {} with -flow discharge: only continuous flow has a steady rate; leave one of them out",
        q_rtol);
  const Real thickness = model.value(Role::wall_diameter);
  reinsertion.clearance = thickness / 2;
  if (thickness >= hopper.orifice)
    throw InputError("{} {}: the beads at the lips of an orifice of -hopper_width {} leave no gap; use less",
                     model.option(Role::wall_diameter), thickness, hopper.orifice);
  if (!t_end) t_end = q_rtol > 0 ? 10000 : 100;
}

void HopperOptions::resolve_dissipation() {
  const bool unknown = !model.in_catalogue();
  if (!model.is_set(Role::drag)) {
    const bool dissipates = unknown || !model.parameters(Role::restitution).empty() || kinetic_friction() > 0;
    model.set(Role::drag, dissipates ? 0 : std::sqrt(0.1));
  }
  constexpr Real shut = 0.1;  // no particle passes so narrow an orifice
  if (unknown || flow != FlowKind::continuous || hopper.orifice < shut) return;
  check_dissipation(model, "continuous flow", "gravity adds", ", or use -flow discharge");
}

bool HopperOptions::drag_per_mass() const { return model.term(Drag<2>{}).law == DragLaw::per_mass; }

Real HopperOptions::smallest_diameter() const {
  return start.given() ? *std::ranges::min_element(start.particles().topology.sigma) : sizes.smallest();
}
Real HopperOptions::largest_diameter() const {
  return start.given() ? *std::ranges::max_element(start.particles().topology.sigma) : sizes.largest();
}

Real HopperOptions::creep_speed() const {
  const Real smallest = smallest_diameter(), average = dim == 2 ? pi / 4 : pi / 6;
  const Real mass = average * (drag_per_mass() && kinetic_friction() == 0 ? 1 : std::pow(smallest, dim));
  return mass / (drag() + kinetic_friction());
}

void HopperOptions::resolve_clog_speed() {
  const Real average = dim == 2 ? pi / 4 : pi / 6, largest = std::pow(largest_diameter(), dim);
  const Real terminal = average * (drag_per_mass() ? 1 : largest) / drag();
  if (clog_speed && *clog_speed >= terminal)
    throw InputError(
        "-clog_speed {:g}: with {} {:g} no particle falls faster than {:.3g}, so a flow would count as rest; give a "
        "smaller speed, or leave it out",
        *clog_speed, drag_option(), drag(), terminal);
  if (!clog_speed) clog_speed = std::min(1e-3, slow_part * creep_speed());
}

void HopperOptions::warn_of_clog_speed() const {
  if (*clog_speed > slow_part * creep_speed() * (1 + 1e-9))
    warn(
        "-clog_speed {:g} is more than {:g} of m g/(drag + friction) = {:.3g}: a slow flow may count as rest; give a "
        "smaller "
        "speed, or leave it out",
        *clog_speed, slow_part, creep_speed());
}

void HopperOptions::refuse_unread(const Options& options) const {
  const auto refuse = [&](const std::vector<std::string>& names, bool read, const std::string& unread_by,
                          const std::string& read_by) {
    if (read) return;
    for (const std::string& name : names)
      if (options.given(name))
        throw InputError("-{} ({}) with {}, which does not read it; leave it out, or use {}", name,
                         options.source(name), unread_by, read_by);
  };
  const auto refuse_by_model = [&](const std::vector<std::string>& names, const std::vector<std::string>& readers) {
    refuse(names, contains(readers, model.name), "-model " + model.name, "-model " + alternatives(readers));
  };
  start.refuse(options, {"n", "size_distribution", "size_ratio", "size_fraction", "size_deviation", "n_vertices",
                         "mesh", "shape_parameter", "pack_fraction", "pack_tolerance"});
  if (start.given() && start.particles().has_widths) start.refuse(options, {"edge_width"});
  model.refuse_unread(options, dynamics == Dynamics::overdamped ? Drag<2>::name() : "");
  const auto with_particles = [&](std::initializer_list<ModelKind> kinds) {
    std::vector<std::string> names;
    for (const ModelDefinition& one : model.models())
      if (contains(kinds, one.particles)) names.push_back(one.name);
    return names;
  };
  refuse_by_model({"n_vertices", "shape_parameter", "self_crossing"},
                  with_particles({ModelKind::rough, ModelKind::smooth}));
  refuse_by_model({"mesh"}, with_particles({ModelKind::rough, ModelKind::smooth}));
  refuse({"mesh"}, dim == 3, "-dim 2", "-dim 3");
  refuse({"n_vertices"}, mesh.empty(), "-mesh", "no -mesh");
  refuse_by_model({"edge_width"}, with_particles({ModelKind::smooth}));
  const std::string these_sizes = "-size_distribution " + sizes.kind;
  refuse({"size_ratio", "size_fraction"}, sizes.kind == "bidisperse", these_sizes, "-size_distribution bidisperse");
  refuse({"size_deviation"}, sizes.kind == "normal", these_sizes, "-size_distribution normal");
  refuse({"hopper_width", "hopper_angle", "hopper_angle_left", "hopper_wall_distance"}, outline.empty(), "-outline",
         "no -outline");
  refuse({"count", "reinsertion_gap", "reinsertion_lateral_speed"}, flow == FlowKind::continuous, "-flow discharge",
         "-flow continuous");
  refuse({"jacobian"}, integrator == IntegratorKind::ts, "-integrator verlet", "-integrator ts");
}

Real HopperOptions::elastic_fraction(Real elastic, Real lightest) const {
  if (model.particles() == ModelKind::disk) return 0.2;
  const Real flowing = kinetic_friction() > 0 ? 0.35 : drag() > 0 ? 0.4 : 0.2;
  if (flow != FlowKind::discharge || drag() == 0) return flowing;
  if (model.particles() != ModelKind::sp) return 0.2;
  // A bounce on a wall changes the energy of a particle by a part of (dt/elastic)², up or down, as steps happen to meet
  // the touch. Drag must take more: at least its rate times the length of the shortest bounce, that is about elastic.
  return std::min(flowing, std::max(0.05, 2 * std::sqrt(drag() / lightest * elastic)));
}

Real HopperOptions::first_skin() const { return skin.value_or(usual_skin(model.particles(), dim)); }

}  // namespace pliant
