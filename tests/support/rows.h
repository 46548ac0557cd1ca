// Systems that are large enough for several chunks or ranks: particles in rows, in contact with their neighbours.
#pragma once

#include "configurations.h"

namespace pliant::test {

/// columns^(D−1) · rows soft particles of diameters 0.85 … 1.15 above the flat bottom of a hopper, with velocities.
template <int D>
Configuration<D> soft_rows(Random& random, Index columns, Index rows) {
  constexpr Real spacing = 0.95;
  Configuration<D> c;
  c.walls = Hopper{.wall_distance = spacing * columns, .orifice = 3, .angle = 90}.walls<D>();
  const Index layer = D == 2 ? columns : columns * columns;
  for (Index k = 0; k < layer * rows; ++k) {
    std::array<Index, D> cell;
    cell[0] = k % columns;
    cell[1] = k / columns % (D == 2 ? rows : columns);
    cell[D - 1] = k / layer;
    Vec<D> r;
    for (int d = 0; d < D; ++d) r[d] = spacing * (cell[d] + 0.5 - (d < D - 1 ? columns / 2.0 : 0)) + random(-0.1, 0.1);
    c.add_soft(random(0.85, 1.15), r);
  }
  c.random_velocities(random);
  return c;
}

/// columns · rows irregular polygons of 5 … 12 vertices over the orifice of a hopper, with velocities.
inline Configuration<2> polygon_rows(Random& random, Index columns, Index rows) {
  constexpr Real spacing = 1.05;
  Configuration<2> c;
  c.walls = Hopper{.wall_distance = spacing * columns, .orifice = 3, .angle = 90}.walls<2>();
  for (Index k = 0; k < columns * rows; ++k) {
    const Vec<2> r(spacing * (k % columns + 0.5 - columns / 2.0), spacing * (k / columns + 0.4));
    c.add_polygon(irregular_polygon(random, 5 + random.below(8), random(0.4, 0.6), r), random(0.1, 0.4));
  }
  c.random_velocities(random);
  return c;
}

/// 0 … n−1 in random order.
inline std::vector<Index> random_order(Random& random, Index n) {
  std::vector<Index> order(n);
  for (Index k = 0; k < n; ++k) {
    const Index other = random.below(k + 1);
    order[k] = order[other];
    order[other] = k;
  }
  return order;
}

}  // namespace pliant::test
