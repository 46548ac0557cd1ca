#include <pliant/scenarios/hopper/hopper.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numeric>

#include <pliant/analysis/clog.h>
#include <pliant/analysis/flow_precision.h>
#include <pliant/base/console.h>
#include <pliant/base/log.h>
#include <pliant/base/text.h>
#include <pliant/io/summary.h>
#include <pliant/model/drag.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/polygon.h>
#include <pliant/run/crossing_watch.h>
#include <pliant/run/heat.h>
#include <pliant/run/memory.h>
#include <pliant/run/overlap_check.h>
#include <pliant/run/passage_watch.h>
#include <pliant/run/run.h>
#include <pliant/run/surface_check.h>
#include <pliant/scenarios/hopper/blockage.h>
#include <pliant/scenarios/hopper/measurements.h>
#include <pliant/scenarios/hopper/orifice_counter.h>
#include <pliant/scenarios/hopper/passage.h>
#include <pliant/scenarios/hopper/report.h>
#include <pliant/scenarios/hopper/steps.h>
#include <pliant/scenarios/particles/options.h>
#include <pliant/setup/reinsertion.h>
#include <pliant/system/point_drag.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

namespace pliant {
namespace {

template <int D>
Vec<D> down() {
  Vec<D> g = Vec<D>::Zero();
  g[D - 1] = -1;
  return g;
}

template <int D>
std::unique_ptr<Simulation<D>> make_simulation(const HopperOptions& p, const Ranks& ranks) {
  ParticleSystem<D> particles({}, p.container->walls<D>(), p.force_field<D>(down<D>()), p.first_skin(), ranks);
  if (!p.skin) particles.tune_skin();
  Topology all = start_topology(p.start, p.model, D, p.sizes, p.particles, p.seed, p.shape);
  const Sorting sorting = p.integrator == IntegratorKind::verlet ? Sorting::regularly : Sorting::at_start;
  if (p.dynamics == Dynamics::inertial)
    return std::make_unique<Simulation<D>>(std::move(all), std::move(particles), sorting);
  return std::make_unique<Simulation<D>>(
      std::move(all),
      OverdampedSystem<D>(std::move(particles), std::make_unique<PointDrag<D>>(p.model.term(Drag<D>{}))), sorting);
}

/// Protocol of the hopper: particles flow, are counted, reinserted and measured.
template <int D>
class HopperProtocol final : public Protocol<D> {
 public:
  HopperProtocol(const HopperOptions& p, const Ranks& communicator)
      : Protocol<D>(make_simulation<D>(p, communicator)),
        p_(p),
        clog_(p.clog_time, *p.clog_speed),
        largest_(*std::ranges::max_element(this->simulation().all().sigma)),
        counter_(p.counting, p.removal_depth.value_or(2 * largest_)) {
    const Topology& all = this->simulation().all();
    for (const Real a0 : all.a0) mean_size_ += a0 / all.particles();
    narrowest_ = *std::min_element(all.diameter.begin(), all.diameter.end());
    largest_a0_ = *std::max_element(all.a0.begin(), all.a0.end());
    top_ = std::accumulate(all.a0.begin(), all.a0.end(), 0.0) /
           (*p.pack_fraction * std::pow(p.container->inflow_width() / 2, D - 1));
    // Long particles, and surfaces, start with space to rotate.
    if (deformable() && !p.start.given() && (D == 3 || p.shape.shape_parameter > 0)) {
      Real outer = 0;  // content of the disks, or spheres, around them
      for (Index m = 0; m < all.particles(); ++m)
        outer += D == 2 ? pi * square(outer_radius(all, m)) : 4 * pi / 3 * std::pow(outer_radius(all, m), 3);
      const Real width = p.container->inflow_width();
      top_ = std::max(top_, outer / (*p.pack_fraction * (D == 2 ? width : square(width / 2))));
    }
    if (!p.container->plain())
      top_ = std::max(
          top_, p.container->fill_height(D, std::accumulate(all.a0.begin(), all.a0.end(), 0.0) / *p.pack_fraction));
    if (p.start.given()) top_ = std::max(top_, p.start.particles().height);
    steps_ = hopper_steps<D>(p, all, particles().field());
    critical_step_ = steps_.critical;
    if (p.q_rtol > 0) precision_.emplace(p.q_rtol);
  }

  // --- Before the run

  std::string title() const override {
    return fmt::format("hopper: {} particles ({}, {}D{}), W = {}, w = {}, {}, {}", p_.particles, p_.model.name, D,
                       vertices_text(), p_.hopper.wall_distance, p_.hopper.orifice, shape_text(),
                       p_.flow == FlowKind::continuous ? "continuous flow" : "discharge");
  }
  std::string model() const override { return p_.model.name; }
  Real last_time() const override { return *p_.t_end; }
  Real first_dt() const override {
    if (p_.dt || p_.integrator == IntegratorKind::verlet) return steps_.dt;
    return standard_step(TsIntegrator({.implicit = p_.implicit}, MPI_COMM_SELF), steps_.motions, steps_.dt);
  }
  Real critical_step() const override { return critical_step_; }
  std::optional<Real> fixed_skin() const override { return p_.skin; }

  std::unique_ptr<Integrator> make_integrator(Real dt) override {
    std::unique_ptr<Integrator> integrator;
    if (p_.integrator == IntegratorKind::verlet) {
      integrator = std::make_unique<FixedStepVerlet>(dt);
    } else {
      auto ts = std::make_unique<TsIntegrator>(TsOptions{.dt = dt,
                                                         .longest_dt = longest_dt(),
                                                         .implicit = p_.implicit,
                                                         .jacobian = p_.jacobian,
                                                         .admissible = admissible()},
                                               ranks().comm());
      if (ts->needs_jacobian()) particles().check_derivatives();  // before there is a folder
      integrator = std::move(ts);
    }
    // Of an implicit method, or one whose error is controlled where no step is stable, the time scale of Verlet
    // remains.
    const Real stable = longest_stable_step(*integrator, steps_.motions);
    if (integrator->explicit_fixed_step() || (std::isfinite(stable) && stable > 0)) critical_step_ = stable;
    if constexpr (D == 2)
      if (p_.has_barrier())
        outlines_ = integrator->explicit_fixed_step()
                        ? CrossingWatch(steps_.least_distances(integrator->next_dt()), integrator->next_dt())
                        : CrossingWatch({.walls = p_.model.term(LipContact{}).with_edges ? 0.0 : -1.0}, 0);
    outlines_.set_self_crossing(self_crossing_watch());
    return integrator;
  }

  RunGeometry geometry() const override {
    RunGeometry g;
    g.kind = D == 2 ? "hopper2d" : "hopper3d";
    g.attributes = {{"W", p_.hopper.wall_distance}, {"w", p_.hopper.orifice}};
    if (p_.outline.empty()) {
      g.attributes["angle"] = p_.hopper.angle;
      if (p_.left_angle) g.attributes["left_angle"] = *p_.left_angle;
    }
    for (const WallSegment& wall : particles().walls().segments()) {
      // Walls without end are drawn up to the same height.
      const Vec<2> end = std::isfinite(wall.length)
                             ? wall.end()
                             : Vec<2>(wall.origin[0], p_.container->upright_from() + 2 * p_.container->inflow_width());
      g.segments.insert(g.segments.end(), {wall.origin[0], wall.origin[1], end[0], end[1]});
      g.radius.push_back(wall.radius);
    }
    return g;
  }

  /// None without inertia: explicit steps at the limit of stability leave velocities, and so the heat, noisy.
  EnergyAudit<D>* audit() override { return p_.dynamics == Dynamics::inertial ? &audit_ : nullptr; }
  void write_axes(RunWriter& writer) const override { writer.write_axis("profile_height", profile_heights()); }
  std::string unread_options_advice() const override {
    return p_.integrator == IntegratorKind::verlet ? "-integrator verlet does not read it; add -integrator ts" : "";
  }
  void check() const override {
    const Integrator& integrator = this->simulation().integrator();
    const Real dt = integrator.next_dt();
    if (p_.integrator == IntegratorKind::verlet && !((*p_.t_end - state().t) / dt < FixedStepVerlet::most_steps))
      throw InputError("-t_end {:g}: the run would have too many steps of dt = {:.3g} t0; give an earlier end",
                       *p_.t_end, dt);
    check_fit(this->simulation().all(), *p_.container);
    if (p_.start.fresh()) check_start(dt);
    const Topology& all = this->simulation().all();
    const Real longest = deformable() ? *std::max_element(all.l0.begin(), all.l0.end()) : 0;
    for (const WallSegment& wall : particles().walls().segments())
      if (wall.radius > 0 && wall.radius < longest)
        throw InputError(
            "-obstacle disk:{:g},{:g},{:g} is so small that it enters edges, which are {:.3g} sigma_avg long and touch "
            "disks at their ends only; use a polygon",
            wall.origin[0], wall.origin[1], wall.radius, longest);
  }

  /// Every rank packs all particles, which takes no longer than one rank would.
  std::vector<Real> start() override {
    const Topology& all = this->simulation().all();
    std::vector<Real> x(static_cast<std::size_t>(all.points()) * D);
    if (ranks().root() && !p_.container->plain()) warn_if_blocked();
    if (ranks().root()) p_.warn_of_clog_speed();
    if (p_.start.given()) return p_.start.particles().x;
    const Packing packing = pack<D>(all, *p_.container,
                                    {*p_.pack_fraction, p_.pack_tolerance, static_cast<std::uint64_t>(p_.seed),
                                     p_.model.value(Role::wall_diameter) / 2},
                                    x.data());
    if (ranks().root())
      say("packed to a fraction of {:.3f}, height {:.1f}, in {} iterations of FIRE; largest overlap {:.1e}\n",
          packing.fraction, packing.height, packing.iterations, packing.max_overlap);
    packing_iterations_ = packing.iterations;
    return x;
  }

  nlohmann::ordered_json start_source() const override { return p_.start.source(); }
  void placed() override { counter_.reset(topology().owned()); }
  void started() override {
    p_.start.set_motion(this->simulation());
    p_.start.report_energy(this->simulation(), p_.model.option(Role::contact_energy));
  }

  void repeat(const Series& series) override {
    if (!precision_) return;
    const auto column = [&](const char* name) -> const std::vector<Real>& { return series.at(name).values; };
    const auto &time = column("time"), &crossed = column("crossed_count"), &area = column("crossed_area"),
               &energy = column("kinetic_energy"), &top = column("top_height"), &fraction = column("bulk_fraction");
    judged_ = run().even_samples();
    bool precise = false;  // by the previous run; this run may have a later end
    for (std::size_t i = 0; i < time.size(); ++i)
      if (judged_->take(time[i]))
        precise = precision_->add({time[i], crossed[i], area[i], energy[i], top[i], fraction[i]});
    if (precise) run().end("done", "q_rtol");
  }

  void ready() override {
    watch([&](ParticleSystem<2>& system) { outlines_.start(system, state()); });
    passing_.record_overlaps();
    passing_.ignore_walls();
    passing_.allow_overlaps(deformable());  // polygons and surfaces have other checks
    passing_.have_inertia(p_.dynamics == Dynamics::inertial);
    passing_.start(particles(), state());
    counter_.start(state(), topology());
  }

  void judge_end() override {
    last_sample_ = take_sample<D>(particles(), state(), *p_.container, counter_.flow(), run().last_dt());
    end_without_flow();
  }

  // --- During the run

  bool follow() override {
    watch([&](ParticleSystem<2>& system) { outlines_.after_step(system, state()); });
    this->simulation().find_velocities();
    passing_.after_step(particles(), state());
    pair_overlap_ = std::max(pair_overlap_, passing_.take_overlap());
    const bool changed = follow_particles();
    if (changed) watch([&](ParticleSystem<2>& system) { outlines_.after_change(system, state()); });
    return changed;
  }

  void sorted(const Migration& migration) override {
    counter_.move(migration);
    passing_.start(particles(), state());
    watch([&](ParticleSystem<2>& system) { outlines_.after_change(system, state()); });
  }

  /// Crossings of all ranks since the last call become events.
  void record_events() override {
    std::vector<OrificeCrossing<D>> all = ranks().all_gather(counter_.take_crossings());
    std::sort(all.begin(), all.end(), [](const OrificeCrossing<D>& a, const OrificeCrossing<D>& b) {
      return std::pair(a.at.t, a.id) < std::pair(b.at.t, b.id);
    });
    for (const OrificeCrossing<D>& c : all)
      run().add_event(
          {{"time", c.at.t}, {"particle", static_cast<Real>(c.id)}, {"position", c.at.x}, {"velocity", c.at.v}});
  }

  std::vector<SeriesValue> sample() override {
    const State& s = state();
    last_sample_ = take_sample<D>(particles(), s, *p_.container, counter_.flow(), run().last_dt());
    check_particles();
    if constexpr (D == 3)
      if (deformable()) check_shapes();
    if (audit() != nullptr) add_budget(last_sample_.row, audit_, this->simulation());
    count_self_crossings();
    warn_of_short_edges();
    const FlowCount& crossed = last_sample_.crossed;
    end_without_flow();
    if (!judged_) judged_ = run().even_samples();
    const bool precise =
        precision_ && judged_->take(s.t) &&
        precision_->add({s.t, static_cast<Real>(crossed.crossed), crossed.area, last_sample_.kinetic_energy,
                         last_sample_.top_height, last_sample_.bulk_fraction});
    if (ranks().broadcast(precise)) run().end("done", "q_rtol");  // only the root has the samples before a restart
    return last_sample_.row;
  }

  const std::vector<Index>* reinsertions() const override {
    return p_.flow == FlowKind::continuous ? &counter_.reinsertions() : nullptr;
  }

  std::string progress() const override {
    std::string line =
        fmt::format("max overlap {:.3f}  crossed {}", last_sample_.max_overlap, last_sample_.crossed.crossed);
    if (precision_)
      line += fmt::format("  error of Q {} of {:g} %", percent(precision_->relative_error()), 100 * p_.q_rtol);
    return line;
  }

  void visit(Archive& a) override {
    if (a.reads()) a.particles().particles("active", p_.flow == FlowKind::continuous ? 1 : 0, 1);
    const std::int64_t crossed = counter_.visit(a, ranks(), largest_a0_);
    ClogDetector::State clog = clog_.state();
    Real quiet_since = std::isnan(clog.quiet_since) ? -1 : clog.quiet_since, limit = *p_.clog_speed;
    a.number("quiet_since", quiet_since, -1, a.t());
    a.number("crossed_before_quiet", clog.crossed, -1, crossed);
    a.newer("clog_speed", limit);
    a.newer("wall_overlap", wall_overlap_, 0);
    a.newer("pair_overlap", pair_overlap_, 0);
    a.number("packing_iterations", packing_iterations_);
    p_.start.visit(a);
    if (!a.reads()) return;
    // With another limit of speeds the quiet time may have begun later: restart it.
    const bool quiet = quiet_since >= 0 && limit == *p_.clog_speed;
    clog_.restore({quiet ? quiet_since : NAN, clog.crossed});
  }

  std::string failure_details() const override {
    std::string details;
    if (last_sample_.first >= 0)
      details = fmt::format(", largest overlap {:.3f} between particles {} and {}", last_sample_.max_overlap,
                            last_sample_.first, last_sample_.second);
    if (const Real edge = last_sample_.shortest_edge; edge < 0.5)
      details += fmt::format(", shortest edge {:.2g} l0: {}", edge,
                             steps_.bending_rate > 0
                                 ? "bending is stiffer there, so use " + longer_edges()
                                 : fmt::format("a larger {} keeps edges longer", p_.model.option(Role::perimeter)));
    return details;
  }

  // --- After the run

  void conclude(nlohmann::ordered_json& s) override {
    s["crossed_count"] = ranks().sum(counter_.flow().crossed);
    s["packing_iterations"] = packing_iterations_;
  }

  void report(const Series& series, nlohmann::ordered_json& s) override {
    const HopperEnd end{.options = p_,
                        .status = s["status"],
                        .ended_by = s.value("ended_by", ""),
                        .t = state().t,
                        .quiet_since = clog_.state().quiet_since,
                        .in_hopper = last_sample_.in_hopper,
                        .max_speed = last_sample_.max_speed,
                        .wall_overlap = wall_overlap_,
                        .pair_overlap = pair_overlap_,
                        .restart_command = run().restart_command()};
    report_hopper(end, series, evaluate_series(even_rows(series, run().even_samples()), p_, mean_size_), s);
  }

 private:
  using Protocol<D>::particles;
  using Protocol<D>::ranks;
  using Protocol<D>::run;
  using Protocol<D>::state;
  using Protocol<D>::topology;

  /// In this interval no point falls farther than a quarter of the narrowest particle, from any initial height.
  Real longest_dt() const { return narrowest_ / 4 / std::sqrt(2 * top_); }

  /// A barrier has no meaning inside an outline or beyond a wall.
  std::function<bool(const Real*)> admissible() {
    if constexpr (D == 2)
      if (p_.has_barrier()) return [this](const Real* x) { return outlines_.admits(particles(), x); };
    return {};
  }

  void end_without_flow() {
    const std::int64_t crossed = last_sample_.crossed.crossed;
    // Particles that have left a continuous flow will fall into it again.
    const Real speed = p_.flow == FlowKind::continuous ? last_sample_.fastest : last_sample_.max_speed;
    if (clog_.update(state().t, crossed, last_sample_.in_hopper, speed))
      run().end(arch_over_orifice<D>(particles(), state(), *p_.container) ? "clogged" : "at_rest");
    if (p_.flow == FlowKind::discharge && last_sample_.in_hopper == 0) run().end("empty");
  }
  /// Counts particles at the orifice line; reinserts those that leave, or removes them in a discharge. Errors:
  /// NumericalError for a particle that has crossed the line outside the orifice.
  bool follow_particles() {
    const auto event = counter_.follow(state(), particles(), *p_.container, ranks().rank());
    const auto& astray = event.astray;
    enum { none_leave, some_leave, one_astray };
    const int worst = ranks().max(astray ? one_astray : !event.leaving.empty() ? some_leave : none_leave);
    if (worst == none_leave) return false;
    if (worst == one_astray)
      ranks().together([&] {
        if (astray) throw through_wall(astray->id, astray->at.x, "crossed the orifice line outside the orifice");
      });
    const LogScope log(LogEvent::reinsert);
    std::vector<Leaving> leaving = ranks().all_gather(event.leaving);
    std::sort(leaving.begin(), leaving.end(), [](const Leaving& a, const Leaving& b) { return a.id < b.id; });
    std::vector<Index> ids;
    for (const Leaving& l : leaving) ids.push_back(l.id);
    audit_.outside(ids, [&] { remove(leaving); });
    return true;
  }

  /// Reinserts particles that have left; in a discharge deactivates them.
  void remove(const std::vector<Leaving>& leaving) {
    const Topology& own = topology();
    State& s = state();
    for (const Leaving& l : leaving) {
      const bool mine = l.rank == ranks().rank();
      if (p_.flow == FlowKind::continuous) {
        reinsert<D>(ranks(), own, *p_.container, particles().walls(), p_.model.particles() == ModelKind::smooth,
                    static_cast<std::uint64_t>(p_.seed), l, s, p_.reinsertion);
        particles().history().forget(l.id);
        if (!mine) continue;
        stop_spin(l.particle);
        this->simulation().relist(l.particle);
        counter_.reinserted(l.particle, s, own);
        passing_.reinserted(l.particle, s);
      } else if (mine) {
        for (Index i = own.offset[l.particle]; i < own.offset[l.particle + 1]; ++i) point<D>(s.v().data(), i).setZero();
        stop_spin(l.particle);
        particles().deactivate(l.particle);
      }
    }
  }

  /// Of own particle m, if it has any.
  void stop_spin(Index m) {
    const std::span<Real> spins = this->simulation().spins();
    if (!spins.empty()) std::ranges::fill(spins.subspan(static_cast<std::size_t>(m) * rotations<D>, rotations<D>), 0.0);
  }

  Passage<D> passage() const { return {state().x().data(), topology(), *p_.container, particles().walls()}; }

  NumericalError through_wall(Index id, const std::array<Real, D>& at, std::string_view how) const {
    const bool enters = D == 2 && deformable() && !p_.model.term(LipContact{}).with_edges;
    return NumericalError(
        "particle {} has {}, at ({:.3f}): it went through a wall; {}{} or {}", id, how, fmt::join(at, ", "),
        enters ? fmt::format("use {} edge, as lips enter edges without, ", p_.model.option(Role::lip_rule)) : "",
        stiffen_walls(), shorten());
  }

  /// Stops the run at faults after which no later number could be trusted.
  void check_particles() {
    const State& s = state();
    const Topology& own = topology();
    const Passage<D> places = passage();
    ranks().together([&] {
      for (Index m = 0; m < own.owned(); ++m) {
        const Vec<D> r = mean_of_points<D>(s.x().data(), own, m), v = mean_of_points<D>(s.v().data(), own, m);
        if (!r.allFinite() || !v.allFinite())
          throw NumericalError("particle {} has a position or velocity that is not finite", own.id[m]);
        if (own.active[m] && places.through_wall(m, counter_.outside(m)))
          throw through_wall(own.id[m], counter_.sight(s, own, m).x, "left the hopper");
        if (const Real roof = 10 * (top_ + p_.container->upright_from() + largest_); r[D - 1] > roof)
          throw NumericalError(
              "particle {} was thrown to a height of {:.3g} sigma_avg, beyond {:.3g}, ten times that of the start: {}",
              own.id[m], r[D - 1], roof, why_thrown());
      }
    });
    const Real deepest = check_walls_hold(this->simulation().view(), this->step_taken(), ranks(),
                                          fmt::format("{} or {}", stiffen_walls(), shorten()));
    wall_overlap_ = std::max(wall_overlap_, deepest);
  }

  /// Stops the run at surfaces that pierce each other, and at shapes without meaning.
  void check_shapes() requires(D == 3) {
    self_crossings_ = check_surfaces(
        this->simulation().view(), ranks(),
        {.contacts =
             fmt::format("stiffen the contacts ({}, now {:g}){}", p_.model.option(Role::contact_energy),
                         p_.model.value(Role::contact_energy),
                         p_.model.choice(Role::edge_contacts) == "literal"
                             ? fmt::format(", let vertices touch faces ({} edge)", p_.model.option(Role::edge_contacts))
                             : ""),
         .shape =
             fmt::format("raise {}, or {}", p_.model.options({Role::area, Role::perimeter, Role::bending}), shorten()),
         .self_crossing = "; -self_crossing count continues the run, but volumes of such particles are wrong",
         .self_crossing_stops = p_.self_crossing == OnSelfCrossing::stop});
  }

  SelfCrossingWatch self_crossing_watch() const {
    const ModelChoice& model = p_.model;
    const auto switches = model.parameters(Role::self_contact);
    const bool touches_itself = !switches.empty() && switches[0]->flag;
    const std::string cure =
        touches_itself ? fmt::format("raise {}, or shorten the step (-dt)",
                                     model.options({Role::contact_energy, Role::perimeter, Role::bending}))
        : switches.empty()
            ? "shorten the step (-dt)"
            : fmt::format("add {}, which keeps outlines from crossing themselves, or raise {}",
                          model.option(Role::self_contact), model.options({Role::perimeter, Role::bending}));
    return {.stops = p_.self_crossing == OnSelfCrossing::stop,
            .refuses_trials = touches_itself && p_.has_barrier(),
            .cure = cure + "; -self_crossing count continues the run, but areas of such particles are wrong"};
  }

  /// A column of the sample, where such particles do not end the run.
  void count_self_crossings() {
    if (!deformable() || p_.self_crossing == OnSelfCrossing::stop) return;
    if constexpr (D == 2) self_crossings_ = look_at_own_outlines(this->simulation().view()).count;
    last_sample_.row.emplace_back(self_crossing_column,
                                  static_cast<Real>(ranks().sum(static_cast<std::int64_t>(self_crossings_))));
  }

  /// visit(system) where there are outlines that can be crossed.
  template <class Visit>
  void watch(Visit&& visit) {
    if constexpr (D == 2)
      if (deformable()) visit(particles());
  }

  /// Where energy comes from: the step, or reinsertion, which lifts particles as fast as they leave.
  std::string why_thrown() const {
    const std::string step = fmt::format("unstable step: {}", shorten());
    if (p_.flow == FlowKind::discharge) return step;
    const std::string flow = fmt::format(
        "gravity puts more energy into the flow than friction and drag take: raise {}, or narrow the orifice "
        "(-hopper_width)",
        p_.model.options({Role::friction, Role::kinetic_friction, Role::drag}));
    const Integrator& integrator = this->simulation().integrator();
    if (!integrator.explicit_fixed_step()) return fmt::format("{}; or {}", flow, step);
    const bool long_step = integrator.next_dt() > CriticalStep::safe_part * critical_step_;
    return fmt::format("most likely, as dt/dt_critical is {} {:g}, {}; else {}", long_step ? "above" : "not above",
                       CriticalStep::safe_part, long_step ? step : flow, long_step ? flow : step);
  }

  std::string stiffen_walls() const {
    return fmt::format("stiffen the walls ({}, now {:g})", p_.model.option(Role::wall_energy),
                       p_.model.value(Role::wall_energy));
  }

  /// Cures for shrunken edges.
  std::string longer_edges() const {
    return fmt::format("a smaller -dt, a larger {} or {} full", p_.model.option(Role::perimeter),
                       p_.model.option(Role::bending_form));
  }

  /// Cure for too long a step.
  std::string shorten() const {
    const Integrator& integrator = this->simulation().integrator();
    return integrator.explicit_fixed_step() ? fmt::format("shorten the step (-dt, now {:.3g})", integrator.next_dt())
                                            : "lower the tolerances (-ts_rtol, -ts_atol) or the step (-dt)";
  }

  // --- Texts

  /// Errors: InputError for particles of -start that are not in the container, inside each other, or too fast.
  void check_start(Real dt) const {
    const StartParticles& start = p_.start.particles();
    const Topology& all = start.topology;
    const Passage<D> places{start.x.data(), all, *p_.container, particles().walls()};
    p_.start.template check<D>(dt, [&](Index m) -> std::optional<std::string> {
      if (places.through_wall(m)) return "is outside the container or in a wall; move it";
      if (mean_of_points<D>(start.x.data(), all, m)[D - 1] < -counter_.depth())
        return fmt::format("is more than -removal_depth {:.3g} below the orifice; move it, or leave it out",
                           counter_.depth());
      return {};
    });
    const Real mean = std::accumulate(all.sigma.begin(), all.sigma.end(), 0.0) / all.particles();
    if (ranks().root() && (mean < 0.5 || mean > 2))
      warn("-start {}: the mean diameter is {:.3g}, but lengths of a run are in mean diameters; scale the file",
           printable(p_.start.file()), mean);
  }

  /// For an outline or obstacles that leave no way.
  void warn_if_blocked() const {
    const Topology& all = this->simulation().all();
    Real widest = 0;
    for (Index m = 0; m < all.particles(); ++m) widest = std::max(widest, 2 * outer_radius(all, m));
    if (!p_.container->template lets_pass<D>(widest / 2))
      warn(
          "the largest particle, {:.3g} sigma_avg wide, has no path from the upper end to the orifice; widen the gaps "
          "between walls (-outline, -hopper_width) and obstacles (-obstacle)",
          widest);
  }

  /// Once, for a fixed step that is too long for the bending of edges that have shrunk.
  void warn_of_short_edges() {
    if (short_edges_seen_ || p_.dynamics == Dynamics::overdamped ||
        !this->simulation().integrator().explicit_fixed_step())
      return;
    const Real edge = last_sample_.shortest_edge, dt = run().last_dt(), ratio = dt * steps_.bending_rate / (2 * edge);
    if (!(ratio > 1)) return;
    short_edges_seen_ = true;
    if (ranks().root())
      warn(
          "t = {:.4g}: edges have shrunk to {:.2g} of their rest length, where -dt {:.3g} is {:.2g} times the limit of "
          "stability of bending; use {}",
          state().t, edge, dt, ratio, longer_edges());
  }

  std::string vertices_text() const {
    if (!deformable()) return "";
    const Topology& all = this->simulation().all();
    return all.points() == all.particles() * all.points_of(0) ? fmt::format(", {} vertices each", all.points_of(0))
                                                              : fmt::format(", {} vertices", all.points());
  }

  std::string shape_text() const {
    std::string text = p_.outline.empty() ? fmt::format("angle {}", p_.hopper.angle) : "user-defined outline";
    if (p_.left_angle) text += fmt::format(", left {}", *p_.left_angle);
    if (!p_.obstacle.empty()) text += ", with obstacles";
    return text;
  }

  bool deformable() const { return p_.deformable(); }

  const HopperOptions& p_;
  ClogDetector clog_;
  Real largest_;  ///< diameter
  OrificeCounter<D> counter_;
  EnergyAudit<D> audit_{this->simulation()};
  std::optional<FlowPrecision> precision_;
  std::optional<EvenSamples> judged_;  ///< by it

  // State for checkpoints.
  std::int64_t packing_iterations_ = 0;
  Real wall_overlap_ = 0;  ///< largest of a point with a wall up to now, over its radius
  PassageWatch<D> passing_;
  Real pair_overlap_ = 0;  ///< largest overlap up to now of particles that pass through each other, else 0

  Real mean_size_ = 0;                   ///< a0
  Real narrowest_ = 0, largest_a0_ = 0;  ///< diameter of a point; a0
  Real top_ = 0;                         ///< upper bound of the height of the filling of a flat hopper at the start
  HopperSteps steps_;
  Real critical_step_ = 0;  ///< stability limit of the integrator
  CrossingWatch outlines_;
  Index self_crossings_ = 0;  ///< own particles that crossed themselves at the last check
  Sample<D> last_sample_;
  bool short_edges_seen_ = false;  ///< has warned of them
};

RunSize size_of(const HopperOptions& p) {
  const std::int64_t n = p.particles;
  if (p.start.given()) return {n, p.start.particles().topology.points(), p.dim};
  return {n, p.deformable() ? n * p.shape.vertices : n, p.dim};
}

/// Checks, before the particles are created, that the container holds them.
void check_size(const Checkpoint& c, const HopperOptions& p) {
  const RunSize size = size_of(p);
  c.integer_array("id", static_cast<std::size_t>(size.particles));
  c.real_array("x", static_cast<std::size_t>(size.points) * static_cast<std::size_t>(p.dim));
}

template <int D>
std::unique_ptr<AnyRun> make(const HopperOptions& p, const Options& options, const Ranks& ranks,
                             std::optional<Checkpoint> checkpoint) {
  return std::make_unique<Run<D>>("hopper", p, options, ranks, std::make_unique<HopperProtocol<D>>(p, ranks),
                                  std::move(checkpoint));
}

}  // namespace

Scenario hopper_scenario(const std::vector<ModelDefinition>& models) {
  HopperOptions defaults(models);
  std::vector<std::string> most_used{"model", "dim", "n", "hopper_width", "hopper_wall_distance"};
  for (const Role role : {Role::kinetic_friction, Role::drag})
    most_used.emplace_back(defaults.model.table().with(role)[0]->name);
  most_used.insert(most_used.end(), {"t_end", "seed", "output"});
  Scenario s = option_scenario<HopperOptions>(
      "hopper", "gravity-driven flow through an orifice",
      [](const HopperOptions& p, const Options& options, const Ranks& ranks, std::optional<Checkpoint> checkpoint) {
        check_memory(size_of(p),
                     p.start.given()  ? "-start " + p.start.file()
                     : p.deformable() ? fmt::format("-n {} with -n_vertices {}", p.particles, p.shape.vertices)
                                      : fmt::format("-n {}", p.particles),
                     ranks);
        if (checkpoint)
          check_size(*checkpoint, p);
        else
          p.refuse_unread(options);
        return p.dim == 2 ? make<2>(p, options, ranks, std::move(checkpoint))
                          : make<3>(p, options, ranks, std::move(checkpoint));
      },
      std::move(defaults), std::move(most_used));
  s.units = "Units: σ_avg = g = ρ = 1, t0 = sqrt(σ_avg/g).";
  return s;
}

}  // namespace pliant
