// Options that the runs of all scenarios share: where they write, how often, and when they stop.
#pragma once

#include <initializer_list>
#include <string>

#include <pliant/base/options.h>
#include <pliant/io/frame.h>

namespace pliant {

enum class FramePrecision { real64, real32 };

struct MemberOutput;

struct RunOptions {
  std::string output = "pliant-run", restart;
  std::int64_t seed = 1;
  Index threads = 1;  ///< threads of this process
  Index ensemble = 0, ensemble_workers = 0;
  std::string ensemble_over;       ///< OPTION=VALUE,VALUE…, as the user gave it
  MemberOutput* member = nullptr;  ///< of a member of an ensemble, which writes no folder
  bool allow_unstable_dt = false, allow_energy_error = false;
  std::string frame_fields = "all";  ///< as the user gave them
  FramePrecision frame_precision = FramePrecision::real64;
  Index frame_deflate = 0;
  Real frame_interval = 2, sample_interval = 0.2, checkpoint_interval = 300, max_wall_time = 0, progress_interval = 60;

  /// Whether -restart and -output name two folders: the run then continues as a branch in -output. Errors: InputError
  /// if an options file sets -output.
  bool branches(const Options& options) const;

  /// How frames are written. Errors: InputError for unknown fields.
  FrameFormat frame_format() const;

  /// No automatic values; scenarios with automatic values define resolve().
  void resolve() {}

 protected:
  /// The group "Output". intervals: with the times between frames and between samples.
  void bind_output(Options& options, bool intervals = true);
  /// Faults with which a run continues, after a warning.
  void bind_allowed(Options& options);
  void bind_threads(Options& options);
};

/// Errors: InputError if the user has given one of these options, which `by` ("-path quench") does not read.
void refuse_unread_by(const std::string& by, const Options& options, std::initializer_list<const char*> names);

}  // namespace pliant
