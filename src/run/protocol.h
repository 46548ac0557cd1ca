// The hooks with which a scenario controls its run; run.h has the rest.
#pragma once

#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <pliant/io/checkpoint.h>
#include <pliant/io/run_writer.h>
#include <pliant/run/energy_audit.h>
#include <pliant/run/schedule.h>
#include <pliant/run/shared_checkpoint.h>
#include <pliant/run/simulation.h>
#include <pliant/run/stored_particles.h>

namespace pliant {

/// Services of a run for its protocol.
class RunAccess {
 public:
  virtual ~RunAccess() = default;
  /// The run ends after this step. status: "done", "clogged", …; by: the option or condition that ended a run with
  /// status "done". The first call counts.
  virtual void end(std::string status, std::string by = {}) = 0;
  /// A frame of the present state. Collective.
  virtual void write_frame() = 0;
  /// A row of /events in run.h5, always of the same columns; the root's counts.
  virtual void add_event(const std::vector<SeriesValue>& row) = 0;
  /// Length of the last step, also where a restart has not taken one yet; before the first that to come.
  virtual Real last_dt() const = 0;
  /// The command that continues the run.
  virtual std::string restart_command() const = 0;
  /// Whether the run is to stop with a checkpoint, for a step that takes long. Collective.
  virtual bool stop_requested() const = 0;
  /// The samples to average over, counted from the first sample of the run.
  virtual EvenSamples even_samples() const = 0;
};

/// A scenario's part of a run. All functions are called on every rank, and may be collective, unless stated otherwise.
template <int D>
class Protocol {
 public:
  static constexpr int dim = D;

  explicit Protocol(std::unique_ptr<Simulation<D>> simulation) : simulation_(std::move(simulation)) {}
  virtual ~Protocol() = default;
  Protocol(const Protocol&) = delete;
  Protocol& operator=(const Protocol&) = delete;

  Simulation<D>& simulation() { return *simulation_; }
  const Simulation<D>& simulation() const { return *simulation_; }
  void attach(RunAccess& run) { run_ = &run; }

  // --- Before the run

  virtual std::string title() const = 0;  ///< a line for the start of the run
  virtual std::string model() const = 0;
  virtual std::string_view unit_of_time() const { return "t0"; }  ///< in messages
  virtual bool counts_steps() const { return false; }             ///< the time is the number of steps
  virtual Real last_time() const = 0;                             ///< latest end of the run
  virtual std::string end_at_last_time() const { return "t_end"; }
  virtual Real first_dt() const = 0;
  /// The longest stable step of an explicit method with a fixed step, in t0.
  virtual Real critical_step() const { return std::numeric_limits<Real>::infinity(); }
  /// Part of the critical step; longer fixed steps give a warning.
  virtual Real safe_part() const { return CriticalStep::safe_part; }
  /// Margin of the neighbour lists, where the user has chosen it.
  virtual std::optional<Real> fixed_skin() const { return {}; }
  /// dt: first_dt(), or where a restart left off.
  virtual std::unique_ptr<Integrator> make_integrator(Real dt) = 0;
  /// Kind, attributes and walls at the start, for run.h5.
  virtual RunGeometry geometry() const = 0;
  /// Axes of series, for run.h5: written at the start. On the root.
  virtual void write_axes(RunWriter& /*writer*/) const {}
  /// Advice about options that were not read; check() refuses inconsistent options, before any output is written.
  virtual std::string unread_options_advice() const { return {}; }
  virtual void check() const {}

  /// The file of the particles at the start, for the manifest and the summary; null without one.
  virtual nlohmann::ordered_json start_source() const { return nullptr; }
  /// Positions at the start [points · D], by id, of all particles on every rank.
  virtual std::vector<Real> start() = 0;
  /// The rank's particles are new, at the start and in a restart: data per particle are initialised.
  virtual void placed() {}
  /// A new run's particles are where they start.
  virtual void started() {}
  /// A restart sees the samples of the run so far. On the root; a call of end() counts on all ranks.
  virtual void repeat(const Series& /*series*/) {}
  /// The state is complete, new or restored; steps follow.
  virtual void ready() {}
  /// A restart continues from the state in which end() was called: calls end() again if the run still ends there,
  /// because options may have changed.
  virtual void judge_end() {}

  /// Energy budget of a scenario whose energy changes only by forces, walls, and EnergyAudit::outside; null without a
  /// budget.
  virtual EnergyAudit<D>* audit() { return nullptr; }
  /// At the end of a run, which fails where energy is made or lost.
  virtual std::optional<EnergyBudget> energy_budget() {
    return audit() != nullptr ? std::optional(audit()->budget()) : std::nullopt;
  }

  // --- During the run

  /// After every accepted step. Returns whether it has changed the state. May call end(), write_frame() and
  /// add_event().
  virtual bool follow() { return false; }
  /// Particles were sorted: data per particle move with them.
  virtual void sorted(const Migration& /*migration*/) {}
  /// Called before a sample and a checkpoint: stored events go to add_event().
  virtual void record_events() {}
  /// A row of /series. May call end(). Errors: NumericalError where no later number could be trusted.
  virtual std::vector<SeriesValue> sample() = 0;
  /// x1 y1 x2 y2 of each wall at this time, where they are not always as in the geometry.
  virtual std::vector<Real> wall_segments() { return {}; }
  /// Attributes of a frame in addition to its time: the state of the protocol.
  virtual std::map<std::string, Real> frame_attributes() const { return {}; }
  /// How often each own particle was reinserted; null where particles never are.
  virtual const std::vector<Index>* reinsertions() const { return nullptr; }
  /// Displacements of modes [own points · K · D], of each point by one mode after the other, for frames; null without.
  virtual const std::vector<Real>* modes() const { return nullptr; }
  /// Whether frames have the stress of each particle. Needs a box that is periodic in all directions.
  virtual bool measures_stress() const { return false; }
  virtual std::string progress() const { return {}; }
  /// Visits every quantity of the protocol that a restart needs, under a name that only the protocol uses, to write or
  /// to read the quantity. Before reading, the particles and the state are restored; the lists are not. Errors:
  /// InputError, as in Archive.
  virtual void visit(Archive& /*archive*/) {}
  /// Details for the message of a failure; empty or beginning with "; ".
  virtual std::string failure_details() const { return {}; }

  // --- After a run that was not stopped

  /// Adds results to the summary.
  virtual void conclude(nlohmann::ordered_json& /*summary*/) {}
  /// Adds results from the series, and prints them. On the root.
  virtual void report(const Series& /*series*/, nlohmann::ordered_json& /*summary*/) {}

 protected:
  RunAccess& run() const { return *run_; }
  bool attached() const { return run_ != nullptr; }
  State& state() { return simulation_->state(); }
  const State& state() const { return simulation_->state(); }
  ParticleSystem<D>& particles() { return simulation_->particles(); }
  const ParticleSystem<D>& particles() const { return simulation_->particles(); }
  const Topology& topology() const { return simulation_->topology(); }
  const Ranks& ranks() const { return simulation_->ranks(); }
  /// Length of the step that led here. At the start the length of the coming step, if it is fixed, and 0 if the method
  /// has not determined it yet.
  Real step_taken() const {
    return state().step > 0 || simulation_->integrator().explicit_fixed_step() ? run_->last_dt() : 0;
  }

 private:
  std::unique_ptr<Simulation<D>> simulation_;
  RunAccess* run_ = nullptr;
};

}  // namespace pliant
