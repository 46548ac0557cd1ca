#include <pliant/scenarios/droplets/droplet_run.h>

#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <pliant/base/console.h>
#include <pliant/base/log.h>
#include <pliant/io/summary.h>
#include <pliant/run/folder.h>
#include <pliant/run/frame_data.h>

namespace pliant {
namespace {

std::unique_ptr<ForceField<2>> make_field(const DropletOptions& p, const DropletSetup& setup) {
  return make_force_field<2>(ModelKind::bubble, p.model_parameters(), setup.gravity);
}

NeighbourNeeds needs(const DropletOptions& p) { return neighbour_needs(ModelKind::bubble, p.model_parameters()); }

OverdampedSystem<2> make_system(const DropletOptions& p, const DropletSetup& setup, const Ranks& ranks) {
  MobilityOptions mobility = p.mobility_options();
  mobility.walls = setup.walls_rub;
  return {setup.droplets, setup.walls, make_field(p, setup), needs(p), p.skin, mobility, ranks};
}

/// The fastest decay of what contacts hold, at touch: of a droplet against a wall by itself, or of droplets against
/// each other, whose friction grows with their number as the stiffness does.
Real fastest_rate(const DropletOptions& p, const DropletSetup& setup) {
  const std::vector<Real>& diameter = setup.droplets.diameter;
  const Real least = *std::min_element(diameter.begin(), diameter.end()) / 2, walls = setup.walls_at_once;
  const Real pairs = p.f0 / (2 * least),
             wall = walls * p.f0 * p.model_parameters().mean_radius / square(least) / (setup.walls_rub ? 1 + walls : 1);
  return std::max(pairs, wall) / p.b;
}

}  // namespace

void DropletSystem::rate(Real t, const Real* y, Real* ydot) {
  droplets_.rate(t, y, ydot);
  ParticleSystem<2>& particles = droplets_.particles();
  const StateView<2> s = particles.view(y, ydot, t);
  const std::vector<Solid<2>>& walls = s.walls.solids();
  Real work = 0;
  if (std::any_of(walls.begin(), walls.end(), [](const Solid<2>& w) { return w.velocity != Vec<2>::Zero(); })) {
    wall_force_.assign(2 * walls.size(), 0);
    particles.field().add_wall_forces(s, wall_force_.data());
    for (std::size_t k = 0; k < walls.size(); ++k)
      work -= point<2>(wall_force_.data(), static_cast<Index>(k)).dot(walls[k].velocity);
  }
  std::array rates{work, droplets_.mobility().power(s)};
  ranks().sum(rates);
  if (ranks().root()) std::copy(rates.begin(), rates.end(), ydot + droplets_.size());
}

DropletRun::DropletRun(const DropletOptions& p, const Options& options, const Ranks& ranks, DropletSetup setup)
    : p_(p),
      options_(options),
      scenario_(setup.scenario),
      ranks_(ranks),
      integration_(setup.integration),
      fastest_rate_(fastest_rate(p, setup)),
      overdamped_(make_system(p, setup, ranks)),
      system_(overdamped_),
      control_(p.checkpoint_interval, p.max_wall_time, ranks),
      sampling_(p.sample_interval),
      framing_(p.frame_interval),
      dt_(p.dt),
      last_dt_(p.dt) {
  omp_set_num_threads(1);
  if (ranks.several()) whole_.emplace(setup.droplets, setup.walls, make_field(p, setup), needs(p), p.skin);
}

ExitCode DropletRun::run() {
  const bool restarted = !restarted_from_.empty();
  integration_.dt = dt_;
  integrator_.emplace(integration_, ranks_.comm());
  options_.check_consumed();
  check_step();
  if (!restarted && options_.given("dt") && last_time() > 0 && dt_ > last_time())
    throw InputError("-dt {:g} is longer than the run, {:g} t0; shorten the step or give a later -t_end", dt_,
                     last_time());
  if (restarted && last_time() < state_.t)
    throw InputError("the run is at t = {:.6g} already, after its end at {:.6g}; give a later -t_end", state_.t,
                     last_time());
  StopSignals signals;
  RunGeometry shape = geometry();
  shape.segments = wall_segments(0);
  const Topology& topology = particles().topology();
  ranks_.on_root([&] {
    writer_.emplace(
        restarted
            ? RunWriter::append(p_.output, topology, restored_samples_, restored_frames_, restored_events_)
            : RunWriter::create(p_.output, make_manifest(scenario_, "bubble", 2, p_.seed, options_), topology, shape));
    for (const std::string& message : writer_->damage()) warn("{}", message);
    checkpoints_.emplace(p_.output, restarted_from_);
    say("{}\n{}: dt = {:.3g} t0; output in {}\n", title(), integrator_->name(), dt_, p_.output);
    if (restarted) say("continuing at t = {:.6g} t0, step {}\n", state_.t, state_.step);
  });
  nlohmann::ordered_json s;
  try {
    if (!restarted) prepare();
    begin();
    cpu_at_start_ = control_.cpu_seconds();
    started_at_ = state_.t;
    const LogScope log(LogStage::run);
    if (had_ended_) judge_end();
    if (ended_by_.empty())
      integrator_->run(static_cast<FirstOrderSystem&>(system_), moving(), last_time(),
                       [this](State&) { return after_step(); });
    control_.end_progress();
    if (!stopped_) complete();
    if (!sampled_) take_sample();  // the summary has results of the last one
    s = summary(stopped_ ? "stopped" : "done");
    if (!stopped_) conclude(s);
    ranks_.on_root([&] {
      writer_->flush();
      write_summary(p_.output, s);
      writer_->close();
    });
  } catch (const Error& error) {
    control_.end_progress();
    fail(error);
  }
  if (ranks_.root()) report(s["cpu_seconds"]);
  return stopped_ ? ExitCode::stopped : ExitCode::done;
}

/// Errors: InputError for a fixed step at which droplets shake.
void DropletRun::check_step() const {
  if (!integrator_->explicit_fixed_step()) return;
  constexpr Real max_safe_ratio = 0.5;
  const Real dt = integrator_->next_dt(), limit = integrator_->stability_limit() / fastest_rate_, ratio = dt / limit;
  if (ratio > 1 && !p_.allow_unstable_dt)
    throw InputError(
        "-dt {:g} is {:.3g} times the limit of stability, {:.3g} t0: droplets would shake; shorten it, leave it out, "
        "or see what happens with -allow_unstable_dt",
        dt, ratio, limit);
  if (ratio > max_safe_ratio * (1 + 1e-9) && ranks_.root())
    warn(
        "-dt {:g} is {:.2f} of the limit of stability, {:.3g} t0, which is an estimate for light loads: above {:g} "
        "compare with half the step",
        dt, ratio, limit, max_safe_ratio);
}

void DropletRun::report(Real cpu) const {
  if (stopped_)
    say("stopped at t = {:.6g} t0 with a checkpoint; run the same command again to go on\n", state_.t);
  else
    say("{} by {} at t = {:.6g} t0; error of the energy budget {:.1e}\n",
        integrator_->statistics().steps > 0 || state_.step == 0 ? "ended" : "it has ended there already,", ended_by_,
        state_.t, budget_error_);
  const IntegratorStatistics total = statistics();
  say("{} steps, {} force evaluations, {:.2f} s CPU\n", total.steps, total.force_evaluations, cpu);
}

void DropletRun::prepare() {
  const std::vector<Real> x = start();
  state_ = State(droplets() + 1, 2);
  std::copy(x.begin(), x.end(), state_.x().begin());
  share_out();
  start_energy_ = energy();
  cpu_at_start_ = control_.cpu_seconds();
  store();  // whenever the run is killed, there is something to go on from
}

/// The first sample and frame.
void DropletRun::begin() {
  if (!sampling_.done_at(0)) sample();
  if (!framing_.done_at(0)) frame();
}

/// Gives every rank of several its droplets.
void DropletRun::share_out() {
  if (!whole_) return;
  std::vector<Index> mine;
  for (Index m = ranks_.rank(); m < droplets(); m += ranks_.size()) mine.push_back(m);
  overdamped_.particles().take(whole_->topology().select(mine));
  take_part();
  tidy();
}

/// Moves droplets to the ranks where they belong now.
void DropletRun::tidy() {
  overdamped_.tidy(own_);
  take_part();
}

void DropletRun::take_part() {
  const Topology& topology = overdamped_.particles().topology();
  std::vector<Index> mine(topology.id.begin(), topology.id.begin() + topology.owned());
  if (ranks_.root()) mine.push_back(droplets());
  numbers_ = ranks_.all_gather(mine);
  own_ = State(static_cast<Index>(mine.size()), 2);
  own_.t = state_.t;
  own_.step = state_.step;
  for (std::size_t k = 0; k < mine.size(); ++k)
    point<2>(own_.x().data(), static_cast<Index>(k)) = point<2>(state_.x().data(), mine[k]);
}

/// [2 · droplets], in the order of the numbers, to [2 · own droplets].
std::vector<Real> DropletRun::own_part(std::span<const Real> all) const {
  const Topology& topology = overdamped_.particles().topology();
  std::vector<Real> own(overdamped_.size());
  for (Index k = 0; k < topology.owned(); ++k) point<2>(own.data(), k) = point<2>(all.data(), topology.id[k]);
  return own;
}

/// What is like own_.x() on the ranks, to what is like state_.x(). Collective.
void DropletRun::gather(std::span<const Real> own, std::span<Real> all) const {
  const std::vector<Real> parts = ranks_.all_gather(std::vector<Real>(own.begin(), own.end()));
  for (std::size_t k = 0; k < numbers_.size(); ++k)
    point<2>(all.data(), numbers_[k]) = point<2>(parts.data(), static_cast<Index>(k));
}

/// What the end of a run adds, unless it was stopped.
void DropletRun::complete() {
  if (!sampling_.done_at(state_.t)) sample();
  if (!framing_.done_at(state_.t)) frame();
  if (integrator_->statistics().steps > 0) store();  // for a restart to a later end
  if (ended_by_.empty()) ended_by_ = "t_end";
}

AfterStep DropletRun::after_step() {
  if (whole_) {
    state_.t = own_.t;
    state_.step = own_.step;
    gather(own_.x(), state_.x());
  }
  const bool changed = follow(), reordered = !changed && overdamped_.particles().crowded();
  if (reordered) tidy();
  if (sampling_.due(state_.t)) sample();
  if (framing_.due(state_.t)) frame();
  if (!ended_by_.empty()) return AfterStep::stop;
  if (control_.due()) {
    control_.progress([&] {
      const Real rate = (state_.t - started_at_) / control_.wall_seconds();
      return fmt::format("t {:.6g}/{:.6g} t0  dt {:.3g}  ETA {}  {}", state_.t, last_time(), last_dt(),
                         duration_text((last_time() - state_.t) / rate), progress());
    });
    stopped_ = control_.stop();
    if (stopped_ || control_.checkpoint_due()) store();
  }
  if (stopped_) return AfterStep::stop;
  if (changed) return AfterStep::changed;
  return reordered ? AfterStep::reordered : AfterStep::proceed;
}

void DropletRun::sample() {
  const LogScope log(LogEvent::sample);
  sampling_.done(state_.t);
  const std::vector<SeriesValue> row = take_sample();
  ranks_.on_root([&] { writer_->add_sample(row); });
}

std::vector<SeriesValue> DropletRun::take_sample() {
  sampled_ = true;
  find_velocities();
  const StateView<2> s = view();
  Real bonds = 0, tense = 0;
  particles().field().for_each_contact(s, [&](const Contact<2>& c) {
    ++bonds;
    tense += c.force.dot(c.normal) < 0;
  });
  const Real total = particles().field().energy(s);
  budget_error_ = total - start_energy_ - work() + dissipated() + withdrawn_;
  std::vector<SeriesValue> row{{"time", state_.t}, {"dt", last_dt()},      {"max_speed", max_speed()},
                               {"bonds", bonds},   {"tense_bonds", tense}, {"energy", total}};
  // Terms that are switched off, or have no walls, are not reported: each has its column all the same.
  std::array<std::pair<const char*, Real>, 5> energies{
      {{"contact", 0}, {"depletion", 0}, {"wall_repulsion", 0}, {"wall_depletion", 0}, {"gravity", 0}}};
  for (const TermReport& term : particles().field().report(s))
    for (auto& [name, value] : energies)
      if (term.name == name) value = term.energy;
  for (const auto& [name, value] : energies) row.emplace_back(fmt::format("{}_energy", name), value);
  row.emplace_back("work", work());
  row.emplace_back("dissipated", dissipated());
  row.emplace_back("withdrawn", withdrawn_);
  row.emplace_back("budget_error", budget_error_);
  measure(row);
  return row;
}

void DropletRun::frame() {
  const LogScope log(LogEvent::frame);
  framing_.done(state_.t);
  find_velocities();
  write_frame();
}

void DropletRun::write_frame() {
  FrameData<2> data(particles(), state_);
  const std::vector<Real> walls = wall_segments(state_.t);
  data.frame.wall_segments = walls;
  ranks_.on_root([&] { writer_->write_frame(data.frame); });
}

void DropletRun::add_event(const std::vector<SeriesValue>& row) {
  ranks_.on_root([&] { writer_->add_event(row); });
}

std::vector<Real> DropletRun::wall_forces() {
  std::vector<Real> force(2 * particles().walls().solids().size());
  particles().field().add_wall_forces(view(), force.data());
  return force;
}

void DropletRun::find_velocities() {
  // The integrator's first guess stays its own, so that output changes no trajectory.
  std::vector<Real> guess = overdamped_.last();
  State& s = moving();
  overdamped_.rate(s.t, s.x().data(), s.v().data());
  if (!guess.empty()) overdamped_.set_last(std::move(guess));
  if (whole_) gather(s.v(), state_.v());
}

Real DropletRun::max_speed() const {
  Real speed = 0;
  for (Index m = 0; m < droplets(); ++m) speed = std::max(speed, velocity(m).norm());
  return speed;
}

Real DropletRun::energy() { return particles().field().energy(view()); }

template <class Change>
void DropletRun::outside_budget(Change&& change) {
  const Real before = energy();
  change();
  withdrawn_ += before - energy();
}

void DropletRun::set_walls(const Walls<2>& walls) {
  outside_budget([&] { put_walls(walls); });
}

void DropletRun::put_walls(const Walls<2>& walls) {
  overdamped_.particles().set_walls(walls);
  if (whole_) whole_->set_walls(walls);
}

void DropletRun::deactivate(Index m) {
  outside_budget([&] { particles().deactivate(m); });
  if (!whole_) return;
  const Topology& topology = overdamped_.particles().topology();
  for (Index k = 0; k < topology.owned(); ++k)
    if (topology.id[k] == m) overdamped_.particles().deactivate(k);
}

Real DropletRun::last_dt() const {
  const IntegratorStatistics& taken = integrator_->statistics();
  return taken.steps > 0 ? taken.last_dt : last_dt_;
}

void DropletRun::store() {
  const LogScope log(LogEvent::checkpoint);
  std::vector<Real> last = overdamped_.last();
  if (whole_ && ranks_.any(!last.empty())) {
    last.resize(own_.size());
    std::vector<Real> all(state_.size());
    gather(last, all);
    all.resize(2 * static_cast<std::size_t>(droplets()));
    last = std::move(all);
  }
  const Real cpu = total_cpu();
  ranks_.on_root([&] {
    writer_->sync();
    CheckpointWriter& c = *checkpoints_;
    c.begin(state_.t, state_.step);
    c.add("x", state_.x());
    c.add("last_velocity", last);
    c.add("active", particles().topology().active);
    // Lists that do not hold are going to be built anew.
    const Neighbours<2>& neighbours = particles().neighbours();
    Neighbours<2>::History lists;
    if (neighbours.valid(particles().walls(), state_.x().data(), state_.t))
      lists = neighbours.history(particles().topology());
    c.add("list_reference", lists.reference);
    const IntegratorStatistics total = statistics();
    c.add("list_time", lists.time);
    c.add("list_rebuilds", list_rebuilds());
    sampling_.save(c, "last_sample_at");
    framing_.save(c, "last_frame_at");
    c.add("samples", writer_->samples());
    c.add("frames", writer_->frames());
    c.add("events", writer_->events());
    c.add("dt", integrator_->next_dt());
    c.add("last_dt", last_dt());
    c.add("start_energy", start_energy_);
    c.add("withdrawn", withdrawn_);
    c.add("ended", !ended_by_.empty());
    c.add("rejected_steps", total.rejected);
    c.add("force_evaluations", total.force_evaluations);
    c.add("cpu_seconds", cpu);
    c.add_text("scenario", scenario_);
    c.add_text("options", options_.json().dump());
    save(c);
    c.finish();
  });
}

void DropletRun::restore(const Checkpoint& c) {
  constexpr Real far = 1e9;  ///< no droplet comes there
  const auto n = static_cast<std::size_t>(droplets());
  state_ = State(droplets() + 1, 2);
  std::ranges::copy(c.real_array("x", state_.size(), -far, far), state_.x().begin());
  state_.t = c.t;
  state_.step = c.step;
  load(c);
  const auto& active = c.integer_array("active", n, 0, 1);
  for (Index m = 0; m < droplets(); ++m)
    if (active[m] == 0) particles().deactivate(m);
  share_out();
  // None before the first sample.
  if (c.step > 0 || c.length("last_velocity") > 0) overdamped_.set_last(own_part(c.real_array("last_velocity", 2 * n)));
  sampling_.load(c, "last_sample_at");
  framing_.load(c, "last_frame_at");
  restored_samples_ = static_cast<std::uint64_t>(c.integer("samples", sampling_.done_at(0) ? 1 : 0));
  restored_frames_ = static_cast<std::uint64_t>(c.integer("frames", framing_.done_at(0) ? 1 : 0));
  restored_events_ = static_cast<std::uint64_t>(c.integer("events"));
  dt_ = c.real("dt", std::numeric_limits<Real>::min(), std::max(dt_, last_time()));
  last_dt_ = c.real("last_dt", std::numeric_limits<Real>::min(), std::max(last_dt_, last_time()));
  start_energy_ = c.real("start_energy");
  withdrawn_ = c.real("withdrawn");
  had_ended_ = c.flag("ended");
  before_ = {.steps = c.step,
             .rejected = c.integer("rejected_steps"),
             .force_evaluations = c.integer("force_evaluations", c.step)};
  cpu_before_ = c.real("cpu_seconds", 0);
  // The lists of the stopped run: the order of their sums is part of the state.
  const auto& reference = c.real_array("list_reference", c.length("list_reference") == 0 ? 0 : 2 * n, -far, far);
  const Real list_time = c.real("list_time", 0, c.t);
  for (std::size_t i = 0; i < reference.size(); ++i)
    if (!(std::abs(state_.x()[i] - reference[i]) <= p_.skin / 2 * (1 + 1e-9)))
      c.refuse("x[{}] = {} is farther from list_reference[{}] = {} than a droplet goes before lists are built anew", i,
               state_.x()[i], i, reference[i]);
  if (!reference.empty())
    particles().neighbours().replay(particles().topology(), particles().walls(), {reference, {}, {}, list_time});
  rebuilds_before_ = c.integer("list_rebuilds") - list_rebuilds();
  restarted_from_ = c.file;
}

std::int64_t DropletRun::list_rebuilds() const {
  return rebuilds_before_ + overdamped_.particles().neighbours().rebuilds();
}

IntegratorStatistics DropletRun::statistics() const {
  IntegratorStatistics s = integrator_->statistics();
  s.steps += before_.steps;
  s.rejected += before_.rejected;
  s.force_evaluations += before_.force_evaluations;
  return s;
}

/// Collective.
nlohmann::ordered_json DropletRun::summary(std::string_view status) {
  const IntegratorStatistics total = statistics();
  nlohmann::ordered_json s = summary_head(scenario_, "bubble", status, ended_by_, options_);
  s["particles"] = droplets();
  s["t"] = state_.t;
  s["integrator"] = integrator_->name();
  s["dt"] = p_.dt;
  s["steps"] = total.steps;
  s["rejected_steps"] = total.rejected;
  s["force_evaluations"] = total.force_evaluations;
  s["list_rebuilds"] = list_rebuilds();
  s["cpu_seconds"] = total_cpu();
  s["wall_seconds"] = control_.wall_seconds();
  if (state_.size() == 0) return s;  // an error before the start
  s["work"] = work();
  s["dissipated"] = dissipated();
  s["budget_error"] = budget_error_;
  return s;
}

void DropletRun::fail(const Error& error) {
  std::string message = error.what();
  if (error.code() == ExitCode::numerical_failure && state_.step > 0)
    message += fmt::format("; t = {:.6g}, step {}, dt = {:.3g}", state_.t, state_.step, last_dt());
  const auto attempt = [&](const auto& output) {
    try {
      output();
    } catch (const Error& second) {
      // A configuration that has no forces has no frame.
      if (second.code() != ExitCode::numerical_failure) message += fmt::format("; then {}", second.what());
    }
  };
  if (error.code() == ExitCode::numerical_failure)
    attempt([&] {
      // With the velocities found last: where droplets have run into each other there are no others.
      if (framing_.done_at(0) && !framing_.done_at(state_.t)) write_frame();
      ranks_.on_root([&] { writer_->flush(); });
    });
  attempt([&] {
    nlohmann::ordered_json s = summary("failed");
    s["message"] = message;
    ranks_.on_root([&] { write_summary(p_.output, s); });
  });
  throw Error(error.code(), message);
}

}  // namespace pliant
