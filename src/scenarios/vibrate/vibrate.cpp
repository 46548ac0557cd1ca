#include <pliant/scenarios/vibrate/vibrate.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <set>

#include <pliant/analysis/block_average.h>
#include <pliant/analysis/steady_state.h>
#include <pliant/base/console.h>
#include <pliant/base/errors.h>
#include <pliant/geometry/container.h>
#include <pliant/io/summary.h>
#include <pliant/model/crossing.h>
#include <pliant/run/crossing_watch.h>
#include <pliant/run/heat.h>
#include <pliant/run/memory.h>
#include <pliant/run/overlap_check.h>
#include <pliant/run/passage_watch.h>
#include <pliant/run/step_check.h>
#include <pliant/scenarios/particles/motions.h>
#include <pliant/scenarios/particles/options.h>
#include <pliant/scenarios/vibrate/options.h>
#include <pliant/setup/packing.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

namespace pliant {
namespace {

template <int D>
Vec<D> along(ShakeDirection direction) {
  Vec<D> unit = Vec<D>::Zero();
  unit[direction == ShakeDirection::vertical ? D - 1 : 0] = 1;
  return unit;
}

/// Floor, side walls and lid in the frame of the container: the floor is at height 0.
WallParts wall_parts(const VibrateOptions& p, int dim) {
  const Real right = p.width / 2, left = dim == 2 ? -right : 0;
  WallParts walls;
  walls.segments.push_back(WallSegment::between({left, 0}, {right, 0}));
  const auto side = [&](Real x) {
    walls.joints.push_back({{x, 0}, walls.next(), 0, false});
    walls.segments.push_back(p.lid ? WallSegment::between({x, 0}, {x, *p.lid}) : WallSegment::ray({x, 0}, {0, 1}));
  };
  side(right);
  if (dim == 2) side(left);
  if (!p.lid) return walls;
  const Index lid = walls.next();
  walls.segments.push_back(WallSegment::between({left, *p.lid}, {right, *p.lid}));
  for (Index s = 1; s < lid; ++s) walls.joints.push_back({walls.segments[s].end(), lid, s, false});
  return walls;
}

/// Displacement A (1 − cos ωt), so that the container starts at rest.
template <int D>
Motion<D> motion_of(const VibrateOptions& p) {
  return {.amplitude = p.amplitude * along<D>(p.direction), .frequency = p.angular_frequency(), .phase = -pi / 2};
}

template <int D>
std::unique_ptr<Simulation<D>> make_simulation(const VibrateOptions& p, const Ranks& ranks) {
  Walls<D> walls;
  walls.add(wall_parts(p, D), motion_of<D>(p));
  Vec<D> gravity = Vec<D>::Zero();
  gravity[D - 1] = -1;
  ParticleSystem<D> particles({}, std::move(walls), p.model.force_field<D>({.gravity = gravity}),
                              p.skin.value_or(usual_skin(p.model.particles(), D)), ranks);
  if (!p.skin) particles.tune_skin();
  Topology all = start_topology(p.start, p.model, D, p.sizes, p.particles, p.seed, p.shape);
  const Sorting sorting = p.integrator == VibrateIntegrator::verlet ? Sorting::regularly : Sorting::at_start;
  return std::make_unique<Simulation<D>>(std::move(all), std::move(particles), sorting);
}

template <int D>
class VibrateProtocol final : public Protocol<D> {
 public:
  VibrateProtocol(const VibrateOptions& p, const Ranks& communicator)
      : Protocol<D>(make_simulation<D>(p, communicator)),
        p_(p),
        motion_(motion_of<D>(p)),
        critical_(particles().field().critical_step(this->simulation().all())) {
    const Topology& all = this->simulation().all();
    for (Index m = 0; m < all.particles(); ++m) mass_ += all.points_of(m) * all.point_mass[m];
    outlines_.set_self_crossing(
        {.cure = fmt::format("raise {}, or shorten the step (-dt)",
                             p.model.options({Role::perimeter, Role::bending, Role::contact_energy}))});
  }

  // --- Before the run

  std::string title() const override {
    return fmt::format(
        "vibrate: {} particles ({}, {}D) in a container of width {:g}, {} vibration with amplitude {:g} and frequency "
        "{:g}, acceleration {:.3g} g",
        p_.particles, p_.model.name, D, p_.width, p_.direction == ShakeDirection::vertical ? "vertical" : "horizontal",
        p_.amplitude, p_.frequency, p_.acceleration());
  }
  std::string model() const override { return p_.model.name; }
  Real last_time() const override { return static_cast<Real>(p_.cycles) / p_.frequency; }
  std::string end_at_last_time() const override { return "cycles"; }
  /// An integer fraction of the time between samples, so that these are at the same phases of all cycles.
  Real first_dt() const override {
    Real longest = p_.dt.value_or(critical_.standard(std::min(0.05 * critical_.elastic, 0.25 * critical_.damping)));
    if (!p_.dt && p_.integrator != VibrateIntegrator::verlet)
      longest = standard_step(TsIntegrator({}, MPI_COMM_SELF), motions(), longest);
    return p_.sample_interval / std::ceil(p_.sample_interval / longest * (1 - 1e-12));
  }
  Real critical_step() const override { return critical_step_; }
  std::vector<FastestRates> motions() const {
    return motions_of(critical_, p_.model, particles().field(), this->simulation().all());
  }
  std::optional<Real> fixed_skin() const override { return p_.skin; }
  std::unique_ptr<Integrator> make_integrator(Real dt) override {
    std::unique_ptr<Integrator> integrator;
    if (p_.integrator == VibrateIntegrator::verlet) {
      integrator = std::make_unique<FixedStepVerlet>(dt);
    } else {
      auto ts = std::make_unique<TsIntegrator>(TsOptions{.dt = dt, .longest_dt = p_.sample_interval}, ranks().comm());
      if (const Real longest = ts->longest_controlled_step();
          std::isfinite(longest) && above(longest, p_.sample_interval))
        throw InputError(
            "-ts_adapt_dt_max {:g} is longer than the time between samples, {:.4g} t0: cycles would have different "
            "numbers of samples; lower it or -samples_per_cycle, or leave it out",
            longest, p_.sample_interval);
      if (ts->needs_jacobian()) particles().check_derivatives();  // before there is a folder
      integrator = std::move(ts);
    }
    critical_step_ = longest_stable_step(*integrator, motions());
    return integrator;
  }
  RunGeometry geometry() const override {
    RunGeometry g{"box", drawn_walls(0), {{"W", p_.width}}};
    if (p_.lid) g.attributes["lid"] = *p_.lid;
    return g;
  }

  void check() const override {
    const Real dt = this->simulation().integrator().next_dt();
    if (p_.integrator == VibrateIntegrator::verlet && !((last_time() - state().t) / dt < FixedStepVerlet::most_steps))
      throw InputError("-cycles {}: the run would have too many steps of dt = {:.3g} t0; give fewer", p_.cycles, dt);
    const Topology& all = this->simulation().all();
    check_fit(all, packing_container());
    if (!p_.start.given()) check_lid(filled_height() / *p_.pack_fraction);
    if (!p_.start.fresh()) return;
    const StartParticles& start = p_.start.particles();
    p_.start.template check<D>(dt, [&](Index m) -> std::optional<std::string> {
      if constexpr (D == 2)
        if (deformable() && outline_meets(start.x.data(), all, m, particles().walls(), 0))
          return "meets a wall of the container; move it";
      if (!inside(mean_of_points<D>(start.x.data(), all, m))) return "is outside the container; move it";
      return {};
    });
  }
  nlohmann::ordered_json start_source() const override { return p_.start.source(); }

  std::vector<Real> start() override {
    if (p_.start.given()) return p_.start.particles().x;
    const Topology& all = this->simulation().all();
    std::vector<Real> x(static_cast<std::size_t>(all.points()) * D);
    const Packing packing = pack<D>(all, packing_container(),
                                    {*p_.pack_fraction, p_.pack_tolerance, static_cast<std::uint64_t>(p_.seed),
                                     p_.model.value(Role::wall_diameter) / 2},
                                    x.data());
    check_lid(packing.height);
    if (ranks().root())
      say("packed to a fraction of {:.3f}, height {:.1f}, in {} iterations of FIRE; largest overlap {:.1e}\n",
          packing.fraction, packing.height, packing.iterations, packing.max_overlap);
    return x;
  }
  void started() override {
    p_.start.set_motion(this->simulation());
    p_.start.report_energy(this->simulation(), p_.model.option(Role::contact_energy));
  }
  void ready() override {
    passages_.start(particles(), state());
    watch([&](ParticleSystem<2>& system) { outlines_.start(system, state()); });
  }

  // --- During the run

  void sorted(const Migration&) override {
    passages_.start(particles(), state());
    watch([&](ParticleSystem<2>& system) { outlines_.after_change(system, state()); });
  }
  bool follow() override {
    passages_.after_step(particles(), state());
    watch([&](ParticleSystem<2>& system) { outlines_.after_step(system, state()); });
    return false;
  }
  std::vector<Real> wall_segments() override { return drawn_walls(state().t); }
  EnergyAudit<D>* audit() override { return &audit_; }

  std::vector<SeriesValue> sample() override {
    const StateView<D> s = this->simulation().view();
    const Real overlap_at_walls =
        check_walls_hold(s, this->step_taken(), ranks(),
                         fmt::format("stiffen the walls ({}, now {:g}), or shorten the step (-dt)",
                                     p_.model.option(Role::wall_energy), p_.model.value(Role::wall_energy)));
    if constexpr (D == 2)
      if (deformable())
        check_outlines_meet_no_wall(s, ranks(), fmt::format("raise {}", p_.model.option(Role::wall_energy)));

    std::array<Real, 3> energies{};     // kinetic, of the translation of points, of the weight
    std::array<Real, 2 * D> moments{};  // mass times place, momentum
    Real top = -std::numeric_limits<Real>::infinity();
    const Topology& own = topology();
    for (Index i = 0; i < own.owned_points(); ++i) {
      const Real mass = own.mass(i);
      const Vec<D> r = s.position(i), v = s.velocity(i);
      energies[0] += s.kinetic_energy(i);
      energies[1] += mass / 2 * v.squaredNorm();
      energies[2] += mass * r[D - 1];
      for (int k = 0; k < D; ++k) {
        moments[k] += mass * r[k];
        moments[D + k] += mass * v[k];
      }
    }
    for (Index m = 0; m < own.owned(); ++m) top = std::max(top, mean_of_points<D>(s.x, own, m)[D - 1]);
    std::set<std::pair<Index, Index>> pairs;
    std::vector<Deepest> deepest{{}};
    particles().field().for_each_contact(s, [&](const Contact<D>& c) {
      if (!(c.overlap > 0)) return;
      const auto [first, second] = std::minmax(own.id[c.first], own.id[c.second]);
      pairs.emplace(first, second);
      if (c.overlap > deepest[0].overlap) deepest[0] = {c.overlap, first, second};
    });
    std::array<Real, 2> sums{particles().field().energy(s), static_cast<Real>(pairs.size())};
    std::vector<Real> force(static_cast<std::size_t>(s.walls.size()) * D);
    particles().field().add_wall_forces(s, force.data());
    std::vector<Real> wall_force(D);
    for (std::size_t k = 0; k < force.size(); ++k) wall_force[k % D] += force[k];
    ranks().sum(energies);
    ranks().sum(moments);
    ranks().sum(sums);
    ranks().sum(wall_force);
    top = ranks().max(top);
    deepest_ = {};
    for (const Deepest& d : ranks().all_gather(deepest))
      if (d.overlap > deepest_.overlap) deepest_ = d;
    if (deepest_.overlap > passing_overlap)
      throw NumericalError(
          "particles {} and {} overlap by {:.3g} of their contact distance: they pass through each other; raise {}, "
          "now {:g}",
          deepest_.first, deepest_.second, deepest_.overlap, p_.model.option(Role::contact_energy),
          p_.model.value(Role::contact_energy));
    largest_overlap_ = std::max(largest_overlap_, deepest_.overlap);
    largest_wall_overlap_ = std::max(largest_wall_overlap_, overlap_at_walls);

    const Vec<D> shift = motion_.shift(s.t), momentum = Eigen::Map<const Vec<D>>(&moments[D]);
    const Real floor = shift[D - 1];
    std::vector<SeriesValue> row{{"time", s.t},
                                 {"dt", run().last_dt()},
                                 {"cycle", s.t * p_.frequency},
                                 {"displacement", shift.dot(along<D>(p_.direction))},
                                 {"mean_height", moments[D - 1] / mass_ - floor},
                                 {"top_height", top - floor},
                                 {"kinetic_energy", energies[0]},
                                 {"fluctuation_energy", energies[1] - momentum.squaredNorm() / (2 * mass_)},
                                 {"potential_energy", sums[0] - energies[2]},
                                 {"gravity_energy", energies[2]},
                                 {"momentum", std::vector<Real>(momentum.begin(), momentum.end())},
                                 {"wall_force", wall_force},
                                 {"contact_pairs", sums[1]},
                                 {"max_overlap", deepest_.overlap}};
    add_budget(row, audit_, this->simulation());
    return row;
  }

  std::string progress() const override {
    return fmt::format("cycle {:.1f}/{}  max overlap {:.3f}", state().t * p_.frequency, p_.cycles, deepest_.overlap);
  }

  void visit(Archive& a) override {
    p_.start.visit(a);
    a.number("largest_overlap", largest_overlap_, 0);
    a.number("largest_wall_overlap", largest_wall_overlap_, 0);
  }

  std::string failure_details() const override {
    if (deepest_.first < 0) return {};
    return fmt::format(", largest overlap {:.3f} between particles {} and {}", deepest_.overlap, deepest_.first,
                       deepest_.second);
  }

  // --- After the run

  void conclude(nlohmann::ordered_json& s) override {
    s["cycles"] = state().t * p_.frequency;
    s["acceleration"] = quantity(p_.acceleration(), BlockAverage::unknown, "g");
    s["weight"] = quantity(mass_, BlockAverage::unknown, D == 2 ? "rho g sigma_avg^2" : "rho g sigma_avg^3");
    s["largest_overlap"] = largest_overlap_;
    s["largest_wall_overlap"] = largest_wall_overlap_;
  }

  void report(const Series& series, nlohmann::ordered_json& s) override {
    const Cycles cycles = whole_cycles(series);
    const std::array<NamedSeries, 3> judged{NamedSeries{"mean_height", cycles.mean_height},
                                            NamedSeries{"fluctuation_energy", cycles.fluctuation_energy},
                                            NamedSeries{"power", cycles.power}};
    const SteadyState steady =
        cycles.end.empty() ? SteadyState{.explanation = "no whole cycle"} : steady_state(cycles.end, judged);
    s["steady"] = steady.steady;
    s["steady_start"] = quantity(steady.time, BlockAverage::unknown, "t0");
    s["steady_explanation"] = steady.explanation;
    s["steady_cycles"] = cycles.end.size() - steady.index;
    const std::string energy = D == 2 ? "rho g sigma_avg^3" : "rho g sigma_avg^4";
    const auto average = [&](const char* name, const std::vector<Real>& values, bool slow, const std::string& unit) {
      BlockAverage b;  // without a steady state there is nothing to average
      const auto rest = std::span<const Real>(values).subspan(steady.index);
      if (steady.steady) b = slow ? slow_average(rest) : block_average(rest);
      s[name] = quantity(b.mean, b.error, unit);
      if (std::isnan(b.error))
        s[name]["no_error"] =
            steady.steady ? "no plateau of the block averages: the run is too short for an error" : steady.explanation;
      if (steady.steady && std::isnan(b.error))
        say("{} = {:.4g} {} (no error: the run is too short)\n", name, b.mean, unit);
      if (steady.steady && !std::isnan(b.error)) say("{} = {:.5g} ± {:.2g} {}\n", name, b.mean, b.error, unit);
    };
    say("{}\n", steady.explanation);
    average("mean_height", cycles.mean_height, true, "sigma_avg");
    average("fluctuation_energy", cycles.fluctuation_energy, false, energy);
    average("power", cycles.power, false, energy + "/t0");
    if (!steady.steady)
      say("to run longer: {} -cycles {}\n", run().restart_command(),
          2 * std::max<std::int64_t>(p_.cycles, BlockAverage::least_samples));
  }

 private:
  using Protocol<D>::particles;
  using Protocol<D>::ranks;
  using Protocol<D>::run;
  using Protocol<D>::state;
  using Protocol<D>::topology;

  struct Deepest {
    Real overlap = 0;  ///< over the contact distance
    Index first = -1, second = -1;
  };

  /// Values of each whole cycle.
  struct Cycles {
    std::vector<Real> end;                              ///< its time
    std::vector<Real> mean_height, fluctuation_energy;  ///< means of its samples
    std::vector<Real> power;                            ///< work of the walls over the duration
  };
  Cycles whole_cycles(const Series& series) const {
    const auto column = [&](const char* name) -> const std::vector<Real>& { return series.at(name).values; };
    const std::vector<Real>&time = column("time"), &height = column("mean_height"),
          &energy = column("fluctuation_energy"), &work = column("work");
    const auto n = static_cast<std::size_t>(p_.samples_per_cycle);
    Cycles all;
    for (std::size_t end = n; end < time.size(); end += n) {
      const std::size_t first = end - n + 1;  // the sample before belongs to the end of the previous cycle
      const auto mean = [&](const std::vector<Real>& values) {
        Real sum = 0;
        for (std::size_t k = first; k <= end; ++k) sum += values[k];
        return sum / static_cast<Real>(n);
      };
      all.end.push_back(time[end]);
      all.mean_height.push_back(mean(height));
      all.fluctuation_energy.push_back(mean(energy));
      all.power.push_back((work[end] - work[end - n]) / (time[end] - time[end - n]));
    }
    return all;
  }

  bool deformable() const { return p_.deformable(); }

  /// Height of the filling if the particles' outer disks (spheres) filled the container without gaps.
  Real filled_height() const {
    const Topology& all = this->simulation().all();
    Real content = 0;
    for (Index m = 0; m < all.particles(); ++m) content += std::pow(outer_radius(all, m), D);
    return D == 2 ? pi * content / p_.width : 4 * content / (3 * square(p_.width / 2));
  }

  /// Errors: InputError if a packing of this height is above the lid.
  void check_lid(Real height) const {
    if (p_.lid && height > *p_.lid)
      throw InputError("-lid {:g}: the packing of {} particles is {:.4g} sigma_avg high; use a higher lid", *p_.lid,
                       p_.particles, height);
  }

  /// For the packing at the start: a hopper with a flat bottom, which `pack` closes.
  Container packing_container() const { return Hopper{.wall_distance = p_.width, .orifice = p_.width / 2}; }

  /// At t = 0.
  bool inside(const Vec<D>& r) const {
    const Vec<2> place = in_plane<D>(r);
    return std::abs(place[0]) < p_.width / 2 && place[1] > 0 && !(p_.lid && place[1] > *p_.lid);
  }

  std::vector<Real> drawn_walls(Real t) const {
    const Vec<D> by = motion_.shift(t);
    const Real height = p_.lid.value_or(2 * p_.width);
    std::vector<Real> drawn;
    for (const WallSegment& wall : wall_parts(p_, D).segments) {
      const Vec<2> end = std::isfinite(wall.length) ? wall.end() : Vec<2>(wall.origin + height * wall.direction);
      drawn.insert(drawn.end(),
                   {wall.origin[0] + by[0], wall.origin[1] + by[D - 1], end[0] + by[0], end[1] + by[D - 1]});
    }
    return drawn;
  }

  template <class Visit>
  void watch(Visit&& visit) {
    if constexpr (D == 2)
      if (deformable()) visit(particles());
  }

  const VibrateOptions& p_;
  Motion<D> motion_;
  CriticalStep critical_;
  Real critical_step_ = 0;  ///< stability limit of the integrator
  Real mass_ = 0;           ///< sum over all particles
  PassageWatch<D> passages_;
  CrossingWatch outlines_;  ///< for polygons
  Deepest deepest_;         ///< in the last sample
  Real largest_overlap_ = 0, largest_wall_overlap_ = 0;
  EnergyAudit<D> audit_{this->simulation()};
};

}  // namespace

Scenario vibrate_scenario() {
  Scenario s = option_scenario<VibrateOptions>(
      "vibrate", "particles in a vibrated container",
      [](const VibrateOptions& p, const Options& options, const Ranks& ranks, std::optional<Checkpoint> checkpoint) {
        check_memory({p.particles, p.points(), p.dim},
                     p.start.given() ? "-start " + p.start.file() : fmt::format("-n {}", p.particles), ranks);
        if (!checkpoint) p.refuse_unread(options);
        const auto make = [&]<int D>(std::integral_constant<int, D>) -> std::unique_ptr<AnyRun> {
          return std::make_unique<Run<D>>("vibrate", p, options, ranks, std::make_unique<VibrateProtocol<D>>(p, ranks),
                                          std::move(checkpoint));
        };
        return p.dim == 2 ? make(std::integral_constant<int, 2>()) : make(std::integral_constant<int, 3>());
      },
      {}, {"model", "dim", "n", "box_width", "amplitude", "frequency", "direction", "cycles", "seed", "output"});
  s.units = "Units: σ_avg = g = ρ = 1, t0 = sqrt(σ_avg/g).";
  return s;
}

}  // namespace pliant
