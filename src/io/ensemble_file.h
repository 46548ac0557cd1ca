// ensemble.h5: the runs of an ensemble, a group for each. docs/reference/file-format.md lists its content.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/base/types.h>
#include <pliant/io/hdf5.h>

namespace pliant {

/// A run of an ensemble, as it is stored.
struct StoredMember {
  Index number = 0;
  nlohmann::ordered_json summary;  ///< as in summary.json of a run alone
};

/// The file of an ensemble. Errors of all functions: OutputError where writing fails, InputError where reading does.
class EnsembleFile {
 public:
  /// A new file. ensemble: describes it, for readers and for a repetition of the command.
  static EnsembleFile create(const std::filesystem::path& folder, const nlohmann::ordered_json& ensemble);
  /// The file in this folder, to add members; empty if there is none. Errors: InputError also where it is damaged.
  static std::optional<EnsembleFile> open(const std::filesystem::path& folder);

  const nlohmann::ordered_json& ensemble() const { return ensemble_; }
  void describe(const nlohmann::ordered_json& ensemble);
  /// The members so far, in the order of their numbers.
  std::vector<StoredMember> members() const;
  /// Stores a member. summary: JSON text. objects: the message with the content of its run.h5 (io/recording.h), empty
  /// if the run failed before it had any. The file has the member after the next flush().
  void add(Index number, const std::string& summary, std::string_view objects);
  void flush() { file_.flush(); }
  void close() { file_.close(); }

 private:
  EnsembleFile(hdf5::File file, nlohmann::ordered_json ensemble)
      : file_(std::move(file)), ensemble_(std::move(ensemble)) {
    file_.keep_little_metadata();
  }

  hdf5::File file_;
  nlohmann::ordered_json ensemble_;
};

}  // namespace pliant
