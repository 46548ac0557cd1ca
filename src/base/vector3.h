// Vectors in space whose components are numbers, or vectors of several numbers: one vector, or four in lanes.
#pragma once

#include <pliant/base/lanes.h>
#include <pliant/base/types.h>

namespace pliant {

template <class R>
struct Vector3 {
  R x, y, z;

  PLIANT_INLINE friend Vector3 operator+(const Vector3& a, const Vector3& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  PLIANT_INLINE friend Vector3 operator-(const Vector3& a, const Vector3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  PLIANT_INLINE friend Vector3 operator*(R s, const Vector3& a) { return {s * a.x, s * a.y, s * a.z}; }
};

template <class R>
PLIANT_INLINE R dot(const Vector3<R>& a, const Vector3<R>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class R>
PLIANT_INLINE Vector3<R> cross(const Vector3<R>& a, const Vector3<R>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class R>
PLIANT_INLINE R norm(const Vector3<R>& a) {
  return square_root(dot(a, a));
}
/// By rows.
template <class R>
struct Matrix3 {
  Vector3<R> x, y, z;

  PLIANT_INLINE friend Vector3<R> operator*(const Matrix3& m, const Vector3<R>& a) {
    return {dot(m.x, a), dot(m.y, a), dot(m.z, a)};
  }
  /// The transposed matrix times a vector.
  PLIANT_INLINE Vector3<R> transposed_times(const Vector3<R>& a) const { return a.x * x + a.y * y + a.z * z; }
};

/// a where the mask is set, else b.
template <class R>
PLIANT_INLINE Vector3<R> select(const MaskOf<R>& mask, const Vector3<R>& a, const Vector3<R>& b) {
  return {mask ? a.x : b.x, mask ? a.y : b.y, mask ? a.z : b.z};
}

/// From and to Eigen's type.
template <class V>
PLIANT_INLINE Vector3<Real> vector3(const V& a) {
  return {a[0], a[1], a[2]};
}
PLIANT_INLINE Vec<3> vec(const Vector3<Real>& a) { return {a.x, a.y, a.z}; }
/// Component k of an array of numbers x0 y0 z0 x1 … .
PLIANT_INLINE Vector3<Real> vector3(const Real* a, Index i) {
  const Real* const p = a + static_cast<std::ptrdiff_t>(i) * 3;
  return {p[0], p[1], p[2]};
}

}  // namespace pliant
