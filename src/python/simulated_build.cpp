// Construction: particles, model, integrator.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <string_view>
#include <tuple>
#include <utility>

#include <pliant/model/crossing.h>
#include <pliant/model/surface_crossing.h>
#include <pliant/python/simulated.h>
#include <pliant/run/overlap_check.h>
#include <pliant/run/step_check.h>
#include <pliant/scenarios/droplets/protocol.h>
#include <pliant/scenarios/particles/motions.h>
#include <pliant/setup/particles.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

namespace pliant::python {
namespace {

constexpr std::string_view unit_of_time = "t0";  // in messages

}  // namespace

template <int D>
Simulated<D>::Simulated(const ParticleArrays& particles, const AnyWalls& walls, const Box<D>& box, const Vec<D>& weight,
                        const std::vector<std::string>& arguments)
    : box_(box), weight_(weight), settings_(std::make_unique<Settings>(arguments)) {
  if (walls.dim() != D) throw InputError("the walls are {}D, but the particles are {}D", walls.dim(), D);
  wall_record_ = WallRecord<D>(walls.parts(), walls.get<D>());
  ParticleTable all;
  append_particles<D>(all, particles);
  build(std::move(all), walls.get<D>(), 0, 0);
  check_start();
  audit_.emplace(*simulation_).start();
  audit_->kicked();
  remember(*this);
}

template <int D>
Simulated<D>::~Simulated() {
  try {
    end_output();
  } catch (const std::exception& error) {
    PySys_WriteStderr("pliant: warning: %.900s\n", error.what());
  }
  forget(*this);
}

template <int D>
std::unique_ptr<ChangeableField<D>> Simulated<D>::make_field(Settings& settings, const Walls<D>& walls) const {
  const Surroundings<D> surroundings{.gravity = weight_};
  settings.model.template resolve<D>(surroundings);
  settings.refuse_unread();
  return std::make_unique<ChangeableField<D>>(settings.model.template force_field<D>(surroundings), walls.size() > 0);
}

template <int D>
ParticleSystem<D> Simulated<D>::make_system(const Topology& all, const Walls<D>& walls,
                                            std::unique_ptr<ForceField<D>> field) const {
  const auto n = static_cast<Real>(all.particles());
  Real width = 0;
  for (const Real sigma : all.sigma) width += sigma / n;
  const Real skin = settings_->skin.value_or(usual_skin(settings_->model.particles(), D) * width);
  return ParticleSystem<D>({}, walls, std::move(field), skin, Ranks(), box_);
}

template <int D>
std::pair<std::unique_ptr<Simulation<D>>, ChangeableField<D>*> Simulated<D>::make_engine(Topology all,
                                                                                         const Walls<D>& walls) const {
  constexpr const char* deformables = D == 2 ? "polygons" : "closed surfaces";
  if (all.deformable() != settings_->model.deformable())
    throw InputError("model {} is for {}, but the particles are {}", settings_->model.name,
                     !settings_->model.deformable() ? "disks and spheres" : deformables,
                     !all.deformable() ? "disks or spheres" : deformables);
  auto field = make_field(*settings_, walls);
  ChangeableField<D>* const changeable = field.get();
  ParticleSystem<D> system = make_system(all, walls, std::move(field));
  if (!settings_->skin) system.tune_skin();
  const Sorting sorting = settings_->method == Method::verlet ? Sorting::regularly : Sorting::at_start;
  if (!settings_->overdamped())
    return {std::make_unique<Simulation<D>>(std::move(all), std::move(system), sorting), changeable};
  auto mobility = settings_->mobility<D>();
  const Mobility<D>& drag = *mobility;
  std::vector<IntegratedQuantity<D>> quantities{
      {"work", [changeable](const ForceField<D>& forces,
                            const StateView<D>& s) { return wall_power(forces, s) + changeable->function_power(s.v); }},
      {"dissipated", [&drag](const ForceField<D>&, const StateView<D>& s) { return drag.power(s); }}};
  return {
      std::make_unique<Simulation<D>>(
          std::move(all), OverdampedSystem<D>(std::move(system), std::move(mobility), std::move(quantities)), sorting),
      changeable};
}

template <int D>
void Simulated<D>::build(ParticleTable all, const Walls<D>& walls, Real t, std::int64_t step) {
  const auto n = static_cast<std::size_t>(all.topology.particles());
  const std::vector<Index> offset = all.topology.offset;
  auto [next, changeable] = make_engine(std::move(all.topology), walls);
  next->state().t = t;
  next->place(all.x);
  // place() makes a state at rest, at time 0.
  State& state = next->state();
  state.t = t;
  state.step = step;
  offset_ = offset;
  simulation_ = std::move(next);
  field_ = changeable;
  const Topology& topology = simulation_->topology();
  ParticleSystem<D>& particles = simulation_->particles();
  scatter(topology, all.v.data(), D, state.v().data());
  if (rotates()) {
    scatter(topology, all.angles.data(), rotations<D>, particles.rotations_in(state.x()).data());
    scatter(topology, all.spins.data(), rotations<D>, particles.rotations_in(state.v()).data());
  }
  for (std::size_t m = 0; m < state.images.size(); ++m)
    for (int k = 0; k < D; ++k) state.images[m][k] += all.images[static_cast<std::size_t>(topology.id[m])][k];
  for (const ParticleTable::Contacts& contacts : all.history)
    if (std::ranges::any_of(particles.history().tables(),
                            [&](const ContactTable& table) { return table.needs().name == contacts.term; })) {
      particles.history().set(contacts.term, contacts.stored);
      particles.history().of(contacts.term).set_heat(contacts.heat);
    }
  particles.set_accepted(state.x());
  simulation_->forget_all();
  const auto start = static_cast<Index>(ids_.size());
  for (auto k = start; k < static_cast<Index>(n); ++k) {
    if (new_ids_.empty()) new_ids_.push_back(next_id_++);
    ids_.push_back(new_ids_.front());
    new_ids_.erase(new_ids_.begin());
  }
  for (SharedArray& shared : arrays_) shared = {};
  stale_ = true;
  set_integrator();
}

template <int D>
void Simulated<D>::check_start() {
  const StateView<D> s = present();
  const auto id = [&](Index i) { return ids_[static_cast<std::size_t>(s.topology.id[s.topology.particle[i]])]; };
  for (const auto& [i, j] : s.neighbours.point_pairs)
    if (s.position(i) == s.position(j))
      throw InputError("particles {} and {} are at the same place, where the force has no direction; move one", id(i),
                       id(j));
  if (!deformable() && !settings_->allow_passing_overlap)
    if (const PassingPair nearest = nearest_passing_pair(s); nearest.gap < 0)
      throw InputError(
          "particles {} and {} overlap by {:.3g} of their contact distance: they are inside each other; move one, or "
          "accept it with -allow_passing_overlap",
          id(nearest.points.first), id(nearest.points.second), nearest.overlap);
  const Real longest = deformable() ? *std::ranges::max_element(s.topology.l0) : 0;
  for (const WallSegment& wall : s.walls.segments())
    if (wall.radius > 0 && wall.radius < longest)
      throw InputError(
          "a wall is a disk of radius {:.3g}, which enters edges of particles, {:.3g} long, as they touch disks at "
          "their "
          "ends only; use a polygon",
          wall.radius, longest);
  for (const auto& [i, part] : s.neighbours.walls) {
    const Real d = s.walls.distance(s.position(i), part, s.t);
    if (!s.walls.solid(part, s.t) && d == 0)
      throw InputError("particle {} is on a wall, where the force has no direction; move it", id(i));
    if (d < 0) throw InputError("particle {} is inside wall {}; move it", id(i), s.walls.wall_of_part(part));
  }
  if constexpr (D == 2)
    if (deformable())
      if (const auto crossing = find_crossing(s))
        throw InputError("vertex {} of particle {} is inside particle {}; move one of them",
                         crossing->vertex - s.topology.offset[crossing->particle],
                         ids_[static_cast<std::size_t>(s.topology.id[crossing->particle])],
                         ids_[static_cast<std::size_t>(s.topology.id[crossing->other])]);
  if constexpr (D == 3)
    if (deformable()) check_surfaces_apart();
  start_watches();
}

template <int D>
void Simulated<D>::check_surfaces_apart() requires(D == 3) {
  const StateView<3> s = present();
  const auto id = [&](Index m) { return ids_[static_cast<std::size_t>(s.topology.id[m])]; };
  const SurfacesLook seen = look_at_surfaces(s);
  const bool touch = !settings_->model.parameters(Role::contact_energy).empty();
  if (const auto& p = seen.piercing; p && touch)
    throw InputError("particle {} pierces particle {}; move one of them", id(p->particle), id(p->other));
  if (seen.bad_shape)
    throw InputError("particle {} has no volume, or no area in a face; give it another shape",
                     id(seen.bad_shape->particle));
  if (seen.crossing_itself)
    throw InputError("particle {} crosses itself; give it another shape", id(*seen.crossing_itself));
  if (const auto& pair = seen.enclosure; pair && touch)
    throw InputError("particle {} is inside particle {}; move one of them", id(pair->inner), id(pair->outer));
}

template <int D>
Topology Simulated<D>::topology_by_id() const {
  const Topology& topology = simulation_->topology();
  std::vector<Index> order(ids_.size());
  for (std::size_t m = 0; m < order.size(); ++m)
    order[static_cast<std::size_t>(topology.id[m])] = static_cast<Index>(m);
  return topology.select(order);
}

template <int D>
ParticleTable Simulated<D>::collect() {
  ParticleTable all;
  const Topology& topology = simulation_->topology();
  State& state = simulation_->state();
  const std::size_t n = ids_.size(), points = rows(0);
  all.topology = topology_by_id();
  all.x.resize(points * D), all.v.resize(points * D);
  all.angles.resize(points * rotations<D>), all.spins.resize(points * rotations<D>);
  gather(topology, state.x().data(), D, all.x.data());
  gather(topology, state.v().data(), D, all.v.data());
  if (rotates()) {
    gather(topology, simulation_->angles().data(), rotations<D>, all.angles.data());
    gather(topology, simulation_->spins().data(), rotations<D>, all.spins.data());
  }
  all.images.resize(n);
  for (std::size_t m = 0; m < state.images.size(); ++m)
    all.images[static_cast<std::size_t>(topology.id[m])] = state.images[m];
  for (const ContactTable& table : simulation_->particles().history().tables())
    all.history.push_back({table.needs().name,
                           table.pairs(),
                           table.needs().width,
                           table.contacts(),
                           {table.heat().begin(), table.heat().end()}});
  return all;
}

template <int D>
void Simulated<D>::rebuild(const std::function<void(ParticleTable&)>& change, const std::vector<Index>& kept) {
  audit_->disturb();
  ParticleTable all = collect();
  change(all);
  const Walls<D> walls = simulation_->particles().walls();
  const Real now = t();
  const std::int64_t taken = steps(), evaluations = simulation_->integrator().statistics().force_evaluations;
  const std::vector<Real> integrated = simulation_->state().extra;
  const auto before = std::tuple(field_, offset_, ids_, arrays_, critical_);
  std::unique_ptr<Simulation<D>> old = std::move(simulation_);
  if (!kept.empty()) {
    std::vector<Index> ids;
    for (const Index k : kept) ids.push_back(ids_[static_cast<std::size_t>(k)]);
    ids_ = std::move(ids);
  }
  try {
    build(std::move(all), walls, now, taken);
    check_start();
    simulation_->state().extra = integrated;
    audit_->move_to(*simulation_);
  } catch (...) {
    simulation_ = std::move(old);
    std::tie(field_, offset_, ids_, arrays_, critical_) = before;
    new_ids_.clear();
    throw;
  }
  settle();
  before_.force_evaluations += evaluations;
  rebuilds_before_ = 0;
}

template <int D>
FastestRates Simulated<D>::rates_of(const Settings& settings, const CriticalStep& critical) const {
  if (settings.overdamped())
    return {.decay = settings.relaxation_rate<D>(simulation_->topology(), critical, has_walls())};
  FastestRates rates{.drag = drag_rate<D>(settings.model, *field_, simulation_->topology())};
  for (const FastestRates& motion : fastest_motions(critical)) {
    rates.oscillation = std::max(rates.oscillation, motion.oscillation);
    rates.decay = std::max(rates.decay, motion.decay);
  }
  return rates;
}

template <int D>
Real Simulated<D>::standard_step(const Settings& settings, const CriticalStep& critical) const {
  if (settings.overdamped()) return 0.2 / rates_of(settings, critical).decay;
  return critical.standard(std::min(0.2 * critical.elastic, 0.5 * critical.damping));
}

template <int D>
Real Simulated<D>::check_step(const Settings& settings, const CriticalStep& critical) const {
  const Real dt = settings.dt.value_or(standard_step(settings, critical));
  if (!std::isfinite(dt)) throw InputError("nothing sets the time scale of this simulation; give -dt");
  if (settings.method == Method::verlet && !settings.allow_unstable_dt)
    check_stable_step(dt, {.longest = critical.limit(), .unit = unit_of_time, .given = settings.dt.has_value()});
  return dt;
}

/// Converts lengths and speeds of a method, which are for a mean diameter (droplets: radius) of 1, to the user's units.
template <int D>
void Simulated<D>::scale(TsOptions& method, const CriticalStep& critical) const {
  const Topology& own = simulation_->topology();
  if (own.owned() == 0) return;
  const std::span<const Real> sigma = std::span(own.sigma).first(static_cast<std::size_t>(own.owned())),
                              diameters = std::span(own.diameter).first(static_cast<std::size_t>(own.owned_points()));
  const Real mean = std::accumulate(sigma.begin(), sigma.end(), Real{0}) / own.owned();
  method.length = settings_->droplets() ? mean / 2 : mean;
  method.atol_x *= method.length;
  // A velocity as wrong as the tolerance moves a particle by the tolerance of positions per unit of time at most, and
  // by a small part of it per standard step.
  constexpr Real small = 3e-4;
  method.atol_v = method.atol_x * std::min<Real>(1, small / standard_step(*settings_, critical));
  constexpr Real part_of_diameter = 1.0 / 8;  // two particles that approach do not miss their contact
  method.longest_move = part_of_diameter * std::ranges::min(diameters);
}

template <int D>
void Simulated<D>::set_integrator(std::optional<Real> next) {
  const CriticalStep critical = critical_of(*field_);
  const Real dt = next ? *next : check_step(*settings_, critical);
  critical_ = critical.limit();
  if (settings_->method == Method::verlet) {
    settings_->options.check_consumed("-integrator verlet does not read it; name a method of PETSc");
    simulation_->set_integrator(std::make_unique<FixedStepVerlet>(dt));
  } else {
    settings_->restore();
    if (overdamped()) (void)settings_->mobility<D>();  // reads its options of PETSc, which are then used
    TsOptions method = settings_->droplets() ? droplet_integration : TsOptions();
    method.dt = dt;
    scale(method, critical);
    method.implicit = settings_->implicit;
    method.jacobian = settings_->jacobian;
    const FastestRates rates = rates_of(*settings_, critical);
    if (!next && !settings_->dt) method.dt = pliant::standard_step(TsIntegrator(method), std::span(&rates, 1), dt);
    auto ts = std::make_unique<TsIntegrator>(method);
    if (ts->needs_jacobian()) simulation_->particles().check_derivatives();
    settings_->options.check_consumed();
    critical_ = ts->longest_stable_step(rates);
    if (!settings_->allow_unstable_dt)
      check_stable(*ts, {.longest = critical_,
                         .unit = unit_of_time,
                         .given = settings_->dt.has_value(),
                         .rotates = field_->rotates()});
    simulation_->set_integrator(std::move(ts));
  }
  mark_changed();
}

template Simulated<2>::Simulated(const ParticleArrays&, const AnyWalls&, const Box<2>&, const Vec<2>&,
                                 const std::vector<std::string>&);
template Simulated<2>::~Simulated();
template std::unique_ptr<ChangeableField<2>> Simulated<2>::make_field(Settings&, const Walls<2>&) const;
template ParticleSystem<2> Simulated<2>::make_system(const Topology&, const Walls<2>&,
                                                     std::unique_ptr<ForceField<2>>) const;
template void Simulated<2>::rebuild(const std::function<void(ParticleTable&)>&, const std::vector<Index>&);
template Topology Simulated<2>::topology_by_id() const;
template FastestRates Simulated<2>::rates_of(const Settings&, const CriticalStep&) const;
template void Simulated<2>::scale(TsOptions&, const CriticalStep&) const;
template Real Simulated<2>::standard_step(const Settings&, const CriticalStep&) const;
template Real Simulated<2>::check_step(const Settings&, const CriticalStep&) const;
template void Simulated<2>::set_integrator(std::optional<Real>);
template std::pair<std::unique_ptr<Simulation<2>>, ChangeableField<2>*> Simulated<2>::make_engine(
    Topology, const Walls<2>&) const;
template Simulated<3>::Simulated(const ParticleArrays&, const AnyWalls&, const Box<3>&, const Vec<3>&,
                                 const std::vector<std::string>&);
template Simulated<3>::~Simulated();
template std::unique_ptr<ChangeableField<3>> Simulated<3>::make_field(Settings&, const Walls<3>&) const;
template ParticleSystem<3> Simulated<3>::make_system(const Topology&, const Walls<3>&,
                                                     std::unique_ptr<ForceField<3>>) const;
template void Simulated<3>::rebuild(const std::function<void(ParticleTable&)>&, const std::vector<Index>&);
template Topology Simulated<3>::topology_by_id() const;
template FastestRates Simulated<3>::rates_of(const Settings&, const CriticalStep&) const;
template void Simulated<3>::scale(TsOptions&, const CriticalStep&) const;
template Real Simulated<3>::standard_step(const Settings&, const CriticalStep&) const;
template Real Simulated<3>::check_step(const Settings&, const CriticalStep&) const;
template void Simulated<3>::set_integrator(std::optional<Real>);
template std::pair<std::unique_ptr<Simulation<3>>, ChangeableField<3>*> Simulated<3>::make_engine(
    Topology, const Walls<3>&) const;

}  // namespace pliant::python
