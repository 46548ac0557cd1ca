// Nearest places of vertices, edges and faces in space: the geometry under the contacts of closed surfaces.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>

#include <pliant/geometry/distance.h>

namespace pliant {

/// A place of a surface and a place of another one. With the points r of an element, the offset from the second place
/// to the first one is Σ_k weight[k] r[k]: the weights of the first simplex are positive and have the sum 1, the
/// weights of the second one are negative with the sum −1, and points that do not carry a place have the weight 0.
struct NearestPlaces {
  Vec<3> offset;
  Real d2;  ///< squared distance
  std::array<Real, 4> weight;
};

/// Points of an element: of the first simplex, then of the second one.
using FourPoints = std::array<Vec<3>, 4>;

/// How the nearest places move with the points, within the parts of the simplices that carry them.
class PlaceMotion {
 public:
  /// first: points of the first simplex.
  PlaceMotion(const FourPoints& r, int first, const NearestPlaces& places);

  /// Coordinates t_i of the places.
  int count() const { return count_; }
  /// ∂weight[k]/∂t_i.
  Real weight(int i, int k) const { return weight_[i][k]; }
  /// ∂t_i/∂r[k]: with the offset o, w its weights, g_i = ∂o/∂t_i and G_ij = g_i·g_j, −Σ_j (G⁻¹)_ij (∂_j w_k o + w_k
  /// g_j).
  const Vec<3>& by_point(int i, int k) const { return by_point_[i][k]; }
  /// Second derivatives of the distance |o| by points k and l, from the second derivatives of |o|²/2,
  ///   w_k w_l 1 + Σ_i (∂_i w_k o + w_k g_i) (∂t_i/∂r_l)ᵀ.
  /// They are zero at no distance.
  Mat<3> hessian(int k, int l) const;

 private:
  NearestPlaces places_;
  int count_ = 0;
  std::array<std::array<Real, 4>, 2> weight_{};
  std::array<std::array<Vec<3>, 4>, 2> mixed_, by_point_;
};

/// The nearest places of a vertex r[0] and the face r[1], r[2], r[3], and of the vertex and the face's parts. Edge k
/// runs from corner k to corner k + 1.
struct VertexOnFace {
  explicit VertexOnFace(const FourPoints& r) : r_(r) {
    for (int k = 0; k < 3; ++k) foot[k] = foot_on_segment<3>(r[0], r[1 + k], r[1 + (k + 1) % 3]);
    const Vec<3> u = r[2] - r[1], v = r[3] - r[1], w = r[0] - r[1], n = u.cross(v);
    const Real n2 = n.squaredNorm();
    const Real of_2 = w.cross(v).dot(n), of_3 = u.cross(w).dot(n), of_1 = n2 - of_2 - of_3;
    if (!(of_1 > 0 && of_2 > 0 && of_3 > 0)) return;
    const Vec<3> offset = w.dot(n) / n2 * n;
    inside = {offset, offset.squaredNorm(), {1, -of_1 / n2, -of_2 / n2, -of_3 / n2}};
  }

  std::optional<NearestPlaces> inside;   ///< where the nearest place is inside the face
  std::array<FootOnSegment<3>, 3> foot;  ///< feet of the vertex on the edges

  /// Number of the nearest edge.
  int nearest_edge() const {
    const int k = foot[1].d2 < foot[0].d2 ? 1 : 0;
    return foot[2].d2 < foot[k].d2 ? 2 : k;
  }
  Real d2() const { return inside ? inside->d2 : foot[nearest_edge()].d2; }
  NearestPlaces on_edge(int k) const {
    NearestPlaces places{foot[k].offset, foot[k].d2, {1}};
    places.weight[1 + k] = foot[k].t - 1;
    places.weight[1 + (k + 1) % 3] = -foot[k].t;
    return places;
  }
  NearestPlaces at_corner(int k) const {
    const Vec<3> offset = r_[0] - r_[1 + k];
    NearestPlaces places{offset, offset.squaredNorm(), {1}};
    places.weight[1 + k] = -1;
    return places;
  }

 private:
  const FourPoints& r_;
};

/// The nearest places of the edges r[0]–r[1] and r[2]–r[3], and of the ends of one edge and the other edge. Parallel
/// edges are nearest at an end.
struct EdgeOnEdge {
  explicit EdgeOnEdge(const FourPoints& r) : r_(r) {
    for (int k = 0; k < 2; ++k) {
      foot[k] = foot_on_segment<3>(r[k], r[2], r[3]);
      foot[2 + k] = foot_on_segment<3>(r[2 + k], r[0], r[1]);
    }
    const Vec<3> u = r[1] - r[0], v = r[3] - r[2], w = r[2] - r[0], n = u.cross(v);
    const Real n2 = n.squaredNorm(), s = w.cross(v).dot(n), t = w.cross(u).dot(n);
    if (!(s > 0 && s < n2 && t > 0 && t < n2)) return;
    const Vec<3> offset = -w.dot(n) / n2 * n;
    inside = {offset, offset.squaredNorm(), {1 - s / n2, s / n2, t / n2 - 1, -t / n2}};
  }

  std::optional<NearestPlaces> inside;   ///< where both nearest places are inside their edges
  std::array<FootOnSegment<3>, 4> foot;  ///< feet of the points on the other edge

  /// Number of the point that is nearest to the other edge.
  int nearest_end() const {
    int k = 0;
    for (int l = 1; l < 4; ++l)
      if (foot[l].d2 < foot[k].d2) k = l;
    return k;
  }
  Real d2() const { return inside ? inside->d2 : foot[nearest_end()].d2; }
  /// The nearest places of point k and the other edge.
  NearestPlaces of_end(int k) const {
    const int start = k < 2 ? 2 : 0;
    const Real sign = k < 2 ? 1 : -1;
    NearestPlaces places{sign * foot[k].offset, foot[k].d2, {}};
    places.weight[k] = sign;
    places.weight[start] = sign * (foot[k].t - 1);
    places.weight[start + 1] = -sign * foot[k].t;
    return places;
  }
  /// A point of the first edge and a point of the second one.
  NearestPlaces of_points(int first, int second) const {
    const Vec<3> offset = r_[first] - r_[second];
    NearestPlaces places{offset, offset.squaredNorm(), {}};
    places.weight[first] = 1;
    places.weight[second] = -1;
    return places;
  }

 private:
  const FourPoints& r_;
};

}  // namespace pliant
