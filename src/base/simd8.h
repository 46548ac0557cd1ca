// Eight doubles at a time, as two fours: each operation is done on one and then on the other, so that the processor
// works on one while the other waits for a root, a division or a table.
#pragma once

#include <pliant/base/simd.h>

namespace pliant::simd {

struct Mask8 {
  Mask4 a, b;

  PLIANT_INLINE std::int64_t operator[](int k) const { return k < 4 ? a[k] : b[k - 4]; }
  PLIANT_INLINE friend Mask8 operator&(const Mask8& m, const Mask8& n) { return {m.a & n.a, m.b & n.b}; }
  PLIANT_INLINE friend Mask8 operator|(const Mask8& m, const Mask8& n) { return {m.a | n.a, m.b | n.b}; }
  PLIANT_INLINE friend Mask8 operator~(const Mask8& m) { return {~m.a, ~m.b}; }
};

struct Real8 {
  Real4 a, b;

  Real8() = default;
  PLIANT_INLINE Real8(Real4 first, Real4 second) : a(first), b(second) {}
  PLIANT_INLINE Real8(Real all8) : a(all(all8)), b(all(all8)) {}  // NOLINT(google-explicit-constructor)

  PLIANT_INLINE Real operator[](int k) const { return k < 4 ? a[k] : b[k - 4]; }
  PLIANT_INLINE void set(int k, Real value) { k < 4 ? a[k] = value : b[k - 4] = value; }

  PLIANT_INLINE friend Real8 operator-(const Real8& x) { return {-x.a, -x.b}; }
  PLIANT_INLINE friend Real8 operator+(const Real8& x, const Real8& y) { return {x.a + y.a, x.b + y.b}; }
  PLIANT_INLINE friend Real8 operator-(const Real8& x, const Real8& y) { return {x.a - y.a, x.b - y.b}; }
  PLIANT_INLINE friend Real8 operator*(const Real8& x, const Real8& y) { return {x.a * y.a, x.b * y.b}; }
  PLIANT_INLINE friend Real8 operator/(const Real8& x, const Real8& y) { return {x.a / y.a, x.b / y.b}; }
  PLIANT_INLINE Real8& operator+=(const Real8& y) { return *this = *this + y; }
  PLIANT_INLINE Real8& operator*=(const Real8& y) { return *this = *this * y; }
  PLIANT_INLINE friend Mask8 operator<(const Real8& x, const Real8& y) { return {x.a < y.a, x.b < y.b}; }
  PLIANT_INLINE friend Mask8 operator>(const Real8& x, const Real8& y) { return {x.a > y.a, x.b > y.b}; }
  PLIANT_INLINE friend Mask8 operator<=(const Real8& x, const Real8& y) { return {x.a <= y.a, x.b <= y.b}; }
  PLIANT_INLINE friend Mask8 operator>=(const Real8& x, const Real8& y) { return {x.a >= y.a, x.b >= y.b}; }
  PLIANT_INLINE friend Mask8 operator==(const Real8& x, const Real8& y) { return {x.a == y.a, x.b == y.b}; }
  PLIANT_INLINE friend Mask8 operator!=(const Real8& x, const Real8& y) { return {x.a != y.a, x.b != y.b}; }
};

PLIANT_INLINE Real8 load8(const Real* p) { return {load4(p), load4(p + 4)}; }
PLIANT_INLINE void store8(Real* p, const Real8& x) {
  store4(p, x.a);
  store4(p + 4, x.b);
}

PLIANT_INLINE Real8 select(const Mask8& m, const Real8& x, const Real8& y) {
  return {select(m.a, x.a, y.a), select(m.b, x.b, y.b)};
}
PLIANT_INLINE Real8 where(const Mask8& m, const Real8& x) { return {where(m.a, x.a), where(m.b, x.b)}; }
PLIANT_INLINE Real8 min(const Real8& x, const Real8& y) { return {min(x.a, y.a), min(x.b, y.b)}; }
PLIANT_INLINE Real8 max(const Real8& x, const Real8& y) { return {max(x.a, y.a), max(x.b, y.b)}; }
PLIANT_INLINE Real8 abs(const Real8& x) { return {abs(x.a), abs(x.b)}; }
PLIANT_INLINE Real8 sqrt(const Real8& x) { return {sqrt(x.a), sqrt(x.b)}; }
PLIANT_INLINE bool any(const Mask8& m) { return any(m.a | m.b); }
PLIANT_INLINE Mask8 first8(Index count) { return {first(count), first(count - 4)}; }

/// ab + cd, of any kind of numbers. Where the compiler fuses a product with the sum it is the first, whose place as an
/// argument of operator+ would leave that open.
template <class R>
PLIANT_INLINE R sum_of(const R& a, const R& b, const R& c, const R& d) {
  R sum = a * b;
  sum += c * d;
  return sum;
}

}  // namespace pliant::simd
