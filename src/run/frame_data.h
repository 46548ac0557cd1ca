// Frames of a system of particles.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <pliant/io/frame.h>
#include <pliant/model/state.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// Centres of the own particles, and their velocities: [owned · D].
template <int D>
struct Centres {
  std::vector<Real> position, velocity;
  void update(const Topology& topology, const State& state);
};

/// A contact of a frame: of two particles, the lower id first, or of a particle and a wall. Plain data, to be sent.
template <int D>
struct ContactRecord {
  std::array<Index, 2> particles;
  Real overlap;
  std::array<Real, D> position, normal, force;
  std::array<Real, D> friction;  ///< the part of the force by friction and damping
};

/// A frame with particles and contacts in the order of their ids: each rank has an equal share of the ids, the root the
/// first. In a periodic box particles are where their centres are in it, whole, and contacts at the first particle.
/// Owns the arrays. The constructor is collective.
template <int D>
class FrameData {
 public:
  /// reinsertions: how often each own particle was reinserted; null: no particle ever is. wall_contacts: whether to
  /// find them, which costs some evaluations of forces. stress: of each particle.
  /// modes: displacements [own points · K · D], or null.
  FrameData(ParticleSystem<D>& system, const State& state, const std::vector<Index>* reinsertions = nullptr,
            bool wall_contacts = true, bool stress = false, const std::vector<Real>* modes = nullptr);
  FrameData(const FrameData&) = delete;
  FrameData& operator=(const FrameData&) = delete;
  Frame frame;

 private:
  void find_contacts(ParticleSystem<D>& system, const StateView<D>& view);

  std::vector<Real> positions_, velocities_, angles_, spins_, wall_force_;
  std::vector<Real> centres_;        ///< deformable particles only; the centre of a soft particle is its position
  std::vector<Real> content_, rim_;  ///< area and perimeter of polygons, volume and area of closed surfaces
  std::vector<Real> particle_stress_, modes_;
  std::vector<std::uint8_t> active_;
  std::vector<std::int64_t> images_;  ///< in a periodic box
  std::vector<Real> box_;             ///< its origin, lengths and tilt factors
  std::vector<Index> offset_, contact_count_, reinsertions_;
  std::vector<ContactRecord<D>> contacts_, wall_contacts_;
};

}  // namespace pliant
