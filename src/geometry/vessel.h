// A container with a user-defined outline.
#pragma once

#include <vector>

#include <pliant/geometry/hopper.h>
#include <pliant/geometry/obstacle.h>

namespace pliant {

/// Two polylines, each from an end of the orifice, at y = 0, to the place where the wall continues vertically without
/// end. In 3D the right one is the meridian (ρ, z) of a body of revolution. The region lies between them above the
/// orifice.
class Vessel {
 public:
  using Line = std::vector<Vec<2>>;

  /// Where the points of the lines come from, for messages: lines of a file, from 1.
  struct Source {
    std::vector<int> left, right;
  };

  /// The lines, at least two points each, must not meet each other or themselves; the orifice is centred on x = 0.
  /// Errors: InputError where that is not so.
  Vessel(Line left, Line right, const Source& source = {});

  Real orifice() const { return 2 * right_.front()[0]; }
  /// x of the upright walls.
  Real left() const { return left_.back()[0]; }
  Real right() const { return right_.back()[0]; }
  /// Least and largest x.
  Vec<2> extent() const { return extent_; }
  /// Height from which on the walls are upright.
  Real upright_from() const { return top_; }
  /// Distance from the axis to the nearest wall at height y; half of the orifice below it.
  Real half_width(int dim, Real y) const;
  bool inside(int dim, const Vec<2>& p) const;
  /// Area (volume) between the orifice and height y.
  Real capacity(int dim, Real y) const;
  WallParts walls(int dim) const;

 private:
  /// One segment of a line.
  struct Piece {
    Vec<2> a, b;
    bool left;
  };
  static void add_side(const Line& line, bool right, WallParts& walls);
  /// visit(x) for each wall that is at height y.
  template <class Visit>
  void at_height(int dim, Real y, Visit&& visit) const;
  std::size_t band(Real y) const;

  Line left_, right_;
  Vec<2> extent_;
  std::vector<Piece> pieces_;
  std::vector<std::vector<Index>> bands_;  ///< pieces in slices of equal height, up to the top
  Real top_ = 0;
};

/// The hopper, with a left wall at another angle to gravity, in degrees; 0: upright from the orifice on. Both sloped
/// walls end at the same height, where they are W apart. In 2D. Errors: InputError for measures or angles that make no
/// such.
Vessel uneven_hopper(const Hopper& hopper, Real left_angle);

}  // namespace pliant
