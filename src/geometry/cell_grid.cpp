#include <pliant/base/simd.h>
#include <pliant/geometry/cell_grid.h>

namespace pliant {
namespace {

using simd::Mask4;
using simd::Real4;

static_assert(lanes == 4);

template <int D>
PLIANT_INLINE Index find(const CellRows<D>& rows, const Real* const* coordinate, const Real* radius, const Real* r,
                         Real reach, Index* near) {
  Index found = 0;
  rows.for_each([&](Index first, Index last) __attribute__((always_inline)) {
    for (Index k = first; k < last; k += 4) {
      Real4 d2{};
      for (int axis = 0; axis < D; ++axis) {
        const Real4 u = simd::load4(coordinate[axis] + k) - simd::all(r[axis]);
        d2 += u * u;
      }
      const Real4 limit = simd::all(reach) + simd::load4(radius + k);
      const Mask4 is_near = (d2 < limit * limit) & (Real4{0, 1, 2, 3} < simd::all(last - k));
      for (int lane = 0; lane < 4; ++lane) {
        near[found] = k + lane;
        found -= static_cast<Index>(is_near[lane]);
      }
    }
  });
  return found;
}

PLIANT_MULTIVERSION Index find_2d(const CellRows<2>& rows, const Real* const* coordinate, const Real* radius,
                                  const Real* r, Real reach, Index* near) {
  return find<2>(rows, coordinate, radius, r, reach, near);
}
PLIANT_MULTIVERSION Index find_3d(const CellRows<3>& rows, const Real* const* coordinate, const Real* radius,
                                  const Real* r, Real reach, Index* near) {
  return find<3>(rows, coordinate, radius, r, reach, near);
}

}  // namespace

template <>
Index find_near<2>(const CellRows<2>& rows, const std::array<std::vector<Real>, 2>& coordinate, const Real* radius,
                   const Vec<2>& r, Real reach, Index* near) {
  const std::array at{coordinate[0].data(), coordinate[1].data()};
  return find_2d(rows, at.data(), radius, r.data(), reach, near);
}
template <>
Index find_near<3>(const CellRows<3>& rows, const std::array<std::vector<Real>, 3>& coordinate, const Real* radius,
                   const Vec<3>& r, Real reach, Index* near) {
  const std::array at{coordinate[0].data(), coordinate[1].data(), coordinate[2].data()};
  return find_3d(rows, at.data(), radius, r.data(), reach, near);
}

}  // namespace pliant
