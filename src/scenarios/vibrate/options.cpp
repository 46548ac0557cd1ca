#include <pliant/scenarios/vibrate/options.h>

#include <fmt/format.h>

#include <pliant/base/errors.h>
#include <pliant/scenarios/particles/options.h>

namespace pliant {
namespace {

std::vector<ModelDefinition> models_in_container() {
  std::vector<ModelDefinition> all;
  for (const ModelKind kind : {ModelKind::disk, ModelKind::sp, ModelKind::rough, ModelKind::smooth})
    all.push_back(catalogue_model(kind));
  for (ModelDefinition& model : all)
    if (model.particles != ModelKind::sp && model.particles != ModelKind::disk)
      model.space = {};  // only hoppers have checks of surfaces
  return all;
}

}  // namespace

VibrateOptions::VibrateOptions() : model(models_in_container()) {}

void VibrateOptions::bind(Options& o) {
  constexpr auto fixed = OnRestart::fixed;
  explain_gravitational_units(o);
  model.bind(o, UnitSystem::gravitational(), true);
  o.bind("dim", dim,
         {.help = "dimension; 3 for disk (spheres) and sp",
          .min = 2,
          .max = 3,
          .cures = {{Cure::two_dimensions, "2"}, {Cure::three_dimensions, "3"}},
          .on_restart = fixed});
  o.group("Particles");
  start.bind(o);
  o.bind("n", particles,
         {.help = "number of particles", .min = 1, .max = 1e8, .cures = {Cure::more_particles}, .on_restart = fixed});
  o.bind("seed", seed, {.help = "seed of all random numbers", .min = 0, .on_restart = fixed});
  bind_sizes(o, sizes);
  bind_shape(o, shape);
  bind_packing(o, pack_fraction, pack_tolerance);

  o.group("Container");
  o.bind("box_width", width,
         {.help = "distance of the side walls (3D: diameter)",
          .unit = "sigma_avg",
          .min = 0,
          .min_open = true,
          .cures = {Cure::wider_container},
          .on_restart = fixed});
  o.bind("lid", lid,
         {.help = "height of a lid above the floor",
          .unit = "sigma_avg",
          .min = 0,
          .min_open = true,
          .automatic = "no lid",
          .on_restart = fixed});
  o.bind("amplitude", amplitude,
         {.help = "amplitude A of the displacement A (1 - cos(2 pi f t))",
          .unit = "sigma_avg",
          .min = 0,
          .min_open = true,
          .on_restart = fixed});
  o.bind("frequency", frequency,
         {.help = "frequency f", .unit = "1/t0", .min = 0, .min_open = true, .on_restart = fixed});
  o.bind("direction", direction, {{"vertical", ShakeDirection::vertical}, {"horizontal", ShakeDirection::horizontal}},
         {.help = "direction of the vibration; horizontal: x", .on_restart = fixed});

  o.group("Integration");
  o.bind("integrator", integrator, {{"verlet", VibrateIntegrator::verlet}, {"ts", VibrateIntegrator::ts}},
         {.help = "velocity Verlet with a fixed step, or PETSc TS (-ts_type, -ts_rtol, ...)",
          .cures = {{Cure::verlet, "verlet"}, {Cure::ts, "ts"}},
          .on_restart = fixed});
  o.bind("dt", dt,
         {.help = "longest step; shortened so that it divides the time between samples",
          .unit = "t0",
          .min = 0,
          .min_open = true,
          .cures = {Cure::shorter_step},
          .automatic = "0.05 of the elastic limit, at most 0.25 of the damping limit, 0.7 of dt_critical",
          .on_restart = fixed});
  bind_allowed(o);
  o.bind("cycles", cycles,
         {.help = "number of cycles of the vibration, after which the run ends",
          .min = 1,
          .max = 1e9,
          .extends = {"cycles", "MORE"}});
  bind_threads(o);
  o.bind("skin", skin,
         {.help = "skin of the neighbour lists",
          .unit = "sigma_avg",
          .min = 0,
          .min_open = true,
          .automatic = "tuned to the motion during the run",
          .on_restart = fixed});

  bind_output(o, false);
  o.bind("frames_per_cycle", frames_per_cycle,
         {.help = "frames in each cycle; 0.1: a frame every ten cycles", .min = 0, .max = 1e6, .min_open = true});
  o.bind("samples_per_cycle", samples_per_cycle,
         {.help = "samples of the series in each cycle", .min = 4, .max = 1e6, .on_restart = fixed});
}

void VibrateOptions::take_start(const std::optional<Checkpoint>& checkpoint) {
  start.take(start_needs(model, dim, shape), checkpoint);
  if (start.given()) particles = start.particles().topology.particles();
}

void VibrateOptions::resolve() {
  if (dim == 3 && !model.model().space)
    throw InputError("-model {} does not exist here in 3D; use {}", model.name, cures({Cure::two_dimensions}));
  check_regular_shape(shape);
  if (dim == 2)
    model.resolve<2>({});
  else
    model.resolve<3>({});
  if (!pack_fraction) pack_fraction = default_pack_fraction(dim);
  check_dissipation(model, "a vibrated container", "the walls add", "");
  sample_interval = 1 / (frequency * samples_per_cycle);
  frame_interval = 1 / (frequency * frames_per_cycle);
}

void VibrateOptions::refuse_unread(const Options& options) const {
  start.refuse(options, {"n", "size_distribution", "size_ratio", "size_fraction", "size_deviation", "n_vertices",
                         "shape_parameter", "pack_fraction", "pack_tolerance"});
  if (start.given() && start.particles().has_widths) start.refuse(options, {"edge_width"});
  model.refuse_unread(options);
  refuse_unread_particles(options, model, sizes);
}

}  // namespace pliant
