#include <pliant/run/options.h>

#include <fmt/format.h>

#include <filesystem>

#include <pliant/base/errors.h>

namespace pliant {

bool RunOptions::branches(const Options& options) const {
  if (restart.empty() || !options.given("output") ||
      std::filesystem::weakly_canonical(output) == std::filesystem::weakly_canonical(restart))
    return false;
  // With an options file, the folder is the folder of the run that the file creates.
  if (const std::string& from = options.source("output"); from != "command line")
    throw InputError(
        "-output {} ({}) with -restart {}: a branch needs -output on the command line; to continue in place, leave it "
        "out or give -output {}",
        output, from, restart, restart);
  return true;
}

void RunOptions::bind_output(Options& o, bool intervals) {
  o.group("Output");
  o.bind("output", output,
         {.help = "folder of the run", .cures = {Cure::other_folder}, .on_restart = OnRestart::forget});
  o.bind("restart", restart,
         {.help = "folder of a run to continue in place, or as a branch in -output", .on_restart = OnRestart::forget});
  if (intervals) {
    o.bind("frame_interval", frame_interval,
           {.help = "time between frames; less than a step: every step", .unit = "t0", .min = 0, .min_open = true});
    o.bind("sample_interval", sample_interval,
           {.help = "time between samples of the series; less than a step: every step",
            .unit = "t0",
            .min = 0,
            .min_open = true});
  }
  o.bind("frame_fields", frame_fields,
         {.help = "fields of frames: all, positions (alone), or a list with commas",
          .read = [](const std::string& text, const std::filesystem::path&) {
            try {
              parse_frame_fields(text);
            } catch (const InputError& error) {
              throw InputError("-frame_fields {}: {}", text, error.what());
            }
            return text;
          }});
  o.bind("frame_precision", frame_precision, {{"double", FramePrecision::real64}, {"single", FramePrecision::real32}},
         {.help = "precision of real numbers in frames: 16 or 7 digits"});
  o.bind("frame_deflate", frame_deflate,
         {.help = "compression of frames (HDF5's deflate): 0 none … 9 smallest and slowest",
          .min = 0,
          .max = 9,
          .cures = {{Cure::no_compression, "0"}}});
  o.bind("checkpoint_interval", checkpoint_interval,
         {.help = "wall time between checkpoints; 0: only at the start and the end", .unit = "s", .min = 0});
  o.bind("progress_interval", progress_interval,
         {.help = "wall time between progress lines if the output is not a terminal; 0: none",
          .unit = "s",
          .min = 0,
          .on_restart = OnRestart::forget});
  o.bind("ensemble", ensemble,
         {.help = "number of runs in one file, with the seeds from -seed on; 0: a single run",
          .min = 0,
          .max = 1000000,
          .on_restart = OnRestart::forget});
  o.bind("ensemble_over", ensemble_over,
         {.help = "OPTION=VALUE,VALUE,...: for each value as many runs as with -ensemble alone",
          .only_with = "-ensemble",
          .on_restart = OnRestart::forget});
  o.bind("ensemble_workers", ensemble_workers,
         {.help = "runs of an ensemble at a time; 0: one for each core",
          .only_with = "-ensemble",
          .min = 0,
          .max = 1024,
          .on_restart = OnRestart::forget});
  o.bind("max_wall_time", max_wall_time,
         {.help = "wall-time limit: writes a checkpoint and stops; 0: no limit",
          .unit = "s",
          .min = 0,
          .on_restart = OnRestart::forget});
}

void RunOptions::bind_allowed(Options& o) {
  o.bind("allow_unstable_dt", allow_unstable_dt, {.help = "continue with a fixed -dt above the limit of stability"});
  o.bind("allow_energy_error", allow_energy_error,
         {.help = "warn, instead of ending with exit code 3, if energy is not conserved to 10 %"});
}

FrameFormat RunOptions::frame_format() const {
  return {.fields = parse_frame_fields(frame_fields),
          .single = frame_precision == FramePrecision::real32,
          .deflate = frame_deflate};
}

void RunOptions::bind_threads(Options& o) {
  o.bind("threads", threads,
         {.help = "threads of each process; results do not depend on their number",
          .min = 1,
          .max = 1024,
          .on_restart = OnRestart::forget});
}

void refuse_unread_by(const std::string& by, const Options& options, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (options.given(name))
      throw InputError("-{} ({}) with {}, which does not read it; leave it out", name, options.source(name), by);
}

}  // namespace pliant
