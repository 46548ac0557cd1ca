#include <pliant/model/surface.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <pliant/base/errors.h>
#include <pliant/geometry/hinge.h>

namespace pliant {

Real Surface::total_rest_area() const { return std::accumulate(rest_area.begin(), rest_area.end(), Real(0)); }

Real Surface::mean_rest_length() const {
  return std::accumulate(rest_length.begin(), rest_length.end(), Real(0)) / static_cast<Real>(rest_length.size());
}

void connect_parts(Surface& s) {
  s.across.resize(s.faces.size());
  s.around.resize(s.vertices.size());
  s.lowest_face.resize(s.vertices.size());
  s.corners.resize(s.hinges.size());
  s.opposite.resize(s.faces.size());
  const auto place = [&](Index face, Index vertex) {
    const Face& own = s.faces[face];
    return static_cast<Index>(std::ranges::find(own, vertex) - own.begin());
  };
  for (std::size_t k = 0; k < s.hinges.size(); ++k) {
    const Hinge& h = s.hinges[k];
    s.across[h.left][place(h.left, h.a)] = {h.right, h.d};
    s.across[h.right][place(h.right, h.b)] = {h.left, h.c};
    s.corners[k] = {place(h.left, h.c), place(h.right, h.d)};
    s.opposite[h.left][s.corners[k][0]] = s.opposite[h.right][s.corners[k][1]] = static_cast<Index>(k);
    s.around[h.a].push_back(h.b);
    s.around[h.b].push_back(h.a);
  }
  for (std::size_t f = s.faces.size(); f-- > 0;)
    for (const Index i : s.faces[f]) s.lowest_face[i] = static_cast<Index>(f);
}

Real sphere_diameter(Real volume) { return std::cbrt(6 * volume / pi); }

Surface relaxed_surface(const TriangleMesh& mesh) {
  Surface s;
  s.hinges = check_mesh(mesh);
  s.faces = mesh.faces;
  s.vertices = mesh.vertices;
  const Vec<3> mean = std::accumulate(s.vertices.begin(), s.vertices.end(), Vec<3>(Vec<3>::Zero())) / s.points();
  for (Vec<3>& r : s.vertices) r -= mean;
  s.volume = volume(mesh);
  s.sigma = sphere_diameter(s.volume);
  const std::vector<Vec<3>>& r = mesh.vertices;
  for (const auto& [a, b, c] : s.faces) s.rest_area.push_back(face_normal(r[a], r[b], r[c]).norm() / 2);
  for (const Hinge& h : s.hinges) {
    s.rest_length.push_back((r[h.b] - r[h.a]).norm());
    const HingeAngle angle(r[h.a], r[h.b], r[h.c], r[h.d]);
    s.rest_angle.push_back(std::atan2(angle.sine, angle.cosine));
  }
  connect_parts(s);
  return s;
}

Surface surface_with_shape(const TriangleMesh& mesh, Real shape) {
  Surface s = relaxed_surface(mesh);
  const Real own = shape_parameter(s.total_rest_area(), s.volume);
  if (shape < own)
    throw InputError("the shape parameter is {}, but the surface at rest has {}; choose that or more", shape, own);
  const Real stretch = std::cbrt(shape / own);
  for (Real& length : s.rest_length) length *= stretch;
  for (Real& area : s.rest_area) area *= square(stretch);
  return s;
}

void Surfaces::add_particle(Topology& topology, Index which, Real volume, Real delta, Real mass) {
  const Surface& surface = kinds[which];
  const Real sigma = sphere_diameter(volume);
  topology.add_polygon(surface.points(), volume, surface.mean_rest_length() * sigma / surface.sigma, delta, mass);
  topology.sigma.back() = sigma;
  kind.push_back(which);
}

Real surface_volume(const Real* x, const Topology& topology, const Surface& surface, Index m) {
  const Index first = topology.offset[m];
  const Vec<3> o = point<3>(x, first);
  Real sixfold = 0;
  for (const auto& [a, b, c] : surface.faces) {
    const Vec<3> u = point<3>(x, first + a) - o, v = point<3>(x, first + b) - o, w = point<3>(x, first + c) - o;
    sixfold += u.dot(v.cross(w));
  }
  return sixfold / 6;
}

Real surface_area(const Real* x, const Topology& topology, const Surface& surface, Index m) {
  const auto at = [&](Index i) { return Vec<3>(point<3>(x, topology.offset[m] + i)); };
  Real sum = 0;
  for (const auto& [a, b, c] : surface.faces) sum += face_normal(at(a), at(b), at(c)).norm() / 2;
  return sum;
}

SurfaceShape look_at_surface(const Real* x, const Topology& topology, const Surfaces& surfaces, Index m) {
  constexpr Real infinity = std::numeric_limits<Real>::infinity();
  const Surface& surface = surfaces.of(topology, m);
  const Index first = topology.offset[m];
  const auto at = [&](Index i) { return Vec<3>(point<3>(x, first + i)); };
  SurfaceShape shape{surface_volume(x, topology, surface, m), infinity, 0, infinity, 0};
  const Real unit = square(surfaces.scale(topology, m));
  for (std::size_t f = 0; f < surface.faces.size(); ++f) {
    const auto& [a, b, c] = surface.faces[f];
    const Real ratio = face_normal(at(a), at(b), at(c)).norm() / 2 / (unit * surface.rest_area[f]);
    if (!(ratio >= shape.least_area)) shape.least_area = ratio, shape.smallest_face = static_cast<Index>(f);
  }
  for (std::size_t k = 0; k < surface.hinges.size(); ++k) {
    const Hinge& h = surface.hinges[k];
    const Real cosine = HingeAngle(at(h.a), at(h.b), at(h.c), at(h.d)).cosine;
    if (!(cosine >= shape.least_cosine)) shape.least_cosine = cosine, shape.sharpest_hinge = static_cast<Index>(k);
  }
  return shape;
}

}  // namespace pliant
