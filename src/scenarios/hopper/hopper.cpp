#include <pliant/scenarios/hopper/hopper.h>

#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numeric>

#include <pliant/analysis/clog.h>
#include <pliant/analysis/crossing.h>
#include <pliant/analysis/flow_precision.h>
#include <pliant/base/console.h>
#include <pliant/base/log.h>
#include <pliant/io/summary.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/polygon.h>
#include <pliant/model/wall_contact.h>
#include <pliant/run/crossing_watch.h>
#include <pliant/run/folder.h>
#include <pliant/run/frame_data.h>
#include <pliant/run/run_control.h>
#include <pliant/run/schedule.h>
#include <pliant/run/stored_particles.h>
#include <pliant/scenarios/hopper/measurements.h>
#include <pliant/scenarios/hopper/passage.h>
#include <pliant/setup/reinsertion.h>
#include <pliant/system/drag_limit.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

namespace pliant {
namespace {

enum class Outcome { done, precise, clogged, empty, stopped };

std::string_view to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::done:
    case Outcome::precise:
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

/// As one word of a shell's command line.
std::string shell_word(const std::string& text) {
  if (text.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_./+-=,:@%") ==
      std::string::npos)
    return text;
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

/// Of a fraction; "?" where it is unknown.
std::string percent(Real fraction) { return std::isnan(fraction) ? "?" : fmt::format("{:.2g}", 100 * fraction); }

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
  HopperRun(const HopperOptions& p, const Options& options, const Ranks& ranks, std::optional<Checkpoint> checkpoint)
      : p_(p),
        options_(options),
        ranks_(ranks),
        all_(make_particles(p.model, D, draw_diameters(p.sizes, p.particles, static_cast<std::uint64_t>(p.seed)),
                            p.shape)),
        system_({}, p.hopper.walls<D>(), make_force_field<D>(p.model, p.model_parameters(), down<D>()),
                neighbour_needs(p.model, p.model_parameters()), p.first_skin(), ranks),
        control_(p.checkpoint_interval, p.max_wall_time, ranks),
        clog_(p.clog_time, p.clog_speed),
        sampling_(p.sample_interval),
        framing_(p.frame_interval) {
    for (const Real sigma : all_.sigma) largest_ = std::max(largest_, sigma);
    for (const Real a0 : all_.a0) mean_size_ += a0 / all_.particles();
    points_ = all_.points();
    top_ = std::accumulate(all_.a0.begin(), all_.a0.end(), 0.0) /
           (*p.pack_fraction * std::pow(p.hopper.wall_distance / 2, D - 1));
    const CriticalStep critical = system_.field().critical_step(all_);
    critical_step_ = critical.least();
    Real lightest = std::numeric_limits<Real>::infinity(), heaviest = 0;
    for (Index m = 0; m < all_.particles(); ++m) {
      const Real mass = all_.point_mass[m] * all_.points_of(m);
      lightest = std::min(lightest, mass);
      heaviest = std::max(heaviest, mass);
    }
    dt_ = p.dt.value_or(
        std::min({1e-3, p.elastic_fraction(critical.elastic, lightest) * critical.elastic, 0.5 * critical.damping}));
    if (p.dynamics == Dynamics::overdamped) {
      drag_limit_.emplace(system_, p.zeta);
      // The stiffest spring, k/m = (2/dt)², relaxes at the rate k/ζ.
      critical_step_ = critical.elastic * critical.elastic * p.zeta / (2 * heaviest);
      dt_ = p.dt.value_or(std::min(1e-3, 0.2 * critical_step_));
    }
    if (p.q_rtol > 0) precision_.emplace(p.q_rtol);
    if (!p.skin) system_.tune_skin();
    last_dt_ = dt_;
    if (checkpoint) load(*checkpoint);
    checkpoint.reset();
    make_integrator();
  }

  ExitCode run() {
    options_.check_consumed(
        p_.integrator == IntegratorKind::verlet ? "-integrator verlet does not read it; add -integrator ts" : "");
    check_step();
    if (restarted() && *p_.t_end < state_.t - dt_ / 2)
      throw InputError("-t_end {}: the checkpoint in {} is at t = {:.6g} already; give a later end", *p_.t_end,
                       p_.output, state_.t);
    if (p_.integrator == IntegratorKind::verlet && !((*p_.t_end - state_.t) / dt_ < FixedStepVerlet::most_steps))
      throw InputError("-t_end {:g}: with dt = {:.3g} t0 these are more steps than can be counted; give an earlier end",
                       *p_.t_end, dt_);
    check_fit(all_, p_.hopper);
    StopSignals signals;
    writer_.emplace(
        restarted() ? RunWriter::append(p_.output, all_, restored_samples_, restored_frames_, restored_events_, ranks_)
                    : RunWriter::create(p_.output, make_manifest("hopper", to_string(p_.model), D, p_.seed, options_),
                                        all_, geometry(), ranks_));
    ranks_.on_root([&] {
      for (const std::string& message : writer_->damage()) warn("{}", message);
      checkpoints_.emplace(p_.output, restarted_from_);
      writer_->write_axis("profile_height", profile_heights());
      announce();
    });
    try {
      if (restarted()) {
        all_ = Topology();
        repeat_judgements();
      } else {
        prepare();
      }
      watch([&](ParticleSystem<2>& system) { outlines_.start(system, state_); });
      begin();
      cpu_at_start_ = control_.cpu_seconds();
      started_at_ = state_.t;
      see_all();
      const LogScope log(LogStage::run);
      if (outcome_ == Outcome::done) integrate();
      control_.end_progress();
      complete();
    } catch (const Error& error) {
      control_.end_progress();
      fail(error);
    }
    return finish();
  }

 private:
  /// No point falls farther in it than a quarter of the narrowest one, whatever the height that it has come from.
  Real longest_dt() const {
    return *std::min_element(all_.diameter.begin(), all_.diameter.end()) / 4 / std::sqrt(2 * top_);
  }

  void integrate() {
    if (!drag_limit_) {
      integrator_->run(system_, state_, *p_.t_end, fresh_, [this](State& s) { return after_step(s); });
      return;
    }
    auto& ts = dynamic_cast<TsIntegrator&>(*integrator_);
    ts.run(*drag_limit_, state_, *p_.t_end, [&](State& s) {
      if (ts.first_same_as_last())
        std::ranges::copy(drag_limit_->last(), s.v().begin());
      else
        drag_limit_->rate(s.t, s.x().data(), s.v().data());
      return after_step(s);
    });
  }

  void make_integrator() {
    if (p_.integrator == IntegratorKind::verlet)
      integrator_ = std::make_unique<FixedStepVerlet>(dt_);
    else
      integrator_ = std::make_unique<TsIntegrator>(TsOptions{.dt = dt_,
                                                             .longest_dt = longest_dt(),
                                                             .implicit = p_.implicit,
                                                             .jacobian = p_.jacobian,
                                                             .admissible = admissible()},
                                                   ranks_.comm());
    if constexpr (D == 2) {
      const auto* ts = dynamic_cast<const TsIntegrator*>(integrator_.get());
      if (p_.contact_law == ContactLaw::barrier)
        outlines_ = ts == nullptr || ts->explicit_fixed_step()
                        ? CrossingWatch(least_distances(), dt_)
                        : CrossingWatch({.walls = p_.lip_contact == ContactRule::edge ? 0.0 : -1.0}, 0);
    }
  }

  /// Where the fixed step is the critical one of a barrier.
  LeastDistances least_distances() const {
    // The rate is that at stiff_distance and goes as 1/d; without inertia it is the square that counts.
    const Real step = drag_limit_ ? system_.field().critical_step(all_).elastic * std::sqrt(dt_ / critical_step_) : dt_,
               factor = BarrierOverlap::stiff_distance * step / 2;
    return {factor * EdgeContact<BarrierOverlap>{p_.e_c}.max_rate(all_),
            factor * WallContact<2, BarrierOverlap>{p_.e_w}.max_rate(all_)};
  }

  /// A barrier has no meaning inside an outline or beyond a wall.
  std::function<bool(const Real*)> admissible() {
    if constexpr (D == 2)
      if (p_.contact_law == ContactLaw::barrier) return [this](const Real* x) { return outlines_.admits(system_, x); };
    return {};
  }

  /// The start of a new run.
  void prepare() {
    const LogScope log(LogStage::pack);
    share_out(packed());
    tidy(state_);
    cpu_at_start_ = control_.cpu_seconds();
    save(state_, true);  // whenever the run is killed, there is something to go on from
  }

  /// The first sample and frame.
  void begin() {
    if (!sampling_.done_at(0)) sample(state_);
    if (!framing_.done_at(0)) frame(state_);
  }

  /// Positions of all points. Every rank packs all particles, which takes no longer than one rank would.
  std::vector<Real> packed() {
    std::vector<Real> x(static_cast<std::size_t>(points_) * D);
    const Packing packing =
        pack<D>(all_, p_.hopper, {*p_.pack_fraction, p_.pack_tolerance, static_cast<std::uint64_t>(p_.seed)}, x.data());
    if (ranks_.root())
      say("packed to a fraction of {:.3f}, height {:.1f}, in {} iterations of FIRE; largest overlap {:.1e}\n",
          packing.fraction, packing.height, packing.iterations, packing.max_overlap);
    packing_iterations_ = packing.iterations;
    return x;
  }

  /// Leaves each rank its own particles, and nobody all of them.
  void share_out(const std::vector<Real>& x) {
    std::vector<Index> mine;
    for (Index m = ranks_.rank(); m < all_.particles(); m += ranks_.size()) mine.push_back(m);
    take(mine);
    state_ = State(system_.topology().points(), D);
    for (Index k = 0; k < static_cast<Index>(mine.size()); ++k)
      std::copy(x.begin() + static_cast<std::ptrdiff_t>(all_.offset[mine[k]]) * D,
                x.begin() + static_cast<std::ptrdiff_t>(all_.offset[mine[k] + 1]) * D,
                state_.x().begin() + static_cast<std::ptrdiff_t>(system_.topology().offset[k]) * D);
    all_ = Topology();
  }

  /// Makes the particles with these ids, in this order, the rank's own.
  void take(std::span<const Index> ids) {
    system_.take(all_.select(ids));
    counted_.assign(ids.size(), 0);
    reinserted_.assign(ids.size(), 0);
    seen_.assign(ids.size(), {});
  }

  void see_all() {
    for (Index m = 0; m < system_.topology().owned(); ++m) seen_[m] = sight(state_, m);
  }

  void tidy(State& s) {
    const Migration migration = system_.tidy(s);
    migration.move(counted_);
    migration.move(reinserted_);
    migration.move(seen_);
  }

  /// The rule for an early end is a function of the samples: a restart shows it the stored ones again. If the last one
  /// would have ended the run, it has ended.
  void repeat_judgements() {
    if (!precision_ || restored_samples_ == 0) return;
    ranks_.on_root([&] { repeat_stored_judgements(); });
    outcome_ = ranks_.broadcast(outcome_);
  }

  void repeat_stored_judgements() {
    const Series series = writer_->read_series();
    const auto column = [&](const char* name) -> const std::vector<Real>& { return series.at(name).values; };
    const auto &time = column("time"), &crossed = column("crossed_count"), &area = column("crossed_area"),
               &energy = column("kinetic_energy");
    for (std::size_t i = 0; i < time.size(); ++i)
      outcome_ = precision_->add(time[i], crossed[i], area[i], energy[i]) ? Outcome::precise : Outcome::done;
  }

  /// What the end of a run adds, unless it was stopped.
  void complete() {
    if (outcome_ == Outcome::stopped) return;
    if (outcome_ == Outcome::done) save(state_, false);  // for a restart to a later end
    if (!sampling_.done_at(state_.t)) sample(state_);
    if (!framing_.done_at(state_.t)) frame(state_);
  }

  // --- After every accepted step

  AfterStep after_step(State& s) {
    watch([&](ParticleSystem<2>& system) { outlines_.after_step(system, s); });
    // Before anything below builds lists, so that output changes no trajectory. TS methods lose their history by it.
    const bool untidy = system_.crowded() || (p_.integrator == IntegratorKind::verlet && system_.untidy());
    const bool changed = follow_particles(s), reordered = untidy && !changed;
    if (reordered) tidy(s);
    if (changed || reordered) watch([&](ParticleSystem<2>& system) { outlines_.after_change(system, s); });
    if (sampling_.due(s.t)) sample(s);
    if (framing_.due(s.t)) frame(s);
    if (outcome_ == Outcome::precise) save(s, changed);  // for a restart that asks for more
    if (outcome_ == Outcome::done && control_.due()) {
      control_.progress([&] { return progress_line(s); });
      if (control_.stop()) outcome_ = Outcome::stopped;
      if (outcome_ == Outcome::stopped || control_.checkpoint_due()) save(s, changed);
    }
    if (outcome_ != Outcome::done) return AfterStep::stop;
    if (changed) return AfterStep::changed;
    return reordered ? AfterStep::reordered : AfterStep::proceed;
  }

  /// Counts the particles that have crossed the orifice line; those 2 σ_l below are put back or, in a discharge, taken
  /// out. Errors: NumericalError where one has crossed the line beside the orifice. Nothing moves more than skin/2
  /// between two list rebuilds, so only particles that were near enough at the last one are looked at.
  bool follow_particles(State& s) {
    const Topology& topology = system_.topology();
    if (system_.neighbours().rebuilds() != watched_since_) {
      watched_since_ = system_.neighbours().rebuilds();
      watched_.clear();
      for (Index m = 0; m < topology.owned(); ++m)
        if (topology.active[m] && height(s, m) < system_.neighbours().skin()) watched_.push_back(m);
    }
    std::vector<Leaving> leaving;
    std::optional<Crossing> astray;
    for (const Index m : watched_) {
      const Sighting<D> now = sight(s, m);
      const Real h = now.x[D - 1];
      const bool below = h < 0;
      if (below != (seen_[m].x[D - 1] < 0)) {
        const Crossing crossing{topology.id[m], below ? on_the_line(seen_[m], now) : now};
        if (!passage(s).through_orifice(m, crossing.at.x)) {
          astray = crossing;
        } else if (below && !counted_[m]) {
          counted_[m] = 1;
          ++flow_.crossed;
          flow_.area += topology.a0[m];
          crossings_.push_back(crossing);
        }
      }
      seen_[m] = now;
      if (h < -2 * largest_ && topology.active[m])
        leaving.push_back({topology.id[m], ranks_.rank(), m, reinserted_[m]});
    }
    enum { nobody, some_leave, one_astray };
    const int event = ranks_.max(astray ? one_astray : !leaving.empty() ? some_leave : nobody);
    if (event == nobody) return false;
    if (event == one_astray)
      ranks_.together([&] {
        if (astray) throw through_wall(astray->id, astray->at.x, "crossed the orifice line outside the orifice");
      });
    const LogScope log(LogEvent::put_back);
    leaving = ranks_.all_gather(leaving);
    std::sort(leaving.begin(), leaving.end(), [](const Leaving& a, const Leaving& b) { return a.id < b.id; });
    for (const Leaving& l : leaving) {
      const bool mine = l.rank == ranks_.rank();
      if (p_.flow == FlowKind::continuous) {
        reinsert<D>(ranks_, topology, p_.hopper, system_.walls(), p_.model == ModelKind::smooth,
                    static_cast<std::uint64_t>(p_.seed), l, s);
        if (!mine) continue;
        system_.relocate(s.x().data(), l.particle);
        seen_[l.particle] = sight(s, l.particle);
        counted_[l.particle] = 0;
        ++reinserted_[l.particle];
      } else if (mine) {
        for (Index i = topology.offset[l.particle]; i < topology.offset[l.particle + 1]; ++i)
          point<D>(s.v().data(), i).setZero();
        system_.deactivate(l.particle);
      }
    }
    return true;
  }

  Real height(const State& s, Index m) const { return mean_of_points<D>(s.x().data(), system_.topology(), m)[D - 1]; }

  Passage<D> passage(const State& s) const { return {s.x().data(), system_.topology(), p_.hopper, system_.walls()}; }

  NumericalError through_wall(Index id, const std::array<Real, D>& at, std::string_view how) const {
    const bool enters = deformable() && p_.lip_contact == ContactRule::literal;
    return NumericalError(
        "particle {} has {}, at ({:.3f}): it went through a wall; {}stiffen the walls (-e_w, now {:g}) or {}", id, how,
        fmt::join(at, ", "), enters ? "use -lip_contact edge, as lips enter edges without, " : "", p_.e_w, shorten());
  }

  Sighting<D> sight(const State& s, Index m) const {
    Sighting<D> now{s.t, {}, {}};
    const Vec<D> x = mean_of_points<D>(s.x().data(), system_.topology(), m),
                 v = mean_of_points<D>(s.v().data(), system_.topology(), m);
    std::copy(x.begin(), x.end(), now.x.begin());
    std::copy(v.begin(), v.end(), now.v.begin());
    return now;
  }

  /// Crossings of all ranks since the last call become events.
  void record_crossings() {
    std::vector<Crossing> all = ranks_.all_gather(std::exchange(crossings_, {}));
    std::sort(all.begin(), all.end(),
              [](const Crossing& a, const Crossing& b) { return std::pair(a.at.t, a.id) < std::pair(b.at.t, b.id); });
    ranks_.on_root([&] {
      for (const Crossing& c : all)
        writer_->add_event(std::array<SeriesValue, 4>{
            {{"time", c.at.t}, {"particle", static_cast<Real>(c.id)}, {"position", c.at.x}, {"velocity", c.at.v}}});
    });
  }

  void sample(const State& s) {
    const LogScope log(LogEvent::sample);
    record_crossings();
    sampling_.done(s.t);
    last_sample_ = take_sample<D>(system_, s, p_.hopper, flow_, last_dt());
    check(s);
    ranks_.on_root([&] { writer_->add_sample(last_sample_.row); });
    const FlowCount& crossed = last_sample_.crossed;
    if (precision_ &&
        precision_->add(s.t, static_cast<Real>(crossed.crossed), crossed.area, last_sample_.kinetic_energy))
      outcome_ = Outcome::precise;
    if (p_.flow == FlowKind::discharge && last_sample_.in_hopper == 0) outcome_ = Outcome::empty;
    if (clog_.update(s.t, crossed.crossed, last_sample_.in_hopper, last_sample_.max_speed)) outcome_ = Outcome::clogged;
    outcome_ = ranks_.broadcast(outcome_);
  }

  /// Stops the run at what no later number could be trusted after.
  void check(const State& s) {
    const Topology& topology = system_.topology();
    const Passage<D> places = passage(s);
    ranks_.together([&] {
      for (Index m = 0; m < topology.owned(); ++m) {
        const Vec<D> r = mean_of_points<D>(s.x().data(), topology, m), v = mean_of_points<D>(s.v().data(), topology, m);
        if (!r.allFinite() || !v.allFinite())
          throw NumericalError("particle {} has a position or velocity that is not finite", topology.id[m]);
        if (topology.active[m] && places.through_wall(m))
          throw through_wall(topology.id[m], sight(s, m).x, "left the hopper");
        if (const Real roof = 10 * (top_ + p_.hopper.slope_height() + largest_); r[D - 1] > roof)
          throw NumericalError(
              "particle {} was thrown to a height of {:.3g} sigma_avg, beyond {:.3g}, ten times that of the start: the "
              "step makes energy; {}",
              topology.id[m], r[D - 1], roof, shorten());
      }
    });
  }

  /// visit(system) where there are outlines that can be crossed.
  template <class Visit>
  void watch(Visit&& visit) {
    if constexpr (D == 2)
      if (deformable()) visit(system_);
  }

  void frame(const State& s) {
    const LogScope log(LogEvent::frame);
    framing_.done(s.t);
    writer_->write_frame(FrameData<D>(system_, s).frame);
  }

  // --- Checkpoints

  /// Everything per particle or point is stored in the order of the ranks, and within a rank in its own order.
  void save(const State& s, bool changed) {
    const LogScope log(LogEvent::checkpoint);
    record_crossings();
    const Topology& topology = system_.topology();
    ranks_.on_root([&] {
      writer_->sync();
      checkpoints_->begin(s.t, s.step);
    });
    // One array at a time, so that they are not in memory once more.
    const auto add = [&](const char* name, auto&& values) {
      const auto all = ranks_.gather(std::forward<decltype(values)>(values));
      ranks_.on_root([&] { checkpoints_->add(name, all); });
    };
    const auto add_own = [&](const char* name, const auto& values) {
      add(name, std::span(values).first(topology.owned()));
    };
    add("x", s.x());
    add("v", s.v());
    add("predicted", s.predicted());
    {
      typename Neighbours<D>::History lists = system_.neighbours().history(topology);
      // Lists that do not hold are going to be built anew. Ranks whose particles have just left have none.
      if (!ranks_.all(s.size() == 0 || system_.neighbours().valid(system_.walls(), s.x().data()))) lists = {};
      add("list_reference", std::move(lists.reference));
      add("list_places", lists.places);  // none on several ranks
      add("list_relocated", lists.relocated);
    }
    add_own("id", topology.id);
    add_own("active", topology.active);
    add("counted", counted_);
    add("reinserted", reinserted_);
    add("rank_particles", std::vector<std::int64_t>{topology.owned()});
    const IntegratorStatistics total = statistics();
    const std::int64_t crossed = ranks_.sum(flow_.crossed);
    const Real crossed_area = ranks_.sum(flow_.area), cpu = total_cpu();
    ranks_.on_root([&] {
      CheckpointWriter& c = *checkpoints_;
      sampling_.save(c, "last_sample_at");
      framing_.save(c, "last_frame_at");
      c.add("samples", writer_->samples());
      c.add("frames", writer_->frames());
      c.add("events", writer_->events());
      c.add("crossed", crossed);
      c.add("crossed_area", crossed_area);
      const ClogDetector::State& clog = clog_.state();
      c.add("quiet_since", std::isnan(clog.quiet_since) ? -1 : clog.quiet_since);
      c.add("crossed_before_quiet", clog.crossed);
      c.add("changed", std::int64_t{changed});
      c.add("dt", next_dt());
      c.add("last_dt", last_dt());
      c.add("skin", system_.neighbours().skin());
      c.add("evaluations_since_sort", system_.use().evaluations);
      c.add("list_rebuilds_since_sort", system_.use().rebuilds);
      c.add("list_rebuilds", list_rebuilds());
      c.add("packing_iterations", packing_iterations_);
      c.add("rejected_steps", total.rejected);
      c.add("force_evaluations", total.force_evaluations);
      c.add("jacobian_evaluations", total.jacobian_evaluations);
      c.add("linear_iterations", total.linear_iterations);
      c.add("cpu_seconds", cpu);
      c.add_text("scenario", "hopper");
      c.add_text("options", options_.json().dump());
      c.finish();
    });
  }

  /// All that is read is checked before it is used.
  void load(const Checkpoint& c) {
    const StoredParticles stored(c, all_, D, ranks_);
    take(stored.ids());
    const std::int64_t crossed = c.integer("crossed");
    const auto restore = [&](auto& own, const char* name, std::int64_t least, std::int64_t most) {
      const auto values = stored.particles(name, least, most);
      own.assign(values.begin(), values.end());
    };
    restore(counted_, "counted", 0, 1);
    restore(reinserted_, "reinserted", 0, crossed);
    std::vector<std::uint8_t> active;
    restore(active, "active", p_.flow == FlowKind::continuous ? 1 : 0, 1);
    for (std::size_t m = 0; m < active.size(); ++m)
      if (active[m] == 0) system_.deactivate(static_cast<Index>(m));

    state_.t = c.t;
    state_.step = c.step;
    sampling_.load(c, "last_sample_at");
    framing_.load(c, "last_frame_at");
    // A particle that moves by some diameters in a step has gone through others.
    dt_ = c.real("dt", std::numeric_limits<Real>::min(), std::max(dt_, *p_.t_end));
    last_dt_ = c.real("last_dt", std::numeric_limits<Real>::min(), std::max(dt_, *p_.t_end));
    const Real fastest = 10 * largest_ / dt_;
    state_.assign(stored.points("x"), stored.points("v", fastest), stored.points("predicted", fastest));
    const Real area = static_cast<Real>(crossed) * *std::max_element(all_.a0.begin(), all_.a0.end());
    const Real crossed_area = c.real("crossed_area", 0, area * (1 + 1e-9));
    if (ranks_.root()) flow_ = {crossed, crossed_area};
    const Real quiet_since = c.real("quiet_since", -1, c.t);
    clog_.restore({quiet_since < 0 ? NAN : quiet_since, c.integer("crossed_before_quiet", -1, crossed)});
    restored_samples_ = static_cast<std::uint64_t>(c.integer("samples", sampling_.done_at(0) ? 1 : 0));
    restored_frames_ = static_cast<std::uint64_t>(c.integer("frames", framing_.done_at(0) ? 1 : 0));
    restored_events_ = static_cast<std::uint64_t>(c.integer("events", crossed, crossed));
    before_ = {.steps = c.step,
               .rejected = c.integer("rejected_steps"),
               .force_evaluations = c.integer("force_evaluations", c.step),
               .jacobian_evaluations = c.integer("jacobian_evaluations"),
               .linear_iterations = c.integer("linear_iterations")};
    packing_iterations_ = c.integer("packing_iterations");
    fresh_ = c.flag("changed");
    cpu_before_ = c.real("cpu_seconds", 0);
    // The lists of the stopped run: the order of their sums is part of the state.
    const Real widest = std::max(p_.first_skin(), *std::max_element(all_.diameter.begin(), all_.diameter.end()));
    const Real skin = c.real("skin", p_.skin.value_or(std::numeric_limits<Real>::min()), p_.skin.value_or(widest));
    const auto [reference, relocated, places] = stored.lists(skin / 2 * (1 + 1e-9));
    const std::int64_t rebuilds = c.integer("list_rebuilds"),
                       since_sort = c.integer("list_rebuilds_since_sort", 0, rebuilds),
                       evaluations = c.integer("evaluations_since_sort");
    system_.neighbours().set_skin(skin);
    if (!reference.empty()) {
      if (ranks_.several())
        system_.rebuild(stored.own_points(reference).data());
      else
        system_.neighbours().replay(system_.topology(), system_.walls(), {reference, relocated, places});
    }
    system_.set_use({evaluations, since_sort});
    rebuilds_before_ = rebuilds - system_.neighbours().rebuilds();
    restarted_from_ = c.file;
  }

  /// Whether the step is fixed and its method explicit: then it can be too long.
  bool explicit_fixed_step() const {
    const auto* ts = dynamic_cast<const TsIntegrator*>(integrator_.get());
    return ts == nullptr || ts->explicit_fixed_step();
  }

  /// What to do about too long a step.
  std::string shorten() const {
    return explicit_fixed_step() ? fmt::format("shorten the step (-dt, now {:.3g})", next_dt())
                                 : "lower the tolerances (-ts_rtol, -ts_atol) or the step (-dt)";
  }

  /// Errors: InputError for a step that makes energy from nothing, or that is longer than the run.
  void check_step() const {
    const Real dt = next_dt(), ratio = dt / critical_step_;
    if (!restarted() && *p_.t_end > 0 && dt > *p_.t_end)
      throw InputError("-dt {:g} is longer than the run, -t_end {:g}; shorten the step or give a later end", dt,
                       *p_.t_end);
    if (!explicit_fixed_step()) return;
    if (ratio > 1 && !p_.allow_unstable_dt)
      throw InputError(
          "-dt {:g} is {:.3g} times the limit of stability, {:.3g} t0: the step would make energy; shorten it, "
          "leave it out, or see what happens with -allow_unstable_dt",
          dt, ratio, critical_step_);
    if (ratio > max_safe_ratio * (1 + 1e-9) && ranks_.root())
      warn(
          "-dt {:g} is {:.2f} of the limit of stability, {:.3g} t0: above {:g} contacts that open and close heat; "
          "compare with half the step",
          dt, ratio, critical_step_, max_safe_ratio);
  }

  Real next_dt() const {
    const auto* ts = dynamic_cast<const TsIntegrator*>(integrator_.get());
    return ts != nullptr ? ts->next_dt() : dt_;
  }

  /// Of the last step, also where a restart has not taken one yet; before the first the one to come.
  Real last_dt() const {
    const IntegratorStatistics& taken = integrator_->statistics();
    return taken.steps > 0 ? taken.last_dt : last_dt_;
  }

  // --- Texts, summary

  IntegratorStatistics statistics() const {
    IntegratorStatistics s = integrator_->statistics();
    s.steps += before_.steps;
    s.rejected += before_.rejected;
    s.force_evaluations += before_.force_evaluations;
    s.jacobian_evaluations += before_.jacobian_evaluations;
    s.linear_iterations += before_.linear_iterations;
    return s;
  }

  std::int64_t list_rebuilds() const { return rebuilds_before_ + system_.neighbours().rebuilds(); }

  Real total_cpu() const { return cpu_before_ + control_.cpu_seconds() - cpu_at_start_; }

  void announce() const {
    say("hopper: {} particles ({}, {}D{}), W = {}, w = {}, angle {}, {}\n", p_.particles, to_string(p_.model), D,
        deformable() ? fmt::format(", {} vertices each", p_.shape.vertices) : "", p_.hopper.wall_distance,
        p_.hopper.orifice, p_.hopper.angle, p_.flow == FlowKind::continuous ? "continuous flow" : "discharge");
    say("{}: dt = {:.3g} t0, dt/dt_critical = {:.2f}; output in {}\n", integrator_->name(), dt_, dt_ / critical_step_,
        p_.output);
    if (restarted()) say("continuing at t = {:.6g} t0, step {}\n", state_.t, state_.step);
  }

  std::string progress_line(const State& s) const {
    const Real wall = control_.wall_seconds(), done = s.t - started_at_, rate = done / wall;
    const Real steps = static_cast<Real>(integrator_->statistics().steps);
    std::string line =
        fmt::format("t {:.2f}/{:g} t0  {:.3g} steps/s  ETA {}  dt/dt_c {:.2f}  max overlap {:.3f}  crossed {}", s.t,
                    *p_.t_end, steps / wall, duration_text((*p_.t_end - s.t) / rate), last_dt() / critical_step_,
                    last_sample_.max_overlap, last_sample_.crossed.crossed);
    if (precision_)
      line += fmt::format("  error of Q {} of {:g} %", percent(precision_->relative_error()), 100 * p_.q_rtol);
    return line;
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

  /// Collective.
  nlohmann::ordered_json summary(std::string_view status) {
    const IntegratorStatistics total = statistics();
    const Real cpu = total_cpu(), steps = static_cast<Real>(total.steps);
    nlohmann::ordered_json s = summary_head("hopper", to_string(p_.model), status,
                                            outcome_ == Outcome::precise ? "q_rtol" : "t_end", options_);
    s["particles"] = p_.particles;
    s["t"] = state_.t;
    s["crossed_count"] = ranks_.sum(flow_.crossed);
    s["integrator"] = integrator_->name();
    s["dt"] = dt_;
    s["dt_critical"] = critical_step_;
    s["steps"] = total.steps;
    s["rejected_steps"] = total.rejected;
    s["force_evaluations"] = total.force_evaluations;
    s["jacobian_evaluations"] = total.jacobian_evaluations;
    s["linear_iterations"] = total.linear_iterations;
    s["list_rebuilds"] = list_rebuilds();
    s["skin"] = system_.neighbours().skin();
    s["packing_iterations"] = packing_iterations_;
    s["cpu_seconds"] = cpu;
    s["wall_seconds"] = control_.wall_seconds();
    s["particle_steps_per_second"] = steps * p_.particles / cpu;
    s["ns_per_particle_step"] = steps > 0 ? nlohmann::ordered_json(1e9 * cpu / (steps * p_.particles)) : nullptr;
    s["ns_per_vertex_step"] =
        steps > 0 && deformable() ? nlohmann::ordered_json(1e9 * cpu / (steps * points_)) : nullptr;
    return s;
  }

  [[noreturn]] void fail(const Error& error) {
    std::string message = error.what();
    const Real ratio = next_dt() / critical_step_;
    if (error.code() == ExitCode::numerical_failure && explicit_fixed_step() && ratio > max_safe_ratio * (1 + 1e-9))
      message = fmt::format("-dt {:g} is {} the limit of stability: shorten it first; {}", next_dt(),
                            ratio > 1 ? fmt::format("{:.3g} times", ratio) : fmt::format("{:.2f} of", ratio), message);
    if (error.code() == ExitCode::numerical_failure && state_.step > 0)
      message += fmt::format("; t = {:.6g}, step {}, dt = {:.3g}, dt/dt_critical = {:.2f}{}", state_.t, state_.step,
                             dt_, dt_ / critical_step_,
                             last_sample_.first < 0
                                 ? std::string()
                                 : fmt::format(", largest overlap {:.3f} between particles {} and {}",
                                               last_sample_.max_overlap, last_sample_.first, last_sample_.second));
    try {
      if (error.code() == ExitCode::numerical_failure) {
        const bool finite = std::all_of(state_.x().begin(), state_.x().end(), [](Real a) { return std::isfinite(a); });
        // Before the first frame the particles have no places.
        if (ranks_.all(finite && writer_->frames() > 0)) frame(state_);
        ranks_.on_root([&] { writer_->flush(); });
      }
      nlohmann::ordered_json s = summary("failed");
      s["message"] = message;
      ranks_.on_root([&] { write_summary(p_.output, s); });
    } catch (const Error& second) {
      message += fmt::format("; then {}", second.what());
    }
    throw Error(error.code(), message);
  }

  ExitCode finish() {
    nlohmann::ordered_json s = summary(to_string(outcome_));
    ranks_.on_root([&] { write_results(s); });
    return outcome_ == Outcome::stopped ? ExitCode::stopped : ExitCode::done;
  }

  void write_results(nlohmann::ordered_json& s) {
    writer_->flush();
    if (outcome_ == Outcome::stopped) {
      say("stopped at t = {:.6g} t0 with a checkpoint; run the same command again to go on\n", state_.t);
    } else {
      const Series series = writer_->read_series();
      nlohmann::ordered_json measured = evaluate_series(series, p_, mean_size_);
      // A clog is no flow, whatever came out before it: fits leave such a run out.
      if (outcome_ == Outcome::clogged)
        for (const char* name : {"Q", "Q_corrected"})
          if (measured.contains(name)) measured[name].update({{"value", 0}, {"error", nullptr}});
      // What comes after it is no flow.
      if (outcome_ == Outcome::clogged || p_.flow == FlowKind::discharge)
        measured["flow_ended"] = quantity(last_crossing(series), BlockAverage::unknown, "t0");
      for (const auto& [name, value] : measured.items()) s[name] = value;
      report(measured, s["cpu_seconds"]);
      warn_of_overlap(series);
      if (outcome_ == Outcome::done) warn_of_standstill(series);
      if (precision_ && outcome_ == Outcome::done) warn_of_error(measured);
    }
    write_summary(p_.output, s);
    writer_->close();
  }

  /// For a run that -t_end ended first.
  void warn_of_error(const nlohmann::ordered_json& measured) const {
    const bool known = measured.contains("Q") && !measured["Q"]["error"].is_null();
    const Real error = known ? Real(measured["Q"]["error"]) / Real(measured["Q"]["value"]) : BlockAverage::unknown;
    warn("-t_end {:g} came before -hopper_q_rtol {:g} was certain: the error of Q is {} %; go on with {}", *p_.t_end,
         p_.q_rtol, percent(error), command_to_go_on());
  }

  /// For a run whose flow has ended without a clog: what is left may bounce where too little carries off its energy.
  void warn_of_standstill(const Series& series) const {
    const Real last = last_crossing(series), since = state_.t - last;
    if (last_sample_.in_hopper > 0 && since >= p_.clog_time && since > 0.2 * state_.t)
      warn(
          "nothing has crossed since t = {:.4g} t0, but particles move at up to {:.2g} sigma_avg/t0, above -clog_speed "
          "{:g}: not counted as clogged, and averages have that time in them",
          last, last_sample_.max_speed, p_.clog_speed);
  }

  /// Centres that meet pass through each other.
  void warn_of_overlap(const Series& series) const {
    const Real deepest = std::ranges::max(series.at("max_overlap").values);
    if (deepest > 0.95)
      warn("particles overlapped by {:.3g} of their contact distance: they pass through each other; raise {}, now {:g}",
           deepest, deformable() ? "-e_c" : "-e_sp", deformable() ? p_.e_c : p_.e_sp);
  }

  /// To twice the time, and as many samples as an error needs.
  std::string command_to_go_on() const {
    const Real later = 2 * std::max(state_.t, 64 * p_.sample_interval);
    return fmt::format("pliant hopper -restart {} -t_end {:.3g}", shell_word(p_.output), later);
  }

  void report(const nlohmann::ordered_json& measured, Real cpu) const {
    const bool few = measured.contains("steady_samples") && measured["steady_samples"] <= BlockAverage::least_samples;
    const std::string no_error =
        outcome_ == Outcome::clogged                            ? "clogged"
        : measured.contains("Q") && measured["Q"]["value"] == 0 ? "no error: nothing has crossed"
        : few ? fmt::format("no error: fewer than {} steady samples", BlockAverage::least_samples)
              : "no error: it drifts, or its correlations are too long for the run";
    const auto print = [&](const char* name, const char* text) {
      if (!measured.contains(name) || measured[name]["value"].is_null()) return;
      const Real value = measured[name]["value"];
      const std::string unit = measured[name]["unit"], space = unit.empty() ? "" : " ";
      if (measured[name]["error"].is_null())
        say("{} = {:.3g}{}{} ({})\n", text, value, space, unit, no_error);
      else
        say("{} = {:.5g} ± {:.2g}{}{}\n", text, value, Real(measured[name]["error"]), space, unit);
    };
    if (outcome_ == Outcome::clogged)
      say("clogged: no crossing and no motion since t = {:.4g} t0\n", clog_.state().quiet_since);
    if (outcome_ == Outcome::precise)
      say("ended at t = {:.6g} t0: Q has the relative error that -hopper_q_rtol asks for\n", state_.t);
    if (measured.contains("steady_explanation")) say("{}\n", std::string(measured["steady_explanation"]));
    if (outcome_ == Outcome::done && measured.contains("steady") && !measured["steady"])
      say("to run longer: {}\n", command_to_go_on());
    print("Q", "Q");
    print("Q_corrected", "Q'");
    print("contacts_per_particle", "contacts per particle");
    print("drag_friction_ratio", "drag/friction");
    if (measured.contains("c0")) say("{}\n", discharge_text(measured));
    const IntegratorStatistics total = statistics();
    const Real ns = 1e9 * cpu / static_cast<Real>(std::max<std::int64_t>(total.steps, 1));
    say("{} steps, {} force evaluations, {:.2f} s CPU, {:.1f} ns per particle-step{}\n", total.steps,
        total.force_evaluations, cpu, ns / p_.particles,
        deformable() ? fmt::format(", {:.1f} ns per vertex-step", ns / points_) : "");
  }

  bool deformable() const { return p_.model != ModelKind::sp; }
  bool restarted() const { return !restarted_from_.empty(); }

  /// dt/dt_critical from which on docs/steps.md finds that flows heat.
  static constexpr Real max_safe_ratio = 0.5;

  const HopperOptions& p_;
  const Options& options_;
  Ranks ranks_;
  Topology all_;  ///< all particles by id; empty once they are shared out
  ParticleSystem<D> system_;
  RunControl control_;
  ClogDetector clog_;
  std::optional<FlowPrecision> precision_;
  std::optional<DragLimit<D>> drag_limit_;  ///< where there is no inertia
  std::unique_ptr<Integrator> integrator_;
  std::optional<RunWriter> writer_;
  std::optional<CheckpointWriter> checkpoints_;  ///< on the root

  // State that a checkpoint keeps.
  FlowCount flow_;
  std::vector<std::uint8_t> counted_;  ///< per own particle: has crossed since it was last put back
  std::vector<Index> reinserted_;      ///< times put back
  std::vector<Sighting<D>> seen_;      ///< last sight of each; kept up to date for those that are watched
  struct Crossing {
    Index id;
    Sighting<D> at;
  };
  std::vector<Crossing> crossings_;  ///< not recorded yet
  Schedule sampling_, framing_;
  std::int64_t packing_iterations_ = 0;
  State state_;

  Real largest_ = 0, mean_size_ = 0;  ///< diameter; a0
  Real top_ = 0;                      ///< of the filling of a flat hopper at the start; not less than it is
  Index points_ = 0;                  ///< of all particles
  Real critical_step_ = 0, dt_ = 0;
  Real last_dt_ = 0;            ///< before the first step of this process
  std::string restarted_from_;  ///< file of the checkpoint
  bool fresh_ = true;
  std::uint64_t restored_samples_ = 0, restored_frames_ = 0, restored_events_ = 0;
  IntegratorStatistics before_;  ///< of the runs before a restart
  Real cpu_before_ = 0, cpu_at_start_ = 0, started_at_ = 0;
  CrossingWatch outlines_;
  std::vector<Index> watched_;
  std::int64_t watched_since_ = -1, rebuilds_before_ = 0;
  Sample<D> last_sample_;
  Outcome outcome_ = Outcome::done;
};

/// Whether it holds the particles that the options ask for, before they are made.
void check_size(const Checkpoint& c, const HopperOptions& p) {
  const auto n = static_cast<std::size_t>(p.particles),
             points = p.model == ModelKind::sp ? n : n * static_cast<std::size_t>(p.shape.vertices);
  c.integer_array("id", n);
  c.real_array("x", points * static_cast<std::size_t>(p.dim));
}

}  // namespace

ExitCode run_hopper(HopperOptions& p, Options& options, const Ranks& ranks) {
  start_log();
  FolderLock lock;  // held until the run has closed its files
  std::function<ExitCode()> run;
  make_run("hopper", p, options, ranks, lock, [&](std::optional<Checkpoint> checkpoint) {
    p.resolve();
    if (!checkpoint) p.refuse_unread(options);
    if (checkpoint) check_size(*checkpoint, p);
    omp_set_num_threads(p.threads);
    const auto make = [&]<int D>() {
      // The checkpoint is dropped once it is read.
      const auto hopper = std::make_shared<HopperRun<D>>(p, options, ranks, std::move(checkpoint));
      run = [hopper] { return hopper->run(); };
    };
    p.dim == 2 ? make.template operator()<2>() : make.template operator()<3>();
  });
  return run();
}

}  // namespace pliant
