// The walls that a periodic box may have.
#pragma once

#include <pliant/geometry/box.h>
#include <pliant/geometry/walls.h>

namespace pliant {

/// Walls act on particles at their positions, which may lie in any image of a periodic box: therefore walls must be
/// equal in all images. Segments in the plane run along a periodic direction, far beyond the box on either side; in 3D
/// planes (rays from the axis) go with boxes that are open along z, and upright cylinders with boxes that are periodic
/// along z only. A tilted box has no walls. Solids do not change along a periodic direction. Walls that move do not
/// turn, and segments do not move along a periodic direction. Errors: InputError for the first other wall.
template <int D>
void check_walls(const Box<D>& box, const Walls<D>& walls) {
  if (box.open()) return;
  constexpr Real far = 1000;  // box lengths
  if (box.tilted() && walls.size() > 0) throw InputError("a tilted box has no walls; leave out the tilt or the walls");
  if (D == 2 && !walls.lips().empty()) throw InputError("a periodic box has no walls with lips; make the box open");
  // Whether a segment reaches so far in a direction that nothing is beyond it.
  const auto reaches = [&](const WallSegment& wall, int axis, Real low, Real high) {
    if (wall.direction[1 - axis] != 0) return false;
    const Real a = wall.origin[axis], b = a + wall.direction[axis] * wall.length;
    return std::min(a, b) <= low && std::max(a, b) >= high;
  };
  for (Index part = 0; part < walls.part_count(); ++part) {
    const Index number = walls.wall_of_part(part), body = walls.body_of_wall(number);
    const Motion<D>& motion = walls.motion(body);
    const Pose<D> start = walls.pose(body, motion.since);
    if (motion.turns() || start.turned)
      throw InputError("wall {} turns, which walls of a periodic box cannot; make the box open", number);
    if (walls.solid(part, 0)) continue;
    for (int k = 0; k < D; ++k)
      if (box.periodic(k) &&
          (motion.velocity[k] != 0 || (motion.oscillates() && motion.amplitude[k] != 0) || start.shift[k] != 0))
        throw InputError(
            "wall {} is a segment that moves along direction {}, in which the box is periodic; make it a half-space",
            number, k);
  }
  for (Index s = 0; s < static_cast<Index>(walls.segments().size()); ++s) {
    const WallSegment& wall = walls.segments()[s];
    const Index number = walls.wall_of_part(s);
    for (int k = 0; k < D; ++k) {
      if (!box.periodic(k)) continue;
      const Real low = box.origin()[k] - far * box.length()[k], high = box.origin()[k] + far * box.length()[k];
      const bool radial = D == 3 && k < 2;  // the meridian has ρ and z
      if (!reaches(wall, D == 3 && k == 2 ? 1 : radial ? 0 : k, radial ? 0 : low, radial ? std::max(-low, high) : high))
        throw InputError(
            "wall {} is not the same in all images of the box, which is periodic in direction {} with length {:g}; "
            "walls must run along this direction, {:g} lengths beyond the box at least",
            number, k, box.length()[k], far);
    }
  }
  for (Index part = 0; part < walls.part_count(); ++part)
    if (const std::optional<Solid<D>> solid = walls.solid(part, 0))
      for (int k = 0; k < D; ++k)
        if (box.periodic(k) && (solid->out[k] != 0 || (!solid->flat() && solid->along[k] != 0)))
          throw InputError(
              "wall {} is not the same in all images of the box, which is periodic in direction {}; its faces must run "
              "along this direction",
              walls.wall_of_part(part), k);
}

}  // namespace pliant
