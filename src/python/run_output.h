// The run folder of a simulation that Python drives.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/io/folder_lock.h>
#include <pliant/io/run_writer.h>
#include <pliant/run/schedule.h>
#include <pliant/run/simulation.h>

namespace pliant::python {

/// run.h5 with frames and series, run.xdmf and summary.json, as of scenarios; no checkpoints. Errors of all members:
/// OutputError.
template <int D>
class RunOutput {
 public:
  /// Creates the folder, with a frame and a sample of the present state. Intervals: times between frames and between
  /// samples; none: frames and samples on request only. all: the particles by id, which may not change. Errors:
  /// InputError for a folder that holds a run, FolderInUse.
  RunOutput(const std::filesystem::path& folder, std::optional<Real> frame_interval,
            std::optional<Real> sample_interval, const Topology& all, const std::string& model, const Options& options,
            Simulation<D>& simulation);

  /// After an accepted step: writes a frame and a sample if they are due.
  void follow(Simulation<D>& simulation);
  void write_frame(Simulation<D>& simulation);
  void write_sample(Simulation<D>& simulation);
  /// The last frame and sample, and summary.json. failure: the message of a run that failed, or empty.
  void finish(const Options& options, std::int64_t force_evaluations, const std::string& failure,
              Simulation<D>& simulation);

  /// Whether this process has created the folder: a fork of it leaves the files alone.
  bool owned() const;
  const std::filesystem::path& folder() const { return writer_->folder(); }

 private:
  /// x1 y1 x2 y2 of each wall; walls without end as long as the particles' region.
  std::vector<Real> drawn_walls(const Walls<D>& walls, Real t) const;

  int process_;
  FolderLock lock_;
  std::optional<RunWriter> writer_;
  std::optional<Schedule> framing_, sampling_;
  std::string model_;
  Vec<D> middle_;  ///< of the region of the particles at the start
  Real extent_;    ///< half of its largest side, and some diameters
  std::vector<Real> first_walls_;
  Real last_frame_ = -1, last_sample_ = -1;  ///< times
};

extern template class RunOutput<2>;
extern template class RunOutput<3>;

}  // namespace pliant::python
