#include <pliant/python/settings.h>

#include <algorithm>

#include <pliant/catalogue/catalogue.h>
#include <pliant/model/drag.h>
#include <pliant/scenarios/droplets/options.h>
#include <pliant/system/point_drag.h>

namespace pliant::python {
namespace {

std::vector<ModelDefinition> all_models() {
  std::vector<ModelDefinition> models;
  for (const ModelKind kind :
       {ModelKind::sp, ModelKind::rough, ModelKind::smooth, ModelKind::disk, ModelKind::shape, ModelKind::bubble})
    models.push_back(catalogue_model(kind));
  return models;
}

}  // namespace

Settings::Settings() : model(all_models()) { bind(); }

Settings::Settings(const std::vector<std::string>& arguments) : Settings() {
  arguments_ = arguments;
  options.parse(arguments);
  check();
}

void Settings::refuse_unread() const {
  model.refuse_unread(options, overdamped() && !droplets() ? Drag<2>::name() : "");
}

void Settings::check() const {
  if (!droplets())
    for (const char* name : {"b", "mobility", "wall_friction"})
      if (options.given(name))
        throw InputError("-{} with the model {}: only droplets (bubble) have this friction; leave it out", name,
                         model.name);
  if (droplets() && options.given("dynamics") && dynamics == Dynamics::inertial)
    throw InputError("-dynamics inertial with the model bubble: droplets have no inertia; leave -dynamics out");
  if (!overdamped()) return;
  if (model.particles() == ModelKind::disk)
    throw InputError("-dynamics overdamped with the model disk, which needs inertia; use another model, such as sp");
  if (method == Method::verlet)
    throw InputError(
        "-integrator verlet needs inertia, but the particles have none; use a method of PETSc, such as rk");
  if (const Real mu = model.value(Role::kinetic_friction); !droplets() && mu > 0)
    throw InputError("-dynamics overdamped with {0} {1}: velocities follow from drag alone; use {0} 0",
                     model.option(Role::kinetic_friction), mu);
}

template <int D>
std::unique_ptr<Mobility<D>> Settings::mobility() const {
  if (!droplets()) return std::make_unique<PointDrag<D>>(model.term(Drag<D>{}));
  return std::make_unique<NeighbourDrag<D>>(
      NeighbourDragOptions{b, model.term(Depletion<D>{}).range(), wall_friction, coupling});
}

template <int D>
Real Settings::relaxation_rate(const Topology& particles, const CriticalStep& critical, bool walls) const {
  const int walls_at_once = walls ? 2 : 0;  // on both sides of a droplet
  if (droplets()) return fastest_relaxation(model, b, particles.diameter, walls_at_once, wall_friction);
  const auto drag = model.term(Drag<D>{});
  Real most = 0;
  for (Index m = 0; m < particles.particles(); ++m)
    most = std::max(most, particles.point_mass[m] * drag_shares<D>(drag.law, particles, m));
  return critical.crowded.translation.stiffness * most / drag.zeta;
}

template std::unique_ptr<Mobility<2>> Settings::mobility<2>() const;
template std::unique_ptr<Mobility<3>> Settings::mobility<3>() const;
template Real Settings::relaxation_rate<2>(const Topology&, const CriticalStep&, bool) const;
template Real Settings::relaxation_rate<3>(const Topology&, const CriticalStep&, bool) const;

void Settings::bind() {
  model.bind(options, UnitSystem::gravitational());
  bind_droplet_drag(options, b, coupling);
  options.bind("wall_friction", wall_friction,
               {.help = "walls exert viscous friction on droplets, like a static neighbour [T 4.1]"});
  options.group("Integration");
  options.bind(
      "dynamics", dynamics, {{"inertial", Dynamics::inertial}, {"overdamped", Dynamics::overdamped}},
      {.help = "Newton's equations, or overdamped: velocity = force / drag coefficient; droplets: overdamped"});
  options.bind("integrator", method, {{"verlet", Method::verlet}, {"ts", Method::ts}},
               {.help = "velocity Verlet with a fixed step, or a method of PETSc TS",
                .cures = {{Cure::verlet, "verlet"}, {Cure::ts, "ts"}}});
  options.bind("implicit", implicit, {{"all", TermGroup::all}, {"shape", TermGroup::shape}},
               {.help = "forces that the integrator treats implicitly: all, or shape energies alone",
                .cures = {{Cure::split_forces, "shape"}, {Cure::whole_forces, "all"}}});
  options.bind("jacobian", jacobian,
               {{"assembled", JacobianKind::assembled}, {"matrix_free", JacobianKind::matrix_free}},
               {.help = "Jacobian of an implicit method: sparse matrix, or matrix-free products"});
  options.bind("dt", dt,
               {.help = "fixed step, or first step of an adaptive method",
                .unit = "t0",
                .min = 0,
                .min_open = true,
                .cures = {Cure::shorter_step},
                .automatic = "part of the limit of stability"});
  options.bind("allow_unstable_dt", allow_unstable_dt, {.help = "allow a fixed step above the limit of stability"});
  options.bind("allow_energy_error", allow_energy_error,
               {.help = "continue if energy is not conserved to 10 %, instead of an error"});
  options.bind(
      "allow_passing_overlap", allow_passing_overlap,
      {.help = "continue if disks, spheres or droplets overlap by more than 95 % of their contact distance, and "
               "pass through each other"});
  options.bind("skin", skin,
               {.help = "skin of the neighbour lists",
                .unit = "sigma_avg",
                .min = 0,
                .min_open = true,
                .automatic = "part of the mean diameter, then tuned"});
  options.bind("threads", threads, {.help = "threads; results do not depend on their number", .min = 1, .max = 1024});
}

}  // namespace pliant::python
