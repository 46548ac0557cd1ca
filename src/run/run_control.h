// Parts of all runs: stop requests, wall time, checkpoints now and then, the progress line.
#pragma once

#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <functional>
#include <string>

#include <pliant/base/ranks.h>

namespace pliant {

/// The process's response to each signal, as it was at construction. Libraries that MPI loads install handlers of their
/// own: hwloc's OpenCL plugin brings LLVM's, which replace the SIG_IGN of nohup.
class InheritedSignals {
 public:
  InheritedSignals();
  /// Restores the former responses. MPI's handlers of crashes remain, because they print the place; SIGCHLD remains
  /// MPI's.
  void restore() const;

 private:
  static constexpr int count = 32;  ///< signals 1 … 31; beyond are real-time signals
  std::array<struct sigaction, count> responses_{};
};

/// From construction to destruction SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1 and SIGXCPU request a stop instead of
/// killing the run; another signal more than two seconds after the first kills (not SIGXCPU). After destruction this
/// remains so if a signal has come. Ignored signals stay ignored: SIGHUP under nohup, SIGINT in the background of a
/// script. Within the life of another object, as in a process that makes runs of an ensemble, a request that came
/// before counts, and the request ends with the inner object.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;
  static bool requested();
  /// The first signal since construction; 0 without one.
  static int signal();
  static constexpr std::array signals{SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1, SIGXCPU};

 private:
  std::array<struct sigaction, signals.size()> before_{};
};

/// An observer of the runs of its thread while it lives, for a program that embeds runs. The monitor replaces the
/// progress line.
class RunMonitor {
 public:
  RunMonitor();
  virtual ~RunMonitor();
  RunMonitor(const RunMonitor&) = delete;
  RunMonitor& operator=(const RunMonitor&) = delete;
  /// A run begins that writes this folder.
  virtual void begin(const std::string& /*folder*/) {}
  /// A few times per second, and at the end: the time of the run, its end at the latest, and the text of the progress
  /// line.
  virtual void progress(Real t, Real end, const std::string& text) = 0;
  /// A few times per second: whether to stop the run with a checkpoint.
  virtual bool stop() = 0;
  /// The monitor of this thread, or null.
  static RunMonitor* current();

 private:
  RunMonitor* before_;
};

/// Clock of a run, to be called often: the clock reads the time only now and then. On several ranks due() must be
/// called at the same steps; if it is true, all ranks call the collective functions. The root's clock counts.
class RunControl {
 public:
  /// Wall seconds; 0 or less: never.
  RunControl(Real checkpoint_interval, Real max_wall_time, Ranks ranks = Ranks(), Real progress_interval = 0);

  /// Whether to check the clock at this step: cheap, rarely true, equal on all ranks.
  bool due();
  bool stop() const;      ///< a signal came, or the wall time is used up; collective
  bool checkpoint_due();  ///< true once per interval; collective
  Real wall_seconds() const;
  Real cpu_seconds() const;  ///< CPU time of all ranks; collective

  /// Rewrites the progress line on a terminal (stderr), at most twice a second, and prints it as a line on a standard
  /// output that is not a terminal (a file, a pipe), once in a progress interval. `text` is made only when needed.
  /// Where there is a RunMonitor, it gets the line instead, with the time of the run and its end.
  void progress(Real t, Real end, const std::function<std::string()>& text);
  /// Ends the progress line.
  void end_progress();

 private:
  using Clock = std::chrono::steady_clock;
  Real seconds_since(Clock::time_point t) const;

  Ranks ranks_;
  Real checkpoint_interval_, max_wall_time_, progress_interval_;
  Clock::time_point start_, last_look_, last_checkpoint_, last_progress_, last_line_;
  Real cpu_start_;
  int steps_to_look_ = 1, left_ = 1;
  bool terminal_, prints_lines_, line_open_ = false;
};

/// "1 h 02 min", "35 s".
std::string duration_text(Real seconds);

}  // namespace pliant
