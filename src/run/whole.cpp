#include <pliant/run/whole.h>

#include <algorithm>
#include <span>

namespace pliant {

/// Coordinates or velocities of the ranks' own particles to those of all, on every rank.
template <int D>
void Whole<D>::gather(std::span<const Real> own, std::span<Real> all) {
  const Ranks& ranks = simulation_.ranks();
  const Topology &part = simulation_.topology(), &whole = copy_->topology();
  if (arrangement_ != simulation_.arrangement()) {
    ids_ = ranks.all_gather(std::vector<Index>(part.id.begin(), part.id.begin() + part.owned()));
    arrangement_ = simulation_.arrangement();
  }
  const auto put = [&](std::span<const Real> own_values, std::span<Real> all_values, int width) {
    const std::vector<Real> values = ranks.all_gather(std::vector<Real>(own_values.begin(), own_values.end()));
    auto from = values.begin();
    for (const Index id : ids_) {
      const auto count = static_cast<std::ptrdiff_t>(whole.points_of(id)) * width;
      std::copy_n(from, count, all_values.begin() + static_cast<std::ptrdiff_t>(whole.offset[id]) * width);
      from += count;
    }
  };
  const ParticleSystem<D>& particles = simulation_.particles();
  put(particles.positions_in(own), copy_->positions_in(all), D);
  if (const int width = particles.coordinates().angles; width > 0)
    put(particles.rotations_in(own), copy_->rotations_in(all), width);
}

template <int D>
void Whole<D>::restore() {
  update();
  if (!copy_) return;
  const Topology& part = simulation_.topology();
  std::vector<Index> gone;
  for (Index k = 0; k < part.owned(); ++k)
    if (part.active[k] == 0) gone.push_back(part.id[k]);
  for (const Index m : simulation_.ranks().all_gather(gone)) copy_->deactivate(m);
}

template <int D>
void Whole<D>::update() {
  if (!copy_) return;
  copy_state_.t = simulation_.state().t;
  copy_state_.step = simulation_.state().step;
  gather(simulation_.state().x(), copy_state_.x());
  for (const ContactTable& table : std::as_const(simulation_).particles().history().tables()) {
    const StoredContacts own = table.contacts();
    const Ranks& ranks = simulation_.ranks();
    copy_->history().set(table.needs().name, {ranks.all_gather(own.keys), ranks.all_gather(own.values)});
  }
}

template <int D>
void Whole<D>::update_velocities() {
  if (copy_) gather(simulation_.state().v(), copy_state_.v());
}

template <int D>
void Whole<D>::set_walls(const Walls<D>& walls) {
  simulation_.particles().set_walls(walls);
  if (copy_) copy_->set_walls(walls);
}

template <int D>
void Whole<D>::deactivate(Index m) {
  const Topology& own = simulation_.topology();
  for (Index k = 0; k < own.owned(); ++k)
    if (own.id[k] == m) simulation_.particles().deactivate(k);
  if (copy_) copy_->deactivate(m);
}

template class Whole<2>;
template class Whole<3>;

}  // namespace pliant
