// Events of PETSc's -log_view.
#pragma once

#include <pliant/base/types.h>

namespace pliant {

/// Timed parts of the program. docs/performance.md explains the names.
enum class LogEvent {
  forces,      ///< "PliantForces": one evaluation, lists and ghosts excluded
  lists,       ///< "PliantLists": neighbour lists built
  ghosts,      ///< "PliantGhosts": ghosts found and sent whole
  halo,        ///< "PliantHalo": positions and velocities of ghosts
  sort,        ///< "PliantSort": particles sorted and moved between ranks
  reinsert,    ///< "PliantReinsert": particles reinserted
  sample,      ///< "PliantSample": a row of the series measured
  frame,       ///< "PliantFrame": a frame gathered and written
  checkpoint,  ///< "PliantCheckpoint": writing a checkpoint
};
enum class LogStage { pack, run };  ///< "Packing", "Run"

/// Starts PETSc's log if -log_view is among the options, which PETSc itself looks for only as it starts.
void start_log();

/// Measures the time from construction to destruction; hardly any cost without -log_view, and no effect if PETSc does
/// not run.
class LogScope {
 public:
  explicit LogScope(LogEvent event);
  explicit LogScope(LogStage stage);
  ~LogScope();
  LogScope(const LogScope&) = delete;
  LogScope& operator=(const LogScope&) = delete;

 private:
  int event_ = -1;
  bool stage_ = false;
};

}  // namespace pliant
