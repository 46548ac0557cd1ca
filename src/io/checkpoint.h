// Checkpoints: the complete state of a run, written in turn to two files, so that one of them is always whole.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <pliant/model/state.h>

namespace pliant {

/// The state, and what the scenario and the neighbour lists need to go on bit for bit, under names of their own.
struct Checkpoint {
  State state;
  std::map<std::string, std::vector<double>> reals;  ///< not named "y" or "a"; no name that `integers` has too
  std::map<std::string, std::vector<std::int64_t>> integers;
  std::map<std::string, std::string> strings;  ///< not named "time" or "step"
};

/// Writes checkpoint-a.h5 and checkpoint-b.h5 of a folder in turn, never over the newest one that can be read.
class CheckpointWriter {
 public:
  explicit CheckpointWriter(std::filesystem::path folder);
  /// Writes atomically: on errors, and when the program is killed, the older checkpoints stay. Errors: OutputError.
  void write(const Checkpoint& checkpoint);

 private:
  std::filesystem::path folder_;
  int next_ = 0;  ///< 0: a, 1: b
};

struct NewestCheckpoint {
  Checkpoint checkpoint;
  std::string file;     ///< where it was read from
  std::string message;  ///< empty, or what is wrong with the other file, for the user to see
};

/// The checkpoint of the highest step that reads whole (checksums included). Errors: InputError if there is none.
NewestCheckpoint read_newest_checkpoint(const std::filesystem::path& folder);

}  // namespace pliant
