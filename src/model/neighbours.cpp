#include <pliant/model/neighbours.h>

#include <cmath>

#include <pliant/base/errors.h>

namespace pliant {

template <int D>
bool Neighbours<D>::valid(const Real* x) const {
  if (reference_.empty()) return false;
  const Real limit = square(skin_ / 2);
  const Real* reference = reference_.data();
  const std::size_t n = reference_.size() / D;
  bool inside = true;
  for (std::size_t i = 0; i < n; ++i) {
    Real moved2 = 0;
    for (int k = 0; k < D; ++k) moved2 += square(x[i * D + k] - reference[i * D + k]);
    inside &= moved2 <= limit;  // false for NaN too
  }
  return inside;
}

template <int D>
void Neighbours<D>::rebuild(const Topology& topology, const Walls<D>& wall, const Real* x) {
  const Index n = topology.points();
  for (std::size_t k = 0; k < static_cast<std::size_t>(n) * D; ++k)
    if (!std::isfinite(x[k]))
      throw NumericalError("position of point {} of particle {} is not finite; lower -dt or the stiffness",
                           k / D - topology.offset[topology.particle[k / D]], topology.particle[k / D]);

  const PointCloud cloud{x, topology.diameter, topology.particle, topology.next, topology.active};
  if (needs_.point_pairs || needs_.vertex_edges) {
    // Cells as wide as the mean reach of a point: a search then visits a few cells of a few points each.
    Real mean = 0;
    for (const Real d : topology.diameter) mean += d;
    grid_.build(x, n, mean / n + skin_, [&](Index i) { return cloud.uses(i); });
  }
  if (needs_.point_pairs) find_point_pairs<D>(cloud, grid_, skin_, point_pairs);
  if (needs_.walls) find_wall_pairs<D>(cloud, wall, skin_, walls);
  if constexpr (D == 2) {
    if (needs_.vertex_edges) find_vertex_edge_pairs(cloud, grid_, skin_, vertex_edges);
    if (needs_.lips) find_lip_pairs(cloud, wall, skin_, lips);
  }
  reference_.assign(x, x + static_cast<std::size_t>(n) * D);
  ++rebuilds_;
}

template class Neighbours<2>;
template class Neighbours<3>;

}  // namespace pliant
