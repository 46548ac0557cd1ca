#include <pliant/scenarios/packings/options.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>
#include <pliant/catalogue/droplet_rest.h>
#include <pliant/jamming/potential.h>
#include <pliant/scenarios/particles/options.h>

namespace pliant {
namespace {

const std::vector<std::pair<std::string, Minimiser>> minimisers{
    {"lbfgs", Minimiser::lbfgs}, {"newton", Minimiser::newton}, {"fire", Minimiser::fire}};

std::vector<ModelDefinition> models() {
  std::vector<ModelDefinition> all;
  for (const ModelKind kind : {ModelKind::sp, ModelKind::rough, ModelKind::smooth, ModelKind::bubble})
    all.push_back(catalogue_model(kind));
  return all;
}

}  // namespace

PackingOptions::PackingOptions(std::initializer_list<std::string_view> unused) : model(models()) {
  for (const std::string_view term : {"friction", "friction_vertex", "friction_edge", "wall", "lip"})
    model.leave_out(term);
  for (const std::string_view term : unused) model.leave_out(term);
  model.set_default(Role::contact_energy, 1.0);
  model.set_default(Role::wall_energy, 1.0);
  model.set_default(Role::volume, 10);
  model.set_default(Role::area, 10, 1);
  model.set_default(Role::perimeter, 1.0);
  model.set_default(Role::bending, 0.0);
  model.set_default(Role::contact_force, 1.0);
  model.keep(Role::mean_radius);  // of walls
  frame_interval = sample_interval = 1;
}

void PackingOptions::bind_particles(Options& o) {
  constexpr auto fixed = OnRestart::fixed;
  o.explain_units({{"sigma_avg", "sigma_avg, the mean diameter, is the unit of length: leave it out"},
                   {"sigma", "sigma_avg, the mean diameter, is the unit of length: leave it out"},
                   {"eps", "eps is the unit of energy, in which contact energies are given: leave it out"}});
  model.bind(o, UnitSystem::static_packings(), true);
  o.bind("dim", dim,
         {.help = "dimension",
          .min = 2,
          .max = 3,
          .cures = {{Cure::two_dimensions, "2"}, {Cure::three_dimensions, "3"}},
          .on_restart = fixed});
  o.group("Particles");
  o.bind("n", particles,
         {.help = "number of particles", .min = 1, .max = 1e7, .cures = {Cure::more_particles}, .on_restart = fixed});
  o.bind("seed", seed, {.help = "seed of all random numbers", .min = 0, .on_restart = fixed});
  bind_sizes(o, sizes);
  bind_shape(o, shape);
  bind_mesh(o, mesh);
}

void PackingOptions::resolve_particles() {
  resolve_shape(shape, mesh, model.particles(), dim);
  if (dim == 2) {
    check_regular_shape(shape);
    model.resolve<2>({});
  } else {
    model.resolve<3>({});
  }
}

std::string PackingOptions::minimiser_name() const {
  return std::ranges::find(minimisers, minimiser, &std::pair<std::string, Minimiser>::second)->first;
}

void PackingOptions::bind_minimisation(Options& o) {
  constexpr auto fixed = OnRestart::fixed;
  o.group("Minimisation");
  o.bind("minimiser", minimiser, minimisers,
         {.help = "near a minimum: L-BFGS where it is faster than FIRE, Newton's method (PETSc TAO, -tao_...), or FIRE",
          .on_restart = fixed});
  o.bind("force_tolerance", force_tolerance,
         {.help = "largest force at a minimum, divided by the pressure times sigma_avg^(d-1)",
          .min = 1e-12,
          .max = 0.1,
          .on_restart = fixed});
  o.bind("max_iterations", max_iterations,
         {.help = "largest number of iterations of a minimisation", .min = 1, .on_restart = fixed});
  bind_threads(o);
}

void PackingOptions::bind_analysis(Options& o) {
  constexpr auto fixed = OnRestart::fixed;
  o.group("Analysis");
  o.bind("contact_threshold", contact_threshold,
         {.help = "smallest force of a contact that counts, divided by (sum f^2)/(sum f)",
          .min = 0,
          .max = 0.5,
          .on_restart = fixed});
  o.bind("moduli", moduli,
         {.help = "elastic moduli of each packing; force tolerance at most 1e-12", .on_restart = fixed});
  o.bind(
      "modes", modes,
      {.help = "number of the lowest vibrational modes of each packing in the series", .min = 0, .on_restart = fixed});
  o.bind("pre_stress", pre_stress, {{"kept", PreStress::kept}, {"dropped", PreStress::dropped}},
         {.help = "modes: with pre-stress, or as if contacts and shapes were at rest",
          .only_with = "-modes",
          .on_restart = fixed});
  o.bind("mode_amplitude", mode_amplitude,
         {.help = "energies of packings displaced along modes: largest displacement of a point, and 32 smaller ones",
          .unit = "sigma_avg",
          .only_with = "-modes",
          .min = 0,
          .min_open = true,
          .automatic = "no such energies",
          .on_restart = fixed});
}

std::vector<Real> PackingOptions::mode_amplitudes() const {
  constexpr int per_decade = 8, decades = 4;
  std::vector<Real> all;
  if (mode_amplitude)
    for (int k = -decades * per_decade; k <= 0; ++k)
      all.push_back(*mode_amplitude * std::pow(Real(10), Real(k) / per_decade));
  return all;
}

std::optional<Index> PackingOptions::free_coordinates() const {
  if (!model.deformable()) return dim;
  if (dim == 3 || !(model.value(Role::perimeter) > 0 && model.value(Role::area) > 0)) return {};
  return model.value(Role::bending) > 0 ? 3 : shape.vertices - 1;
}

void PackingOptions::bind_packing_output(Options& o, const std::string& step) {
  bind_output(o, false);
  o.bind("frame_interval", frame_interval, {.help = "number of " + step + " between frames", .min = 1});
  o.bind("sample_interval", sample_interval,
         {.help = "number of " + step + " between samples of the series", .min = 1});
}

void PackingOptions::refuse_unread(const Options& options) const {
  model.refuse_unread(options);
  refuse_unread_particles(options, model, sizes);
  if (!model.deformable()) refuse_unread_by("-model " + model.name, options, {"mesh"});
  if (dim == 2) refuse_unread_by("-dim 2", options, {"mesh"});
  if (!mesh.empty()) refuse_unread_by("-mesh", options, {"n_vertices"});
  if (modes == 0) refuse_unread_by("-modes 0", options, {"pre_stress", "mode_amplitude"});
}

void PackOptions::bind_path(Options& o, bool compresses) {
  constexpr auto fixed = OnRestart::fixed;
  bind_particles(o);
  o.group("Packing");
  using enum PackingPath;
  using Paths = std::vector<std::pair<std::string, PackingPath>>;
  o.bind("path", path,
         compresses ? Paths{{"decompress", decompress}, {"compress", compress}, {"quench", quench}}
                    : Paths{{"decompress", decompress}, {"quench", quench}},
         {.help = compresses ? "lower the pressure in steps, raise the fraction in steps, or find one minimum"
                             : "lower the pressure in steps, or find one minimum",
          .on_restart = fixed});
  o.bind("fraction", fraction,
         {.help = "area or volume fraction of the random start",
          .min = 1e-3,
          .max = 3,
          .max_open = true,
          .automatic = fmt::format(
              "soft particles: 0.9 (3D: 0.7){}; deformable: disks around them cover 0.65 (3D: spheres 0.55)",
              compresses ? ", compress: 0.5 (3D: 0.3)" : ""),
          .on_restart = fixed});
  o.bind("pressure", pressure,
         {.help = "pressure of the last packing", .unit = "eps/sigma_avg^d", .min = 0, .min_open = true});
  o.bind("start_pressure", start_pressure,
         {.help = "decompress: pressure of the first packing",
          .unit = "eps/sigma_avg^d",
          .min = 0,
          .min_open = true,
          .on_restart = fixed});
  o.bind("steps_per_decade", per_decade,
         {.help = "decompress: pressures for each factor of ten", .min = 1, .max = 1000, .on_restart = fixed});
  if (compresses)
    o.bind("fraction_step", fraction_step,
           {.help = "compress: growth of the fraction in a step",
            .min = 0,
            .max = 0.1,
            .min_open = true,
            .on_restart = fixed});
}

void PackOptions::bind(Options& o) {
  bind_path(o, true);
  bind_minimisation(o);
  bind_analysis(o);
  bind_packing_output(o, "packings");
}

void PackOptions::resolve() {
  resolve_particles();
  if (model.particles() == ModelKind::bubble)  // refuses attraction that is stronger than the contact force
    for (const Real sigma : {sizes.smallest(), sizes.largest()})
      droplets_at_rest(model.term(BubbleContact<2>{}).law, model.term(Depletion<2>{}).law, sigma / 2, sigma / 2);
  if (modes > points() * dim)
    throw InputError("-modes {}: {} points in {}D have {} modes; give fewer", modes, points(), dim, points() * dim);
  if (const Index most = dim == 2 ? Potential<2>::most_points : Potential<3>::most_points;
      minimiser == Minimiser::newton && points() > most)
    throw InputError(
        "-minimiser newton with {} points in {}D: with more than {} the factors of the Hessians take too long; "
        "use -minimiser lbfgs, or fewer points",
        points(), dim, most);
  if (!fraction) {
    fraction = path == PackingPath::compress ? (dim == 2 ? 0.5 : 0.3) : (dim == 2 ? 0.9 : 0.7);
    if (model.deformable()) {
      // The disks (spheres) around the particles have to find room.
      const Topology one = make_particles(model.particles(), dim, {1}, shape);
      const Real radius = outer_radius(one, 0);
      fraction = dim == 2 ? 0.65 * one.a0[0] / (pi * square(radius))
                          : 0.55 * one.a0[0] / (4 * pi / 3 * radius * square(radius));
    }
  }
  if (path == PackingPath::decompress && pressure > start_pressure)
    throw InputError("-pressure {:g} is above -start_pressure {:g}: a decompression lowers the pressure; exchange them",
                     pressure, start_pressure);
}

std::vector<Real> PackOptions::pressures() const {
  if (path == PackingPath::quench) return {};
  if (path == PackingPath::compress) return {pressure};
  std::vector<Real> all;
  const Real decades = std::log10(start_pressure / pressure);
  const auto steps = static_cast<int>(std::ceil(decades * per_decade - 1e-9));
  for (int k = 0; k < steps; ++k) all.push_back(start_pressure * std::pow(10, -static_cast<Real>(k) / per_decade));
  all.push_back(pressure);
  return all;
}

void PackOptions::refuse_unread(const Options& options) const {
  PackingOptions::refuse_unread(options);
  refuse_unread_by_path(options);
  if (path == PackingPath::quench) refuse_unread_by("-path quench", options, {"pressure"});
  if (path != PackingPath::compress) refuse_unread_by("-path " + path_name(), options, {"fraction_step"});
}

void PackOptions::refuse_unread_by_path(const Options& options) const {
  if (path != PackingPath::decompress)
    refuse_unread_by("-path " + path_name(), options, {"start_pressure", "steps_per_decade"});
}

std::string PackOptions::path_name() const {
  return path == PackingPath::decompress ? "decompress" : path == PackingPath::compress ? "compress" : "quench";
}

std::string PackOptions::path_text() const {
  const std::string_view name = path == PackingPath::decompress ? "decompression"
                                : path == PackingPath::compress ? "compression"
                                                                : "quench";
  const std::string end = path == PackingPath::quench ? "" : fmt::format(" to the pressure {:g}", pressure);
  return fmt::format("{} particles ({}, {}D), {} from the fraction {:.4g}{}", particles, model.name, dim, name,
                     *fraction, end);
}

ShearOptions::ShearOptions() : PackOptions(std::initializer_list<std::string_view>{}) {
  pressure = 1e-3;
  model.make_automatic(Role::drag, "1 with -shear_rate; else 0");
}

void ShearOptions::bind(Options& o) {
  constexpr auto fixed = OnRestart::fixed;
  bind_path(o, false);
  o.group("Shear");
  o.bind("shear_rate", rate,
         {.help = "steady shear at this rate, with drag relative to the flow",
          .unit = "1/t0",
          .min = 0,
          .min_open = true,
          .automatic = "quasistatic steps",
          .on_restart = fixed});
  o.bind("strain", strain,
         {.help = "shear strain at the end",
          .min = 0,
          .max = 1e6,
          .min_open = true,
          .extends = {"strain", "LARGER"},
          .automatic = "0.1; with -shear_rate 10"});
  o.bind(
      "strain_step", strain_step,
      {.help = "quasistatic: shear strain of each step", .min = 0, .max = 0.1, .min_open = true, .on_restart = fixed});
  o.bind("cycles", cycles,
         {.help = "quasistatic: cycles of strain 0, +strain, -strain, 0; 0 cycles: one direction",
          .min = 0,
          .max = 1e6,
          .extends = {"cycles", "MORE"}});
  o.bind("control", control, {{"volume", ShearControl::volume}, {"pressure", ShearControl::pressure}},
         {.help = "quasistatic: constant during shear, the volume or the pressure -pressure", .on_restart = fixed});
  o.bind("integrator", integrator, {{"verlet", ShearIntegrator::verlet}, {"ts", ShearIntegrator::ts}},
         {.help = "-shear_rate: velocity Verlet with a fixed step, or PETSc TS (-ts_type, -ts_rtol, ...)",
          .cures = {{Cure::verlet, "verlet"}, {Cure::ts, "ts"}},
          .on_restart = fixed});
  o.bind(
      "dt", dt,
      {.help = "-shear_rate: fixed step, or first step of an adaptive method",
       .unit = "t0",
       .min = 0,
       .min_open = true,
       .cures = {Cure::shorter_step},
       .automatic = "0.2 of the elastic limit, at most 0.5 of the damping limit, 0.7 of dt_critical, a strain of 0.1",
       .on_restart = fixed});
  bind_allowed(o);
  bind_minimisation(o);
  bind_analysis(o);
  bind_output(o, false);
  o.bind("frame_interval", frames_,
         {.help = "packings between frames; with -shear_rate time in t0",
          .min = 0,
          .min_open = true,
          .automatic = "1; with -shear_rate a strain of 0.2"});
  o.bind("sample_interval", samples_,
         {.help = "packings between samples of the series; with -shear_rate time in t0",
          .min = 0,
          .min_open = true,
          .automatic = "1; with -shear_rate a strain of 0.01"});
}

void ShearOptions::resolve() {
  PackOptions::resolve();
  if (rate && model.particles() == ModelKind::bubble)
    throw InputError("-shear_rate with -model bubble: droplets have no inertia; leave it out for quasistatic steps");
  if (!strain) strain = rate ? 10 : 0.1;
  sample_interval = samples_.value_or(rate ? 0.01 / *rate : 1);
  frame_interval = frames_.value_or(rate ? 0.2 / *rate : 1);
  if (!model.is_set(Role::drag)) model.set(Role::drag, rate ? 1.0 : 0.0);
  if (!rate)
    for (const auto& [name, value] :
         {std::pair("sample_interval", sample_interval), {"frame_interval", frame_interval}})
      if (!(value >= 1)) throw InputError("-{} {:g}: at least one packing; give 1 or more", name, value);
}

void ShearOptions::refuse_unread(const Options& options) const {
  PackingOptions::refuse_unread(options);
  refuse_unread_by_path(options);
  if (path == PackingPath::quench && control == ShearControl::volume)
    refuse_unread_by("-path quench and -control volume", options, {"pressure"});
  const auto refuse = [&](const std::vector<std::string>& names, std::string_view reason) {
    for (const std::string& name : names)
      if (options.given(name)) throw InputError("-{} ({}) {}; leave it out", name, options.source(name), reason);
  };
  if (rate)
    refuse({"strain_step", "cycles", "control", "moduli", "modes", "contact_threshold"},
           "with -shear_rate, which makes no packings at equilibrium");
  else
    refuse({model.table().with(Role::drag)[0]->name, "drag", "dt", "integrator", "allow_unstable_dt",
            "allow_energy_error"},
           "without -shear_rate: quasistatic shear has no velocities");
}

}  // namespace pliant
