#include <pliant/scenarios/packings/steady_shear.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <pliant/analysis/block_average.h>
#include <pliant/analysis/steady_state.h>
#include <pliant/base/console.h>
#include <pliant/io/summary.h>
#include <pliant/model/drag.h>
#include <pliant/run/overlap_check.h>
#include <pliant/run/step_check.h>
#include <pliant/scenarios/packings/measures.h>
#include <pliant/scenarios/packings/pack.h>
#include <pliant/scenarios/particles/motions.h>
#include <pliant/system/stress.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

namespace pliant {
namespace {

/// Largest growth of the strain in a step; with a larger one touching particles pass each other in a few steps.
constexpr Real most_strain = 0.1;
constexpr Real most_controlled_strain =
    0.015;  // free particles have no error that would shorten a step before they touch

/// All terms but the drag, which has no part in a minimum of the energy.
PackOptions preparation(const ShearOptions& p) {
  PackOptions packing(p);
  packing.model.set(Role::drag, 0.0);
  return packing;
}

template <int D>
std::unique_ptr<Simulation<D>> make_simulation(const ShearOptions& p, const Ranks& ranks) {
  auto [all, particles] = particles_in_box<D>(p, ranks);
  particles.tune_skin();
  // Methods that remember steps forget them when particles are sorted.
  const Sorting sorting = p.integrator == ShearIntegrator::verlet ? Sorting::regularly : Sorting::at_start;
  return std::make_unique<Simulation<D>>(std::move(all), std::move(particles), sorting);
}

}  // namespace

template <int D>
SteadyShear<D>::SteadyShear(const ShearOptions& p, const Ranks& ranks)
    : Protocol<D>(make_simulation<D>(p, ranks)), p_(p) {
  critical_ = this->particles().field().critical_step(this->simulation().all());
  dt_ = p.dt.value_or(
      critical_.standard(std::min({0.2 * critical_.elastic, 0.5 * critical_.damping, most_strain / *p.rate})));
  if (!p.dt && p.integrator != ShearIntegrator::verlet)
    dt_ = standard_step(TsIntegrator({}, MPI_COMM_SELF), motions(), dt_);
}

template <int D>
std::string SteadyShear<D>::title() const {
  return fmt::format("steady shear: {}; then at the rate {:g}/t0 to the strain {:g}", p_.path_text(), *p_.rate,
                     *p_.strain);
}

template <int D>
std::unique_ptr<Integrator> SteadyShear<D>::make_integrator(Real dt) {
  std::unique_ptr<Integrator> integrator;
  if (p_.integrator == ShearIntegrator::verlet) {
    integrator = std::make_unique<FixedStepVerlet>(dt);
  } else {
    integrator = std::make_unique<TsIntegrator>(TsOptions{.dt = dt, .longest_dt = most_controlled_strain / *p_.rate},
                                                this->ranks().comm());
  }
  critical_step_ = longest_stable_step(*integrator, motions());
  return integrator;
}

template <int D>
void SteadyShear<D>::check() const {
  const Integrator& integrator = this->simulation().integrator();
  const Real dt = integrator.next_dt(), strain = dt * *p_.rate;
  if (integrator.explicit_fixed_step() && above(strain, most_strain) && this->ranks().root())
    warn(
        "-dt {:g} with -shear_rate {:g}: the strain grows by {:.2g} in a step, and touching particles pass each other "
        "in a few steps; shorten -dt to {:.2g} or less",
        dt, *p_.rate, strain, most_strain / *p_.rate);
}

template <int D>
std::vector<FastestRates> SteadyShear<D>::motions() const {
  return motions_of(critical_, p_.model, this->particles().field(), this->simulation().all());
}

/// The root makes the packing, because energies are minimised on one rank. If each rank made the packing, ranks on
/// different types of processors could obtain different packings, because a minimisation amplifies rounding errors.
template <int D>
std::vector<Real> SteadyShear<D>::start() {
  const Topology& all = this->simulation().all();
  std::vector<Real> x, length;
  this->ranks().on_root([&] {
    const PackOptions options = preparation(p_);
    PackProtocol<D> packing(options, Ranks(), false);
    Simulation<D>& packed = packing.simulation();
    packed.set_integrator(packing.make_integrator(1));
    packed.place(packing.start());
    packed.advance(packing.last_time());
    const Vec<D>& edges = packed.particles().box().length();
    length.assign(edges.begin(), edges.end());
    const Topology& from = packed.topology();
    x.resize(static_cast<std::size_t>(all.points()) * D);
    for (Index m = 0; m < from.owned(); ++m)
      std::copy_n(&packed.state().x()[static_cast<std::size_t>(from.offset[m]) * D], from.points_of(m) * D,
                  &x[static_cast<std::size_t>(all.offset[from.id[m]]) * D]);
  });
  this->ranks().broadcast(x);
  this->ranks().broadcast(length);
  shear_box(length);
  return x;
}

template <int D>
void SteadyShear<D>::shear_box(const std::vector<Real>& length) {
  box_ = Box<D>(Vec<D>::Zero(), Eigen::Map<const Vec<D>>(length.data()));
  this->particles().set_box(box_);
  this->particles().shear_at(*p_.rate, shortened_);
}

template <int D>
void SteadyShear<D>::started() {
  State& s = this->state();
  const ShearFlow<D>& flow = this->particles().box().flow();
  for (Index i = 0; i < this->topology().owned_points(); ++i)
    point<D>(s.v().data(), i) = flow.at(point<D>(s.x().data(), i));
}

template <int D>
void SteadyShear<D>::ready() {
  if (measured_) return;
  measured_ = true;
  const Measured now = measure();
  start_energy_ = now.energy + now.kinetic_energy;
  integrate(now);
}

template <int D>
bool SteadyShear<D>::follow() {
  shortened_ = this->particles().shift_lattice(this->state());
  if (this->state().step % stride() == 0) {
    const Measured now = measure();
    integrate(now);
    look_at_particles(now);
  }
  return false;
}

template <int D>
void SteadyShear<D>::look_at_particles(const Measured& now) {
  // check_crossings() is for polygons and surfaces; a rank may be without particles.
  if (this->simulation().all().deformable()) return;
  const Real h = this->step_taken();
  if (const Real way = now.fastest * h; way > 1)
    throw NumericalError(
        "a particle moves by {:.3g} radii in a step relative to the flow: contacts may be missed; shorten the step "
        "(-dt), raise {}, or lower the rate (-shear_rate)",
        way, p_.model.option(Role::drag));
  const PassingPair nearest = nearest_passing_pair(this->simulation().view(), h);
  pair_overlap_ = std::max(pair_overlap_, this->ranks().max(nearest.gap < 0 ? nearest.overlap : 0));
}

template <int D>
typename SteadyShear<D>::Measured SteadyShear<D>::measure() {
  Measured now;
  const ForceField<D>& field = this->particles().field();
  const StateView<D> s = this->simulation().view();
  for (const TermVirial<D>& term : field.virials(s)) now.stress += term.virial;
  for (Index i = 0; i < s.topology.owned_points(); ++i) {
    const Real mass = s.topology.mass(i);
    const Vec<D> w = s.velocity(i) - s.flow.at(s.position(i));
    now.kinetic += momentum_flux(s, i);
    now.kinetic_energy += mass / 2 * w.squaredNorm();
    now.fastest = std::max(now.fastest, 2 * w.norm() / s.topology.diameter[i]);
    now.momentum += mass * w;
  }
  now.energy = field.energy(s);
  now.drag_power = field.power(s);
  const Ranks& ranks = this->ranks();
  for (Mat<D>* const sum : {&now.stress, &now.kinetic}) ranks.sum(std::span(sum->data(), D * D));
  ranks.sum(std::span(now.momentum.data(), D));
  now.fastest = ranks.max(now.fastest);
  for (Real* const sum : {&now.energy, &now.kinetic_energy, &now.drag_power}) *sum = ranks.sum(*sum);
  now.stress /= volume();
  now.kinetic /= volume();
  return now;
}

/// In a flow with the velocity gradient rate, U and the kinetic energy relative to the flow change by
/// V rate σ_xy − (power of the drag), with the sum of both parts of the stress.
template <int D>
void SteadyShear<D>::integrate(const Measured& now) {
  const Real t = this->state().t;
  work_.add(t, volume() * *p_.rate * now.shear_stress());
  heat_.add(t, now.drag_power);
  largest_kinetic_ = std::max(largest_kinetic_, now.kinetic_energy);
}

template <int D>
EnergyBudget SteadyShear<D>::budget(const Measured& now) {
  const SampledIntegral work = work_, heat = heat_;
  const Real largest = largest_kinetic_;
  if (this->state().step % stride() != 0) integrate(now);
  EnergyBudget b;
  b.work = work_.value();
  b.heat = heat_.value();
  b.energy = now.energy + now.kinetic_energy;
  b.change = b.energy - start_energy_;
  b.uncertainty_of_work = work_.error();
  b.uncertainty = std::hypot(b.uncertainty_of_work, heat_.error());
  b.largest = largest_kinetic_;
  work_ = work;  // the run may continue
  heat_ = heat;
  largest_kinetic_ = largest;
  return b;
}

template <int D>
std::vector<SeriesValue> SteadyShear<D>::sample() {
  check_crossings<D>(this->particles(), this->state().x().data(), "in the flow",
                     {.contacts = "lower the rate (-shear_rate)",
                      .shape = fmt::format("raise the contact energy ({}) or the stiffness of the shapes",
                                           p_.model.option(Role::contact_energy)),
                      .self_crossing = ""});
  const Measured now = measure();
  const EnergyBudget b = budget(now);
  const StateView<D> s = this->simulation().view();
  std::set<std::pair<Index, Index>> pairs;
  Real overlap = 0;
  this->particles().field().for_each_contact(s, [&](const Contact<D>& c) {
    if (!(c.overlap > 0)) return;
    pairs.insert(std::minmax(c.first, c.second));
    overlap = std::max(overlap, c.overlap);
  });
  const std::int64_t all_pairs = this->ranks().sum(static_cast<std::int64_t>(pairs.size()));
  return {{"time", this->state().t},
          {"dt", this->step_taken()},
          {"strain", strain()},
          {"shear_stress", now.shear_stress()},
          {"pressure", now.pressure()},
          {"stress", upper_triangle<D>(now.stress + now.kinetic)},
          {"kinetic_stress", upper_triangle<D>(now.kinetic)},
          {"energy", now.energy + now.kinetic_energy},
          {"kinetic_energy", now.kinetic_energy},
          {"work", b.work},
          {"heat", b.heat},
          {"momentum", std::vector<Real>(now.momentum.begin(), now.momentum.end())},
          {"fraction", packing_fraction(this->particles(), this->state().x().data())},
          {"contact_pairs", static_cast<Real>(all_pairs)},
          {"max_overlap", this->ranks().max(overlap)}};
}

template <int D>
std::string SteadyShear<D>::progress() const {
  return fmt::format("strain {:.4g}", strain());
}

template <int D>
void SteadyShear<D>::visit(Archive& a) {
  std::vector<Real> length(box_.length().begin(), box_.length().end());
  a.array("box_length", length, D, std::numeric_limits<Real>::min());
  a.number("edge_shortened_by", shortened_, -Archive::any_count);
  a.flag("energy_measured", measured_);
  a.number("start_energy", start_energy_);
  a.number("largest_kinetic_energy", largest_kinetic_, 0);
  a.newer("pair_overlap", pair_overlap_, 0);
  work_.visit(a, "work_of_shear");
  heat_.visit(a, "heat_of_drag");
  if (a.reads()) shear_box(length);
}

template <int D>
void SteadyShear<D>::conclude(nlohmann::ordered_json& s) {
  s["strain"] = strain();
  s["shear_rate"] = *p_.rate;
}

template <int D>
void SteadyShear<D>::report(const Series& all, nlohmann::ordered_json& s) {
  const Series series = even_rows(all, this->run().even_samples());
  const auto column = [&](const char* name) { return std::span<const Real>(series.at(name).values); };
  const std::span<const Real> time = column("time"), stress = column("shear_stress"), pressure = column("pressure"),
                              kinetic = column("kinetic_energy");
  const std::string unit = D == 2 ? "eps/sigma_avg^2" : "eps/sigma_avg^3";
  const std::array<NamedSeries, 3> judged{NamedSeries{"shear_stress", stress}, NamedSeries{"pressure", pressure},
                                          NamedSeries{"kinetic_energy", kinetic}};
  const SteadyState steady = steady_state(time, judged);
  s["steady"] = steady.steady;
  s["steady_start"] = quantity(steady.time, BlockAverage::unknown, "t0");
  s["steady_explanation"] = steady.explanation;
  s["steady_samples"] = time.size() - steady.index;
  const bool passed = pair_overlap_ > 0;
  if (passed) {
    s["passing_overlap"] = pair_overlap_;
    warn(
        "particles overlapped by {:.3g} of their contact distance: they pass through each other; raise {}, or "
        "lower the rate (-shear_rate)",
        pair_overlap_, p_.model.option(Role::drag));
  }
  const auto average = [&](const char* name, const BlockAverage& b, std::string_view of, Real factor = 1) {
    // Without a steady state there is nothing to average.
    s[name] = steady.steady ? quantity(factor * b.mean, passed ? BlockAverage::unknown : factor * b.error, of)
                            : quantity(BlockAverage::unknown, BlockAverage::unknown, of);
    if (s[name]["error"].is_null())
      s[name]["no_error"] = !steady.steady ? steady.explanation
                            : passed       ? "particles passed through each other"
                            : std::isnan(b.mean)
                                ? "particles exert no pressure"
                                : "no plateau of the block averages: the run is too short for an error";
  };
  const BlockAverage of_stress = block_average(stress.subspan(steady.index));
  average("flow_stress", of_stress, unit);
  average("viscosity", of_stress, unit + " t0", 1 / *p_.rate);
  average("flow_pressure", block_average(pressure.subspan(steady.index)), unit);
  average("stress_ratio", block_ratio(stress.subspan(steady.index), pressure.subspan(steady.index)), "");
  if (!steady.steady) {
    warn("no flow stress: {}; shear to a larger -strain", steady.explanation);
    return;
  }
  const std::string error = passed                        ? " (no error: particles passed through each other)"
                            : std::isnan(of_stress.error) ? " (no error: the run is too short)"
                                                          : "";
  say("flow stress {:.4g}{} {}{}, viscosity {:.4g} {} t0, from the strain {:.3g} on\n", of_stress.mean,
      error.empty() ? fmt::format(" ± {:.2g}", of_stress.error) : "", unit, error, of_stress.mean / *p_.rate, unit,
      steady.time * *p_.rate);
}

template class SteadyShear<2>;
template class SteadyShear<3>;

}  // namespace pliant
