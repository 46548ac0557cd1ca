// What every scenario's run has in common: stop requests, wall time, checkpoints now and then, the progress line.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

#include <pliant/base/types.h>

namespace pliant {

/// From construction to destruction SIGINT, SIGTERM, SIGUSR1 and SIGXCPU ask the run to stop instead of killing it; a
/// second one kills.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;
  static bool requested();
};

/// Clock of a run. Ask often: it looks at the time only now and then.
class RunControl {
 public:
  /// Wall seconds; 0 or less: never.
  RunControl(Real checkpoint_interval, Real max_wall_time);

  /// Whether to look closer at this step: cheap, true once in a while.
  bool due();
  bool stop() const;      ///< a signal came, or the wall time is used up
  bool checkpoint_due();  ///< true once per interval
  Real wall_seconds() const;
  Real cpu_seconds() const;

  /// Rewrites the progress line on a terminal (stderr), at most twice a second; silent in a pipe. `text` is made only
  /// when needed.
  void progress(const std::function<std::string()>& text);
  /// Ends the progress line.
  void end_progress();

 private:
  using Clock = std::chrono::steady_clock;
  Real seconds_since(Clock::time_point t) const;

  Real checkpoint_interval_, max_wall_time_;
  Clock::time_point start_, last_look_, last_checkpoint_, last_progress_;
  Real cpu_start_;
  int steps_to_look_ = 1, left_ = 1;
  bool terminal_, line_open_ = false;
};

/// "1 h 02 min", "35 s".
std::string duration_text(Real seconds);

}  // namespace pliant
