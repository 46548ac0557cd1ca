// The equations of motion as an integrator sees them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/kernels/arrays.h>
#include <pliant/kernels/prefetch.h>

namespace pliant {

/// ẏ = f(t, y), solved by an integrator. rate() is collective.
class FirstOrderSystem {
 public:
  virtual ~FirstOrderSystem() = default;
  /// Coordinates x on this rank.
  virtual std::size_t size() const = 0;
  /// Length of y on this rank: y = x here, so that ẋ = f(t, x), the motion without inertia. The unknowns beyond x are v
  /// (has_velocities), or quantities integrated with the coordinates (State::extra).
  virtual std::size_t unknowns() const { return size(); }
  virtual bool has_velocities() const { return false; }
  virtual const Ranks& ranks() const {
    static const Ranks self;
    return self;
  }
  /// The first of the coordinates are positions; the others are angles.
  virtual std::size_t positions() const { return size(); }
  /// Upper bound of the speed of walls that particles at x can reach at time t.
  virtual Real outside_speed(Real /*t*/, const Real* /*x*/) const { return 0; }
  /// Writes ydot[unknowns()]. May update internal caches (neighbour lists, first guesses), never y.
  virtual void rate(Real t, const Real* y, Real* ydot) = 0;
  /// A step of length h has been accepted, which ends at t with x and v; v is undefined without velocities. An
  /// integrator calls this before its observer. evaluated: the last rates were those at t and x, though v may
  /// have been another. Contact history changes here only. Collective.
  virtual void accepted(Real /*t*/, const Real* /*x*/, const Real* /*v*/, Real /*h*/, bool /*evaluated*/ = false) {}
};

/// ẍ = a(t, x, ẋ), which is a first-order system for y = [x; v]. acceleration() is collective.
class SecondOrderSystem : public FirstOrderSystem {
 public:
  /// Writes a[size()]. May update internal caches (neighbour lists), never x or v.
  virtual void acceleration(Real t, const Real* x, const Real* v, Real* a) = 0;

  std::size_t unknowns() const final { return 2 * size(); }
  bool has_velocities() const final { return true; }
  void rate(Real t, const Real* y, Real* ydot) final {
    const std::size_t n = size();
    std::copy_n(y + n, n, ydot);
    acceleration(t, y, y + n, ydot + n);
  }

  /// Whether fused_step() is worth its second arrays of positions and velocities, compared to acceleration() and passes
  /// over all coordinates.
  virtual bool fuses_step() const { return false; }

  /// Upper bound of the change of any coordinate, on any rank, until the next call of acceleration() or fused_step();
  /// bounds since the last call add up. Saves a system the comparison of positions with the reference positions of its
  /// lists.
  /// Infinity if other changes are possible. The same on all ranks.
  virtual void moved_by(Real /*change*/) {}

  /// Update of the integrator for the coordinates first … last−1 once their accelerations are complete, while they are
  /// in the processor's cache; several threads call it for different ranges at the same time. a is numbered as an array
  /// of all coordinates, but holds only these. Returns an upper bound of the change of a coordinate until the next
  /// fused step.
  struct Advance {
    std::function<Real(std::size_t first, std::size_t last, const Real* a)> step;
    Prefetch arrays;  ///< coordinates that it reads or writes, in addition to the fused step
  };

  /// As acceleration(), with `advance.step` called once for every coordinate, for accelerations that are not stored. x
  /// and v hold the owned coordinates and may get longer: on several ranks the coordinates of ghosts follow, which
  /// saves a copy. Returns whether all accelerations on all ranks are finite.
  virtual bool fused_step(Real t, std::vector<Real>& x, std::vector<Real>& v, const Advance& advance) {
    std::vector<Real> a(size());
    acceleration(t, x.data(), v.data(), a.data());
    moved_by(ranks().max(advance.step(0, size(), a.data())));
    return ranks().all(first_non_finite(a.data(), size()) == size());
  }
};

}  // namespace pliant
