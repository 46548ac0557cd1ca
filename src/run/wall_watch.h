// Finds points that have passed through walls, and checks again as soon as a passage is possible.
#pragma once

#include <vector>

#include <pliant/model/state.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// Finds a point (the centre of a disk or sphere, or a vertex of a polygon) that has crossed a wall segment, or has
/// entered a solid or a disk of the walls, in the first accepted state in which it has, as a check after every step
/// would: a point and a wall cannot meet before the sum of their displacements reaches their distance. Therefore
/// WallWatch stores the smallest distance, and checks again when the motion reaches it, which takes tens to hundreds of
/// steps. A point has crossed a segment if its path since the last check, as the moving wall sees it, meets the
/// segment; so a particle may be on either side of a wall at the start. A point that crosses and returns within a
/// single step is not found. The watch reads the neighbour lists and never rebuilds them, so it changes no number of a
/// run. All functions are collective, and do nothing where no wall acts. Errors: NumericalError on all ranks, which
/// names particle, wall and cures.
template <int D>
class WallWatch {
 public:
  /// To be called before the first step, and after particles or walls were placed elsewhere or particles reordered.
  void start(ParticleSystem<D>& system, const State& s);
  /// After every step.
  void after_step(ParticleSystem<D>& system, const State& s);

 private:
  /// moved: upper bound of the motion of a point relative to a wall since the last check.
  void look(ParticleSystem<D>& system, const State& s, Real moved);

  Real gap_ = 0;                 ///< no point can meet a wall before it has moved by this relative to the wall
  Real t_ = 0;                   ///< time of the last check
  std::vector<Real> reference_;  ///< positions of the own points then
};

}  // namespace pliant
