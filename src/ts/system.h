// The equations of motion as an integrator sees them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/kernels/ahead.h>
#include <pliant/kernels/finite.h>

namespace pliant {

/// ẏ = f(t, y) for what an integrator carries. rate() is collective.
class FirstOrderSystem {
 public:
  virtual ~FirstOrderSystem() = default;
  /// Coordinates x on this rank.
  virtual std::size_t size() const = 0;
  /// Length of y on this rank: y = x here, so that ẋ = f(t, x), the motion without inertia.
  virtual std::size_t unknowns() const { return size(); }
  virtual const Ranks& ranks() const {
    static const Ranks self;
    return self;
  }
  /// Writes ydot[unknowns()]. May update internal caches (neighbour lists, first guesses), never y.
  virtual void rate(Real t, const Real* y, Real* ydot) = 0;
};

/// ẍ = a(t, x, ẋ), which is a first-order system for y = [x; v]. acceleration() is collective.
class SecondOrderSystem : public FirstOrderSystem {
 public:
  /// Writes a[size()]. May update internal caches (neighbour lists), never x or v.
  virtual void acceleration(Real t, const Real* x, const Real* v, Real* a) = 0;

  std::size_t unknowns() const final { return 2 * size(); }
  void rate(Real t, const Real* y, Real* ydot) final {
    const std::size_t n = size();
    std::copy_n(y + n, n, ydot);
    acceleration(t, y, y + n, ydot + n);
  }

  /// Whether sweep() is worth its second arrays of positions and velocities, compared to acceleration() and passes over
  /// all coordinates.
  virtual bool one_pass() const { return false; }

  /// What an integrator does with the coordinates first … last−1 once their accelerations are complete, while they are
  /// in the processor's cache; for different ranges by several threads at a time. Returns the positions that the next
  /// sweep will be asked for, complete in that range.
  struct Advance {
    std::function<const Real*(std::size_t first, std::size_t last)> step;
    Ahead arrays;  ///< coordinates that it reads or writes, beside those of the sweep
  };

  /// As acceleration(), with `advance.step` called once for every coordinate. x and v hold own coordinates and may get
  /// longer: on several ranks those of ghosts follow, which saves a copy. foreseen: x is what advance returned in the
  /// last sweep, and nothing has changed it since. Returns whether all accelerations on all ranks are finite.
  virtual bool sweep(Real t, std::vector<Real>& x, std::vector<Real>& v, Real* a, bool /*foreseen*/,
                     const Advance& advance) {
    acceleration(t, x.data(), v.data(), a);
    advance.step(0, size());
    return ranks().all(first_non_finite(a, size()) == size());
  }
};

}  // namespace pliant
