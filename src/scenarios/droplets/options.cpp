#include <pliant/scenarios/droplets/options.h>

#include <fmt/format.h>

#include <algorithm>

namespace pliant {
namespace {

constexpr auto fixed = OnRestart::fixed;

}  // namespace

void bind_droplet_drag(Options& o, Real& b, Coupling& mobility) {
  o.bind("b", b,
         {.help = "coefficient b of drag and of friction between neighbours",
          .unit = "F t0/R",
          .min = 0,
          .min_open = true,
          .on_restart = fixed});
  o.bind("mobility", mobility, {{"exact", Coupling::exact}, {"lagged", Coupling::lagged}, {"mean", Coupling::mean}},
         {.help = "solve the force balance (exact), or use previous velocities (lagged, mean)", .on_restart = fixed});
  o.accept_petsc_prefix("mobility_ksp_");
  o.accept_petsc_prefix("mobility_pc_");
}

Real fastest_relaxation(const ModelChoice& model, Real b, const std::vector<Real>& diameters, int walls_at_once,
                        bool walls_rub) {
  const Real least = *std::ranges::min_element(diameters) / 2, walls = walls_at_once;
  const Real force = model.value(Role::contact_force), pairs = force / (2 * least),
             wall = walls * force * model.value(Role::mean_radius) / square(least) / (walls_rub ? 1 + walls : 1);
  return std::max(pairs, wall) / b;
}

DropletOptions::DropletOptions() : model({catalogue_model(ModelKind::bubble)}) { model.keep(Role::mean_radius); }

void DropletOptions::bind_model(Options& o) {
  const std::string radius = "R, the mean radius of the droplets, is the unit of length: leave it out";
  o.explain_units({{"R", radius},
                   {"r", radius},
                   {"radius", radius},
                   {"rho", "rho is 1 in these units: leave it out"},
                   {"t0", "t0 = b R/force is the unit of time: leave it out"}});
  model.bind(o, UnitSystem::droplets());
  bind_droplet_drag(o, b, mobility);
}

void DropletOptions::bind_droplets(Options& o) {
  o.bind("delta", radii.deviation,
         {.help = "polydispersity: standard deviation of the radius divided by its mean",
          .min = 0,
          .max = 0.3,
          .on_restart = fixed});
  o.bind("seed", seed, {.help = "seed of all random numbers", .min = 0, .on_restart = fixed});
}

void DropletOptions::bind_integration(Options& o, const std::string& automatic_dt, const std::string& automatic_end) {
  o.group("Integration");
  o.bind("integrator", integrator, {{"ts", DropletIntegrator::ts}},
         {.help = "PETSc TS (-ts_type, -ts_atol, ...)", .cures = {{Cure::ts, "ts"}}, .on_restart = fixed});
  o.bind("dt", dt,
         {.help = "first step of an adaptive method, or the fixed step",
          .unit = "t0",
          .min = 0,
          .min_open = true,
          .cures = {Cure::shorter_step},
          .automatic = automatic_dt + "; fixed steps: at most half of the limit of stability",
          .on_restart = fixed});
  bind_allowed(o);
  o.bind("t_end", t_end,
         {.help = "end of the run", .unit = "t0", .min = 0, .extends = {"t_end", "LATER"}, .automatic = automatic_end});
  o.bind("skin", skin,
         {.help = "skin of the neighbour lists", .unit = "R", .min = 0, .min_open = true, .on_restart = fixed});
}

}  // namespace pliant
