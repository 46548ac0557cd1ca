// Changes by Python: parameters, particles, walls.
#include <algorithm>
#include <set>
#include <utility>

#include <pliant/python/simulated.h>

namespace pliant::python {

template <int D>
void Simulated<D>::configure(const std::vector<std::string>& arguments) {
  const EngineUse use(EngineUse::Kind::access);
  check_usable();
  auto settings = std::make_unique<Settings>(arguments);
  if (settings->model.name != settings_->model.name)
    throw InputError("the model of a simulation is {} and cannot become {}; make another simulation",
                     settings_->model.name, settings->model.name);
  auto field = make_field(*settings, simulation().particles().walls());
  const CriticalStep critical = critical_of(*field);
  check_step(*settings, critical);
  // The mobility has coefficients, too.
  if (!overdamped() && field_->fits(*field)) {
    audit_->disturb();
    field_->take_model(std::move(*field));
    simulation_->particles().coefficients_changed();
    settings_ = std::move(settings);
    if (settings_->dt || settings_->method == Method::ts ||
        !(standard_step(*settings_, critical) > 0.8 * dt() && standard_step(*settings_, critical) < 1.25 * dt()))
      defer([this] {
        before_.force_evaluations += simulation_->integrator().statistics().force_evaluations;
        set_integrator();
      });
  } else {
    settings_ = std::move(settings);
    defer([this] { rebuild([](ParticleTable&) {}); });
  }
  note_change();
}

template <int D>
void Simulated<D>::add(const ParticleArrays& arrays) {
  const EngineUse use(EngineUse::Kind::access);
  check_usable();
  keep_particles();
  take_changes();
  ParticleTable trial;
  append_particles<D>(trial, arrays);
  const auto count = trial.topology.particles();
  for (Index k = 0; k < count; ++k) new_ids_.push_back(next_id_++);
  defer([this, arrays] { rebuild([&](ParticleTable& all) { append_particles<D>(all, arrays); }); });
}

template <int D>
void Simulated<D>::remove(const std::vector<Index>& ids) {
  const EngineUse use(EngineUse::Kind::access);
  check_usable();
  keep_particles();
  take_changes();
  const std::set<Index> gone(ids.begin(), ids.end());
  for (const Index id : gone)
    if (std::ranges::find(ids_, id) == ids_.end() && std::ranges::find(new_ids_, id) == new_ids_.end())
      throw InputError("there is no particle with the id {}; see ids", id);
  if (gone.size() >= ids_.size() + new_ids_.size())
    throw InputError("remove() of all {} particles; keep at least one", gone.size());
  defer([this, gone] {
    std::vector<Index> kept;
    for (std::size_t k = 0; k < ids_.size(); ++k)
      if (!gone.contains(ids_[k])) kept.push_back(static_cast<Index>(k));
    if (kept.size() < ids_.size()) rebuild([&](ParticleTable& all) { all = select_particles<D>(all, kept); }, kept);
  });
}

template <int D>
void Simulated<D>::move_wall(Index body, const MotionArguments& arguments) {
  const EngineUse use(EngineUse::Kind::access);
  check_usable();
  Walls<D> walls = simulation().particles().walls();
  if (body < 0 || body >= walls.bodies())
    throw InputError("there is no wall {}; this simulation has {}, from 0 on", body, walls.bodies());
  const Motion<D> motion = motion_of<D>(arguments, t());
  wall_record_.moves(walls, body, t());
  walls.set_motion(body, motion);
  audit_->disturb(EnergyAudit<D>::Change::velocities);
  simulation_->particles().set_walls(std::move(walls));
  note_change();
}

template <int D>
void Simulated<D>::apply() {
  const std::vector<std::function<void()>> changes = std::exchange(deferred_, {});
  for (const auto& change : changes) change();
}

template void Simulated<2>::configure(const std::vector<std::string>&);
template void Simulated<2>::add(const ParticleArrays&);
template void Simulated<2>::remove(const std::vector<Index>&);
template void Simulated<2>::move_wall(Index, const MotionArguments&);
template void Simulated<2>::apply();
template void Simulated<3>::configure(const std::vector<std::string>&);
template void Simulated<3>::add(const ParticleArrays&);
template void Simulated<3>::remove(const std::vector<Index>&);
template void Simulated<3>::move_wall(Index, const MotionArguments&);
template void Simulated<3>::apply();

}  // namespace pliant::python
