#include <pliant/scenarios/channel/options.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <map>

#include <pliant/base/errors.h>
#include <pliant/base/text.h>
#include <pliant/model/contact_laws.h>
#include <pliant/setup/polylines.h>

namespace pliant {
namespace {

constexpr Real never = 1e300;  ///< s between frames if no frames are wanted

constexpr const char* one_outline = "the outline of a channel is one polygon, and plungers are sides of it";
constexpr const char* one_shape = "the shape of a particle is one polygon";

/// The corners in a file: one polygon. name: name of the file, `what`: explanation, both for messages.
std::vector<Vec<2>> parse_corners(std::string_view text, const std::string& name, const char* what = one_outline) {
  std::vector<Polyline> all = parse_polylines(text, name, "cm");
  if (all.size() > 1) throw InputError("{}:{}: a second polyline; {}", name, all[1].lines[0], what);
  try {
    return make_polygon(std::move(all[0].points));
  } catch (const InputError& error) {
    throw InputError("{}: {}", name, error.what());
  }
}

/// The corners in a file, relative to `folder`; kind: noun for the file in messages.
std::string corners_of(const std::string& file, const std::filesystem::path& folder, const std::string& kind,
                       const char* what) {
  const std::string path = path_from(folder, file);
  std::string text;
  for (const Vec<2>& r : parse_corners(read_text_file(path, largest_outline, kind), kind + " " + printable(path), what))
    text += fmt::format("{} {}\n", r[0], r[1]);
  return text;
}

std::string read_corners(const std::string& file, const std::filesystem::path& folder) {
  return corners_of(file, folder, "outline", one_outline);
}
std::string read_shape(const std::string& file, const std::filesystem::path& folder) {
  return corners_of(file, folder, "shape", one_shape);
}

/// "x,y;x,y"
std::vector<Vec<2>> parse_places(const std::string& text) {
  const auto values = parse_numbers(text, ",; \t");
  if (!values || values->empty() || values->size() % 2 != 0)
    throw InputError("-plungers {}: not a list of places; write x,y;x,y, two numbers in cm for each", printable(text));
  std::vector<Vec<2>> places;
  for (std::size_t k = 0; k < values->size(); k += 2) places.emplace_back((*values)[k], (*values)[k + 1]);
  return places;
}

}  // namespace

ChannelOptions::ChannelOptions()
    : model({catalogue_model(ModelKind::disk), catalogue_model(ModelKind::rough)},
            {.substrate = true,
             .rest_outlines = true,
             .materials = {"plunger"},
             .usual_dynamic_friction = 0.3}) {  // acrylic on acrylic and on aluminium [T 3.2]
  frame_interval = never;
  for (const Role role : {Role::contact_energy, Role::wall_energy, Role::contact_law}) model.keep(role);
  constexpr Real earth = 981;
  model.set_default(Role::normal_gravity, earth);
}

void ChannelOptions::bind(Options& o) {
  constexpr auto fixed = OnRestart::fixed;
  const auto positive = [](std::string help, std::string unit, std::vector<OptionCure> cures = {}) {
    return OptionSpec{.help = std::move(help),
                      .unit = std::move(unit),
                      .min = 0,
                      .min_open = true,
                      .cures = std::move(cures),
                      .on_restart = fixed};
  };

  o.group("Channel");
  o.bind("geometry", kind,
         {{"L", ChannelKind::l}, {"T", ChannelKind::t}, {"X", ChannelKind::x}, {"straight", ChannelKind::straight}},
         {.help = "directions of the arms: x y (L), x y -x (T), x y -x -y (X), x -x (straight)", .on_restart = fixed});
  o.bind("channel_width", size.width, positive("width of the channel", "cm", {Cure::wider_container}));
  o.bind("channel_arm", size.arm, positive("length of an arm, from its end to the far side of the bend", "cm"));
  o.bind("outline", outline,
         {.help = "file with the corners of a channel: lines x y in cm, one polygon",
          .cures = {Cure::own_outline},
          .on_restart = fixed,
          .read = read_corners});
  o.bind("plungers", plungers,
         {.help = "points x,y, one on each plunger side, in order of pushes; empty: all arms", .on_restart = fixed});
  o.bind("shear", shear,
         {.help = "-geometry straight: speed of the side walls, divided by the plunger speed", .on_restart = fixed});

  o.group("Disks");
  start.bind(o);
  o.bind("distribution", distribution,
         {.help = "sizes of the disks, from [T table 3.1]", .choices = size_distribution_names(), .on_restart = fixed});
  o.bind("radii", radii,
         {.help = "list of radii separated by commas, instead of -distribution", .unit = "cm", .on_restart = fixed});
  o.bind("counts", counts, {.help = "relative numbers of disks of these radii", .on_restart = fixed});
  o.bind("area_fraction", area_fraction,
         {.help = "area of the disks, divided by the area between the plungers after a stroke",
          .min = 0,
          .max = 1,
          .min_open = true,
          .on_restart = fixed});
  o.bind("density", density, positive("density of the disks", "g/cm^3"));
  o.bind("thickness", thickness, positive("thickness of the disks", "cm"));
  o.bind("start_overlap", start_overlap,
         {.help = "largest overlap at the start, divided by the contact distance",
          .min = 1e-12,
          .max = 0.1,
          .on_restart = fixed});
  o.bind("seed", seed, {.help = "seed of the initial positions", .min = 0, .on_restart = fixed});

  model.bind(o, UnitSystem::cgs());
  o.bind("shape", shape.kind, {{"ellipse", OutlineKind::ellipse}, {"rod", OutlineKind::rod}},
         {.help = "-model rough: shape of the polygons; each has the area of a disk", .on_restart = fixed});
  o.bind("aspect", shape.aspect,
         {.help = "-model rough: length divided by width",
          .min = 1,
          .max = 20,
          .cures = {Cure::smaller_aspect},
          .on_restart = fixed});
  o.bind("shape_outline", shape_outline,
         {.help = "-model rough: file with the corners of a shape: lines x y, one polygon",
          .on_restart = fixed,
          .read = read_shape});
  o.bind("n_vertices", n_vertices,
         {.help = "-model rough: vertices of the smallest polygons; edges have equal length",
          .min = 6,
          .max = 1000,
          .cures = {Cure::even_vertices, Cure::more_vertices},
          .on_restart = fixed});
  o.bind("stiffness", stiffness,
         positive("stiffness of contacts, the same for all sizes", "g/s^2",
                  {Cure::stiffer_contacts, Cure::stiffer_walls, Cure::softer_particles}));

  o.group("Plungers");
  o.bind(
      "pushes", pushes,
      {.help = "number of pushes, one plunger after the other", .min = 1, .max = 1e6, .extends = {"pushes", "MORE"}});
  o.bind("plunger_speed", push.speed, positive("speed of a plunger", "cm/s"));
  o.bind("stroke", push.stroke, positive("travel of a plunger in a push", "cm"));
  o.bind("retract_speed", push.retract_speed,
         {.help = "speed of the returning plunger; 0: returns at once", .unit = "cm/s", .min = 0, .on_restart = fixed});
  o.bind(
      "pause", push.pause,
      {.help = "pause between the return of a plunger and the next push", .unit = "s", .min = 0, .on_restart = fixed});

  o.group("Jams");
  o.bind("jam_overlap", jam_overlap,
         {.help = "overlap that counts as a jam, divided by the radius of the smaller disk",
          .min = 0,
          .max = 1,
          .min_open = true});
  o.bind("jam_force", jam_force,
         {.help = "plunger force that counts as a jam, divided by the weight of all disks; 0: none", .min = 0});
  o.bind("on_jam", on_jam, {{"continue", OnJam::proceed}, {"end", OnJam::end}},
         {.help = "at a jam: continue, or end the run"});

  o.group("Integration");
  o.bind("dt", dt,
         {.help = "longest step; shortened so that it divides the time between frames",
          .unit = "s",
          .min = 0,
          .min_open = true,
          .cures = {Cure::shorter_step},
          .automatic = "0.2 of the elastic limit, at most 0.5 of the damping limit, 0.7 of dt_critical",
          .on_restart = fixed});
  bind_allowed(o);
  o.bind("t_end", t_end,
         {.help = "end of the run; if between two pushes, the run ends with the earlier push",
          .unit = "s",
          .min = 0,
          .extends = {"t_end", "LATER"},
          .automatic = "the end of the last push"});
  bind_threads(o);
  o.bind("skin", skin,
         {.help = "skin of the neighbour lists",
          .unit = "cm",
          .min = 0,
          .min_open = true,
          .automatic = "tuned to the motion during the run",
          .on_restart = fixed});

  bind_output(o, false);
  o.bind("frame_travel", push.frame_travel,
         positive("travel of the plunger between frames, rounded so that it divides the stroke", "cm"));
  o.bind("sample_travel", sample_travel,
         {.help = "travel of the plunger between samples of the series", .unit = "cm", .min = 0, .min_open = true});
}

void ChannelOptions::take_start(const std::optional<Checkpoint>& checkpoint) {
  start.take({.dim = 2,
              .model = model.name,
              .polygons = rough(),
              .rotates = model.particles() == ModelKind::disk,
              .length = "cm",
              .density = density * thickness},
             checkpoint);
}

void ChannelOptions::resolve_sizes() {
  if (!start.given()) {
    sizes = radii.empty() && counts.empty() ? size_distribution(distribution) : parse_sizes(radii, counts);
    disks = disks_for_area(sizes, area_fraction * filled_area());
    return;
  }
  std::map<Real, Index, std::greater<>> numbers;
  for (const Real sigma : start.particles().topology.sigma) ++numbers[sigma / 2];
  sizes.clear();
  disks.clear();
  for (const auto& [radius, number] : numbers) {
    sizes.push_back({radius, static_cast<Real>(number)});
    disks.push_back(number);
  }
}

/// The polygons of the file, or the sizes of the distribution: visit(number of vertices, k). A run that is too large
/// for the memory has no list of all polygons yet.
template <class Visit>
void ChannelOptions::for_each_polygon(Visit&& visit) const {
  const auto count = start.given() ? start.particles().topology.particles() : static_cast<Index>(sizes.size());
  for (Index k = 0; k < count; ++k)
    visit(start.given() ? start.particles().topology.points_of(k) : vertices(sizes[static_cast<std::size_t>(k)].radius),
          k);
}

/// Rest length of the edges of one of them.
Real ChannelOptions::edge_of(Index k) const {
  return start.given() ? start.particles().topology.l0[k] : edge(sizes[static_cast<std::size_t>(k)].radius);
}

Real ChannelOptions::resolve_outlines() {
  const OutlineShape drawn =
      shape_outline.empty()
          ? shape
          : OutlineShape{OutlineKind::corners, 1, parse_corners(shape_outline, "-shape_outline", one_shape)};
  RestOutlines all;
  const auto need = [&](Index n) {
    const auto k = static_cast<std::size_t>(n);
    all.resize(std::max(all.size(), k + 1));
    if (all[k].empty()) all[k] = rest_outline(drawn, n);
  };
  for_each_polygon([&](Index n, Index) { need(n); });
  outlines = std::make_shared<RestOutlines>(std::move(all));
  Real largest = 0;
  for_each_polygon([&](Index n, Index k) { largest = std::max(largest, edge_of(k) * outline_radius((*outlines)[n])); });
  return largest;
}

Topology ChannelOptions::particles() const {
  if (start.given()) return start.particles().topology;
  Topology all;
  for (std::size_t k = 0; k < sizes.size(); ++k) {
    const Real R = sizes[k].radius;
    for (Index n = 0; n < disks[k]; ++n)
      if (rough())
        all.add_polygon(vertices(R), pi * square(R), edge(R), edge(R), mass(R));
      else
        all.add_soft(2 * R, mass(R));
  }
  return all;
}

void ChannelOptions::resolve() {
  channel = outline.empty() ? Channel(kind, size) : Channel(parse_corners(outline, "-outline"));
  if (!plungers.empty()) channel->set_plungers(parse_places(plungers));
  if (channel->plungers().empty())
    throw InputError("-outline without plungers; name the sides that are plungers with -plungers x,y;x,y");
  channel->check_stroke(push.stroke);
  if (gravity() == 0 && jam_force > 0)
    throw InputError(
        "{} 0: -jam_force {:g} counts the weight of all disks, which is 0; set -jam_force 0, so that only overlaps "
        "count as jams",
        model.option(Role::normal_gravity), jam_force);
  if (shear != 0 && (kind != ChannelKind::straight || !outline.empty()))
    throw InputError("-shear {:g}: only the walls of -geometry straight can move along themselves; leave it out",
                     shear);

  resolve_sizes();
  const Real largest = rough()
                           ? resolve_outlines()
                           : std::ranges::max_element(sizes, {}, [](const SizeClass& of) { return of.radius; })->radius;
  for (const Plunger& p : channel->plungers())
    if (2 * largest >= p.width())
      throw InputError(
          "{0}s of a radius of {1:g} cm and a plunger that is {2:g} cm wide; use smaller {0}s or a wider channel",
          particle(), largest, p.width());

  Real contact = stiffness, wall = stiffness;
  if (rough()) {
    Real smallest = std::numeric_limits<Real>::infinity();
    for_each_polygon([&](Index, Index k) { smallest = std::min(smallest, edge_of(k)); });
    contact = stiffness * square(smallest);
    wall = contact / 4;  // over half the distance
  }
  model.set(Role::contact_energy, contact);
  model.set(Role::wall_energy, wall);
  model.set(Role::contact_law, to_string(rough() ? ContactLaw::harmonic : ContactLaw::spring));
  model.resolve(surroundings());
  sample_interval = sample_travel / push.speed;
}

void ChannelOptions::refuse_unread(const Options& o) const {
  model.refuse_unread(o);
  start.refuse(o, {"distribution", "radii", "counts", "area_fraction", "start_overlap", "n_vertices", "seed"});
  if (start.given() && start.particles().has_masses) start.refuse(o, {"density", "thickness"});
  const auto refuse = [&](const std::string& name, const std::string& other) {
    if (o.given(name)) throw InputError("-{} with -{}, which replaces it; leave one of them out", name, other);
  };
  if (!outline.empty())
    for (const char* name : {"geometry", "channel_width", "channel_arm"}) refuse(name, "outline");
  if (!radii.empty() && distribution != ChannelOptions().distribution) refuse("distribution", "radii");
  if (!shape_outline.empty())
    for (const char* name : {"shape", "aspect"}) refuse(name, "shape_outline");
  const auto refuse_all = [&](std::initializer_list<const char*> names, const char* why) {
    for (const char* name : names)
      if (o.given(name)) throw InputError("-{} with -model {}: {}; leave it out", name, model.name, why);
  };
  if (!rough()) refuse_all({"shape", "aspect", "shape_outline", "n_vertices"}, "disks have one shape");
}

Index ChannelOptions::vertices(Real radius) const {
  Real smallest = radius;
  for (const SizeClass& of : sizes) smallest = std::min(smallest, of.radius);
  return static_cast<Index>(std::lround(n_vertices * radius / smallest));
}

Real ChannelOptions::edge(Real radius) const {
  return radius * std::sqrt(pi / outline_area((*outlines)[static_cast<std::size_t>(vertices(radius))]));
}

Real ChannelOptions::filled_area() const {
  const Real area = channel->area() - push.stroke * channel->plungers()[0].width();
  if (!(area > 0))
    throw InputError("-stroke {:g}: the plunger would fill the channel; shorten the stroke", push.stroke);
  return area;
}

}  // namespace pliant
