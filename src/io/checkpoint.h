// Checkpoints: the complete state of a run, written in turn to two files, so that one file is always complete.
#pragma once

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/base/types.h>
#include <pliant/io/hdf5.h>

namespace pliant {

/// Data with which a scenario resumes bit for bit, under names of the scenario: numbers, arrays of numbers, and texts.
/// The file may have been edited, or belong to another run: all functions check the values that they return. Errors of
/// all functions: InputError that names the file, the entry and its value.
struct Checkpoint {
  static constexpr Real any = std::numeric_limits<Real>::max();
  static constexpr std::int64_t any_count = 9'007'199'254'740'992;  ///< 2^53: sums of counts do not overflow

  /// A finite number, least … most.
  Real real(const std::string& name, Real least = -any, Real most = any) const;
  std::int64_t integer(const std::string& name, std::int64_t least = 0, std::int64_t most = any_count) const;
  bool flag(const std::string& name) const { return integer(name, 0, 1) != 0; }
  /// Numbers that older versions did not store: `otherwise` where they are missing.
  Real real_or(const std::string& name, Real otherwise, Real least = -any, Real most = any) const {
    return reals.contains(name) ? real(name, least, most) : otherwise;
  }
  std::int64_t integer_or(const std::string& name, std::int64_t otherwise, std::int64_t least = 0,
                          std::int64_t most = any_count) const {
    return integers.contains(name) ? integer(name, least, most) : otherwise;
  }
  /// Arrays of this length, whose values are finite and least … most.
  const std::vector<double>& real_array(const std::string& name, std::size_t length, Real least = -any,
                                        Real most = any) const;
  const std::vector<std::int64_t>& integer_array(const std::string& name, std::size_t length, std::int64_t least = 0,
                                                 std::int64_t most = any_count) const;
  /// Values of an array whose length is not known before.
  std::size_t length(const std::string& name) const;
  const std::string& text(const std::string& name) const;
  /// Throws the error that the checkpoint cannot be used because of this.
  template <class... Args>
  [[noreturn]] void refuse(fmt::format_string<Args...> why, Args&&... args) const {
    throw InputError("{}: {}", file, fmt::format(why, std::forward<Args>(args)...));
  }

  Real t = 0;                                        ///< finite, not negative
  std::int64_t step = 0;                             ///< not negative
  std::map<std::string, std::vector<double>> reals;  ///< arrays, and numbers as arrays of one
  std::map<std::string, std::vector<std::int64_t>> integers;
  std::map<std::string, std::string> strings;
  std::string file;  ///< where it was read from
};

/// Writes checkpoint-a.h5 and checkpoint-b.h5 of a folder in turn. A checkpoint is begun, added to and finished: an
/// added array may be freed at once.
class CheckpointWriter {
 public:
  /// newest: the checkpoint from which the run resumes, which is overwritten last; empty for a new run.
  explicit CheckpointWriter(std::filesystem::path folder, const std::filesystem::path& newest = {});

  /// In memory; an unfinished checkpoint is dropped.
  void begin(Real t, std::int64_t step);
  /// Arrays and numbers; no name twice.
  template <std::ranges::contiguous_range Values>
  void add(const std::string& name, const Values& values) {
    check_new(name);
    group_->write(name, values, {std::ranges::size(values)});
  }
  void add(const std::string& name, Real value) { add_number(name, value); }
  void add(const std::string& name, std::integral auto value) { add_number(name, static_cast<std::int64_t>(value)); }
  /// Not named "time" or "step".
  void add_text(const std::string& name, const std::string& text);
  /// Writes atomically: on errors, and when the program is killed, the older checkpoints stay. Errors: OutputError.
  void finish();

 private:
  void check_new(const std::string& name) const;
  template <class Number>
  void add_number(const std::string& name, Number value) {
    check_new(name);
    group_->write(name, std::span(&value, 1), {});
  }

  std::filesystem::path folder_;
  int next_ = 0;  ///< 0: a, 1: b
  std::optional<hdf5::File> file_;
  std::optional<hdf5::Group> group_;
};

struct StoredCheckpoints {
  std::vector<std::filesystem::path> files;  ///< complete checkpoints, highest step first
  std::vector<std::string> problems;         ///< the faults of the other files
};

/// Whether there is a file of such a name, good or bad.
bool has_checkpoint(const std::filesystem::path& folder);

/// Finds the checkpoints of a folder and compares them with their checksums. Errors: InputError if there is no
/// checkpoint file.
StoredCheckpoints find_checkpoints(const std::filesystem::path& folder);

/// Errors: InputError if the file is damaged, of another format, or no checkpoint.
Checkpoint read_checkpoint(const std::filesystem::path& file);

}  // namespace pliant
