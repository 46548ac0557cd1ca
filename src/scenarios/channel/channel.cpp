#include <pliant/scenarios/channel/channel.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <pliant/base/console.h>
#include <pliant/base/errors.h>
#include <pliant/catalogue/catalogue.h>
#include <pliant/io/summary.h>
#include <pliant/run/crossing_watch.h>
#include <pliant/run/heat.h>
#include <pliant/run/memory.h>
#include <pliant/run/overlap_check.h>
#include <pliant/run/passage_watch.h>
#include <pliant/scenarios/channel/options.h>
#include <pliant/scenarios/channel/start.h>
#include <pliant/ts/verlet.h>

namespace pliant {
namespace {

RunSize size_of(const ChannelOptions& p) {
  RunSize size;
  if (p.start.given()) return {p.start.particles().topology.particles(), p.start.particles().topology.points()};
  for (std::size_t k = 0; k < p.sizes.size(); ++k) {
    size.particles += p.disks[k];
    size.points += std::int64_t{p.disks[k]} * (p.rough() ? p.vertices(p.sizes[k].radius) : 1);
  }
  return size;
}

/// Standard step: contacts are resolved, and their damping is stable (docs/reference/steps.md).
Real standard_step(const CriticalStep& critical) {
  return critical.standard(std::min(0.2 * critical.elastic, 0.5 * critical.damping));
}

std::unique_ptr<Simulation<2>> make_simulation(const ChannelOptions& p, const Ranks& ranks) {
  constexpr Real first_skin = 0.1;
  ParticleSystem<2> particles({}, p.channel->walls(), p.model.force_field(p.surroundings()),
                              p.skin.value_or(first_skin), ranks);
  if (!p.skin) particles.tune_skin();
  return std::make_unique<Simulation<2>>(p.particles(), std::move(particles), Sorting::regularly);
}

class ChannelProtocol final : public Protocol<2> {
 public:
  ChannelProtocol(const ChannelOptions& p, const Ranks& ranks)
      : Protocol<2>(make_simulation(p, ranks)),
        p_(p),
        channel_(*p.channel),
        critical_(particles().field().critical_step(simulation().all())),
        schedule_(p.push, p.dt.value_or(standard_step(critical_))) {
    outlines_.set_self_crossing(
        {.cure = fmt::format("raise {}, which holds its outline, or shorten -dt", p.model.option(Role::rest_shape))});
    const Topology& all = simulation().all();
    for (Index m = 0; m < all.particles(); ++m) weight_ += all.points_of(m) * all.point_mass[m];
    weight_ *= p.gravity();
  }

  // --- Before the run

  std::string title() const override {
    constexpr std::size_t most_listed = 12;
    std::string disks;
    if (p_.sizes.size() > most_listed)
      disks = fmt::format("{} from {:.4g} to {:.4g}", simulation().all().particles(), p_.sizes.back().radius,
                          p_.sizes.front().radius);
    for (std::size_t k = 0; k < p_.sizes.size() && p_.sizes.size() <= most_listed; ++k)
      disks += fmt::format("{}{} of {:.4g}", k > 0 ? ", " : "", p_.disks[k], p_.sizes[k].radius);
    return fmt::format(
        "channel: {} radii in cm: {}; area fraction {:.4f} of {:.4g} cm^2; {} plungers, {:g} cm/s over {:g} "
        "cm; "
        "{} pushes",
        p_.rough() ? "rough polygons that cover the areas of disks with" : "disks with", disks, area_fraction(),
        p_.filled_area(), channel_.plungers().size(), p_.push.speed, p_.push.stroke, p_.pushes);
  }
  std::string model() const override { return p_.model.name; }
  std::string_view unit_of_time() const override { return "s"; }
  Real first_dt() const override { return schedule_.dt(); }
  Real critical_step() const override { return critical_.limit(); }
  std::optional<Real> fixed_skin() const override { return p_.skin; }
  std::unique_ptr<Integrator> make_integrator(Real dt) override { return std::make_unique<FixedStepVerlet>(dt); }

  Real last_time() const override { return static_cast<Real>(last_step()) * schedule_.dt(); }
  std::string end_at_last_time() const override {
    return last_step() < schedule_.end_of_push(p_.pushes - 1) ? "t_end" : "pushes";
  }

  RunGeometry geometry() const override {
    std::map<std::string, Real> attributes{{"stroke", p_.push.stroke}};
    if (p_.outline.empty()) attributes.insert({{"width", p_.size.width}, {"arm", p_.size.arm}});
    return {"channel", drawn_walls(0), attributes};
  }

  void check() const override {
    const Real way = p_.push.speed * schedule_.dt(), radius = smallest_radius();
    if (way > radius)
      throw InputError(
          "-plunger_speed {:g}: the plunger moves by {:.3g} cm in a step of {:.3g} s, more than the smallest radius, "
          "{:g} cm, and would pass through {}s; lower it or -dt",
          p_.push.speed, way, schedule_.dt(), radius, p_.particle());
    if (!p_.start.fresh()) return;
    const StartParticles& start = p_.start.particles();
    p_.start.check<2>(schedule_.dt(), [&](Index m) -> std::optional<std::string> {
      for (Index i = start.topology.offset[m]; i < start.topology.offset[m + 1]; ++i)
        if (!channel_.inside(point<2>(start.x.data(), i))) return "is outside the channel or in a wall; move it";
      return {};
    });
  }
  nlohmann::ordered_json start_source() const override { return p_.start.source(); }

  std::vector<Real> start() override {
    if (p_.start.given()) return p_.start.particles().x;
    const Topology& all = simulation().all();
    const auto seed = static_cast<std::uint64_t>(p_.seed);
    const ChannelStart start =
        p_.rough() ? random_polygon_start(all, p_.outlines, channel_, channel_.walls(), p_.start_overlap, seed)
                   : random_start(all, channel_, channel_.walls(), p_.start_overlap, seed);
    if (ranks().root())
      say("pushed apart in {} iterations of FIRE; largest overlap {:.1e}\n", start.iterations, start.max_overlap);
    return start.x;
  }

  void started() override {
    p_.start.set_motion(simulation());
    put_walls();
  }
  void ready() override {
    passages_.allow_overlaps(p_.rough());  // polygons have other checks
    passages_.record_overlaps();
    passages_.start(particles(), state());
    if (p_.rough()) outlines_.start(particles(), state());
  }

  void judge_end() override {
    if (p_.on_jam == OnJam::end && jammed_in(schedule_.push_at(state().step))) run().end("jammed");
  }

  // --- During the run

  void sorted(const Migration&) override {
    passages_.start(particles(), state());
    if (p_.rough()) outlines_.after_change(particles(), state());
  }

  bool follow() override {
    passages_.after_step(particles(), state());
    pair_overlap_ = std::max(pair_overlap_, passages_.take_overlap());
    if (p_.rough()) outlines_.after_step(particles(), state());
    const std::int64_t step = state().step;
    const bool changes = schedule_.phase_begin(step) == step, stroke_ends = schedule_.phase_at(step) == PushPhase::hold;
    // At the end of a stroke the plunger still pushes; at the beginning of a stroke it has moved back.
    if (changes && stroke_ends) check_walls();  // before a plunger that moves back at once
    const auto put = [&] { audit_.outside([&] { put_walls(); }); };
    if (changes && !stroke_ends) put();
    if (schedule_.frame_at(step)) run().write_frame();
    if (changes && stroke_ends) put();
    if (changes) passages_.start(particles(), state());
    return changes;
  }

  std::map<std::string, Real> frame_attributes() const override {
    const std::int64_t step = state().step;
    if (!schedule_.in_stroke(step)) return {};
    return {{"push", static_cast<Real>(schedule_.push_at(step))}, {"plunger_travel", schedule_.travel_at(step)}};
  }

  std::vector<Real> wall_segments() override { return drawn_walls(state().step); }

  EnergyAudit<2>* audit() override { return &audit_; }

  std::vector<SeriesValue> sample() override {
    check_inside();
    check_walls();
    const StateView<2> s = simulation().view();
    const ForceField<2>& field = particles().field();
    std::array<Real, 6> sums{};  // kinetic and stored energy, momentum, angular momentum, contacts
    for (Index i = 0; i < topology().owned_points(); ++i) {
      const Vec<2> momentum = topology().mass(i) * s.velocity(i), r = s.position(i);
      sums[0] += s.kinetic_energy(i);
      sums[2] += momentum[0];
      sums[3] += momentum[1];
      sums[4] += r[0] * momentum[1] - r[1] * momentum[0];
      if (s.spins != nullptr) sums[4] += topology().inertia[topology().particle[i]] * s.spin(i);
    }
    sums[1] = field.energy(s);
    std::vector<Deepest> deepest{{}};
    const auto overlaps = [&](Real depth, Index first, Index second) {
      if (depth > deepest[0].overlap) deepest[0] = {depth, first, second};
    };
    field.for_each_contact(s, [&](const Contact<2>& c) {
      const auto [first, second] = std::minmax(topology().id[c.first], topology().id[c.second]);
      overlaps(c.overlap * c.reach / std::min(radius(c.first), radius(c.second)), first, second);
      ++sums[5];
    });
    for (const auto& [i, part] : s.neighbours.walls) {
      const Index m = topology().particle[i];
      const Real reach = topology().diameter[i] / 2;
      overlaps((1 - s.walls.distance(s.position(i), part, s.t) / reach) * (reach / radius(m)), topology().id[m], -1);
    }
    ranks().sum(sums);
    deepest_ = {};
    for (const Deepest& d : ranks().all_gather(deepest))
      if (d.overlap > deepest_.overlap) deepest_ = d;
    largest_overlap_ = std::max(largest_overlap_, deepest_.overlap);

    measure_plungers(s);
    notice_jam();
    std::vector<SeriesValue> row{{"time", s.t},
                                 {"dt", run().last_dt()},
                                 {"push", static_cast<Real>(schedule_.push_at(state().step))},
                                 {"plunger_travel", schedule_.travel_at(state().step)},
                                 {"plunger_force", std::span<const Real>(plunger_force_)},
                                 {"max_overlap", deepest_.overlap},
                                 {"contact_pairs", sums[5]},
                                 {"kinetic_energy", sums[0]},
                                 {"elastic_energy", sums[1]},
                                 {"plunger_work", audit_.wall_work()},
                                 {"momentum", std::span<const Real>(sums).subspan(2, 2)},
                                 {"angular_momentum", sums[4]}};
    heat_ = add_heat(row, particles().history(), ranks());
    row.emplace_back("heat", heat_);
    return row;
  }

  std::string progress() const override {
    const std::int64_t step = state().step;
    return fmt::format("push {}/{}, {:.2f} cm  force {}  overlap {:.1e}", schedule_.push_at(step) + 1, p_.pushes,
                       schedule_.travel_at(step), force_text(largest_force()), deepest_.overlap);
  }

  void visit(Archive& a) override {
    p_.start.visit(a);
    std::int64_t push = schedule_.push_at(state().step);
    a.number("push", push, push, push);
    a.array("jammed_pushes", jams_, 0, push);
    a.number("largest_overlap", largest_overlap_, 0);
    a.newer("wall_overlap", wall_overlap_, 0);
    a.newer("pair_overlap", pair_overlap_, 0);
    a.number("largest_plunger_force", largest_plunger_force_, 0);
    if (!a.reads()) return;
    const auto events = static_cast<std::int64_t>(jams_.size());
    a.from().integer("events", events, events);
    put_walls();
  }

  std::string failure_details() const override {
    if (deepest_.first < 0) return {};
    return fmt::format(", largest overlap {:.3f} of a radius between {} {} and {}", deepest_.overlap, p_.particle(),
                       deepest_.first,
                       deepest_.second < 0 ? "a wall" : fmt::format("{} {}", p_.particle(), deepest_.second));
  }

  // --- After the run

  void conclude(nlohmann::ordered_json& s) override {
    s["area_fraction"] = area_fraction();
    nlohmann::ordered_json disks = nlohmann::ordered_json::array();
    for (std::size_t k = 0; k < p_.sizes.size(); ++k)
      disks.push_back({{"radius", p_.sizes[k].radius}, {"count", p_.disks[k]}});
    s["disks"] = disks;
    s["weight"] = quantity(weight_, NAN, "dyn");
    s["pushes"] = (state().step + schedule_.period() - schedule_.steps_of_push()) / schedule_.period();
    s["frame_travel"] = quantity(schedule_.frame_travel(), NAN, "cm");
    s["jammed_pushes"] = jams_;
    s["largest_overlap"] = largest_overlap_;
    s["largest_plunger_force"] = quantity(largest_plunger_force_, NAN, "dyn");
    s["plunger_work"] = quantity(audit_.wall_work(), NAN, "erg");
    s["heat"] = quantity(heat_, NAN, "erg");
  }

  void report(const Series&, nlohmann::ordered_json& s) override {
    say("{} pushes; largest force on a plunger {}, largest overlap {:.2g} of a radius\n", std::int64_t(s["pushes"]),
        force_text(largest_plunger_force_), largest_overlap_);
    if (pair_overlap_ > 0)
      warn(
          "{0}s overlapped by {1:.3g} of their contact distance: they pass through each other; raise -stiffness, now "
          "{2:g}",
          p_.particle(), pair_overlap_, p_.stiffness);
    if (wall_overlap_ > passing_overlap)
      warn("a {} overlapped a wall by {:.3g} radii: it passes through the wall; raise -stiffness, now {:g}",
           p_.particle(), wall_overlap_, p_.stiffness);
    if (!jams_.empty()) say("jammed in push {}\n", fmt::join(jams_, ", "));
  }

 private:
  struct Deepest {
    Real overlap = 0;  ///< over the radius of the smaller one
    Index first = -1, second = -1;
  };

  Real radius(Index m) const { return topology().sigma[m] / 2; }
  Real area_fraction() const { return covered_area(p_.sizes, p_.disks) / p_.filled_area(); }

  Real smallest_radius() const {
    return std::ranges::min_element(p_.sizes, {}, [](const SizeClass& of) { return of.radius; })->radius;
  }

  /// Never between two pushes.
  std::int64_t last_step() const {
    const std::int64_t last = schedule_.end_of_push(p_.pushes - 1);
    if (!p_.t_end || !(*p_.t_end / schedule_.dt() < static_cast<Real>(last))) return last;
    const auto asked = static_cast<std::int64_t>(std::llround(*p_.t_end / schedule_.dt()));
    return schedule_.in_stroke(asked) ? asked : schedule_.end_of_push(schedule_.push_at(asked));
  }

  std::size_t plunger_at(std::int64_t step) const {
    return static_cast<std::size_t>(schedule_.push_at(step)) % channel_.plungers().size();
  }

  /// The walls from this step on.
  void put_walls() {
    const std::int64_t begin = schedule_.phase_begin(state().step);
    const Real speed = schedule_.velocity_at(begin);
    const bool pushes = schedule_.phase_at(begin) == PushPhase::push;
    const std::int64_t strokes = schedule_.push_at(begin) + (pushes ? 0 : 1);  // until then
    simulation().particles().set_walls(
        channel_.walls({.plunger = plunger_at(begin),
                        .travel = schedule_.travel_at(begin),
                        .speed = speed,
                        .shear = pushes ? p_.shear * speed : 0,
                        .sheared = p_.shear * p_.push.stroke * static_cast<Real>(strokes),
                        .since = static_cast<Real>(begin) * schedule_.dt()}));
  }

  std::vector<Real> drawn_walls(std::int64_t step) const {
    return channel_.drawn_walls(plunger_at(step), schedule_.travel_at(step));
  }

  /// Forces on the plungers, against their directions.
  void measure_plungers(const StateView<2>& s) {
    const Index walls = s.walls.size(), plungers = static_cast<Index>(channel_.plungers().size());
    std::vector<Real> force(2 * static_cast<std::size_t>(walls));
    particles().field().add_wall_forces(s, force.data());
    ranks().sum(force);
    plunger_force_.clear();
    for (Index k = 0; k < plungers; ++k)
      plunger_force_.push_back(-point<2>(force.data(), walls - plungers + k).dot(channel_.plungers()[k].direction));
    largest_plunger_force_ = std::max(largest_plunger_force_, largest_force());
  }
  Real largest_force() const {
    return plunger_force_.empty() ? 0 : *std::max_element(plunger_force_.begin(), plunger_force_.end());
  }

  std::string force_text(Real force) const {
    return weight_ > 0 ? fmt::format("{:.3g} of the weight of all disks", force / weight_)
                       : fmt::format("{:.3g} dyn", force);
  }

  bool jammed_in(std::int64_t push) const { return !jams_.empty() && jams_.back() == push; }

  /// Once in each push.
  void notice_jam() {
    const std::int64_t step = state().step, push = schedule_.push_at(step);
    const bool overlaps = deepest_.overlap > p_.jam_overlap,
               presses = p_.jam_force > 0 && largest_force() > p_.jam_force * weight_;
    if ((!overlaps && !presses) || jammed_in(push)) return;
    jams_.push_back(push);
    const Real travel = schedule_.travel_at(step);
    if (ranks().root())
      warn("push {} jams at {:.3f} cm: {}; {}", push, travel,
           overlaps ? fmt::format("{}s overlap by {:.2g} of a radius (-jam_overlap {:g})", p_.particle(),
                                  deepest_.overlap, p_.jam_overlap)
                    : fmt::format("the force on a plunger is {:.3g} times the {}s' weight (-jam_force {:g})",
                                  largest_force() / weight_, p_.particle(), p_.jam_force),
           p_.on_jam == OnJam::end ? "the run ends" : "the run goes on");
    run().add_event({{"time", state().t},
                     {"push", static_cast<Real>(push)},
                     {"plunger_travel", travel},
                     {"plunger_force", largest_force()},
                     {"max_overlap", deepest_.overlap}});
    if (p_.on_jam == OnJam::end) run().end("jammed");
  }

  void check_walls() {
    const Real deepest = check_walls_hold(simulation().view(), schedule_.dt(), ranks(),
                                          "raise -stiffness, or lower -plunger_speed or -area_fraction");
    wall_overlap_ = std::max(wall_overlap_, deepest);
  }

  void check_inside() const {
    Index outside = -1;
    for (Index i = 0; i < topology().owned_points() && outside < 0; ++i)
      if (!channel_.inside(point<2>(state().x().data(), i))) outside = topology().id[topology().particle[i]];
    outside = static_cast<Index>(ranks().max(Real(outside)));
    if (outside >= 0)
      throw NumericalError("{} {} has left the channel: shorten -dt, or raise -stiffness if overlaps are large",
                           p_.particle(), outside);
  }

  const ChannelOptions& p_;
  const Channel& channel_;
  CriticalStep critical_;
  PushSchedule schedule_;
  Real weight_ = 0;         ///< weight of all particles
  CrossingWatch outlines_;  ///< for polygons
  PassageWatch<2> passages_;
  Deepest deepest_;                  ///< in the last sample
  std::vector<Real> plunger_force_;  ///< in the last sample
  std::vector<std::int64_t> jams_;   ///< pushes
  Real largest_overlap_ = 0, largest_plunger_force_ = 0;
  Real wall_overlap_ = 0;  ///< largest of a disk or vertex with a wall, over its radius
  Real pair_overlap_ = 0;  ///< largest overlap up to now of disks that pass through each other, else 0
  EnergyAudit<2> audit_{simulation()};
  Real heat_ = 0;  ///< at the last sample
};

}  // namespace

Scenario channel_scenario() {
  Scenario s = option_scenario<ChannelOptions>(
      "channel", "frictional disks pushed through a bent channel by plungers",
      [](const ChannelOptions& p, const Options& options, const Ranks& ranks, std::optional<Checkpoint> checkpoint) {
        check_memory(size_of(p),
                     p.start.given() ? "-start " + p.start.file()
                     : p.rough() ? fmt::format("-area_fraction {:g} with -n_vertices {}", p.area_fraction, p.n_vertices)
                                 : fmt::format("-area_fraction {:g} of these disks", p.area_fraction),
                     ranks);
        if (!checkpoint) p.refuse_unread(options);
        return std::make_unique<Run<2>>("channel", p, options, ranks, std::make_unique<ChannelProtocol>(p, ranks),
                                        std::move(checkpoint));
      },
      {},
      {"model", "geometry", "channel_width", "channel_arm", "distribution", "area_fraction", "stiffness", "pushes",
       "seed", "output"});
  s.units = "Units: cm, g, s; forces in dyn = g cm/s².";
  return s;
}

}  // namespace pliant
