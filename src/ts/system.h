// The equation of motion as an integrator sees it.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/kernels/ahead.h>
#include <pliant/kernels/finite.h>

namespace pliant {

/// ẍ = a(t, x, ẋ): a vector of `size()` coordinates on each rank. acceleration() and sweep() are collective.
class SecondOrderSystem {
 public:
  virtual ~SecondOrderSystem() = default;
  virtual std::size_t size() const = 0;
  virtual const Ranks& ranks() const {
    static const Ranks self;
    return self;
  }
  /// Writes a[size()]. May update internal caches (neighbour lists), never x or v.
  virtual void acceleration(Real t, const Real* x, const Real* v, Real* a) = 0;

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
