#include <pliant/scenarios/droplets/protocol.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include <pliant/base/console.h>
#include <pliant/run/overlap_check.h>
#include <pliant/system/neighbour_drag.h>

namespace pliant {
namespace {

enum { work, dissipated };  // integrated quantities

constexpr char slower_droplets[] = "lower -dt or the tolerance (-ts_atol), or slow walls or gravity";

ParticleSystem<2> make_particles(const DropletOptions& p, const DropletSetup& setup, Topology droplets,
                                 const Ranks& ranks) {
  return {std::move(droplets), setup.walls, p.model.force_field<2>({.gravity = setup.gravity}), p.skin, ranks};
}

std::unique_ptr<Simulation<2>> make_simulation(const DropletOptions& p, const DropletSetup& setup, const Ranks& ranks) {
  NeighbourDragOptions drag = p.drag_options();
  drag.walls = setup.walls_rub;
  auto mobility = std::make_unique<NeighbourDrag<2>>(drag);
  const NeighbourDrag<2>& friction = *mobility;
  std::vector<IntegratedQuantity<2>> quantities(2);
  quantities[work] = {"work", wall_power<2>};
  quantities[dissipated] = {"dissipated",
                            [&friction](const ForceField<2>&, const StateView<2>& s) { return friction.power(s); }};
  return std::make_unique<Simulation<2>>(
      setup.droplets,
      OverdampedSystem<2>(make_particles(p, setup, {}, ranks), std::move(mobility), std::move(quantities)),
      Sorting::never);
}

}  // namespace

void refuse_ranks(const std::string& scenario, const Ranks& ranks) {
  if (ranks.several())
    throw InputError(
        "{} on {} ranks: each rank would factorise the drag matrix of all droplets; start it without mpiexec, and "
        "several runs at once to use more cores",
        scenario, ranks.size());
}

DropletProtocol::DropletProtocol(const DropletOptions& p, const Ranks& ranks, const DropletSetup& setup)
    : Protocol<2>(make_simulation(p, setup, ranks)),
      p_(p),
      integration_(setup.integration),
      fastest_rate_(fastest_relaxation(p.model, p.b, setup.droplets.diameter, setup.walls_at_once, setup.walls_rub)),
      dt_(p.dt.value_or(standard_dt())) {}

std::unique_ptr<Integrator> DropletProtocol::make_integrator(Real dt) {
  integration_.dt = dt;
  auto integrator = std::make_unique<TsIntegrator>(integration_, ranks().comm());
  if (integrator->explicit_fixed_step()) critical_step_ = integrator->longest_stable_step({.decay = fastest_rate_});
  return integrator;
}

/// A fixed step follows the limit of stability; a controlled one finds its length.
Real DropletProtocol::standard_dt() const {
  const TsIntegrator method(integration_, MPI_COMM_SELF);
  const Real longest = p_.longest_standard_dt;
  return method.explicit_fixed_step() ? std::min(longest, 0.5 * method.longest_stable_step({.decay = fastest_rate_}))
                                      : longest;
}

void DropletProtocol::started() { start_energy_ = energy(); }

void DropletProtocol::ready() {
  passages_.have_inertia(false);
  passages_.start(particles(), state());
  before_.assign(state().x().begin(), state().x().end());
}

bool DropletProtocol::follow() {
  check_motion();
  passages_.after_step(particles(), state());
  const bool changed = follow_stages();
  if (changed) passages_.start(particles(), state());
  return changed;
}

void DropletProtocol::check_motion() {
  for (Index m = 0; m < droplets(); ++m) {
    const Real way = (position(m) - point<2>(before_.data(), m)).norm();
    if (way > radius(m))
      throw NumericalError("droplet {} moves by {:.3g} radii in a step: contacts may be missed; {}", m, way / radius(m),
                           slower_droplets);
  }
  std::copy_n(state().x().begin(), before_.size(), before_.begin());
}

std::vector<SeriesValue> DropletProtocol::sample() {
  const Real speed = max_speed();
  const StateView<2> s = view();
  const ForceField<2>& field = particles().field();
  if (const Real deepest = check_walls_hold(s, 0, Ranks(), slower_droplets); deepest > passing_overlap)
    throw NumericalError("a droplet overlaps a wall by {:.3g} radii: it passes through the wall; {}", deepest,
                         slower_droplets);
  Real bonds = 0, tense = 0;
  field.for_each_contact(s, [&](const Contact<2>& c) {
    ++bonds;
    tense += c.force.dot(c.normal) < 0;
  });
  const Real total = field.energy(s);
  budget_error_ = total - start_energy_ - integrated(work) + integrated(dissipated) + withdrawn_;
  std::vector<SeriesValue> row{{"time", s.t},    {"dt", run().last_dt()}, {"max_speed", speed},
                               {"bonds", bonds}, {"tense_bonds", tense},  {"energy", total}};
  // Terms that are switched off, or have no walls, are not reported: each has its column all the same.
  std::array<std::pair<const char*, Real>, 5> energies{
      {{"contact", 0}, {"depletion", 0}, {"wall_repulsion", 0}, {"wall_depletion", 0}, {"gravity", 0}}};
  for (const TermReport& term : field.report(s))
    for (auto& [name, value] : energies)
      if (term.name == name) value = term.energy;
  for (const auto& [name, value] : energies) row.emplace_back(fmt::format("{}_energy", name), value);
  row.emplace_back("work", integrated(work));
  row.emplace_back("dissipated", integrated(dissipated));
  row.emplace_back("withdrawn", withdrawn_);
  row.emplace_back("budget_error", budget_error_);
  measure(row);
  return row;
}

std::vector<Real> DropletProtocol::wall_forces() {
  std::vector<Real> force(2 * static_cast<std::size_t>(particles().walls().size()));
  particles().field().add_wall_forces(view(), force.data());
  return force;
}

Real DropletProtocol::max_speed() {
  simulation().find_velocities();
  Real speed = 0;
  for (Index m = 0; m < droplets(); ++m) speed = std::max(speed, point<2>(state().v().data(), m).norm());
  return speed;
}

Real DropletProtocol::energy() { return particles().field().energy(view()); }

template <class Change>
void DropletProtocol::outside_budget(Change&& change) {
  const Real before = energy();
  change();
  simulation().forget_velocities();
  withdrawn_ += before - energy();
}

void DropletProtocol::set_walls(const Walls<2>& walls) {
  outside_budget([&] { put_walls(walls); });
}

void DropletProtocol::put_walls(const Walls<2>& walls) { particles().set_walls(walls); }

void DropletProtocol::deactivate(Index m) {
  outside_budget([&] { particles().deactivate(m); });
}

void DropletProtocol::visit(Archive& a) {
  a.number("start_energy", start_energy_);
  a.number("withdrawn", withdrawn_);
  visit_more(a);
}

std::optional<EnergyBudget> DropletProtocol::energy_budget() {
  const Real total = energy();
  return EnergyBudget{.work = integrated(work) - withdrawn_,
                      .heat = integrated(dissipated),
                      .change = total - start_energy_,
                      .energy = total};
}

void DropletProtocol::conclude(nlohmann::ordered_json& s) {
  s["work"] = integrated(work);
  s["dissipated"] = integrated(dissipated);
  s["budget_error"] = budget_error_;
  conclude_more(s);
}

void DropletProtocol::report(const Series&, nlohmann::ordered_json& s) {
  const std::string by = s.contains("ended_by") ? s["ended_by"] : s["status"];
  say("ended at t = {:.6g} t0 ({}); error of the energy budget {:.1e}\n", Real(s["t"]), by, budget_error_);
}

}  // namespace pliant
