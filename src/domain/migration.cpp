#include <pliant/domain/migration.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include <pliant/domain/hilbert.h>
#include <pliant/domain/partition.h>
#include <pliant/model/polygon.h>

namespace pliant {

Migration::Migration(const Ranks& ranks, const Topology& topology, const std::vector<int>& destination,
                     const std::vector<std::uint64_t>& key)
    : ranks_(ranks), destination_(destination), count_(ranks.size()), point_count_(ranks.size()) {
  const auto own = static_cast<std::size_t>(topology.owned());
  offset_.assign(topology.offset.begin(), topology.offset.begin() + topology.owned() + 1);
  for (Index m = 0; m < topology.owned(); ++m) {
    ++count_[destination[m]];
    point_count_[destination[m]] += topology.points_of(m);
  }
  std::vector<std::size_t> next(ranks.size());
  std::exclusive_scan(count_.begin(), count_.end(), next.begin(), std::size_t(0));
  struct Traveller {
    std::uint64_t key;
    Index id, points;
  };
  std::vector<Traveller> leaving(own);
  leaving_.resize(own);
  for (Index m = 0; m < topology.owned(); ++m) {
    const std::size_t k = next[destination[m]]++;
    leaving_[k] = m;
    leaving[k] = {key[m], topology.id[m], topology.points_of(m)};
  }
  const std::vector<Traveller> arrived = ranks.exchange(std::move(leaving), count_);
  struct Place {
    std::uint64_t key;
    Index id, arrival;
    auto operator<=>(const Place&) const = default;
  };
  std::vector<Place> places(arrived.size());
  arrived_offset_.assign(arrived.size() + 1, 0);
  for (std::size_t k = 0; k < arrived.size(); ++k) {
    places[k] = {arrived[k].key, arrived[k].id, static_cast<Index>(k)};
    arrived_offset_[k + 1] = arrived_offset_[k] + arrived[k].points;
  }
  std::ranges::sort(places);
  order_.resize(arrived.size());
  std::ranges::transform(places, order_.begin(), &Place::arrival);
}

void Migration::move(Topology& topology) const {
  topology.drop_ghosts();
  move_points(topology.diameter, 1);
  move(topology.point_mass);
  move(topology.inverse_point_mass);
  move(topology.inertia);
  move(topology.inverse_inertia);
  move(topology.sigma);
  move(topology.a0);
  move(topology.l0);
  move(topology.active);
  move(topology.id);
  std::vector<Index> points;
  points.reserve(order_.size());
  for (const Index k : order_) points.push_back(arrived_offset_[k + 1] - arrived_offset_[k]);
  topology.connect(points);
}

void Migration::move_coordinates(std::vector<Real>& values, const Coordinates& per_point) const {
  if (per_point.angles == 0) return move_points(values, per_point.positions);
  const auto split =
      values.begin() + static_cast<std::ptrdiff_t>(values.size()) / per_point.all() * per_point.positions;
  std::vector<Real> angles(split, values.end());
  values.erase(split, values.end());
  move_points(values, per_point.positions);
  move_points(angles, per_point.angles);
  values.insert(values.end(), angles.begin(), angles.end());
}

void Migration::move(State& state, const Coordinates& per_point) const {
  std::vector<Real> x(state.x().begin(), state.x().end()), v(state.v().begin(), state.v().end());
  move_coordinates(x, per_point);
  move_coordinates(v, per_point);
  state.assign(x, v);
}

template <int D>
Migration plan_migration(const Ranks& ranks, const Topology& topology, const Real* x) {
  constexpr int bits = 16;
  const auto n = static_cast<std::size_t>(topology.owned());
  std::vector<Real> centres(n * D), weights(n);
  std::vector<Real> box(2 * D, -std::numeric_limits<Real>::max());  // −low, high
  for (std::size_t m = 0; m < n; ++m) {
    const Vec<D> centre = mean_of_points<D>(x, topology, static_cast<Index>(m));
    point<D>(centres.data(), static_cast<Index>(m)) = centre;
    weights[m] = topology.points_of(static_cast<Index>(m));
    for (int k = 0; k < D; ++k) {
      box[k] = std::max(box[k], -centre[k]);
      box[D + k] = std::max(box[D + k], centre[k]);
    }
  }
  ranks.max(box);
  Real side = 0;
  for (int k = 0; k < D; ++k) side = std::max(side, box[k] + box[D + k]);
  const Real cells = side > 0 ? ((1 << bits) - 1) / side : 0;
  std::vector<std::uint64_t> key(n);
  for (std::size_t m = 0; m < n; ++m) {
    std::array<std::uint32_t, D> cell;
    for (int k = 0; k < D; ++k) cell[k] = static_cast<std::uint32_t>((centres[m * D + k] + box[k]) * cells);
    key[m] = hilbert_key<D>(cell, bits);
  }
  return Migration(ranks, topology, bisect<D>(ranks, centres, weights), key);
}

template Migration plan_migration<2>(const Ranks&, const Topology&, const Real*);
template Migration plan_migration<3>(const Ranks&, const Topology&, const Real*);

}  // namespace pliant
