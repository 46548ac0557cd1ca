#include <pliant/scenarios/clog/options.h>

#include <algorithm>

#include <pliant/base/errors.h>

namespace pliant {

ClogOptions::ClogOptions() {
  radii.deviation = 0.01;
  frame_interval = 500;
  sample_interval = 50;
  longest_standard_dt = 0.7;
  t_end = 1e6;
}

void ClogOptions::bind(Options& o) {
  constexpr auto fixed = OnRestart::fixed;
  bind_model(o);
  o.bind("g", g,
         {.help = "gravity: a droplet weighs g R^3",
          .unit = "F/R^3",
          .min = 0,
          .min_open = true,
          .cures = {Cure::smaller_load},
          .on_restart = fixed});
  o.bind("wall_friction", wall_friction,
         {.help = "walls exert viscous friction, like a static neighbour [T 4.1]", .on_restart = fixed});

  o.group("Droplets");
  start.bind(o);
  o.bind("n", n,
         {.help = "number of droplets", .min = 1, .max = 1e5, .cures = {Cure::more_particles}, .on_restart = fixed});
  bind_droplets(o);
  o.bind("fill_fraction", fill_fraction,
         {.help = "fraction of the area that the droplets cover at the start",
          .min = 0.01,
          .max = 0.5,
          .cures = {Cure::less_overlap},
          .on_restart = fixed});

  o.group("Hopper");
  o.bind("hopper_width", width,
         {.help = "width w of the exit",
          .unit = "2 R",
          .min = 0,
          .min_open = true,
          .cures = {Cure::narrower_orifice, Cure::wider_orifice},
          .on_restart = fixed});
  o.bind("hopper_angle", angle,
         {.help = "angle of the walls to gravity",
          .unit = "degrees",
          .min = 10,
          .max = 80,
          .cures = {Cure::other_angle},
          .on_restart = fixed});
  o.bind("clog_speed", clog_speed,
         {.help = "largest speed of droplets at rest", .unit = "R/t0", .min = 0, .min_open = true});
  o.bind("rest", rest, {{"minimum", RestRule::minimum}, {"speed", RestRule::speed}},
         {.help = "rest test: a nearby energy minimum or -clog_speed, or -clog_speed alone"});

  bind_integration(o, "0.7, at most 0.2 b/g", "");
  bind_output(o);
}

void ClogOptions::take_start(const std::optional<Checkpoint>& checkpoint) {
  start.take({.dim = 2, .model = model.name, .length = "R"}, checkpoint);
  if (start.given()) n = start.particles().topology.particles();
}

void ClogOptions::resolve() {
  if (clog_speed >= g / b)
    throw InputError("-clog_speed {}: a single droplet falls only at g/b = {}; give a smaller speed", clog_speed,
                     g / b);
  constexpr Real way_in_step = 0.2;  // a single droplet falls this far; groups fall several times as fast
  longest_standard_dt = std::min(longest_standard_dt, way_in_step * b / g);
}

}  // namespace pliant
