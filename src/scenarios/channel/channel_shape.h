// Channels: the interior, the walls around it, and the places of plungers.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <pliant/geometry/obstacle.h>
#include <pliant/geometry/walls.h>

namespace pliant {

/// Arms that meet in a square with a corner at the origin. L: arms along +x and +y, so that the origin is the outer
/// corner [T Fig. 3.2]. T: along +x, +y and −x. X: along −y, too. Straight: along +x and −x.
enum class ChannelKind { l, t, x, straight };

/// cm
struct ChannelSize {
  Real width = 20.5;
  Real arm = 37.7;  ///< from an end to the far side of the square
};

/// A face that can move into the channel, along its normal.
struct Plunger {
  std::array<Vec<2>, 2> ends;  ///< of the face, at rest
  Vec<2> direction;            ///< unit, into the channel
  Real width() const { return (ends[1] - ends[0]).norm(); }
};

/// Plungers that move from time `since` on.
struct PlungerMotion {
  std::size_t plunger = 0;
  Real travel = 0, speed = 0;  ///< then, from its place at rest; into the channel
  Real shear = 0;              ///< speed of the walls of a straight channel, along x below, against it above
  Real sheared = 0;            ///< displacement of the side walls so far, to which contacts stick
  Real since = 0;
};

/// A polygon of which some sides are plungers; the others are walls. Sides are segments, joined where two walls meet.
/// An inner corner is one surface, with one contact that moves around the corner; an outer corner, or a corner of a
/// wall and a plunger, has two surfaces. Plungers are half-spaces, and so are the walls of a straight channel, which
/// can move along themselves.
class Channel {
 public:
  static constexpr Index plunger_material = 1;  ///< material of plungers; other walls have material 0

  /// All arms end in plungers, in the order +x, +y, −x, −y. Errors: InputError if arms are not longer than wide.
  Channel(ChannelKind kind, const ChannelSize& size);
  /// Without plungers. Errors: InputError where the corners make no polygon.
  explicit Channel(std::vector<Vec<2>> corners);

  /// The sides nearest to these places are the plungers, in this order. Errors: InputError for a place that lies on no
  /// side, and for a side that is named twice.
  void set_plungers(const std::vector<Vec<2>>& places);
  /// Errors: InputError for a stroke that runs into a corner of the channel.
  void check_stroke(Real stroke) const;

  /// Sides, then plungers: all plungers are at rest but one.
  Walls<2> walls(const PlungerMotion& motion = {}) const;
  /// The same as x1 y1 x2 y2 of each.
  std::vector<Real> drawn_walls(std::size_t plunger, Real travel) const;

  const std::vector<Plunger>& plungers() const { return plungers_; }
  bool inside(const Vec<2>& r) const { return region_.contains(r); }
  Real area() const { return region_.content(2, std::numeric_limits<Real>::infinity()); }
  const std::vector<Vec<2>>& corners() const { return region_.corners; }

 private:
  void place_plungers();

  Obstacle region_;  ///< with the plungers at rest; side k begins at corner k
  bool straight_ = false;
  std::vector<std::size_t> sides_;  ///< sides that are plungers, in the order of their pushes
  std::vector<Plunger> plungers_;
};

}  // namespace pliant
