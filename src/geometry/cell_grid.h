// Cell grid: points sorted into square cells of a bounding box; the broad phase of every neighbour search.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>

namespace pliant {

/// The rows of cells that meet a box, as ranges of places in the order of the cells.
template <int D>
struct CellRows {
  const Index* start;          ///< first entry of each cell
  std::array<Index, D> count;  ///< cells of the grid
  std::array<Index, D> first, last;

  template <class Visit>
  PLIANT_INLINE void for_each(Visit&& visit) const {
    const auto row = [&](Index base) { visit(start[base + first[0]], start[base + last[0] + 1]); };
    for (Index cy = first[1]; cy <= last[1]; ++cy) {
      if constexpr (D == 2) {
        row(cy * count[0]);
      } else {
        for (Index cz = first[2]; cz <= last[2]; ++cz) row((cz * count[1] + cy) * count[0]);
      }
    }
  }
};

/// Numbers that are read at once in a search, also past the last point.
inline constexpr std::size_t lanes = 4;

/// Places in the rows of points, given by coordinates and radii, whose distance from r is less than reach + radius, in
/// their order; returns their number. near holds all points of the rows and `lanes` more.
template <int D>
Index find_near(const CellRows<D>& rows, const std::array<std::vector<Real>, D>& coordinate, const Real* radius,
                const Vec<D>& r, Real reach, Index* near);

/// Grid over the points it was built from. The number of cells stays below a few per point (cells grow for sparse
/// clouds), so that a far outlier costs neither memory nor time. Queries visit whole cells: the caller tests the
/// distance.
template <int D>
class CellGrid {
 public:
  /// x: [n · D], diameter: [n]. Only points with use(i) enter. Positions must be finite.
  template <class Use>
  void build(const Real* x, const Real* diameter, Index n, Real cell_size, Use&& use) {
    Vec<D> low = Vec<D>::Constant(std::numeric_limits<Real>::max()), high = -low;
    Index used = 0;
    for (Index i = 0; i < n; ++i) {
      if (!use(i)) continue;
      ++used;
      low = low.cwiseMin(point<D>(x, i));
      high = high.cwiseMax(point<D>(x, i));
    }
    items_.resize(used);
    cell_of_.resize(n);
    if (used == 0) {
      count_.fill(0);
      start_.assign(1, 0);
      return;
    }
    origin_ = low;
    const Real limit = 8.0 * used + 64;
    for (;; cell_size *= 1.5) {
      Real cells = 1;
      for (int k = 0; k < D; ++k) cells *= std::floor((high[k] - low[k]) / cell_size) + 1;
      if (cells <= limit) break;
    }
    inverse_size_ = 1 / cell_size;
    Index cells = 1;
    for (int k = 0; k < D; ++k) {
      count_[k] = static_cast<Index>(std::floor((high[k] - low[k]) * inverse_size_)) + 1;
      cells *= count_[k];
    }
    // While points are inserted, start_[c + 1] is the next free place of cell c; at the end it is the first place of
    // cell c + 1.
    start_.assign(static_cast<std::size_t>(cells) + 2, 0);
    for (Index i = 0; i < n; ++i) {
      if (!use(i)) continue;
      cell_of_[i] = cell_index(cell_coordinates(point<D>(x, i)));
      ++start_[cell_of_[i] + 2];
    }
    for (Index c = 0; c < cells; ++c) start_[c + 2] += start_[c + 1];
    for (Index i = 0; i < n; ++i)
      if (use(i)) items_[start_[cell_of_[i] + 1]++] = i;
    for (auto& coordinate : coordinate_) coordinate.resize(used + lanes);
    radius_.resize(used + lanes);
    for (Index k = 0; k < used; ++k) {
      const Index i = items_[k];
      for (int axis = 0; axis < D; ++axis) coordinate_[axis][k] = x[static_cast<std::size_t>(i) * D + axis];
      radius_[k] = diameter[i] / 2;
    }
  }

  /// Calls visit(j) for every point in the cells that meet the box low … high: by rows of cells, in ascending order
  /// within a cell.
  template <class Visit>
  void for_each_in_box(const Vec<D>& low, const Vec<D>& high, Visit&& visit) const {
    if (items_.empty()) return;
    rows_of(low, high).for_each([&](Index first, Index last) {
      for (Index k = first; k < last; ++k) visit(items_[k]);
    });
  }

  /// Calls visit(j) for every point in the cells that meet a box of half-width `range` round r, if its distance from r
  /// is less than reach + its own radius. The distances are tested here, on vectors, where the points of a row of cells
  /// lie side by side. near: scratch memory.
  template <class Visit>
  void for_each_near(const Vec<D>& r, Real range, Real reach, std::vector<Index>& near, Visit&& visit) const {
    if (items_.empty()) return;
    const Vec<D> half = Vec<D>::Constant(range);
    const CellRows<D> rows = rows_of(r - half, r + half);
    std::size_t candidates = 0;
    rows.for_each([&](Index first, Index last) { candidates += static_cast<std::size_t>(last - first); });
    if (near.size() < candidates + lanes) near.resize(candidates + lanes);
    const Index found = find_near<D>(rows, coordinate_, radius_.data(), r, reach, near.data());
    for (Index k = 0; k < found; ++k) visit(items_[near[k]]);
  }

 private:
  CellRows<D> rows_of(const Vec<D>& low, const Vec<D>& high) const {
    return {start_.data(), count_, cell_coordinates(low), cell_coordinates(high)};
  }

  [[gnu::always_inline]] std::array<Index, D> cell_coordinates(const Vec<D>& r) const {
    std::array<Index, D> c;
    for (int k = 0; k < D; ++k)
      c[k] = static_cast<Index>(std::clamp((r[k] - origin_[k]) * inverse_size_, Real(0), Real(count_[k] - 1)));
    return c;
  }
  Index cell_index(const std::array<Index, D>& c) const {
    Index index = c[D - 1];
    for (int k = D - 2; k >= 0; --k) index = index * count_[k] + c[k];
    return index;
  }

  Vec<D> origin_;
  Real inverse_size_ = 1;
  std::array<Index, D> count_{};
  std::vector<Index> start_, items_, cell_of_;
  // Of items_, so that a search reads one stretch of memory per row; longer by the numbers that vectors read past the
  // last one.
  std::array<std::vector<Real>, D> coordinate_;
  std::vector<Real> radius_;
};

}  // namespace pliant
