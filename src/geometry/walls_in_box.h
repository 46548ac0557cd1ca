// Which walls a periodic box can have.
#pragma once

#include <pliant/geometry/box.h>
#include <pliant/geometry/walls.h>

namespace pliant {

/// Walls act on particles where they are, and particles of a periodic box may be anywhere: walls have to look the same
/// from all images of a place. Segments in the plane run along a periodic direction, far beyond the box on either side;
/// in 3D planes (rays from the axis) go with boxes that are open along z, and upright cylinders with those that are
/// periodic along z alone. Solids do not change along a periodic direction.
/// Errors: InputError for the first other wall.
template <int D>
void check_walls(const Box<D>& box, const Walls<D>& walls) {
  if (box.open()) return;
  constexpr Real far = 1000;  // box lengths
  if (!walls.lips().empty()) throw InputError("a periodic box has no walls with lips; make the box open");
  // Whether a segment reaches so far in a direction that nothing is beyond it.
  const auto reaches = [&](const WallSegment& wall, int axis, Real low, Real high) {
    if (wall.direction[1 - axis] != 0) return false;
    const Real a = wall.origin[axis], b = a + wall.direction[axis] * wall.length;
    return std::min(a, b) <= low && std::max(a, b) >= high;
  };
  Index number = 0;
  for (const WallSegment& wall : walls.segments()) {
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
    ++number;
  }
  for (const Solid<D>& solid : walls.solids()) {
    for (int k = 0; k < D; ++k)
      if (box.periodic(k) && (solid.out[k] != 0 || (!solid.flat() && solid.along[k] != 0)))
        throw InputError(
            "wall {} is not the same in all images of the box, which is periodic in direction {}; its faces must run "
            "along this direction",
            number, k);
    ++number;
  }
}

}  // namespace pliant
