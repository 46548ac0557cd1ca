#include <pliant/scenarios/hopper.h>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>

#include <pliant/analysis/clog.h>
#include <pliant/base/version.h>
#include <pliant/io/checkpoint.h>
#include <pliant/io/summary.h>
#include <pliant/model/crossing.h>
#include <pliant/model/polygon.h>
#include <pliant/scenarios/hopper_measurements.h>
#include <pliant/scenarios/reinsertion.h>
#include <pliant/scenarios/run_control.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

namespace pliant {
namespace {

namespace fs = std::filesystem;

enum class Outcome { done, clogged, empty, stopped };

std::string_view to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::done:
      return "done";
    case Outcome::clogged:
      return "clogged";
    case Outcome::empty:
      return "empty";
    case Outcome::stopped:
      return "stopped";
  }
  return "";
}

template <int D>
Vec<D> down() {
  Vec<D> g = Vec<D>::Zero();
  g[D - 1] = -1;
  return g;
}

/// A run from start to summary. What a restart needs is in `state_` and in what `save` puts beside it.
template <int D>
class HopperRun {
 public:
  HopperRun(const HopperOptions& p, const Options& options, const std::optional<Checkpoint>& checkpoint)
      : p_(p),
        options_(options),
        system_(make_particles(p.model, D, draw_diameters(p.sizes, p.particles, static_cast<std::uint64_t>(p.seed)),
                               p.shape),
                p.hopper.walls<D>(), make_force_field<D>(p.model, p.model_parameters(), down<D>()),
                neighbour_needs(p.model), *p.skin),
        control_(p.checkpoint_interval, p.max_wall_time),
        clog_(p.clog_time, p.clog_speed),
        counted_(p.particles, 0),
        reinserted_(p.particles, 0),
        state_(system_.topology().points(), D) {
    for (const Real sigma : system_.topology().sigma) largest_ = std::max(largest_, sigma);
    const CriticalStep critical = system_.field().critical_step(system_.topology());
    critical_step_ = critical.least();
    dt_ = p.dt.value_or(std::min({1e-3, 0.2 * critical.elastic, 0.5 * critical.damping}));
    if (checkpoint) load(*checkpoint);
    make_integrator();
  }

  ExitCode run() {
    options_.check_consumed();
    if (restarted_ && p_.t_end < state_.t - dt_ / 2)
      throw InputError("-t_end {}: the checkpoint in {} is at t = {:.6g} already; give a later end", p_.t_end,
                       p_.output, state_.t);
    check_fit(system_.topology(), p_.hopper);
    StopSignals signals;
    writer_.emplace(restarted_ ? RunWriter::append(p_.output, system_.topology(), restored_samples_, restored_frames_)
                               : RunWriter::create(p_.output, manifest(), system_.topology(), geometry()));
    checkpoints_.emplace(p_.output);
    writer_->write_axis("profile_height", profile_heights());
    announce();
    try {
      if (!restarted_) prepare();
      cpu_at_start_ = control_.cpu_seconds();
      started_at_ = state_.t;
      integrator_->run(system_, state_, p_.t_end, fresh_, [this](State& s) { return after_step(s); });
      control_.end_progress();
      complete();
    } catch (const Error& error) {
      control_.end_progress();
      fail(error);
    }
    return finish();
  }

 private:
  void make_integrator() {
    if (p_.integrator == IntegratorKind::verlet)
      integrator_ = std::make_unique<FixedStepVerlet>(dt_);
    else
      integrator_ = std::make_unique<TsIntegrator>(TsOptions{.dt = dt_});
  }

  /// The start of a new run.
  void prepare() {
    const Packing packing =
        pack<D>(system_.topology(), p_.hopper,
                {*p_.pack_fraction, p_.pack_tolerance, static_cast<std::uint64_t>(p_.seed)}, state_.x().data());
    fmt::print("packed to a fraction of {:.3f}, height {:.1f}, in {} iterations of FIRE ({}); largest overlap {:.1e}\n",
               packing.fraction, packing.height, packing.iterations, packing.reason, packing.max_overlap);
    packing_iterations_ = packing.iterations;
    sample(state_);
    frame(state_);
  }

  /// What the end of a run adds, unless it was stopped.
  void complete() {
    if (outcome_ == Outcome::stopped) return;
    if (outcome_ == Outcome::done) save(state_, false);  // for a restart to a later end
    if (last_sample_at_ < state_.t) sample(state_);
    if (last_frame_at_ < state_.t) frame(state_);
  }

  // --- After every accepted step

  AfterStep after_step(State& s) {
    bool changed = follow_particles(s);
    if (s.t >= next_sample_ * p_.sample_interval * (1 - 1e-12)) sample(s);
    if (s.t >= next_frame_ * p_.frame_interval * (1 - 1e-12)) frame(s);
    if (outcome_ == Outcome::done && control_.due()) {
      control_.progress([&] { return progress_line(s); });
      if (control_.stop()) outcome_ = Outcome::stopped;
      if (outcome_ == Outcome::stopped || control_.checkpoint_due()) save(s, changed);
    }
    if (outcome_ != Outcome::done) return AfterStep::stop;
    return changed ? AfterStep::changed : AfterStep::proceed;
  }

  /// Counts the particles that have crossed the orifice line; those 2 σ_l below are put back or, in a discharge, taken
  /// out. Nothing moves more than skin/2 between two list rebuilds, so only particles that were near enough at the last
  /// one are looked at.
  bool follow_particles(State& s) {
    const Topology& topology = system_.topology();
    if (system_.neighbours().rebuilds() != watched_since_) {
      watched_since_ = system_.neighbours().rebuilds();
      watched_.clear();
      for (Index m = 0; m < topology.particles(); ++m)
        if (topology.active[m] && height(s, m) < *p_.skin) watched_.push_back(m);
    }
    bool changed = false;
    for (const Index m : watched_) {
      const Real h = height(s, m);
      if (!counted_[m] && h < 0) {
        counted_[m] = 1;
        ++flow_.crossed;
        flow_.area += topology.a0[m];
      }
      if (h >= -2 * largest_ || !topology.active[m]) continue;
      changed = true;
      if (p_.flow == FlowKind::continuous) {
        counted_[m] = 0;
        reinsert<D>(topology, p_.hopper, system_.walls(), p_.model == ModelKind::smooth,
                    static_cast<std::uint64_t>(p_.seed), m, static_cast<std::uint64_t>(reinserted_[m]++), s);
      } else {
        for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) point<D>(s.v().data(), i).setZero();
        system_.deactivate(m);
      }
    }
    return changed;
  }

  Real height(const State& s, Index m) const { return mean_of_points<D>(s.x().data(), system_.topology(), m)[D - 1]; }

  void sample(const State& s) {
    while (next_sample_ * p_.sample_interval * (1 - 1e-12) <= s.t) ++next_sample_;
    last_sample_at_ = s.t;
    last_sample_ = take_sample<D>(system_, s, p_.hopper, flow_, s.step > 0 ? integrator_->statistics().last_dt : dt_);
    writer_->add_sample(last_sample_.row);
    check(s);
    if (p_.flow == FlowKind::discharge && last_sample_.in_hopper == 0) outcome_ = Outcome::empty;
    if (clog_.update(s.t, flow_.crossed, last_sample_.in_hopper, last_sample_.max_speed)) outcome_ = Outcome::clogged;
  }

  /// Stops the run at what no later number could be trusted after.
  void check(const State& s) {
    const Topology& topology = system_.topology();
    const Real half = p_.hopper.wall_distance / 2;
    for (Index m = 0; m < topology.particles(); ++m) {
      const Vec<D> r = mean_of_points<D>(s.x().data(), topology, m), v = mean_of_points<D>(s.v().data(), topology, m);
      if (!r.allFinite() || !v.allFinite())
        throw NumericalError("particle {} has a position or velocity that is not finite", m);
      const Real lateral = D == 2 ? std::abs(r[0]) : std::hypot(r[0], r[1]);
      if (r[D - 1] > 0 && lateral > std::min(p_.hopper.half_width(r[D - 1]), half) + largest_)
        throw NumericalError("particle {} has gone through a wall at ({:.3f}, {:.3f}), height {:.3f}", m, r[0],
                             D == 2 ? 0 : r[1], r[D - 1]);
    }
    if constexpr (D == 2) {
      if (!topology.deformable()) return;
      if (const auto crossing = find_crossing(system_.view(s.x().data(), s.v().data())))
        throw NumericalError("vertex {} of particle {} has crossed the outline of particle {}",
                             crossing->vertex - topology.offset[crossing->particle], crossing->particle,
                             crossing->other);
    }
  }

  void frame(const State& s) {
    while (next_frame_ * p_.frame_interval * (1 - 1e-12) <= s.t) ++next_frame_;
    last_frame_at_ = s.t;
    writer_->write_frame(FrameData<D>(system_, s).frame);
  }

  // --- Checkpoints

  void save(const State& s, bool changed) {
    writer_->flush();
    Checkpoint c;
    c.state = s;
    c.reals["list_reference"] = system_.neighbours().reference();
    c.reals["flow_area"] = {flow_.area};
    c.reals["clog_quiet_since"] = {clog_.state().quiet_since};
    c.reals["next_dt"] = {next_dt()};
    c.reals["last_output"] = {last_sample_at_, last_frame_at_};
    c.reals["cpu_seconds"] = {total_cpu()};
    c.integers["active"] = {system_.topology().active.begin(), system_.topology().active.end()};
    c.integers["counted"] = counted_;
    c.integers["reinserted"] = reinserted_;
    const IntegratorStatistics total = statistics();
    c.integers["counters"] = {flow_.crossed,
                              clog_.state().crossed,
                              next_sample_,
                              next_frame_,
                              static_cast<std::int64_t>(writer_->samples()),
                              static_cast<std::int64_t>(writer_->frames()),
                              total.steps,
                              total.rejected,
                              total.force_evaluations,
                              packing_iterations_,
                              changed ? 1 : 0};
    c.strings["scenario"] = "hopper";
    c.strings["options"] = options_.json().dump();
    checkpoints_->write(c);
  }

  void load(const Checkpoint& c) try {
    state_ = c.state;
    counted_ = c.integers.at("counted");
    reinserted_ = c.integers.at("reinserted");
    const auto& active = c.integers.at("active");
    for (std::size_t m = 0; m < active.size(); ++m)
      if (active[m] == 0) system_.deactivate(static_cast<Index>(m));
    flow_.area = c.reals.at("flow_area").at(0);
    const auto& n = c.integers.at("counters");
    flow_.crossed = n.at(0);
    last_sample_at_ = c.reals.at("last_output").at(0);
    last_frame_at_ = c.reals.at("last_output").at(1);
    clog_.restore({c.reals.at("clog_quiet_since").at(0), n.at(1)});
    next_sample_ = n.at(2);
    next_frame_ = n.at(3);
    restored_samples_ = static_cast<std::uint64_t>(n.at(4));
    restored_frames_ = static_cast<std::uint64_t>(n.at(5));
    before_ = {.steps = n.at(6), .rejected = n.at(7), .force_evaluations = n.at(8)};
    packing_iterations_ = n.at(9);
    fresh_ = n.at(10) != 0;
    cpu_before_ = c.reals.at("cpu_seconds").at(0);
    if (p_.integrator == IntegratorKind::ts) dt_ = c.reals.at("next_dt").at(0);
    // The lists of the stopped run: the order of their sums is part of the state.
    const auto& reference = c.reals.at("list_reference");
    if (!reference.empty()) system_.neighbours().rebuild(system_.topology(), system_.walls(), reference.data());
    restarted_ = true;
  } catch (const std::out_of_range&) {
    throw InputError("{}: the checkpoint lacks what this version needs; go on with the version that wrote it",
                     p_.output);
  }

  Real next_dt() const {
    const auto* ts = dynamic_cast<const TsIntegrator*>(integrator_.get());
    return ts != nullptr ? ts->next_dt() : dt_;
  }

  // --- Texts, summary

  IntegratorStatistics statistics() const {
    IntegratorStatistics s = integrator_->statistics();
    s.steps += before_.steps;
    s.rejected += before_.rejected;
    s.force_evaluations += before_.force_evaluations;
    return s;
  }

  Real total_cpu() const { return cpu_before_ + control_.cpu_seconds() - cpu_at_start_; }

  void announce() const {
    const Topology& topology = system_.topology();
    fmt::print(
        "hopper: {} particles ({}, {}D{}), W = {}, w = {}, angle {}, {}\n", topology.particles(), to_string(p_.model),
        D, topology.deformable() ? fmt::format(", {} vertices each", p_.shape.vertices) : "", p_.hopper.wall_distance,
        p_.hopper.orifice, p_.hopper.angle, p_.flow == FlowKind::continuous ? "continuous flow" : "discharge");
    fmt::print("{}: dt = {:.3g} t0, dt/dt_critical = {:.2f}; output in {}\n", integrator_->name(), dt_,
               dt_ / critical_step_, p_.output);
    if (restarted_) fmt::print("continuing at t = {:.6g} t0, step {}\n", state_.t, state_.step);
  }

  std::string progress_line(const State& s) const {
    const Real wall = control_.wall_seconds(), done = s.t - started_at_, rate = done / wall;
    const Real steps = static_cast<Real>(integrator_->statistics().steps);
    return fmt::format("t {:.2f}/{:g} t0  {:.3g} steps/s  ETA {}  dt/dt_c {:.2f}  max overlap {:.3f}  crossed {}", s.t,
                       p_.t_end, steps / wall, duration_text((p_.t_end - s.t) / rate),
                       integrator_->statistics().last_dt / critical_step_, last_sample_.max_overlap, flow_.crossed);
  }

  Manifest manifest() const {
    const BuildInfo build = build_info();
    Manifest m;
    m.version = build.version;
    m.build = build.build();
    m.petsc_version = build.petsc;
    m.scenario = "hopper";
    m.model = to_string(p_.model);
    m.created = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
    m.dim = D;
    m.seed = p_.seed;
    m.options = options_.json();
    return m;
  }

  RunGeometry geometry() const {
    RunGeometry g;
    g.kind = D == 2 ? "hopper2d" : "hopper3d";
    g.attributes = {{"W", p_.hopper.wall_distance}, {"w", p_.hopper.orifice}, {"angle", p_.hopper.angle}};
    for (const WallSegment& wall : system_.walls().segments()) {
      const Real length = std::isfinite(wall.length) ? wall.length : 2 * p_.hopper.wall_distance;
      const Vec<2> end = wall.origin + length * wall.direction;
      g.segments.insert(g.segments.end(), {wall.origin[0], wall.origin[1], end[0], end[1]});
    }
    return g;
  }

  nlohmann::ordered_json summary(std::string_view status) {
    const Topology& topology = system_.topology();
    const IntegratorStatistics total = statistics();
    const Real cpu = total_cpu(), steps = static_cast<Real>(total.steps);
    nlohmann::ordered_json s;
    s["program"] = "pliant";
    s["version"] = build_info().version;
    s["scenario"] = "hopper";
    s["model"] = to_string(p_.model);
    s["status"] = status;
    s["parameters"] = options_.json();
    s["particles"] = topology.particles();
    s["t"] = state_.t;
    s["crossed_count"] = flow_.crossed;
    s["integrator"] = integrator_->name();
    s["dt"] = dt_;
    s["dt_critical"] = critical_step_;
    s["steps"] = total.steps;
    s["rejected_steps"] = total.rejected;
    s["force_evaluations"] = total.force_evaluations;
    s["packing_iterations"] = packing_iterations_;
    s["cpu_seconds"] = cpu;
    s["wall_seconds"] = control_.wall_seconds();
    s["particle_steps_per_second"] = steps * topology.particles() / cpu;
    s["ns_per_particle_step"] =
        steps > 0 ? nlohmann::ordered_json(1e9 * cpu / (steps * topology.particles())) : nullptr;
    s["ns_per_vertex_step"] =
        steps > 0 && topology.deformable() ? nlohmann::ordered_json(1e9 * cpu / (steps * topology.points())) : nullptr;
    return s;
  }

  [[noreturn]] void fail(const Error& error) {
    std::string message = error.what();
    if (error.code() == ExitCode::numerical_failure && state_.step > 0)
      message += fmt::format(
          "; t = {:.6g}, step {}, dt = {:.3g}, dt/dt_critical = {:.2f}, largest overlap {:.3f} between particles {} "
          "and {}",
          state_.t, state_.step, dt_, dt_ / critical_step_, last_sample_.max_overlap, last_sample_.first,
          last_sample_.second);
    try {
      if (error.code() == ExitCode::numerical_failure) {
        const bool finite = std::all_of(state_.x().begin(), state_.x().end(), [](Real a) { return std::isfinite(a); });
        if (finite && writer_->frames() > 0) frame(state_);  // none yet: the particles have no places
        writer_->flush();
      }
      nlohmann::ordered_json s = summary("failed");
      s["message"] = message;
      write_summary(p_.output, s);
    } catch (const Error& second) {
      message += fmt::format("; then {}", second.what());
    }
    throw Error(error.code(), message);
  }

  ExitCode finish() {
    writer_->flush();
    nlohmann::ordered_json s = summary(to_string(outcome_));
    if (outcome_ == Outcome::stopped) {
      fmt::print("stopped at t = {:.6g} t0 with a checkpoint; run the same command again to go on\n", state_.t);
    } else {
      nlohmann::ordered_json measured = evaluate_series(writer_->read_series(), p_, system_.topology());
      // A clog is no flow, whatever came out before it: fits leave such a run out.
      if (outcome_ == Outcome::clogged)
        for (const char* name : {"Q", "Q_corrected"})
          if (measured.contains(name)) measured[name].update({{"value", 0}, {"error", nullptr}});
      for (const auto& [name, value] : measured.items()) s[name] = value;
      report(measured);
    }
    write_summary(p_.output, s);
    writer_->close();
    return outcome_ == Outcome::stopped ? ExitCode::stopped : ExitCode::done;
  }

  void report(const nlohmann::ordered_json& measured) const {
    const auto print = [&](const char* name, const char* text) {
      if (!measured.contains(name) || measured[name]["value"].is_null()) return;
      const Real value = measured[name]["value"];
      fmt::print(
          "{} = {:.5g} ± {} {}\n", text, value,
          measured[name]["error"].is_null() ? std::string("?") : fmt::format("{:.2g}", Real(measured[name]["error"])),
          std::string(measured[name]["unit"]));
    };
    if (outcome_ == Outcome::clogged)
      fmt::print("clogged: no crossing and no motion since t = {:.4g} t0\n", clog_.state().quiet_since);
    if (measured.contains("steady_explanation")) fmt::print("{}\n", std::string(measured["steady_explanation"]));
    print("Q", "Q");
    print("Q_corrected", "Q'");
    print("contacts_per_particle", "contacts per particle");
    print("drag_friction_ratio", "drag/friction");
    print("c0", "c0");
    print("total_time", "total time");
    const IntegratorStatistics total = statistics();
    fmt::print(
        "{} steps, {} force evaluations, {:.2f} s CPU, {:.1f} ns per particle-step{}\n", total.steps,
        total.force_evaluations, total_cpu(),
        1e9 * total_cpu() /
            (static_cast<Real>(std::max<std::int64_t>(total.steps, 1)) * system_.topology().particles()),
        system_.topology().deformable()
            ? fmt::format(", {:.1f} ns per vertex-step",
                          1e9 * total_cpu() /
                              (static_cast<Real>(std::max<std::int64_t>(total.steps, 1)) * system_.topology().points()))
            : "");
  }

  const HopperOptions& p_;
  const Options& options_;
  ParticleSystem<D> system_;
  RunControl control_;
  ClogDetector clog_;
  std::unique_ptr<Integrator> integrator_;
  std::optional<RunWriter> writer_;
  std::optional<CheckpointWriter> checkpoints_;

  // State that a checkpoint keeps.
  FlowCount flow_;
  std::vector<std::int64_t> counted_,
      reinserted_;  ///< per particle: has crossed since it was last put back; times put back
  std::int64_t next_sample_ = 0, next_frame_ = 0, packing_iterations_ = 0;
  Real last_sample_at_ = -1, last_frame_at_ = -1;  ///< times
  State state_;

  Real largest_ = 0, critical_step_ = 0, dt_ = 0;
  bool restarted_ = false, fresh_ = true;
  std::uint64_t restored_samples_ = 0, restored_frames_ = 0;
  IntegratorStatistics before_;  ///< of the runs before a restart
  Real cpu_before_ = 0, cpu_at_start_ = 0, started_at_ = 0;
  std::vector<Index> watched_;
  std::int64_t watched_since_ = -1;
  Sample<D> last_sample_;
  Outcome outcome_ = Outcome::done;
};

/// Status in the summary of a run's folder; empty if there is none that can be read.
std::string stored_status(const fs::path& folder) {
  std::ifstream file(folder / "summary.json");
  const nlohmann::json summary = nlohmann::json::parse(file, nullptr, false);
  return summary.is_object() && summary.contains("status") && summary["status"].is_string()
             ? std::string(summary["status"])
             : "";
}

}  // namespace

ExitCode run_hopper(HopperOptions& p, Options& options) {
  std::optional<Checkpoint> checkpoint;
  // The same command again goes on with a run that was stopped.
  const bool again = p.restart.empty() && stored_status(p.output) == "stopped";
  if (!p.restart.empty() && options.given("output") &&
      fs::weakly_canonical(p.output) != fs::weakly_canonical(p.restart))
    throw InputError("-output {}: -restart {} goes on in its own folder; leave -output out", p.output, p.restart);
  if (again || !p.restart.empty()) {
    const fs::path folder = again ? p.output : p.restart;
    NewestCheckpoint newest = read_newest_checkpoint(folder);
    if (!newest.message.empty()) fmt::print(stderr, "pliant: warning: {}\n", newest.message);
    if (newest.checkpoint.strings["scenario"] != "hopper")
      throw InputError("{}: the checkpoint is of scenario '{}', not of hopper", folder.string(),
                       newest.checkpoint.strings["scenario"]);
    options.from_json(nlohmann::json::parse(newest.checkpoint.strings["options"]));
    checkpoint = std::move(newest.checkpoint);
  }
  p.resolve();
  if (p.dim == 2) return HopperRun<2>(p, options, checkpoint).run();
  return HopperRun<3>(p, options, checkpoint).run();
}

}  // namespace pliant
