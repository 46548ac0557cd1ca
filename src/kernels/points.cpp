#include <pliant/kernels/points.h>

#include <pliant/base/multiversion.h>
#include <pliant/kernels/finite.h>

namespace pliant {
namespace {

template <int D>
PLIANT_INLINE void set(const Index* offset, const Real* values, Index first, Index last, const Real* g, Real* f) {
  const std::ptrdiff_t begin = offset[first];
  if (offset[last] - begin == last - first) {  // one point each
    for (std::ptrdiff_t m = 0; m < last - first; ++m)
      for (int k = 0; k < D; ++k) f[(begin + m) * D + k] = values[first + m] * g[k];
    return;
  }
  for (Index m = first; m < last; ++m) {
    Real weight[D];
    for (int k = 0; k < D; ++k) weight[k] = values[m] * g[k];
    for (std::ptrdiff_t i = offset[m]; i < offset[m + 1]; ++i)
      for (int k = 0; k < D; ++k) f[i * D + k] = weight[k];
  }
}

template <int D>
PLIANT_INLINE bool scale(const Index* offset, const Real* values, Index first, Index last, Real* f) {
  FiniteCheck check;
  const std::ptrdiff_t begin = offset[first];
  if (offset[last] - begin == last - first) {  // one point each
    for (std::ptrdiff_t m = 0; m < last - first; ++m)
      for (int k = 0; k < D; ++k) check.add(f[(begin + m) * D + k] *= values[first + m]);
  } else {
    for (Index m = first; m < last; ++m) {
      const Real value = values[m];
      for (std::ptrdiff_t c = std::ptrdiff_t(D) * offset[m]; c < std::ptrdiff_t(D) * offset[m + 1]; ++c)
        check.add(f[c] *= value);
    }
  }
  return check.all_finite();
}

PLIANT_MULTIVERSION bool scale_1d(const Index* offset, const Real* values, Index first, Index last, Real* f) {
  return scale<1>(offset, values, first, last, f);
}
PLIANT_MULTIVERSION bool scale_2d(const Index* offset, const Real* values, Index first, Index last, Real* f) {
  return scale<2>(offset, values, first, last, f);
}
PLIANT_MULTIVERSION bool scale_3d(const Index* offset, const Real* values, Index first, Index last, Real* f) {
  return scale<3>(offset, values, first, last, f);
}

}  // namespace

template <int D>
void set_points(const Index* offset, const Real* values, Index first, Index last, const Vec<D>& g, Real* f) {
  set<D>(offset, values, first, last, g.data(), f);
}
template <int D>
bool scale_points(const Index* offset, const Real* values, Index first, Index last, Real* f) {
  if constexpr (D == 1)
    return scale_1d(offset, values, first, last, f);
  else
    return D == 2 ? scale_2d(offset, values, first, last, f) : scale_3d(offset, values, first, last, f);
}

template void set_points<2>(const Index*, const Real*, Index, Index, const Vec<2>&, Real*);
template void set_points<3>(const Index*, const Real*, Index, Index, const Vec<3>&, Real*);
template bool scale_points<1>(const Index*, const Real*, Index, Index, Real*);
template bool scale_points<2>(const Index*, const Real*, Index, Index, Real*);
template bool scale_points<3>(const Index*, const Real*, Index, Index, Real*);

}  // namespace pliant
