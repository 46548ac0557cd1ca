// Basic types that every folder shares.
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace pliant {

using Real = double;
using Index = std::int32_t;  // as PetscInt in Debian's build

template <int D>
using Vec = Eigen::Matrix<Real, D, 1>;
template <int D>
using Mat = Eigen::Matrix<Real, D, D>;

/// View of point i in an interleaved array (x0 y0 [z0] x1 y1 …).
template <int D>
inline Eigen::Map<const Vec<D>> point(const Real* x, Index i) {
  return Eigen::Map<const Vec<D>>(x + static_cast<std::size_t>(i) * D);
}
template <int D>
inline Eigen::Map<Vec<D>> point(Real* x, Index i) {
  return Eigen::Map<Vec<D>>(x + static_cast<std::size_t>(i) * D);
}

template <class T>
constexpr T square(T a) {
  return a * a;
}

inline constexpr Real pi = 3.141592653589793238462643383279502884;

}  // namespace pliant
