#include <pliant/run/run.h>

#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <utility>

#include <pliant/base/console.h>
#include <pliant/base/log.h>
#include <pliant/io/summary.h>
#include <pliant/run/ensemble.h>
#include <pliant/run/folder.h>
#include <pliant/run/frame_data.h>
#include <pliant/run/step_check.h>

namespace pliant {
namespace {

/// As one word of a shell's command line.
std::string shell_word(const std::string& text) {
  if (text.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_./+-=,:@%") ==
      std::string::npos)
    return text;
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

}  // namespace

template <int D>
Run<D>::Run(std::string scenario, const RunOptions& p, const Options& options, const Ranks& ranks,
            std::unique_ptr<Protocol<D>> protocol, std::optional<Checkpoint> checkpoint)
    : scenario_(std::move(scenario)),
      p_(p),
      options_(options),
      ranks_(ranks),
      protocol_(std::move(protocol)),
      control_(p.checkpoint_interval, p.max_wall_time, ranks, p.progress_interval),
      sampling_(p.sample_interval),
      framing_(p.frame_interval),
      particles_(simulation().all().particles()),
      points_(simulation().all().points()),
      dt_(protocol_->first_dt()),
      last_dt_(dt_),
      first_dt_(dt_),
      frame_format_(p.frame_format()) {
  protocol_->attach(*this);
  if (checkpoint) {
    load(*checkpoint);
  } else {
    simulation().set_integrator(protocol_->make_integrator(dt_));
    first_dt_ = last_dt_ = dt_ = integrator().next_dt();  // -ts_dt overrides it
  }
}

template <int D>
ExitCode Run<D>::run() {
  omp_set_num_threads(p_.threads);
  options_.check_consumed(protocol_->unread_options_advice());
  check();
  StopSignals signals;
  if (RunMonitor* const monitor = RunMonitor::current()) monitor->begin(p_.output);
  const Topology& all = simulation().all();
  RunGeometry geometry = protocol_->geometry();
  if (const Box<D>& box = simulation().particles().box(); !box.open())
    for (const Vec<D>& row : {box.origin(), box.length()})
      geometry.box.insert(geometry.box.end(), row.begin(), row.end());
  branch();
  Manifest manifest = make_manifest(scenario_, protocol_->model(), D, p_.seed, options_);
  manifest.start = protocol_->start_source();
  writer_.emplace(p_.member != nullptr ? RunWriter::recorder(manifest, all, geometry)
                  : restarted()
                      ? RunWriter::append(p_.output, all, restored_samples_, restored_frames_, restored_events_, ranks_)
                      : RunWriter::create(p_.output, manifest, all, geometry, ranks_));
  ranks_.on_root([&] {
    for (const std::string& message : writer_->damage()) warn("{}", message);
    if (branched_ || framing_.changed()) writer_->drop_later_frames();
    if (p_.member == nullptr) checkpoints_.emplace(p_.output, restarted_from_);
    protocol_->write_axes(*writer_);
    announce();
  });
  try {
    if (restarted())
      repeat();
    else
      prepare();
    simulation().forget_all();
    protocol_->ready();
    if (EnergyAudit<D>* const audit = protocol_->audit()) audit->start();
    if (had_ended_ && !ended()) protocol_->judge_end();
    if (!sampling_.done_at(0)) sample();
    if (!framing_.done_at(0)) frame();
    cpu_at_start_ = control_.cpu_seconds();
    started_at_ = state().t;
    {
      const LogScope log(LogStage::run);
      if (!ended()) {
        if (restarted()) ranks_.on_root([&] { drop_summary(p_.output); });
        simulation().advance(protocol_->last_time(), [this](State&) { return after_step(); });
        if (RunMonitor* const monitor = RunMonitor::current())
          monitor->progress(state().t, protocol_->last_time(), progress());
      }
      control_.end_progress();
      if (!stopped()) complete();
    }
    return finish();
  } catch (...) {
    control_.end_progress();
    fail(error_in_flight());
  }
}

// --- Before the first step

template <int D>
void Run<D>::check() {
  check_step();
  check_frame_fields();
  protocol_->check();
  const Real end = protocol_->last_time();
  if (restarted() && end < state().t - dt_ / 2)
    throw InputError("{}: the checkpoint {} is at t = {:.6g} already; give a later end", end_text(), restarted_from_,
                     state().t);
}

/// Errors: InputError for fields that the user names and that this run has not.
template <int D>
void Run<D>::check_frame_fields() {
  frame_format_.check();
  if (p_.frame_fields == "all") return;
  const ParticleSystem<D>& particles = simulation().particles();
  const auto refuse = [&](std::initializer_list<const char*> fields, bool there, std::string_view why) {
    for (const char* field : fields)
      if (!there && frame_format_.has(field))
        throw InputError("-frame_fields {}: this run has no {}, as {}; leave it out", p_.frame_fields, field, why);
  };
  refuse({"angles", "spins"}, particles.coordinates().angles > 0, "its particles do not rotate");
  const bool deformable = points_ > particles_;
  refuse({"area", "perimeter"}, deformable && D == 2, "its particles are not polygons");
  refuse({"volume", "surface_area"}, deformable && D == 3, "its particles are not closed surfaces");
  refuse({"reinsertions"}, protocol_->reinsertions() != nullptr, "particles are never reinserted");
  refuse({"particle_stress"}, protocol_->measures_stress(), "its scenario measures no stress");
  refuse({"modes"}, protocol_->modes() != nullptr, "it computes no vibrational modes");
  refuse({"wall_force", "wall_contacts"}, particles.walls().size() > 0, "it has no walls");
}

/// When the run ends, as the user gave it.
template <int D>
std::string Run<D>::end_text() const {
  const Real end = protocol_->last_time();
  return options_.declared("t_end") && options_.given("t_end") ? fmt::format("-t_end {:g}", end)
                                                               : fmt::format("{:g} {}", end, protocol_->unit_of_time());
}

/// Errors: InputError for an unstable step, or a step longer than the run.
template <int D>
void Run<D>::check_step() const {
  const Real dt = integrator().next_dt(), end = protocol_->last_time(), critical = protocol_->critical_step(),
             ratio = dt / critical;
  const bool given = options_.declared("dt") && options_.given("dt");
  const std::string_view step = given ? "-dt" : "the step";
  if (!restarted() && end > 0 && dt > end && (given || integrator().explicit_fixed_step()))
    throw InputError("{} {:g} is longer than the run, {}; give a shorter -dt or a later end", step, dt, end_text());
  if (!p_.allow_unstable_dt)
    check_stable(integrator(), {.longest = critical,
                                .unit = protocol_->unit_of_time(),
                                .given = given,
                                .rotates = simulation().particles().field().rotates()});
  if (!integrator().explicit_fixed_step()) return;
  if (above(ratio, protocol_->safe_part()) && ranks_.root())
    warn(
        "{} {:g} is {:.2f} of the limit of stability, {:.3g} {}: above {:g} opening and closing contacts add energy; "
        "compare with half the step",
        step, dt, ratio, critical, protocol_->unit_of_time(), protocol_->safe_part());
}

template <int D>
void Run<D>::announce() const {
  say("{}\n{}", protocol_->title(), integrator().name());
  if (!protocol_->counts_steps()) say(": dt = {:.3g} {}", dt_, protocol_->unit_of_time());
  if (const Real critical = protocol_->critical_step(); std::isfinite(critical))
    say(", dt/dt_critical = {:.2f}", dt_ / critical);
  say("; output in {}\n", p_.output);
  if (branched_) say("branch of {}, with a copy of its samples and frames\n", p_.restart);
  if (!restarted()) return;
  if (protocol_->counts_steps())
    say("continuing after step {}\n", state().step);
  else
    say("continuing at t = {:.6g} {}, step {}\n", state().t, protocol_->unit_of_time(), state().step);
}

/// Creates the folder of a branch, unless the run continues in the folder of its checkpoint.
template <int D>
void Run<D>::branch() {
  if (!branched_) return;
  ranks_.on_root([&] { restarted_from_ = begin_branch(restarted_from_, state().t, state().step, p_.output).string(); });
}

/// The start of a new run.
template <int D>
void Run<D>::prepare() {
  const LogScope log(LogStage::pack);
  simulation().place(protocol_->start());
  protocol_->placed();
  protocol_->started();
  cpu_at_start_ = control_.cpu_seconds();
  save(true);  // a killed run always has a checkpoint to continue from
}

/// Early ends are functions of the samples: the stored samples may already have ended the run.
template <int D>
void Run<D>::repeat() {
  if (restored_samples_ == 0) return;
  ranks_.on_root([&] { protocol_->repeat(writer_->read_series()); });
  std::vector<char> by(ended_by_.begin(), ended_by_.end());
  ranks_.broadcast(by);
  if (!ranks_.root() && !by.empty()) end("done", std::string(by.begin(), by.end()));
}

// --- After every accepted step

template <int D>
AfterStep Run<D>::after_step() {
  EnergyAudit<D>* const audit = protocol_->audit();
  if (audit != nullptr) audit->follow();
  // Before the code below builds lists, so that output does not change the trajectory. TS methods lose their history by
  // this.
  const bool changed = protocol_->follow(), sorted = !changed && simulation().wants_sorting();
  if (sorted) protocol_->sorted(simulation().sort());
  if (sampling_.due(state().t)) sample();
  if (framing_.due(state().t)) frame();
  if (ended()) save(changed);  // for a restart with a later end
  if (!ended() && control_.due()) {
    control_.progress(state().t, protocol_->last_time(), [&] { return progress(); });
    if (control_.stop()) end("stopped", {});
    if (stopped() || control_.checkpoint_due()) save(changed);
  }
  if (audit != nullptr) audit->prepare(changed);
  if (ended()) {
    if (changed) simulation().changed();
    return AfterStep::stop;
  }
  if (changed) return AfterStep::changed;
  return sorted ? AfterStep::reordered : AfterStep::proceed;
}

template <int D>
void Run<D>::end(std::string status, std::string by) {
  if (ended()) return;
  status_ = std::move(status);
  ended_by_ = std::move(by);
}

/// Output at the end of a run, unless it was stopped.
template <int D>
void Run<D>::complete() {
  if (!ended()) {
    // Without the sample and frame of the end: for a restart to a later end.
    if (took_steps() || !restarted()) save(false);
    end("done", protocol_->end_at_last_time());
  }
  if (!sampling_.done_at(state().t)) sample();
  if (!framing_.done_at(state().t)) frame();
  if (!sampled_) take_sample();  // the summary has results of the last one
}

template <int D>
std::vector<SeriesValue> Run<D>::take_sample() {
  simulation().find_velocities();
  sampled_ = true;
  return protocol_->sample();
}

template <int D>
void Run<D>::sample() {
  const LogScope log(LogEvent::sample);
  protocol_->record_events();
  sampling_.done(state().t);
  const std::vector<SeriesValue> row = take_sample();
  ranks_.on_root([&] { writer_->add_sample(row); });
}

template <int D>
void Run<D>::frame() {
  simulation().find_velocities();
  write_frame();
}

template <int D>
void Run<D>::write_frame() {
  const LogScope log(LogEvent::frame);
  framing_.done(state().t);
  FrameData<D> data(simulation().particles(), state(), protocol_->reinsertions(), frame_format_.has("wall_contacts"),
                    protocol_->measures_stress() && frame_format_.has("particle_stress"),
                    frame_format_.has("modes") ? protocol_->modes() : nullptr);
  const std::vector<Real> walls = protocol_->wall_segments();
  data.frame.wall_segments = walls;
  data.frame.attributes = protocol_->frame_attributes();
  writer_->write_frame(data.frame, frame_format_);
}

template <int D>
void Run<D>::add_event(const std::vector<SeriesValue>& row) {
  ranks_.on_root([&] { writer_->add_event(row); });
}

template <int D>
Real Run<D>::last_dt() const {
  const IntegratorStatistics& taken = integrator().statistics();
  return taken.steps > 0 ? taken.last_dt : last_dt_;
}

// --- Texts, summary

template <int D>
IntegratorStatistics Run<D>::statistics() const {
  IntegratorStatistics s = integrator().statistics();
  s.steps += before_.steps;
  s.rejected += before_.rejected;
  s.above_tolerance += before_.above_tolerance;
  s.force_evaluations += before_.force_evaluations;
  s.jacobian_evaluations += before_.jacobian_evaluations;
  s.linear_iterations += before_.linear_iterations;
  return s;
}

template <int D>
std::string Run<D>::progress() const {
  const State& s = state();
  const Real wall = control_.wall_seconds(), end = protocol_->last_time(), rate = (s.t - started_at_) / wall,
             critical = protocol_->critical_step(), steps = static_cast<Real>(integrator().statistics().steps);
  std::string line = fmt::format("t {:.6g}/{:.6g} {}  {:.3g} steps/s  ETA {}  ", s.t, end, protocol_->unit_of_time(),
                                 steps / wall, duration_text((end - s.t) / rate));
  line += std::isfinite(critical) ? fmt::format("dt/dt_c {:.2f}", last_dt() / critical)
                                  : fmt::format("dt {:.3g}", last_dt());
  if (const std::string more = protocol_->progress(); !more.empty()) line += "  " + more;
  return line;
}

template <int D>
std::string Run<D>::restart_command() const {
  return fmt::format("{} {} -restart {}", shell_word(program_name()), scenario_, shell_word(p_.output));
}

/// Collective.
template <int D>
nlohmann::ordered_json Run<D>::summary() {
  const IntegratorStatistics total = statistics();
  const Real cpu = total_cpu(), steps = static_cast<Real>(total.steps);
  const bool deformable = points_ != particles_;
  nlohmann::ordered_json s =
      summary_head(scenario_, protocol_->model(), status_, ended_by_.empty() ? "t_end" : ended_by_, options_);
  if (p_.member == nullptr)
    if (const auto of = branch_of(p_.output); !of.is_null()) s["branch_of"] = of;
  if (const auto source = protocol_->start_source(); !source.is_null()) s["start"] = source;
  if (sampling_.changed()) s["longest_sample_interval"] = sampling_.longest();
  s["particles"] = particles_;
  s["t"] = state().t;
  s["integrator"] = integrator().name();
  s["dt"] = first_dt_;
  if (const Real critical = protocol_->critical_step(); std::isfinite(critical)) s["dt_critical"] = critical;
  s["steps"] = total.steps;
  s["rejected_steps"] = total.rejected;
  s["steps_above_tolerance"] = total.above_tolerance;
  s["force_evaluations"] = total.force_evaluations;
  s["jacobian_evaluations"] = total.jacobian_evaluations;
  s["linear_iterations"] = total.linear_iterations;
  s["list_rebuilds"] = list_rebuilds();
  s["skin"] = simulation().particles().neighbours().skin();
  s["cpu_seconds"] = cpu;
  s["wall_seconds"] = control_.wall_seconds();
  s["particle_steps_per_second"] = steps * particles_ / cpu;
  s["ns_per_particle_step"] = steps > 0 ? nlohmann::ordered_json(1e9 * cpu / (steps * particles_)) : nullptr;
  s["ns_per_vertex_step"] = steps > 0 && deformable ? nlohmann::ordered_json(1e9 * cpu / (steps * points_)) : nullptr;
  if (budget_) s["energy_audit"] = budget_->json();
  return s;
}

/// The summary and, of a member of an ensemble, what its file holds so far.
template <int D>
void Run<D>::store(nlohmann::ordered_json&& summary) {
  if (p_.member == nullptr) return write_summary(p_.output, summary);
  p_.member->summary = std::move(summary);
  p_.member->objects = writer_->recorded();
}

/// Names the results of a member of an ensemble: the entries that its scenario has added after the first `of_the_run`.
template <int D>
void Run<D>::name_results(std::size_t of_the_run, const nlohmann::ordered_json& s) {
  if (p_.member == nullptr) return;
  for (auto entry = std::next(s.begin(), static_cast<std::ptrdiff_t>(of_the_run)); entry != s.end(); ++entry)
    p_.member->results.push_back(entry.key());
}

template <int D>
ExitCode Run<D>::finish() {
  if (!stopped()) judge_energy();
  nlohmann::ordered_json s = summary();
  const std::size_t of_the_run = s.size();
  if (!stopped()) protocol_->conclude(s);
  ranks_.on_root([&] {
    writer_->flush();
    if (!stopped()) writer_->drop_later_frames();  // frames of a killed run, later than the end of this run
    if (stopped()) {
      say("stopped at t = {:.6g} {} with a checkpoint; run the same command again to resume\n", state().t,
          protocol_->unit_of_time());
    } else {
      if (restarted() && !took_steps()) say("the run had already ended there\n");
      protocol_->report(writer_->read_series(), s);
      name_results(of_the_run, s);
      report_reliability();
      const IntegratorStatistics total = statistics();
      const Real ns = 1e9 * Real(s["cpu_seconds"]) / static_cast<Real>(std::max<std::int64_t>(total.steps, 1));
      say("{} steps, {} force evaluations, {:.2f} s CPU, {:.1f} ns per particle-step{}\n", total.steps,
          total.force_evaluations, Real(s["cpu_seconds"]), ns / particles_,
          points_ != particles_ ? fmt::format(", {:.1f} ns per vertex-step", ns / points_) : "");
    }
    store(std::move(s));
    writer_->close();
  });
  return stopped() ? ExitCode::stopped : ExitCode::done;
}

template <int D>
void Run<D>::judge_energy() {
  budget_ = protocol_->energy_budget();
  if (budget_ && !p_.allow_energy_error) check_energy(*budget_);
}

/// How far the results of the run can be trusted. On the root.
template <int D>
void Run<D>::report_reliability() const {
  if (budget_) {
    say("{}\n", budget_->text());
    if (const std::string warning = energy_warning(*budget_); !warning.empty()) warn("{}", warning);
  }
  const IntegratorStatistics total = statistics();
  if (total.above_tolerance > 0)
    warn(
        "{} of {} steps were accepted with an error above the tolerance: leave out -ts_adapt_dt_min and "
        "-ts_adapt_always_accept, or raise the tolerances (-ts_rtol, -ts_atol)",
        total.above_tolerance, total.steps);
}

/// Whether the step is the likely cause of a failure.
template <int D>
std::string Run<D>::advice() const {
  const Real dt = integrator().next_dt(), ratio = dt / protocol_->critical_step();
  if (!integrator().explicit_fixed_step() || !above(ratio, protocol_->safe_part())) return {};
  return fmt::format("-dt {:g} is {} the limit of stability: shorten it first; ", dt,
                     ratio > 1 ? fmt::format("{:.3g} times", ratio) : fmt::format("{:.2f} of", ratio));
}

template <int D>
void Run<D>::fail(const Error& error) {
  // The rest is collective. The error of a single rank ends the program without it.
  if (!ranks_.meet(std::chrono::seconds(10))) throw error;
  const bool numerical = error.code() == ExitCode::numerical_failure;
  std::string message = error.what();
  if (numerical) message = advice() + message;
  if (numerical && state().step > 0) {
    message += fmt::format("; t = {:.6g}, step {}, dt = {:.3g}", state().t, state().step, last_dt());
    if (const Real critical = protocol_->critical_step(); std::isfinite(critical))
      message += fmt::format(", dt/dt_critical = {:.2f}", last_dt() / critical);
    message += protocol_->failure_details();
  }
  if (error.code() == ExitCode::out_of_memory && p_.member == nullptr && has_checkpoint(p_.output))
    message += fmt::format("; {} continues from the last checkpoint", restart_command());
  const auto attempt = [&](const auto& output) {
    try {
      output();
    } catch (...) {
      const Error second = error_in_flight();
      // A configuration that has no forces has no frame.
      if (second.code() != ExitCode::numerical_failure) message += fmt::format("; then {}", second.what());
    }
  };
  if (numerical)
    attempt([&] {
      const auto& x = state().x();
      const bool finite = std::all_of(x.begin(), x.end(), [](Real a) { return std::isfinite(a); });
      // Before the first frame the particles have no places. With the velocities found last: where droplets have run
      // into each other there are no others.
      if (ranks_.all(finite && writer_->frames() > 0 && !framing_.done_at(state().t))) write_frame();
      ranks_.on_root([&] { writer_->flush(); });
    });
  attempt([&] {
    status_ = "failed";
    nlohmann::ordered_json s = summary();
    s["message"] = message;
    ranks_.on_root([&] { store(std::move(s)); });
  });
  throw Error(error.code(), message);
}

template class Run<2>;
template class Run<3>;

}  // namespace pliant
