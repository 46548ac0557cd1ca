// The region of the particles, of any shape: for packing, reinsertion, counting and checks.
#pragma once

#include <variant>

#include <pliant/geometry/hopper.h>
#include <pliant/geometry/obstacle.h>
#include <pliant/geometry/vessel.h>

namespace pliant {

/// Where r is in the plane of a container: (x, y), in 3D (ρ, z).
template <int D>
Vec<2> in_plane(const Vec<D>& r) {
  if constexpr (D == 2)
    return {r[0], r[1]};
  else
    return {std::hypot(r[0], r[1]), r[2]};
}

/// Energy of a point that touches both walls of an inner corner of a container: counted once, V + V − V(joint), so that
/// forces do not depend on how finely an outline is divided; or literal, V + V [H 10].
enum class CornerRule { once, literal };

/// Walls around a region above an orifice, which is centred on the axis at y = 0, with obstacles in the region. The
/// upper end is open, with vertical walls of infinite height. Points are given in its plane. In 3D the region is a
/// figure of revolution.
class Container {
 public:
  Container(const Hopper& hopper, std::vector<Obstacle> obstacles = {},  // NOLINT: a hopper is a container
            CornerRule corners = CornerRule::once)
      : shape_(hopper), obstacles_(std::move(obstacles)), corners_(corners) {}
  Container(Vessel vessel, std::vector<Obstacle> obstacles = {},  // NOLINT: so is a vessel
            CornerRule corners = CornerRule::once)
      : shape_(std::move(vessel)), obstacles_(std::move(obstacles)), corners_(corners) {}

  /// Whether it is a hopper, without obstacles.
  bool plain() const { return obstacles_.empty() && std::holds_alternative<Hopper>(shape_); }

  /// Width (diameter) of the orifice.
  Real orifice() const;
  /// Least and largest x between the upright walls, where particles come in; in 3D the diameter there.
  Vec<2> inflow() const;
  Real inflow_width() const { return inflow()[1] - inflow()[0]; }
  /// Least and largest x of all walls.
  Vec<2> extent() const;
  /// Height from which on the walls are upright.
  Real upright_from() const;
  /// Half width of the region at height y, without obstacles; below the orifice half the orifice width.
  Real half_width(int dim, Real y) const;
  /// Whether p is above the orifice line, between the walls and in no obstacle.
  bool inside(int dim, const Vec<2>& p) const;
  /// Whether a disk (sphere) of this radius can start at r, to be pushed to its place from there: the disk overlaps
  /// upright and sloped walls only where the region is too narrow for it, and its distance is at least `margin` of its
  /// radius from all other walls. walls: the walls of this container.
  template <int D>
  bool has_room(const Walls<D>& walls, const Vec<D>& r, Real radius, Real margin) const;
  /// Area (volume) between the orifice and height y.
  Real capacity(int dim, Real y) const;
  /// Area (volume) of the points inside with |x| (in 3D the distance from the axis) below `half`, up to this height.
  Real capacity_near_axis(int dim, Real half, Real height) const;
  /// Height up to which the content fills it.
  Real fill_height(int dim, Real content) const;

  /// Its walls as segments, the obstacles last.
  WallParts parts(int dim) const;
  /// The body that each segment of `parts` belongs to: 0 the left side, 1 the right side (in 3D the whole wall), 2, 3,
  /// … the obstacles.
  std::vector<Index> bodies(int dim) const;
  template <int D>
  Walls<D> walls() const;
  /// All walls, then a closed orifice and a lid at height `lid`: a box to pack particles in. Particles stay `clearance`
  /// farther away from its walls.
  template <int D>
  Walls<D> closed(Real lid, Real clearance = 0) const;

  /// Whether a disk (sphere) of this radius can fall vertically to r without touching walls.
  template <int D>
  static bool can_fall_to(const Walls<D>& walls, const Vec<D>& r, Real radius);

  /// Whether a disk (sphere) of this radius finds a way from the upper end to the orifice. Tests places a quarter of
  /// the radius apart; a way may be too narrow by a quarter of the radius (in large containers by more) and still pass.
  template <int D>
  bool lets_pass(Real radius) const;

 private:
  std::variant<Hopper, Vessel> shape_;
  std::vector<Obstacle> obstacles_;
  CornerRule corners_;
};

}  // namespace pliant
