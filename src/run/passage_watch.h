// Finds particles that have passed through walls or each other, and checks again as soon as a passage is possible.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <pliant/model/state.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// Finds a point (the centre of a disk or sphere, or a vertex of a polygon) that has crossed a wall segment, or has
/// entered a solid or a disk of the walls, in the first accepted state in which it has, as a check after every step
/// would: a point and a wall cannot meet before the sum of their displacements reaches their distance. Therefore
/// PassageWatch stores the smallest distance, and checks again when the motion reaches it, which takes tens to hundreds
/// of steps. A point has crossed a segment if its path since the last check, as the moving wall sees it, meets the
/// segment; so a particle may be on either side of a wall at the start. A point that crosses and returns within a
/// single step is not found. The watch reads the neighbour lists and never rebuilds them, so it changes no number of a
/// run. Disks, spheres and droplets have passed through each other where they overlap by more than passing_overlap,
/// with inertia also where they have done so in the course of a step, on straight lines; of polygons CrossingWatch
/// finds this. All functions are collective. Errors: NumericalError on all ranks, which names particles, wall and
/// cures.
template <int D>
class PassageWatch {
 public:
  /// Whether particles may pass through each other. advice: end of the message if they may not.
  void allow_overlaps(bool allowed, std::string advice = {}) {
    overlaps_allowed_ = allowed;
    advice_ = std::move(advice);
  }
  /// Such overlaps are recorded, for take_overlap(), and are not errors.
  void record_overlaps() { records_ = true; }
  void ignore_walls() { ignores_walls_ = true; }
  /// The largest recorded overlap since the last call, on all ranks; 0 without any.
  Real take_overlap() { return std::exchange(recorded_, 0); }
  /// Without inertia velocities are not part of the state.
  void have_inertia(bool inertia) { inertia_ = inertia; }
  /// To be called before the first step, and after particles or walls were placed elsewhere or particles reordered.
  void start(ParticleSystem<D>& system, const State& s);
  /// Own particle m, of one point, was moved to a place where it overlaps nothing. Not collective.
  void reinserted(Index m, const State& s);
  /// After every step.
  void after_step(ParticleSystem<D>& system, const State& s);

 private:
  /// moved: upper bound of the motion of a point relative to a wall since the last check. h: length of the last step.
  void look(ParticleSystem<D>& system, const State& s, Real moved, Real h);

  bool watches_walls(const ParticleSystem<D>& system) const;
  bool watches_pairs(const ParticleSystem<D>& system) const;
  /// Half the distance that any two particles may approach. Errors: NumericalError.
  Real look_at_pairs(ParticleSystem<D>& system, const State& s, Real h);

  bool overlaps_allowed_ = false, inertia_ = true, records_ = false, ignores_walls_ = false;
  Real recorded_ = 0;
  std::string advice_;
  Real gap_ = 0;                 ///< nothing can pass before a point has moved by this, relative to walls
  Real t_ = 0;                   ///< time of the last check
  std::vector<Real> reference_;  ///< positions of the own points then
  Real last_t_ = 0;              ///< time of the last step
};

}  // namespace pliant
