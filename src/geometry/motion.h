// How walls move: as rigid bodies, by a given motion.
#pragma once

#include <cmath>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>
#include <pliant/geometry/rotation.h>

namespace pliant {

/// Where a rigid body is: its point b is at turn · b + shift.
template <int D>
struct Pose {
  Mat<D> turn = Mat<D>::Identity();
  Vec<D> shift = Vec<D>::Zero();
  bool turned = false;  ///< or `turn` is the identity

  PLIANT_INLINE Vec<D> place(const Vec<D>& b) const { return direction(b) + shift; }
  /// The point of the body that is at r.
  PLIANT_INLINE Vec<D> back(const Vec<D>& r) const {
    const Vec<D> w = r - shift;
    return turned ? Vec<D>(turn.transpose() * w) : w;
  }
  PLIANT_INLINE Vec<D> direction(const Vec<D>& a) const { return turned ? Vec<D>(turn * a) : a; }
  Mat<D> matrix(const Mat<D>& a) const { return turned ? Mat<D>(turn * a * turn.transpose()) : a; }
};

/// A translation at a constant velocity with an oscillation, and a rotation about a pivot that moves with them. By time
/// t the pivot has moved by velocity · (t − since) + amplitude · (sin(frequency · (t − since) + phase) − sin(phase)).
/// Lengths in σ_avg, times in t0.
template <int D>
struct Motion {
  Vec<D> velocity = Vec<D>::Zero();
  Vec<D> amplitude = Vec<D>::Zero();
  Real frequency = 0;             ///< angular
  Real phase = 0;                 ///< rad
  Rotation<D> spin = zero();      ///< angular velocity
  Vec<D> pivot = Vec<D>::Zero();  ///< where it is at time `since`
  Real since = 0;

  /// |spin|
  Real rate() const {
    if constexpr (D == 2)
      return std::abs(spin);
    else
      return spin.norm();
  }
  bool turns() const { return spin != zero(); }
  bool oscillates() const { return frequency != 0 && amplitude != Vec<D>::Zero(); }
  bool rests() const { return velocity == Vec<D>::Zero() && !oscillates() && !turns(); }

  /// How far the pivot has moved by time t, and its velocity then.
  Vec<D> shift(Real t) const {
    Vec<D> s = (t - since) * velocity;
    if (oscillates()) s += (std::sin(frequency * (t - since) + phase) - std::sin(phase)) * amplitude;
    return s;
  }
  Vec<D> drift(Real t) const {
    Vec<D> v = velocity;
    if (oscillates()) v += frequency * std::cos(frequency * (t - since) + phase) * amplitude;
    return v;
  }

  /// Velocity at time t of a material point at r that moves with the body.
  Vec<D> velocity_at(const Vec<D>& r, Real t) const {
    if (!turns()) return drift(t);
    return drift(t) + spin_velocity(spin, Vec<D>(r - pivot - shift(t)));
  }

  /// Where a body is at time t that was at `start` at time `since`.
  Pose<D> pose(const Pose<D>& start, Real t) const {
    Pose<D> pose = start;
    if (!turns()) {
      pose.shift += shift(t);
      return pose;
    }
    Mat<D> turn;
    if constexpr (D == 2) {
      const Real angle = spin * (t - since), c = std::cos(angle), s = std::sin(angle);
      turn << c, -s, s, c;
    } else {
      turn = Eigen::AngleAxis<Real>(rate() * (t - since), spin.normalized()).toRotationMatrix();
    }
    pose.turn = turn * start.turn;
    pose.shift = pivot + shift(t) + turn * (start.shift - pivot);
    pose.turned = true;
    return pose;
  }

 private:
  static Rotation<D> zero() {
    if constexpr (D == 2)
      return 0;
    else
      return Vec<3>::Zero();
  }
};

}  // namespace pliant
