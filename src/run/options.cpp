#include <pliant/run/options.h>

namespace pliant {

void RunOptions::bind_output(Options& o, bool intervals) {
  constexpr auto fixed = OnRestart::fixed;
  o.group("Output");
  o.bind("output", output, {.help = "folder of the run", .on_restart = OnRestart::forget});
  o.bind("restart", restart, {.help = "folder of a run to continue, in place", .on_restart = OnRestart::forget});
  if (intervals) {
    o.bind("frame_interval", frame_interval,
           {.help = "time between frames; less than a step: every step",
            .unit = "t0",
            .min = 0,
            .min_open = true,
            .on_restart = fixed});
    o.bind("sample_interval", sample_interval,
           {.help = "time between samples of the series; less than a step: every step",
            .unit = "t0",
            .min = 0,
            .min_open = true,
            .on_restart = fixed});
  }
  o.bind("checkpoint_interval", checkpoint_interval,
         {.help = "wall time between checkpoints; 0: only at the start and when stopped", .unit = "s", .min = 0});
  o.bind("max_wall_time", max_wall_time,
         {.help = "wall-time limit: writes a checkpoint and stops; 0: no limit",
          .unit = "s",
          .min = 0,
          .on_restart = OnRestart::forget});
}

void RunOptions::bind_threads(Options& o) {
  o.bind("threads", threads,
         {.help = "threads of this process (of each rank under mpiexec); results do not depend on their number",
          .min = 1,
          .max = 1024,
          .on_restart = OnRestart::forget});
}

}  // namespace pliant
