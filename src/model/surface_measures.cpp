#include <pliant/model/surface_measures.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include <pliant/geometry/hinge.h>

namespace pliant {

Real stretch(const Surface& s) {
  Real sum = 0;
  for (const Hinge& h : s.hinges) sum += (s.vertices[h.b] - s.vertices[h.a]).norm();
  return s.mean_rest_length() * static_cast<Real>(s.hinges.size()) / sum;
}

Real widest_gap(const Surface& s) {
  Real widest2 = 0;
  for (const Face& face : s.faces) {
    std::array<Real, 3> side2;  // opposite to vertices 0, 1, 2
    for (std::size_t k = 0; k < 3; ++k)
      side2[k] = (s.vertices[face[(k + 1) % 3]] - s.vertices[face[(k + 2) % 3]]).squaredNorm();
    std::ranges::sort(side2);
    const auto& [a2, b2, c2] = side2;
    // At the centre of the circumscribed circle or, of an obtuse triangle, where the bisector of the middle side b
    // meets the longest side: at b/(2 cos α) from the vertex between them.
    const Real cosine2 = square(b2 + c2 - a2) / (4 * b2 * c2);
    const Real sine2 = 1 - cosine2;
    widest2 = std::max(widest2, c2 > a2 + b2 ? b2 / (4 * cosine2) : a2 / (4 * sine2));
  }
  return stretch(s) * std::sqrt(widest2);
}

namespace {

/// Calls visit(length, angle) for each edge: the angle between the normals of its faces.
template <class Visit>
void for_each_edge(const Real* x, const Topology& topology, const Surface& surface, Index m, Visit&& visit) {
  const auto at = [&](Index i) { return Vec<3>(point<3>(x, topology.offset[m] + i)); };
  for (const Hinge& h : surface.hinges) {
    const HingeAngle angle(at(h.a), at(h.b), at(h.c), at(h.d));
    visit((at(h.b) - at(h.a)).norm(), std::atan2(angle.sine, angle.cosine));
  }
}

}  // namespace

Real shell_volume(const Real* x, const Topology& topology, const Surface& surface, Index m, Real width) {
  Real curvature = 0;
  for_each_edge(x, topology, surface, m, [&](Real length, Real angle) { curvature += length * angle / 2; });
  return width * (surface_area(x, topology, surface, m) + width * (curvature + 4 * pi / 3 * width));
}

Real outer_spheres_volume(const Real* x, const Topology& topology, const Surface& surface, Index m, Real diameter) {
  Real angles = 0;
  for_each_edge(x, topology, surface, m, [&](Real, Real angle) { angles += angle; });
  return (Real(surface.points()) / 2 + angles / (2 * pi)) * pi * diameter * square(diameter) / 6;
}

bool inside_surface(const Real* x, const Topology& topology, const Surface& surface, Index m, const Vec<3>& place) {
  // The sum of the solid angles of the faces: 4π inside, 0 outside [A. van Oosterom, J. Strackee, IEEE Trans. Biomed.
  // Eng. 30, 125 (1983)].
  Real half = 0;
  for (const auto& [a, b, c] : surface.faces) {
    const auto from = [&](Index i) { return Vec<3>(point<3>(x, topology.offset[m] + i) - place); };
    const Vec<3> u = from(a), v = from(b), w = from(c);
    const Real ul = u.norm(), vl = v.norm(), wl = w.norm();
    half += std::atan2(u.dot(v.cross(w)), ul * vl * wl + u.dot(v) * wl + v.dot(w) * ul + w.dot(u) * vl);
  }
  return half > pi;
}

}  // namespace pliant
