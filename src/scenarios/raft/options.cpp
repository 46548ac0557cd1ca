#include <pliant/scenarios/raft/options.h>

#include <fmt/format.h>

#include <algorithm>

#include <pliant/base/errors.h>

namespace pliant {
namespace {

constexpr Real longest_interval = 10, way_between_samples = 1e-3;  // forces peak within 0.01 R before a fracture

}  // namespace

RaftOptions::RaftOptions() {
  radii.deviation = 1.25e-3;
  frame_interval = 1000;
}

void RaftOptions::bind(Options& o) {
  constexpr auto fixed = OnRestart::fixed;
  bind_model(o);

  o.group("Raft");
  o.bind("rows", rows, {.help = "rows p, parallel to the walls", .min = 1, .max = 10000, .on_restart = fixed});
  o.bind("columns", columns, {.help = "columns q: droplets of a row", .min = 1, .max = 10000, .on_restart = fixed});
  o.bind("n", n,
         {.help = "number of droplets; 0: all sites of the p x q lattice", .min = 0, .max = 1e6, .on_restart = fixed});
  o.bind("lattice", lattice, {{"hexagonal", RaftLattice::hexagonal}, {"disordered", RaftLattice::disordered}},
         {.help = "start: hexagonal raft, or droplets added one by one in a strip of p rows", .on_restart = fixed});
  bind_droplets(o);
  o.bind("small_fraction", radii.small_fraction,
         {.help = "fraction phi of small droplets, by number", .min = 0, .max = 1, .on_restart = fixed});
  o.bind("small_radius", radii.small,
         {.help = "radius of a small droplet", .unit = "R", .min = 0.1, .max = 1, .on_restart = fixed});

  o.group("Walls");
  o.bind("motion", motion, {{"compression", WallMotion::compression}, {"extension", WallMotion::extension}},
         {.help = "the moving wall approaches the raft, or recedes from a raft at rest", .on_restart = fixed});
  o.bind("v_wall", v_wall,
         {.help = "speed of the moving wall",
          .unit = "R/t0",
          .min = 0,
          .min_open = true,
          .cures = {Cure::smaller_load},
          .on_restart = fixed});
  o.bind("tilt", tilt,
         {.help = "angle between the moving and the fixed wall",
          .unit = "degrees",
          .min = -20,
          .max = 20,
          .on_restart = fixed});
  o.bind("start_distance", start_distance,
         {.help = "distance of the walls at the start, on the raft's axis",
          .unit = "R",
          .min = 0,
          .min_open = true,
          .cures = {Cure::less_overlap},
          .automatic = "compression: smallest distance without attraction to walls; extension: rest distance",
          .on_restart = fixed});
  o.bind("rows_end", rows_end,
         {.help = "-motion compression: ends at the rest distance of this number of rows", .min = 1, .max = 10000});
  o.bind("end_distance", end_distance,
         {.help = "distance of the walls at the end",
          .unit = "R",
          .min = 0,
          .min_open = true,
          .automatic = "compression: rest distance of -rows_end; extension: 2 more than at the start"});

  bind_integration(o, "0.1", "when -end_distance is reached");
  bind_output(o, false);
  o.bind("frame_interval", frame_interval,
         {.help = "time between frames; less than a step: every step", .unit = "t0", .min = 0, .min_open = true});
  o.bind("sample_interval", samples,
         {.help = "time between samples of the series; less than a step: every step",
          .unit = "t0",
          .min = 0,
          .min_open = true,
          .automatic = fmt::format("{:g}, or the time in which the wall moves by {:g} R, if shorter", longest_interval,
                                   way_between_samples)});
}

void RaftOptions::resolve() {
  sample_interval = samples.value_or(std::min(longest_interval, way_between_samples / v_wall));
  const Index full = rows * columns, alternate = full - rows / 2;
  if (lattice == RaftLattice::hexagonal && droplets() != full && (droplets() != alternate || columns == 1))
    throw InputError("-n {}: a hexagonal raft of {} rows and {} columns has {} droplets{}; leave -n out or change them",
                     n, rows, columns, full,
                     columns > 1 && rows > 1 ? fmt::format(", or {} if every second row has one less", alternate) : "");
}

void RaftOptions::refuse_unread(const Options& options) const {
  if (motion == WallMotion::extension) refuse_unread_by("-motion extension", options, {"rows_end"});
  if (radii.small_fraction == 0) refuse_unread_by("-small_fraction 0", options, {"small_radius"});
}

}  // namespace pliant
