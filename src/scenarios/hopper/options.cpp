#include <pliant/scenarios/hopper/options.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include <pliant/base/console.h>
#include <pliant/base/errors.h>
#include <pliant/scenarios/hopper/shapes.h>

namespace pliant {
namespace {

constexpr Real slow_part = 0.1;  ///< of the speed of a slow flow: rest

constexpr std::array kinds{ModelKind::sp, ModelKind::rough, ModelKind::smooth, ModelKind::disk};

/// An option that not every model reads.
struct PartlyRead {
  std::string name;
  std::vector<ModelKind> by;  ///< of the catalogue
  bool shape = false;         ///< of the particles: read by each model that has these
};

const std::vector<PartlyRead>& partly_read() {
  using enum ModelKind;
  static const std::vector<PartlyRead> table{{"e_sp", {sp}},
                                             {"e_c", {rough, smooth}},
                                             {"k_a", {rough, smooth}},
                                             {"k_l", {rough, smooth}},
                                             {"k_b", {rough, smooth}},
                                             {"area_energy", {rough, smooth}},
                                             {"bending_edges", {rough, smooth}},
                                             {"edge_force", {smooth}},
                                             {"n_vertices", {rough, smooth}, true},
                                             {"shape_parameter", {rough, smooth}, true},
                                             {"lip_contact", {rough, smooth}},
                                             {"rough_contact", {rough}},
                                             {"self_contact", {rough, smooth}},
                                             {"self_crossing", {rough, smooth}, true},
                                             {"edge_width", {smooth}, true},
                                             {"friction_point", {smooth}},
                                             {"friction", {sp, rough, smooth}},
                                             {"e_w", {sp, rough, smooth, disk}},
                                             {"wall_diameter", {sp, rough, smooth}},
                                             {"contact_law", {sp, rough, smooth, disk}},
                                             {"mu", {sp, rough, smooth}},
                                             {"zeta", {sp, rough, smooth, disk}},
                                             {"drag", {sp, rough, smooth, disk}},
                                             {"e_disk", {disk}},
                                             {"mu_disk", {disk}},
                                             {"mu_disk_dynamic", {disk}},
                                             {"mu_wall", {disk}},
                                             {"mu_wall_dynamic", {disk}},
                                             {"restitution", {disk}},
                                             {"tangential_stiffness", {disk}},
                                             {"tangential_damping", {disk}}};
  return table;
}

template <class Values, class Value>
bool contains(const Values& values, const Value& value) {
  return std::find(values.begin(), values.end(), value) != values.end();
}

/// "a", "a or b", "a, b or c".
std::string alternatives(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t k = 0; k < names.size(); ++k)
    text += (k == 0 ? "" : k + 1 < names.size() ? ", " : " or ") + names[k];
  return text;
}

/// Names that people try for what is 1 here.
void explain_units(Options& o) {
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

}  // namespace

void HopperOptions::bind(Options& o) {
  constexpr auto fixed = OnRestart::fixed;
  explain_units(o);
  o.group("Model");
  std::string help =
      "soft particles, deformable particles with rough or smooth outlines, or frictional disks and spheres";
  std::vector<std::string> models;
  for (const ModelKind kind : kinds) models.emplace_back(to_string(kind));
  for (const OwnModel& own : own_models_) {
    help += fmt::format("; {}: {}", own.name, own.help);
    models.push_back(own.name);
  }
  o.bind("model", model, {.help = help, .choices = models, .on_restart = fixed});
  o.bind("dim", dim, {.help = "dimension; 2 for deformable particles", .min = 2, .max = 3, .on_restart = fixed});
  o.bind("e_sp", e_sp,
         {.help = "contact energy E_sp of soft particles",
          .unit = "rho g sigma_avg^(d+1)",
          .min = 0,
          .min_open = true,
          .on_restart = fixed});
  o.bind("e_c", e_c,
         {.help = "contact energy E_c of deformable particles",
          .unit = "rho g sigma_avg^3",
          .min = 0,
          .min_open = true,
          .on_restart = fixed});
  o.bind("e_w", e_w,
         {.help = "wall contact energy E_w",
          .unit = "rho g sigma_avg^(d+1)",
          .min = 0,
          .min_open = true,
          .on_restart = fixed});
  o.bind("wall_diameter", wall_diameter,
         {.help = "thickness of the walls, whose ends, the lips of the orifice, are round",
          .unit = "sigma_avg",
          .min = 0,
          .max = 1,
          .on_restart = fixed});
  o.bind("contact_law", contact_law,
         {{"harmonic", ContactLaw::harmonic},
          {"hertz", ContactLaw::hertz},
          {"barrier", ContactLaw::barrier},
          {"linear", ContactLaw::linear}},
         {.help = "contacts are linear springs, or Hertz' (not of rough particles), or grow without bound before an "
                  "outline or a wall is reached (smooth particles), or have the force E (1 - r/sigma), without 1/sigma "
                  "(soft particles)",
          .on_restart = fixed});
  o.bind("k_a", k_a, {.help = "area stiffness K_a", .unit = "rho g/sigma_avg", .min = 0, .on_restart = fixed});
  o.bind("k_l", k_l, {.help = "perimeter stiffness K_l", .unit = "rho g sigma_avg", .min = 0, .on_restart = fixed});
  o.bind("k_b", k_b, {.help = "bending stiffness K_b", .unit = "rho g sigma_avg^5", .min = 0, .on_restart = fixed});
  o.bind(
      "area_energy", area_energy, {{"absolute", AreaEnergy::absolute}, {"relative", AreaEnergy::relative}},
      {.help = "area energy of deformable particles: K_a/2 (a - a0)^2 [H 8], or K_a a0/2 (a/a0 - 1)^2, K_a a modulus "
               "in rho g sigma_avg",
       .on_restart = fixed});
  o.bind(
      "bending_edges", bending_edges, {{"unit", EdgeVectors::unit}, {"full", EdgeVectors::full}},
      {.help = "bending energy of deformable particles: of the directions of edges [H 8], or of edges over their rest "
               "length",
       .on_restart = fixed});
  o.bind("edge_force", edge_force, {{"single", EdgeForce::single}, {"twofold", EdgeForce::twofold}},
         {.help = "smooth particles: an edge pushes a vertex half as hard as two vertices that meet head on push each "
                  "other, or twice as hard",
          .on_restart = fixed});
  o.bind(
      "mu", mu,
      {.help = "kinetic friction coefficient mu", .unit = "rho sigma_avg^(d-1) g t0", .min = 0, .on_restart = fixed});
  o.bind("zeta", zeta,
         {.help = "drag coefficient zeta",
          .unit = "rho sigma_avg^(d-1) g t0",
          .min = 0,
          .automatic = "0; 0.316 (drag only of [H]) with -mu 0 and a model that dissipates by nothing else (sp, rough, "
                       "smooth)",
          .on_restart = fixed});
  o.bind(
      "drag", drag, {{"per_particle", DragLaw::per_particle}, {"per_mass", DragLaw::per_mass}},
      {.help = "zeta is that of each particle [H 5, 11], or of one of diameter sigma_avg, and of others in proportion "
               "to their mass",
       .on_restart = fixed});
  o.bind("friction", friction, {{"whole", Friction::whole}, {"tangential", Friction::tangential}},
         {.help = "friction acts against the whole relative velocity [H 6, 12], or its tangential part alone",
          .on_restart = fixed});
  o.bind(
      "friction_point", friction_point, {{"contact", FrictionPoint::contact}, {"vertex", FrictionPoint::vertex}},
      {.help =
           "smooth particles: friction acts against the velocity at the contact, or of the edge's first vertex [H 12]",
       .on_restart = fixed});
  o.bind("lip_contact", lip_contact, {{"edge", ContactRule::edge}, {"literal", ContactRule::literal}},
         {.help = "deformable particles: the lips of the orifice touch edges too, or vertices only [H 10]",
          .on_restart = fixed});
  o.bind("corner_contact", corner_contact, {{"once", CornerRule::once}, {"literal", CornerRule::literal}},
         {.help = "inner corners of the container: what touches both walls counts once, or both walls push [H 10]",
          .on_restart = fixed});
  o.bind("rough_contact", rough_contact, {{"edge", ContactRule::edge}, {"literal", ContactRule::literal}},
         {.help = "rough particles: vertices touch stretched edges too, or vertices only [H 9]", .on_restart = fixed});
  o.bind("self_contact", self_contact,
         {.help = "deformable particles: vertices push edges of their own outline too, which keeps it from crossing "
                  "itself",
          .on_restart = fixed});
  o.bind("self_crossing", self_crossing, {{"stop", OnSelfCrossing::stop}, {"count", OnSelfCrossing::count}},
         {.help = "a deformable particle whose outline crosses itself ends the run with exit code 3, or is counted in "
                  "each sample",
          .on_restart = fixed});
  o.bind("e_disk", e_disk,
         {.help = "contact energy of frictional disks and spheres",
          .unit = "rho g sigma_avg^(d+1)",
          .min = 0,
          .min_open = true,
          .on_restart = fixed});
  disk.bind(o, "mu_disk", "static Coulomb friction of particles with each other", "model disk: ");
  wall.bind(o, "mu_wall", "static Coulomb friction of particles with walls and obstacles", "model disk: ");
  o.bind("restitution", restitution,
         {.help = "model disk: coefficient of restitution of a head-on collision, with particles and walls",
          .min = 0,
          .max = 1,
          .min_open = true,
          .on_restart = fixed});
  o.bind("tangential_stiffness", tangential_stiffness,
         {.help = "model disk: stiffness of tangential springs over that of contacts",
          .min = 0,
          .max = 10,
          .min_open = true,
          .on_restart = fixed});
  o.bind("tangential_damping", tangential_damping,
         {.help = "model disk: tangential damping over normal damping", .min = 0, .max = 10, .on_restart = fixed});
  bind_own_models(o);

  o.group("Particles");
  o.bind("n", particles,
         {.help = "number of particles; 0: 1600 in 2D, 6400 in 3D", .min = 0, .max = 1e8, .on_restart = fixed});
  o.bind("seed", seed, {.help = "seed of all random numbers", .min = 0, .on_restart = fixed});
  o.bind(
      "size_distribution", sizes.kind,
      {.help = "distribution of diameters, mean 1", .choices = {"bidisperse", "normal", "mono"}, .on_restart = fixed});
  o.bind("size_ratio", sizes.ratio,
         {.help = "bidisperse: large over small diameter", .min = 1, .max = 10, .on_restart = fixed});
  o.bind("size_fraction", sizes.fraction,
         {.help = "bidisperse: fraction of large particles by number", .min = 0, .max = 1, .on_restart = fixed});
  o.bind("size_deviation", sizes.deviation,
         {.help = "normal: standard deviation of the diameter",
          .unit = "sigma_avg",
          .min = 0,
          .max = 0.3,
          .on_restart = fixed});
  o.bind("n_vertices", shape.vertices,
         {.help = "vertices of a deformable particle", .min = 3, .max = 10000, .on_restart = fixed});
  o.bind("shape_parameter", shape.shape_parameter,
         {.help = "A0 = perimeter^2/(4 pi area) at rest; 0: regular polygon", .min = 0, .on_restart = fixed});
  o.bind("edge_width", shape.edge_width,
         {.help = "smooth particles: width of an edge over its rest length",
          .min = 0,
          .max = 1,
          .min_open = true,
          .on_restart = fixed});

  o.group("Hopper");
  o.bind("hopper_width", hopper.orifice,
         {.help = "width w of the orifice", .unit = "sigma_avg", .min = 0, .min_open = true, .on_restart = fixed});
  o.bind("hopper_angle", hopper.angle,
         {.help = "angle of the sloped walls to gravity; 90: flat bottom",
          .unit = "degrees",
          .min = 10,
          .max = 90,
          .on_restart = fixed});
  o.bind("hopper_angle_left", left_angle,
         {.help = "2D: angle of the left wall where it differs; 0: upright from the orifice on",
          .unit = "degrees",
          .min = 0,
          .max = 90,
          .automatic = "as -hopper_angle",
          .on_restart = fixed});
  o.bind("hopper_wall_distance", wall_distance,
         {.help = "distance W of the upright walls (3D: diameter)",
          .unit = "sigma_avg",
          .min = 0,
          .min_open = true,
          .automatic = "50 in 2D, 25 in 3D",
          .on_restart = fixed});
  o.bind("outline", outline,
         {.help = "file with the walls of a container of one's own, in place of the four above: lines x y in sigma_avg "
                  "from the orifice, at y = 0, up; one polyline that is mirrored (3D: revolved), or two",
          .on_restart = fixed,
          .read = read_outline});
  o.bind(
      "obstacle", obstacle,
      {.help = "obstacles: disk:x,y,r or polygon:FILE (lines x y in sigma_avg), several with commas between them; 3D: "
               "bodies of revolution",
       .on_restart = fixed,
       .read = read_obstacles});
  o.bind("flow", flow, {{"continuous", FlowKind::continuous}, {"discharge", FlowKind::discharge}},
         {.help = "reinsert particles at the top, or let the hopper run empty", .on_restart = fixed});
  o.bind("count", counting, {{"crossing", Counting::crossing}, {"removal", Counting::removal}},
         {.help = "continuous flow: a particle counts as it crosses the orifice line, or as it is put back",
          .on_restart = fixed});
  o.bind("removal_depth", removal_depth,
         {.help = "how far below the orifice line particles are taken out, to be put back at the top",
          .unit = "sigma_avg",
          .min = 0,
          .min_open = true,
          .automatic = "two diameters of the largest particle",
          .on_restart = fixed});
  o.bind("reinsertion_gap", reinsertion.gap,
         {.help = "continuous flow: room that is left below a particle that is put back; 0: it touches another one",
          .unit = "sigma_avg",
          .min = 0,
          .on_restart = fixed});
  o.bind("reinsertion_lateral_speed", reinsertion.lateral_speed,
         {.help = "continuous flow: a particle that is put back gets a random lateral velocity up to this",
          .unit = "sigma_avg/t0",
          .min = 0,
          .automatic = "the velocity of the particle below it",
          .on_restart = fixed});
  o.bind("pack_fraction", pack_fraction,
         {.help = "packing fraction to start from, of the particles' outer disks (spheres)",
          .min = 0,
          .max = 0.9,
          .min_open = true,
          .automatic = "0.84 in 2D, 0.64 in 3D",
          .on_restart = fixed});
  o.bind("pack_tolerance", pack_tolerance,
         {.help = "overlap tolerance of the initial packing, relative", .min = 1e-12, .max = 0.1, .on_restart = fixed});
  o.bind("clog_time", clog_time,
         {.help = "quiet time before a run ends as clogged or at rest: no crossing, all particles slow",
          .unit = "t0",
          .min = 0,
          .min_open = true});
  o.bind("clog_speed", clog_speed,
         {.help = "speed below which a particle is slow",
          .unit = "sigma_avg/t0",
          .min = 0,
          .min_open = true,
          .automatic = "1e-3, or 0.1 m g/(zeta + mu) of the lightest particle where that is less"});

  o.group("Integration");
  o.bind(
      "dynamics", dynamics, {{"inertial", Dynamics::inertial}, {"overdamped", Dynamics::overdamped}},
      {.help = "Newton's equations, or their limit of strong drag, velocity = force/drag coefficient (-integrator ts)",
       .on_restart = fixed});
  o.bind("integrator", integrator, {{"verlet", IntegratorKind::verlet}, {"ts", IntegratorKind::ts}},
         {.help = "plain velocity Verlet with a fixed step, or PETSc TS (-ts_type, -ts_rtol, -ts_monitor, ...)",
          .on_restart = fixed});
  o.bind("implicit", implicit, {{"all", TermGroup::all}, {"shape", TermGroup::shape}},
         {.help = "what an implicit -ts_type solves for: all forces, or the shape energy alone and the rest explicitly "
                  "(-ts_type arkimex)",
          .on_restart = fixed});
  o.bind("jacobian", jacobian, {{"assembled", JacobianKind::assembled}, {"matrix_free", JacobianKind::matrix_free}},
         {.help = "an implicit -ts_type's Jacobian: a sparse matrix, or products by loops over the elements",
          .on_restart = fixed});
  o.bind("dt", dt,
         {.help = "step of velocity Verlet, first step of an adaptive method",
          .unit = "t0",
          .min = 0,
          .min_open = true,
          .automatic = "0.35 of the elastic limit with friction, 0.4 with drag alone, 0.2 with neither, less where a "
                       "discharge must come to rest; 0.2 with -model disk; 0.5 of the damping's; at most 1e-3",
          .on_restart = fixed});
  bind_allowed(o);
  o.bind("t_end", t_end,
         {.help = "end of the run", .unit = "t0", .min = 0, .automatic = "100; 10000 with -hopper_q_rtol"});
  o.bind("hopper_q_rtol", q_rtol,
         {.help = "continuous flow: end before -t_end when Q has this relative standard error; 0: never",
          .min = 0,
          .max = 1,
          .max_open = true});
  bind_threads(o);
  o.bind("skin", skin,
         {.help = "margin of the neighbour lists",
          .unit = "sigma_avg",
          .min = 0,
          .min_open = true,
          .automatic = "tuned to the motion during the run",
          .on_restart = fixed});

  bind_output(o);
}

void HopperOptions::bind_own_models(Options& o) {
  makers_.clear();
  for (const OwnModel& own : own_models_) {
    for (const std::string& name : own.reads)
      if (std::none_of(partly_read().begin(), partly_read().end(),
                       [&](const PartlyRead& option) { return option.name == name && !option.shape; }))
        throw std::logic_error("model " + own.name + " says that it reads -" + name + ", which is not for it to say");
    o.group("Model " + own.name);
    makers_.push_back(own.bind(o));
  }
}

std::size_t HopperOptions::own_model() const {
  return static_cast<std::size_t>(
      std::find_if(own_models_.begin(), own_models_.end(), [&](const OwnModel& own) { return own.name == model; }) -
      own_models_.begin());
}

ModelKind HopperOptions::particle_kind() const {
  if (own_model() < own_models_.size()) return own_models_[own_model()].particles;
  return *std::find_if(kinds.begin(), kinds.end(), [&](ModelKind kind) { return to_string(kind) == model; });
}

template <int D>
std::unique_ptr<ForceField<D>> HopperOptions::force_field(const Vec<D>& gravity) const {
  if (own_model() < own_models_.size()) return makers_[own_model()]->make(model_parameters(), gravity);
  return make_force_field<D>(particle_kind(), model_parameters(), gravity);
}

template std::unique_ptr<ForceField<2>> HopperOptions::force_field<2>(const Vec<2>&) const;
template std::unique_ptr<ForceField<3>> HopperOptions::force_field<3>(const Vec<3>&) const;

void HopperOptions::resolve() {
  if (dim == 3 && deformable())
    throw InputError("-dim 3 with -model {}: deformable particles are two-dimensional; use -model sp or -dim 2", model);
  if (own_model() == own_models_.size() && !has_law(particle_kind(), contact_law))
    throw InputError("-contact_law {} with -model {}: only {} has it; use that, or harmonic", to_string(contact_law),
                     model,
                     contact_law == ContactLaw::hertz    ? "-model sp, smooth or disk"
                     : contact_law == ContactLaw::linear ? "-model sp"
                                                         : "-model smooth");
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
  if (!pack_fraction) pack_fraction = dim == 2 ? 0.84 : 0.64;
  if (shape.shape_parameter > 0 && shape.shape_parameter < regular_shape_parameter(shape.vertices))
    throw InputError(
        "-shape_parameter {}: no polygon of {} vertices has less than {:.6g}, the regular one's; raise it or leave it "
        "out",
        shape.shape_parameter, shape.vertices, regular_shape_parameter(shape.vertices));
  if (integrator == IntegratorKind::verlet && implicit != TermGroup::all)
    throw InputError("-implicit shape with -integrator verlet, which is explicit; use -integrator ts -ts_type arkimex");
  resolve_dissipation();
  resolve_clog_speed();
  if (dynamics == Dynamics::overdamped) {
    if (integrator != IntegratorKind::ts)
      throw InputError("-dynamics overdamped with -integrator verlet, which needs inertia; use -integrator ts");
    if (particle_kind() == ModelKind::disk)
      throw InputError("-dynamics overdamped with -model disk, which needs inertia; use -dynamics inertial");
    if (!(*zeta > 0) || mu > 0)
      throw InputError(
          "-dynamics overdamped with -zeta {} and -mu {}: velocities come from drag alone, which must be "
          "positive; use -zeta 1 -mu 0",
          *zeta, mu);
  }
  if (q_rtol > 0 && flow != FlowKind::continuous)
    throw InputError(
        "-hopper_q_rtol {} with -flow discharge: only continuous flow has a steady rate; leave one of them out",
        q_rtol);
  disk.resolve("mu_disk");
  wall.resolve("mu_wall");
  reinsertion.clearance = wall_diameter / 2;
  if (wall_diameter >= hopper.orifice)
    throw InputError(
        "-wall_diameter {}: the beads at the lips of an orifice of -hopper_width {} leave no gap; use less",
        wall_diameter, hopper.orifice);
  if (!t_end) t_end = q_rtol > 0 ? 10000 : 100;
}

void HopperOptions::resolve_dissipation() {
  const bool own = own_model() < own_models_.size(), has_friction = own || particle_kind() == ModelKind::disk;
  if (!zeta) zeta = has_friction || mu > 0 ? 0 : std::sqrt(0.1);
  constexpr Real shut = 0.1;  // no particle passes so narrow an orifice
  if (own || flow != FlowKind::continuous || hopper.orifice < shut || *zeta > 0 || mu > 0) return;
  if (particle_kind() == ModelKind::disk) {
    if (restitution < 1 || disk.at_rest > 0 || wall.at_rest > 0) return;
    throw InputError(
        "continuous flow with -restitution 1, -mu_disk 0, -mu_wall 0 and -zeta 0: nothing takes the energy that "
        "gravity "
        "puts in, so it grows for ever; lower -restitution, or set -mu_disk or -zeta, or use -flow discharge");
  }
  throw InputError(
      "continuous flow with -zeta 0 and -mu 0: nothing takes the energy that gravity puts in, so it grows for ever; "
      "set "
      "-zeta or -mu, leave -zeta out, or use -flow discharge");
}

Real HopperOptions::creep_speed() const {
  const Real smallest = sizes.smallest(), average = dim == 2 ? pi / 4 : pi / 6;
  const Real mass = average * (drag == DragLaw::per_mass && mu == 0 ? 1 : std::pow(smallest, dim));
  return mass / (*zeta + mu);
}

void HopperOptions::resolve_clog_speed() {
  const Real average = dim == 2 ? pi / 4 : pi / 6, largest = std::pow(sizes.largest(), dim);
  const Real terminal = average * (drag == DragLaw::per_mass ? 1 : largest) / *zeta;
  if (clog_speed && *clog_speed >= terminal)
    throw InputError(
        "-clog_speed {:g}: with -zeta {:g} no particle falls faster than {:.3g}, so a flow would count as rest; give a "
        "smaller speed, or leave it out",
        *clog_speed, *zeta, terminal);
  if (!clog_speed) clog_speed = std::min(1e-3, slow_part * creep_speed());
}

void HopperOptions::warn_of_clog_speed() const {
  if (*clog_speed > slow_part * creep_speed() * (1 + 1e-9))
    warn(
        "-clog_speed {:g} is more than {:g} of m g/(zeta + mu) = {:.3g}: a slow flow may count as rest; give a smaller "
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
    refuse(names, contains(readers, model), "-model " + model, "-model " + alternatives(readers));
  };
  for (const PartlyRead& option : partly_read()) {
    if ((option.name == "zeta" || option.name == "drag") && dynamics == Dynamics::overdamped)
      continue;  // velocities need it, whatever the model
    std::vector<std::string> readers;
    for (const ModelKind kind : option.by) readers.emplace_back(to_string(kind));
    for (const OwnModel& own : own_models_)
      if (option.shape ? contains(option.by, own.particles) : contains(own.reads, option.name))
        readers.push_back(own.name);
    refuse_by_model({option.name}, readers);
  }
  for (const OwnModel& own : own_models_) refuse_by_model(own.options, {own.name});
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
  if (particle_kind() == ModelKind::disk) return 0.2;
  const Real flowing = mu > 0 ? 0.35 : *zeta > 0 ? 0.4 : 0.2;
  if (flow != FlowKind::discharge || *zeta == 0) return flowing;
  if (particle_kind() != ModelKind::sp) return 0.2;
  // A bounce on a wall changes the energy of a particle by a part of (dt/elastic)², up or down, as steps happen to meet
  // the touch. Drag must take more: at least its rate times the length of the shortest bounce, that is about elastic.
  return std::min(flowing, std::max(0.05, 2 * std::sqrt(*zeta / lightest * elastic)));
}

Real HopperOptions::first_skin() const {
  const ModelKind kind = particle_kind();
  return skin.value_or(dim == 3 ? 0.2 : kind == ModelKind::sp ? 0.3 : kind == ModelKind::smooth ? 0.06 : 0.1);
}

ModelParameters HopperOptions::model_parameters() const {
  const ModelKind kind = particle_kind();
  return {.epsilon = kind == ModelKind::sp     ? e_sp
                     : kind == ModelKind::disk ? e_disk
                                               : e_c,
          .epsilon_wall = e_w,
          .wall_diameter = wall_diameter,
          .law = contact_law,
          .k_a = k_a,
          .k_l = k_l,
          .k_b = k_b,
          .area_energy = area_energy,
          .bending_edges = bending_edges,
          .edge_force = edge_force,
          .mu = mu,
          .zeta = *zeta,
          .friction_point = friction_point,
          .friction = friction,
          .drag = drag,
          .lip_edges = lip_contact == ContactRule::edge,
          .rough_edges = rough_contact == ContactRule::edge,
          .self_contact = self_contact,
          .disk = {.mu_disk = disk.at_rest,
                   .mu_disk_dynamic = *disk.sliding,
                   .mu_wall = wall.at_rest,
                   .mu_wall_dynamic = *wall.sliding,
                   .restitution = restitution,
                   .tangential_stiffness = tangential_stiffness,
                   .tangential_damping = tangential_damping}};
}

}  // namespace pliant
