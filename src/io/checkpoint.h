// Checkpoints: the complete state of a run, written in turn to two files, so that one of them is always whole.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <pliant/base/types.h>
#include <pliant/io/hdf5.h>

namespace pliant {

/// What a scenario needs to go on bit for bit, under names of its own.
struct Checkpoint {
  Real t = 0;
  std::int64_t step = 0;
  std::map<std::string, std::vector<double>> reals;
  std::map<std::string, std::vector<std::int64_t>> integers;
  std::map<std::string, std::string> strings;
};

/// Writes checkpoint-a.h5 and checkpoint-b.h5 of a folder in turn, never over the newest one that can be read. A
/// checkpoint is begun, added to and finished: an array can be forgotten once it has been added.
class CheckpointWriter {
 public:
  explicit CheckpointWriter(std::filesystem::path folder);

  /// In memory; what was begun before and not finished is dropped.
  void begin(Real t, std::int64_t step);
  /// Arrays; no name twice.
  template <std::ranges::contiguous_range Values>
  void add(const std::string& name, const Values& values) {
    check_new(name);
    group_->write(name, values, {std::ranges::size(values)}, hdf5::Storage::checksum);
  }
  /// Not named "time" or "step".
  void add_text(const std::string& name, const std::string& text);
  /// Writes atomically: on errors, and when the program is killed, the older checkpoints stay. Errors: OutputError.
  void finish();

 private:
  void check_new(const std::string& name) const;

  std::filesystem::path folder_;
  int next_ = 0;  ///< 0: a, 1: b
  std::optional<hdf5::File> file_;
  std::optional<hdf5::Group> group_;
};

struct NewestCheckpoint {
  Checkpoint checkpoint;
  std::string file;     ///< where it was read from
  std::string message;  ///< empty, or what is wrong with the other file, for the user to see
};

/// The checkpoint of the highest step that reads whole (checksums included). Errors: InputError if there is none.
NewestCheckpoint read_newest_checkpoint(const std::filesystem::path& folder);

}  // namespace pliant
