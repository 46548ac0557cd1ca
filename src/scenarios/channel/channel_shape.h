// Channels: what is inside, the walls around it, and where plungers stand.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <pliant/geometry/obstacle.h>
#include <pliant/geometry/walls.h>

namespace pliant {

/// Arms that meet in a square with a corner at the origin: L has them along +x and +y, so that the origin is its outer
/// corner [T Fig. 3.2]; T along +x, +y and −x; X along −y too; straight along +x and −x.
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

/// A polygon of which some sides are plungers; the others are walls. Between arms there are half-spaces and wedges, so
/// that the inner corner is one contact with one history; the sides of an outline are segments.
class Channel {
 public:
  /// All arms end in plungers, those of +x, +y, −x, −y in this order. Errors: InputError where arms are no longer than
  /// wide.
  Channel(ChannelKind kind, const ChannelSize& size);
  /// Without plungers. Errors: InputError where the corners make no polygon.
  explicit Channel(std::vector<Vec<2>> corners);

  /// The sides nearest to these places are the plungers, in this order. Errors: InputError for a place that lies on no
  /// side, and for a side that is named twice.
  void set_plungers(const std::vector<Vec<2>>& places);
  /// Errors: InputError for a stroke that runs into a corner of the channel.
  void check_stroke(Real stroke) const;

  const std::vector<Plunger>& plungers() const { return plungers_; }
  bool inside(const Vec<2>& r) const { return region_.contains(r); }
  Real area() const { return region_.content(2, std::numeric_limits<Real>::infinity()); }
  const std::vector<Vec<2>>& corners() const { return region_.corners; }

 private:
  void place_plungers();

  Obstacle region_;                        ///< with the plungers at rest; side k begins at corner k
  std::vector<Solid<2>> solids_;           ///< without the ends of arms; none for an outline, whose sides are the walls
  std::vector<std::size_t> ends_, sides_;  ///< ends of arms; sides that are plungers, in their turns
  std::vector<Plunger> plungers_;
};

}  // namespace pliant
