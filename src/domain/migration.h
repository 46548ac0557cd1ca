// Particles that change their place in memory, within a rank and between ranks.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
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
    std::vector<T> leaving(leaving_.size());
    for (std::size_t k = 0; k < leaving.size(); ++k) leaving[k] = values[leaving_[k]];
    const std::vector<T> arrived = ranks_.exchange(std::move(leaving), count_);
    values.resize(order_.size());
    for (std::size_t m = 0; m < order_.size(); ++m) values[m] = arrived[order_[m]];
  }

  /// values [owned points · width]
  template <class T>
  void move_points(std::vector<T>& values, int width) const {
    const auto place = [width](Index point) { return static_cast<std::ptrdiff_t>(point) * width; };
    std::vector<T> leaving(static_cast<std::size_t>(place(offset_.back())));
    auto to = leaving.begin();
    for (const Index m : leaving_)
      to = std::copy(values.begin() + place(offset_[m]), values.begin() + place(offset_[m + 1]), to);
    std::vector<std::size_t> count;
    for (const std::size_t points : point_count_) count.push_back(points * static_cast<std::size_t>(width));
    const std::vector<T> arrived = ranks_.exchange(std::move(leaving), count);
    values.resize(static_cast<std::size_t>(place(arrived_offset_.back())));
    to = values.begin();
    for (const Index k : order_)
      to = std::copy(arrived.begin() + place(arrived_offset_[k]), arrived.begin() + place(arrived_offset_[k + 1]), to);
  }

  /// values [own coordinates]: of the positions of all points, then of their angles.
  void move_coordinates(std::vector<Real>& values, const Coordinates& per_point) const;
  void move(Topology& topology) const;
  void move(State& state, const Coordinates& per_point) const;

  /// Rows that belong to particles: rows [of · width], the k-th goes where own particle of[k] goes. Returns those that
  /// arrive, in no particular order.
  template <class T>
  std::vector<T> send(const std::vector<T>& rows, int width, const std::vector<Index>& of) const {
    std::vector<std::vector<T>> parts(count_.size());
    for (std::size_t k = 0; k < of.size(); ++k)
      parts[destination_[of[k]]].insert(parts[destination_[of[k]]].end(),
                                        rows.begin() + static_cast<std::ptrdiff_t>(k) * width,
                                        rows.begin() + static_cast<std::ptrdiff_t>(k + 1) * width);
    return ranks_.exchange(parts);
  }

 private:
  Ranks ranks_;
  std::vector<int> destination_;       ///< [own particles]
  std::vector<Index> leaving_;         ///< [own particles] in the order in which they are sent, rank by rank
  std::vector<std::size_t> count_,     ///< [ranks] number of particles that are sent to each
      point_count_;                    ///< [ranks] number of their points
  std::vector<Index> offset_;          ///< first point of each particle before the migration
  std::vector<Index> order_;           ///< particle m of the new order is the order_[m]-th that arrived
  std::vector<Index> arrived_offset_;  ///< first point of each arrived particle
};

/// Where particles should be: on the rank of the box they are in, sorted along a Hilbert curve. x [owned points · D].
template <int D>
Migration plan_migration(const Ranks& ranks, const Topology& topology, const Real* x);

}  // namespace pliant
