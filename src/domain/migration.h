// Particles that change their place in memory, within a rank and between ranks.
#pragma once

#include <cstdint>
#include <numeric>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/model/state.h>
#include <pliant/model/topology.h>

namespace pliant {

/// A new place for every particle, to be applied to all data per particle or per point. All functions are collective.
class Migration {
 public:
  /// Particle m of this rank goes to rank destination[m]; there, particles are sorted by key, equal keys by id. Ghosts
  /// are removed.
  Migration(const Ranks& ranks, const Topology& topology, const std::vector<int>& destination,
            const std::vector<std::uint64_t>& key);

  /// values [owned particles]
  template <class T>
  void move(std::vector<T>& values) const {
    std::vector<std::vector<T>> parts(leaving_.size());
    for (std::size_t r = 0; r < leaving_.size(); ++r)
      for (const Index m : leaving_[r]) parts[r].push_back(values[m]);
    const std::vector<T> arrived = ranks_.exchange(parts);
    values.resize(order_.size());
    for (std::size_t m = 0; m < order_.size(); ++m) values[m] = arrived[order_[m]];
  }

  /// values [owned points · width]
  template <class T>
  void move_points(std::vector<T>& values, int width) const {
    std::vector<std::vector<T>> parts(leaving_.size());
    for (std::size_t r = 0; r < leaving_.size(); ++r)
      for (const Index m : leaving_[r])
        parts[r].insert(parts[r].end(), values.begin() + static_cast<std::size_t>(offset_[m]) * width,
                        values.begin() + static_cast<std::size_t>(offset_[m + 1]) * width);
    const std::vector<T> arrived = ranks_.exchange(parts);
    values.clear();
    for (const Index k : order_)
      values.insert(values.end(), arrived.begin() + static_cast<std::size_t>(arrived_offset_[k]) * width,
                    arrived.begin() + static_cast<std::size_t>(arrived_offset_[k + 1]) * width);
  }

  /// values [own coordinates]: of the positions of all points, then of their angles.
  void move_coordinates(std::vector<Real>& values, const Coordinates& per_point) const;
  void move(Topology& topology) const;
  void move(State& state, const Coordinates& per_point) const;

  /// Rows that belong to particles: rows [of · width], the k-th goes where own particle of[k] goes. Returns those that
  /// arrive, in no particular order.
  template <class T>
  std::vector<T> send(const std::vector<T>& rows, int width, const std::vector<Index>& of) const {
    std::vector<std::vector<T>> parts(leaving_.size());
    for (std::size_t k = 0; k < of.size(); ++k)
      parts[destination_[of[k]]].insert(parts[destination_[of[k]]].end(),
                                        rows.begin() + static_cast<std::ptrdiff_t>(k) * width,
                                        rows.begin() + static_cast<std::ptrdiff_t>(k + 1) * width);
    return ranks_.exchange(parts);
  }

 private:
  Ranks ranks_;
  std::vector<std::vector<Index>> leaving_;  ///< [ranks]: own particles in the order in which they are sent
  std::vector<int> destination_;             ///< [own particles]
  std::vector<Index> offset_;                ///< first point of each particle before the migration
  std::vector<Index> order_;                 ///< particle m of the new order is the order_[m]-th that arrived
  std::vector<Index> arrived_offset_;        ///< first point of each arrived particle
};

/// Where particles should be: on the rank of the box they are in, sorted along a Hilbert curve. x [owned points · D].
template <int D>
Migration plan_migration(const Ranks& ranks, const Topology& topology, const Real* x);

}  // namespace pliant
