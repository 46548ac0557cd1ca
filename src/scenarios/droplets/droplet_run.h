// What the runs of droplets have in common, from the start to the summary.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/io/checkpoint.h>
#include <pliant/io/run_writer.h>
#include <pliant/model/state.h>
#include <pliant/run/run_control.h>
#include <pliant/run/schedule.h>
#include <pliant/scenarios/droplets/options.h>
#include <pliant/system/overdamped.h>
#include <pliant/ts/ts_integrator.h>

namespace pliant {

/// Droplets in motion, with two more unknowns, on the root: the work that the walls have done on them and the energy
/// that drag and friction have dissipated. So both are as exact as the positions, and their error is controlled with
/// them. Walls that move must not rub.
class DropletSystem final : public FirstOrderSystem {
 public:
  explicit DropletSystem(OverdampedSystem<2>& droplets) : droplets_(droplets) {}

  std::size_t size() const override { return droplets_.size() + (ranks().root() ? 2 : 0); }
  const Ranks& ranks() const override { return droplets_.ranks(); }
  void rate(Real t, const Real* y, Real* ydot) override;

 private:
  OverdampedSystem<2>& droplets_;
  std::vector<Real> wall_force_;
};

/// What a scenario starts from.
struct DropletSetup {
  std::string scenario;
  Topology droplets;
  Walls<2> walls;
  Vec<2> gravity = Vec<2>::Zero();
  bool walls_rub = false;  ///< MobilityOptions::walls
  int walls_at_once = 1;   ///< that push a droplet along one line
  /// Most steps are as long as stability allows: a low order takes the fewest evaluations, a small error costs nothing.
  TsOptions integration = {.rk_type = "3bs", .atol_x = 1e-8};
};

/// A run of droplets in the plane: integration, samples, frames, checkpoints, restart, stop requests, summary, energy
/// budget. A scenario derives from it and says what is its own. Ranks share forces and the viscous solve. All the rest
/// sees all droplets, at the places of their numbers, on every rank: each does the same with the same numbers, so that
/// all decide alike. One of them writes.
class DropletRun {
 public:
  DropletRun(const DropletOptions& p, const Options& options, const Ranks& ranks, DropletSetup setup);
  virtual ~DropletRun() = default;
  DropletRun(const DropletRun&) = delete;
  DropletRun& operator=(const DropletRun&) = delete;

  /// Before run(): goes on from there. All that is read is checked before it is used. Errors: InputError.
  void restore(const Checkpoint& checkpoint);
  /// Returns and throws as run_hopper does.
  ExitCode run();

 protected:
  // What a scenario says.
  virtual std::string title() const = 0;  ///< a line for the start of the run
  virtual Real last_time() const = 0;     ///< the run ends there at the latest
  /// Positions at the start [2 · droplets].
  virtual std::vector<Real> start() = 0;
  /// Kind and attributes for run.h5; the segments come from wall_segments().
  virtual RunGeometry geometry() const = 0;
  /// x1 y1 x2 y2 of each wall, as it is drawn at time t.
  virtual std::vector<Real> wall_segments(Real t) const = 0;
  /// After every accepted step. May call finish(), frame(), set_walls() and deactivate(), and returns whether it has
  /// changed the state.
  virtual bool follow() = 0;
  /// Calls finish() if the run ends in the present configuration. For a restart from a run that had ended: its end may
  /// have been given anew.
  virtual void judge_end() = 0;
  /// Columns that it adds to a sample; energies and forces are those of `reports`.
  virtual void measure(std::vector<SeriesValue>& row) = 0;
  virtual std::string progress() const = 0;  ///< for the progress line
  virtual void save(CheckpointWriter& checkpoint) const = 0;
  virtual void load(const Checkpoint& checkpoint) = 0;  ///< called before lists are built: may put_walls()
  /// Adds results to the summary of a run that was not stopped.
  virtual void conclude(nlohmann::ordered_json& summary) = 0;

  // What it can use. The same on every rank.
  const State& state() const { return state_; }
  Index droplets() const { return particles().topology().particles(); }
  Real radius(Index m) const { return particles().topology().diameter[m] / 2; }
  Vec<2> position(Index m) const { return point<2>(state_.x().data(), m); }
  /// Found at samples and frames.
  Vec<2> velocity(Index m) const { return point<2>(state_.v().data(), m); }
  /// All of them.
  ParticleSystem<2>& particles() { return whole_ ? *whole_ : overdamped_.particles(); }
  const ParticleSystem<2>& particles() const { return whole_ ? *whole_ : overdamped_.particles(); }
  /// The present configuration, with valid lists.
  StateView<2> view() { return particles().view(state_.x().data(), state_.v().data(), state_.t); }
  /// Force on each wall [2 · walls].
  std::vector<Real> wall_forces();
  /// Velocities of the present configuration: velocity() and max_speed() until the next step.
  void find_velocities();
  Real max_speed() const;
  Real energy();  ///< of the present configuration, that of the weight included

  void finish(std::string_view ended_by) { ended_by_ = ended_by; }
  void frame();
  /// A row of /events in run.h5, always of the same columns.
  void add_event(const std::vector<SeriesValue>& row);
  /// Changes that take energy out of the budget, or bring some in.
  void set_walls(const Walls<2>& walls);
  void deactivate(Index m);
  void put_walls(const Walls<2>& walls);  ///< without looking at the energy

 private:
  void check_step() const;
  void prepare();
  void begin();
  void complete();
  std::vector<SeriesValue> take_sample();
  AfterStep after_step();
  void share_out();
  void tidy();
  void take_part();
  std::vector<Real> own_part(std::span<const Real> all) const;
  void gather(std::span<const Real> own, std::span<Real> all) const;
  State& moving() { return whole_ ? own_ : state_; }
  void sample();
  void write_frame();
  void store();
  template <class Change>
  void outside_budget(Change&& change);
  IntegratorStatistics statistics() const;
  Real last_dt() const;  ///< also where a restart has not taken a step yet; before the first the one to come
  std::int64_t list_rebuilds() const;
  void report(Real cpu) const;
  Real total_cpu() const { return cpu_before_ + control_.cpu_seconds() - cpu_at_start_; }
  Real work() const { return state_.x()[2 * droplets()]; }
  Real dissipated() const { return state_.x()[2 * droplets() + 1]; }
  nlohmann::ordered_json summary(std::string_view status);
  [[noreturn]] void fail(const Error& error);

  const DropletOptions& p_;
  const Options& options_;
  std::string scenario_;
  Ranks ranks_;
  TsOptions integration_;
  Real fastest_rate_;
  OverdampedSystem<2> overdamped_;          ///< this rank's droplets
  std::optional<ParticleSystem<2>> whole_;  ///< all droplets, on several ranks
  DropletSystem system_;
  RunControl control_;
  std::optional<TsIntegrator> integrator_;
  std::optional<RunWriter> writer_;              ///< on the root
  std::optional<CheckpointWriter> checkpoints_;  ///< on the root

  State state_;  ///< of the droplets, then work and dissipation
  State own_;    ///< this rank's part, on several ranks: what the integrator moves
  std::vector<Index>
      numbers_;  ///< of what the ranks have one after the other; work and dissipation follow the droplets
  Real start_energy_ = 0, withdrawn_ = 0;  ///< withdrawn: what changes took out of the energy
  Real budget_error_ = 0;                  ///< of the last sample
  Schedule sampling_, framing_;
  std::int64_t rebuilds_before_ = 0;
  Real dt_ = 0, last_dt_ = 0;    ///< before the first step of this process
  IntegratorStatistics before_;  ///< of the runs before a restart
  Real cpu_before_ = 0, cpu_at_start_ = 0, started_at_ = 0;
  std::uint64_t restored_samples_ = 0, restored_frames_ = 0, restored_events_ = 0;
  std::string restarted_from_;  ///< file of the checkpoint
  bool had_ended_ = false;      ///< not by -t_end: the run that a restart goes on from
  std::string ended_by_;
  bool sampled_ = false, stopped_ = false;
};

}  // namespace pliant
