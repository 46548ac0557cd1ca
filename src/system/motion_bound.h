// Upper bound of how far points have moved since each of several events.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include <pliant/base/types.h>

namespace pliant {

/// Events from which the motion of the points is bounded.
enum class MotionSince {
  list_rebuild,   ///< positions or walls have moved from the reference of the neighbour lists
  narrowing,      ///< of the list of vertices and edges
  outline_check,  ///< of vertices and outlines (CrossingWatch)
  passage_check,  ///< of points with walls and each other (PassageWatch)
};

/// Upper bound of how far any point has moved, without reading the positions. An integrator reports by how much
/// coordinates change at most until the next force evaluation; the bounds of all evaluations since an event add up to
/// the distance since that event. The distance is infinite if some motion was not reported, and until the event has
/// happened for the first time. All numbers are the same on every rank if the reported ones are.
class MotionBound {
 public:
  explicit MotionBound(int dimensions) : per_coordinate_(std::sqrt(static_cast<Real>(dimensions))) {
    distance_.fill(infinite);
  }

  /// Until the next evaluation no coordinate changes by more than this, beyond the changes reported before.
  void report(Real change) { reported_ = reported_.value_or(0) + change; }
  /// The points are where forces are evaluated now: all distances grow by the reported motion.
  void evaluate() {
    const Real change = reported_.value_or(infinite);
    for (Real& distance : distance_) distance += per_coordinate_ * change;
    reported_.reset();
  }
  /// Since the last evaluation images have moved by up to this distance in addition.
  void carry(Real distance) {
    for (Real& moved : distance_) moved += distance;
  }
  /// The points have moved to unreported positions.
  void lose() {
    distance_.fill(infinite);
    reported_.reset();
  }
  /// The event has happened, or is no longer known to have.
  void restart(MotionSince event, Real distance = 0) { distance_[static_cast<std::size_t>(event)] = distance; }
  void lose(MotionSince event) { restart(event, infinite); }

  /// The bound at the last evaluation: reported motion after it does not count yet.
  Real since(MotionSince event) const { return distance_[static_cast<std::size_t>(event)]; }

 private:
  static constexpr Real infinite = std::numeric_limits<Real>::infinity();
  Real per_coordinate_;  ///< largest distance of a point per change of its coordinates: √dimensions
  std::optional<Real> reported_;
  std::array<Real, 4> distance_;
};

}  // namespace pliant
