// A frame of a run, and the datasets that it becomes in run.h5.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/base/types.h>
#include <pliant/io/hdf5.h>

namespace pliant {

/// Equally many numbers of each of some structures in an array; the first ones at `data`, others `stride` bytes apart.
template <class T>
struct Strided {
  const T* data = nullptr;
  std::size_t stride = 0;
  const T* operator[](std::size_t k) const {
    return reinterpret_cast<const T*>(reinterpret_cast<const char*>(data) + k * stride);
  }
};

/// C contacts of a frame in D dimensions; the arrays are the caller's.
struct FrameContacts {
  std::uint64_t count = 0;         ///< C
  Strided<Index> particles;        ///< [C, 2]; the second is −1 for a wall
  Strided<Real> position, normal;  ///< [C, D]
  Strided<Real> ends;              ///< [C, 2, D] the particles' centres; of a wall, where it is touched
  Strided<Real> overlap;           ///< [C]
  Strided<Real> force;             ///< [C, D], on the first particle
};

/// One frame of N particles with P points in D dimensions; the arrays are the caller's. On several ranks, the rank's
/// share of it: a frame is the shares one after the other, but the forces on walls are the root's.
struct Frame {
  Real time = 0;  ///< t0
  std::int64_t step = 0;
  std::span<const Index> offset;                ///< [N + 1] of the points of each particle, from 0
  std::span<const Real> positions, velocities;  ///< [P, D]
  std::span<const Real> centres;                ///< [N, D]
  std::span<const std::uint8_t> active;         ///< [N]
  std::span<const std::int64_t> images =
      {};                                ///< [N, D] box lengths by which particles were wrapped; on every rank or none
  std::span<const Index> contact_count;  ///< [N]
  std::span<const Real> a0, area, perimeter;      ///< [N] of polygons, or empty
  std::span<const Real> wall_force;               ///< [S, D]
  std::span<const Real> angles = {}, spins = {};  ///< [N, 1 or 3] where particles rotate, or empty
  std::span<const Real> wall_segments = {};       ///< [S, 4] where the walls are now, or empty: as in the geometry
  FrameContacts contacts;
  std::map<std::string, Real> attributes = {};  ///< of the scenario, beside time and step; the root's
};

/// A dataset of a frame: this rank's rows of it.
struct FrameArray {
  std::string name;
  hdf5::Type type;
  hdf5::Shape shape;          ///< of the rows of all ranks
  std::uint64_t first, rows;  ///< of this rank
  /// Puts `count` of this rank's rows, from its row `from` on.
  std::function<void(std::uint64_t from, std::uint64_t count, void* to)> make;
  std::uint64_t row_bytes() const { return hdf5::row_width(shape) * hdf5::size_of(type); }
};

/// All arrays of a frame that are per particle, point or contact, and how many there are of these on all ranks.
struct FrameLayout {
  /// Collective. The frame must outlive the layout. Errors: std::invalid_argument if its arrays do not fit together.
  FrameLayout(const Frame& frame, int dim, const Ranks& ranks);
  std::uint64_t particles = 0, points = 0, contacts = 0;
  bool polygons = false;
  std::vector<FrameArray> arrays;
};

}  // namespace pliant
