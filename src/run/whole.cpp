#include <pliant/run/whole.h>

#include <algorithm>
#include <span>

namespace pliant {

/// [own points · D] of the ranks to [points · D] of all, on every rank.
template <int D>
void Whole<D>::gather(std::span<const Real> own, std::span<Real> all) {
  const Ranks& ranks = simulation_.ranks();
  const Topology &part = simulation_.topology(), &whole = copy_->topology();
  if (arrangement_ != simulation_.arrangement()) {
    ids_ = ranks.all_gather(std::vector<Index>(part.id.begin(), part.id.begin() + part.owned()));
    arrangement_ = simulation_.arrangement();
  }
  const std::vector<Real> values = ranks.all_gather(std::vector<Real>(own.begin(), own.end()));
  auto from = values.begin();
  for (const Index id : ids_) {
    const auto count = static_cast<std::ptrdiff_t>(whole.points_of(id)) * D;
    std::copy_n(from, count, all.begin() + static_cast<std::ptrdiff_t>(whole.offset[id]) * D);
    from += count;
  }
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
