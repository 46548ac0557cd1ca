// The equation of motion as an integrator sees it.
#pragma once

#include <cstddef>

#include <pliant/base/ranks.h>

namespace pliant {

/// ẍ = a(t, x, ẋ): a vector of `size()` coordinates on each rank. acceleration() is collective.
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
};

}  // namespace pliant
