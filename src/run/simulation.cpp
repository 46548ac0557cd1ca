#include <pliant/run/simulation.h>

#include <algorithm>

namespace pliant {

template <int D>
void Simulation<D>::place(std::span<const Real> x) {
  std::vector<Index> mine;
  for (Index m = ranks().rank(); m < all_.particles(); m += ranks().size()) mine.push_back(m);
  take(mine);
  state_ = State(topology().points(), particles().coordinates().all());
  if (overdamped() && ranks().root()) state_.extra.assign(overdamped()->quantities().size(), 0);
  for (std::size_t k = 0; k < mine.size(); ++k)
    std::copy(x.begin() + static_cast<std::ptrdiff_t>(all_.offset[mine[k]]) * D,
              x.begin() + static_cast<std::ptrdiff_t>(all_.offset[mine[k] + 1]) * D,
              state_.x().begin() + static_cast<std::ptrdiff_t>(topology().offset[k]) * D);
  fresh_ = true;
  forget_velocities();
  if (sorting_ != Sorting::never || ranks().several()) sort();
}

template <int D>
void Simulation<D>::take(std::span<const Index> ids) {
  particles().take(all_.select(ids));
  ++arrangement_;
}

template <int D>
void Simulation<D>::set_integrator(std::unique_ptr<Integrator> integrator) {
  if (integrator) std::visit([&](const auto& system) { integrator->check_system(system); }, system_);
  integrator_ = std::move(integrator);
}

template <int D>
void Simulation<D>::advance(Real t_end, const StepObserver& observer) {
  const bool fresh = std::exchange(fresh_, false);
  std::visit(
      [&]<class S>(S& system) {
        if constexpr (std::is_same_v<S, ParticleSystem<D>>)
          integrator_->run(system, state_, t_end, fresh, observer);
        else
          integrator_->run(system, state_, t_end, observer);
      },
      system_);
}

template <int D>
void Simulation<D>::step() {
  // The end of a run shortens steps: far enough, it does not.
  advance(state_.t + 1e3 * integrator_->next_dt(), [](State&) { return AfterStep::stop; });
}

template <int D>
void Simulation<D>::find_velocities() {
  OverdampedSystem<D>* const system = overdamped();
  State& s = state_;
  if (system == nullptr || velocities_of_ == s.step) return;
  velocities_of_ = s.step;
  if (!system->mobility().remembers() && integrator_->first_same_as_last() && integrator_->statistics().steps > 0 &&
      ranks().all(system->last().size() == s.size())) {
    std::ranges::copy(system->last(), s.v().begin());
    return;
  }
  // The integrator chooses its first step.
  std::vector<Real> guess = system->last(), rates(system->unknowns());
  system->rate(s.t, s.x().data(), rates.data());
  std::copy_n(rates.begin(), s.size(), s.v().begin());
  if (!guess.empty()) system->set_last(std::move(guess));
}

template <int D>
bool Simulation<D>::wants_sorting() const {
  const bool keeps_order = sorting_ == Sorting::never && !ranks().several();
  return (particles().migration_due() && !keeps_order) || (sorting_ == Sorting::regularly && particles().sort_due());
}

template <int D>
Migration Simulation<D>::sort() {
  ++arrangement_;
  const bool carries = !fresh_ && integrator_->carries();
  std::vector<Real> carried;
  if (carries) carried.assign(integrator_->carried().begin(), integrator_->carried().end());
  Migration migration = overdamped() ? overdamped()->sort(state_) : particles().sort(state_, carried);
  if (carries) {
    migration.move_coordinates(carried, particles().coordinates());
    integrator_->set_carried(carried);
  }
  return migration;
}

template class Simulation<2>;
template class Simulation<3>;

}  // namespace pliant
