// A run of any scenario, from start to summary.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/io/run_writer.h>
#include <pliant/run/options.h>
#include <pliant/run/protocol.h>
#include <pliant/run/run_control.h>
#include <pliant/run/schedule.h>

namespace pliant {

class Archive;
struct RunNumbers;

/// A run of any dimension, made by make_run.
class AnyRun {
 public:
  virtual ~AnyRun() = default;
  /// Runs to the end, or until it is stopped. Collective. Errors: InputError, OutputError, NumericalError after a frame
  /// of the last state and a summary.
  virtual ExitCode run() = 0;
};

/// A simulation, a protocol and a folder: schedules of samples, frames and checkpoints, restart, stop requests, the
/// progress line, the frame and the summary after a failure, statistics over restarts.
template <int D>
class Run final : public AnyRun, private RunAccess {
 public:
  /// checkpoint: start of a resumed run. All its data are checked before use. Errors: InputError.
  Run(std::string scenario, const RunOptions& p, const Options& options, const Ranks& ranks,
      std::unique_ptr<Protocol<D>> protocol, std::optional<Checkpoint> checkpoint);

  ExitCode run() override;

 private:
  void end(std::string status, std::string by) override;
  void write_frame() override;
  void add_event(const std::vector<SeriesValue>& row) override;
  Real last_dt() const override;
  std::string restart_command() const override;
  bool stop_requested() const override { return control_.stop(); }
  EvenSamples even_samples() const override { return EvenSamples(sampling_); }

  Simulation<D>& simulation() { return protocol_->simulation(); }
  const Simulation<D>& simulation() const { return protocol_->simulation(); }
  State& state() { return simulation().state(); }
  const State& state() const { return simulation().state(); }
  const Integrator& integrator() const { return simulation().integrator(); }
  bool restarted() const { return !restarted_from_.empty(); }
  bool ended() const { return !status_.empty(); }
  bool stopped() const { return status_ == "stopped"; }
  Real longest_dt() const { return std::max(dt_, protocol_->last_time()); }
  bool took_steps() const { return integrator().statistics().steps > 0; }

  RunNumbers numbers(bool changed);
  void visit(Archive& archive, RunNumbers& numbers);
  void visit_numbers(Archive& archive, RunNumbers& numbers);
  void save(bool changed);
  void load(const Checkpoint& checkpoint);
  void check();
  void check_step() const;
  void check_frame_fields();
  std::string end_text() const;
  void announce() const;
  void branch();
  void prepare();
  void repeat();
  AfterStep after_step();
  void complete();
  std::vector<SeriesValue> take_sample();
  void sample();
  void frame();
  ExitCode finish();
  void judge_energy();
  void report_reliability() const;
  std::string progress() const;
  nlohmann::ordered_json summary();
  void store(nlohmann::ordered_json&& summary);
  void name_results(std::size_t of_the_run, const nlohmann::ordered_json& summary);
  [[noreturn]] void fail(const Error& error);
  std::string advice() const;
  IntegratorStatistics statistics() const;
  std::int64_t list_rebuilds() const { return rebuilds_before_ + simulation().particles().neighbours().rebuilds(); }
  Real total_cpu() const { return cpu_before_ + control_.cpu_seconds() - cpu_at_start_; }

  const std::string scenario_;
  const RunOptions& p_;
  const Options& options_;
  Ranks ranks_;
  std::unique_ptr<Protocol<D>> protocol_;
  RunControl control_;
  std::optional<RunWriter> writer_;
  std::optional<CheckpointWriter> checkpoints_;  ///< on the root
  Schedule sampling_, framing_;

  Index particles_, points_;  ///< of all ranks
  Real dt_, last_dt_;         ///< the first step of this process; the last one before it
  Real first_dt_;             ///< of the run
  FrameFormat frame_format_;
  std::string restarted_from_;   ///< file of the checkpoint
  bool branched_ = false;        ///< the run is a branch of another folder
  IntegratorStatistics before_;  ///< statistics of the runs before a restart
  std::int64_t rebuilds_before_ = 0;
  Real cpu_before_ = 0, cpu_at_start_ = 0, started_at_ = 0;
  std::uint64_t restored_samples_ = 0, restored_frames_ = 0, restored_events_ = 0;
  std::string status_, ended_by_;       ///< empty while the run continues
  bool had_ended_ = false;              ///< whether the protocol had ended the run from which a restart continues
  bool sampled_ = false;                ///< in this process
  std::optional<EnergyBudget> budget_;  ///< at the end of the run
};

extern template class Run<2>;
extern template class Run<3>;

}  // namespace pliant
