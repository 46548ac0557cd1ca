// A frame of a run, and the datasets that it becomes in run.h5.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/base/types.h>
#include <pliant/io/hdf5.h>

namespace pliant {

/// Numbers of each structure in an array; the numbers of the first structure are at `data`, of the next `stride` bytes
/// further.
template <class T>
struct Strided {
  const T* data = nullptr;
  std::size_t stride = 0;
  const T* operator[](std::size_t k) const {
    return reinterpret_cast<const T*>(reinterpret_cast<const char*>(data) + k * stride);
  }
};

/// C contacts between particles, or K with walls, of a frame in D dimensions; the arrays are the caller's.
struct FrameContacts {
  std::uint64_t count = 0;         ///< C or K
  Strided<Index> particles;        ///< [C, 2] the two particles, or [K, 2] the particle and the wall
  Strided<Real> position, normal;  ///< [C, D], the normal towards the first particle
  Strided<Real> overlap;           ///< [C]
  Strided<Real> force;             ///< [C, D], on the first particle
  Strided<Real> friction = {};     ///< [C, D], the part of the force by friction and damping; without data: 0
};

/// Groups of datasets that a frame can leave out, by the name of the dataset or group. Positions, centres, `active`,
/// `images` and moving walls are in every frame.
inline constexpr std::array<std::string_view, 14> frame_field_names{
    "velocities",   "angles",        "spins",           "area",  "perimeter", "volume",        "surface_area",
    "reinsertions", "contact_count", "particle_stress", "modes", "contacts",  "wall_contacts", "wall_force"};

/// The fields of a frame in the file, and the storage format of its real numbers.
struct FrameFormat {
  std::set<std::string, std::less<>> fields{frame_field_names.begin(), frame_field_names.end()};
  bool single = false;  ///< real numbers of 4 bytes; of 8 otherwise
  int deflate = 0;      ///< level of compression, 0 (none) to 9

  bool has(std::string_view field) const { return fields.contains(field); }
  /// Errors: InputError if frames are to be compressed and the HDF5 library cannot.
  void check(bool can_deflate = hdf5::can_deflate()) const;
};

/// The fields in a list such as "velocities,contacts"; "all"; or "positions" for no fields. Errors: InputError that
/// names the option and lists the fields.
std::set<std::string, std::less<>> parse_frame_fields(std::string_view list);

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
  std::span<const Index> reinsertions = {};  ///< [N] how often each was reinserted, or empty; on every rank or none
  std::span<const Real> area, perimeter;     ///< [N] of polygons, or empty
  std::span<const Real> volume = {}, surface_area = {};  ///< [N] of closed surfaces, or empty
  std::span<const Real> particle_stress = {};  ///< [N, D (D + 1)/2] upper triangles, or empty; on every rank or none
  std::span<const Real> modes = {};            ///< [P, K · D] displacements of K modes, one after the other, or empty
  std::size_t mode_width = 0;                  ///< K · D, the same on every rank; 0: no modes
  std::span<const Real> wall_force;            ///< [S, D]
  std::span<const Real> angles = {}, spins = {};  ///< [N, 1 or 3] where particles rotate, or empty
  std::span<const Real> wall_segments = {};       ///< [S, 4] where the walls are now, or empty: as in the geometry
  std::span<const Real> box = {};  ///< [3, D] origin, lengths and tilt factors of a periodic box, or empty: open
  FrameContacts contacts, wall_contacts;
  std::map<std::string, Real> attributes = {};  ///< attributes of the scenario, in addition to time and step; from the
                                                ///< root
};

/// A dataset of a frame: this rank's rows of it.
struct FrameArray {
  std::string name;
  hdf5::Type type;
  hdf5::Shape shape;          ///< shape of the rows of all ranks
  std::uint64_t first, rows;  ///< range of this rank
  /// Writes `count` rows of this rank to `to`, from row `from` on.
  std::function<void(std::uint64_t from, std::uint64_t count, void* to)> make;
  std::uint64_t row_bytes() const { return hdf5::row_width(shape) * hdf5::size_of(type); }
};

/// All arrays of a frame that are per particle, point or contact, and how many there are of these on all ranks.
struct FrameLayout {
  /// Collective. The frame must outlive the layout. Errors: std::invalid_argument if its arrays do not fit together.
  FrameLayout(const Frame& frame, int dim, const Ranks& ranks, const FrameFormat& format = {});
  std::uint64_t particles = 0, points = 0;
  bool own_centres = false;  ///< particles have several points: centres are not the positions
  std::vector<FrameArray> arrays;
};

}  // namespace pliant
