// The run folder of a simulation that Python drives.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/io/checkpoint.h>
#include <pliant/io/folder_lock.h>
#include <pliant/io/run_writer.h>
#include <pliant/run/archive.h>
#include <pliant/run/energy_audit.h>
#include <pliant/run/schedule.h>
#include <pliant/run/simulation.h>

namespace pliant::python {

/// Times between frames and between samples, none: on request only; and wall seconds between checkpoints.
struct OutputIntervals {
  std::optional<Real> frames, samples;
  Real checkpoints = 300;
  /// Errors: InputError.
  void check() const;
};

/// Where particles are: walls are drawn as long as this region.
template <int D>
struct Region {
  explicit Region(const Simulation<D>& simulation);
  Region() = default;
  /// x1 y1 x2 y2 of each wall at time t.
  std::vector<Real> drawn(const Walls<D>& walls, Real t) const;

  Vec<D> middle = Vec<D>::Zero();
  Real extent = 0;  ///< half of the largest side, and some diameters
};

/// [walls] radius of disks; 0: segments and half-spaces.
template <int D>
std::vector<Real> wall_radii(const Walls<D>& walls);

/// run.h5 with frames and series, run.xdmf, summary.json and checkpoints, as of scenarios. Errors of all members:
/// OutputError.
template <int D>
class RunOutput {
 public:
  /// Creates the folder, with a frame and a sample of the present state. all: the particles by id, which may not
  /// change. Errors: InputError for a folder that holds a run, FolderInUse.
  RunOutput(const std::filesystem::path& folder, const OutputIntervals& intervals, const Topology& all,
            const std::string& model, const Options& options, Simulation<D>& simulation, EnergyAudit<D>& audit);
  /// For a simulation that is restored from a checkpoint: visit() reads it, go_on() opens the folder, whose lock this
  /// is.
  RunOutput(FolderLock lock, const OutputIntervals& intervals, std::string model);
  void go_on(const std::filesystem::path& checkpoint, const Topology& all);

  /// Whether a frame or a sample is due.
  bool due(Real t) const { return (sampling_ && sampling_->due(t)) || (framing_ && framing_->due(t)); }
  /// After an accepted step: writes a frame and a sample if they are due.
  void follow(Simulation<D>& simulation, EnergyAudit<D>& audit);
  /// Without a second frame, or sample, of the same time with the same numbers.
  void write_frame(Simulation<D>& simulation);
  /// audit: without changes that it does not know.
  void write_sample(Simulation<D>& simulation, EnergyAudit<D>& audit);
  bool save_due() const;
  /// The next chance to save is to be used.
  void ask_save() { save_asked_ = true; }
  bool save_asked() const { return save_asked_; }
  /// A checkpoint. visit(archive): writes all quantities to it; text: by name.
  void save(const State& state, const std::map<std::string, std::string>& texts,
            const std::function<void(Archive&)>& visit);
  /// All quantities of the output that a checkpoint needs.
  void visit(Archive& archive);
  /// The last frame and sample, and summary.json. failure: the message of a run that failed, or empty.
  void finish(const Options& options, std::int64_t force_evaluations, const std::string& failure,
              Simulation<D>& simulation, EnergyAudit<D>& audit);

  /// An exception of Python has ended the run so far, or the block that it is in; empty: no longer.
  void interrupt(std::string by) { interruption_ = std::move(by); }

  /// Whether this process has created the folder: a fork of it leaves the files alone.
  bool owned() const;
  const std::filesystem::path& folder() const { return writer_->folder(); }

 private:
  int process_;
  FolderLock lock_;
  std::optional<RunWriter> writer_;
  std::optional<CheckpointWriter> checkpoints_;
  std::optional<Schedule> framing_, sampling_;
  std::chrono::duration<Real> between_saves_;
  std::chrono::steady_clock::time_point last_save_ = std::chrono::steady_clock::now();
  bool save_asked_ = false;
  std::string model_;
  Region<D> region_;  ///< at the start
  std::vector<Real> first_walls_;
  Real last_frame_ = -1, last_sample_ = -1;  ///< times
  std::optional<std::uint32_t> frame_crc_;   ///< checksum of the last frame
  std::vector<Real> sample_row_;             ///< the last sample
  std::string interruption_;
  std::int64_t restored_samples_ = 0, restored_frames_ = 0;
};

extern template struct Region<2>;
extern template struct Region<3>;
extern template class RunOutput<2>;
extern template class RunOutput<3>;

}  // namespace pliant::python
