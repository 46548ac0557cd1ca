// The particles of a hopper's checkpoint, shared out over the ranks that go on with them.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/io/checkpoint.h>
#include <pliant/model/topology.h>

namespace pliant {

/// Place of the lists' skin in the array "numbers" of a hopper's checkpoint.
inline constexpr std::size_t stored_skin = 5;

/// This rank's part: as it was, on as many ranks as before; otherwise an equal one.
class StoredParticles {
 public:
  /// `all`: the particles of the run, in the order of their ids. Errors: std::out_of_range if the checkpoint lacks an
  /// array.
  StoredParticles(const Checkpoint& checkpoint, const Topology& all, int dim, const Ranks& ranks);

  std::span<const Index> ids() const { return ids_; }
  /// values [particles of all ranks]
  template <class T>
  std::span<const T> particles(const std::vector<T>& values) const {
    return std::span(values).subspan(first_, ids_.size());
  }
  /// values [points of all ranks · dim]
  std::span<const Real> points(const std::vector<Real>& values) const {
    return std::span(values).subspan(first_coordinate_, coordinates_);
  }

 private:
  std::vector<Index> ids_;
  std::size_t first_ = 0, first_coordinate_ = 0, coordinates_ = 0;
};

}  // namespace pliant
