#include <pliant/kernels/surface_forces.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include <pliant/base/lanes.h>
#include <pliant/base/simd.h>

namespace pliant {
namespace {

using simd::Real4;

/// A vector of each of four particles. The alignment is explicit: GCC's depends on the instruction set.
struct alignas(sizeof(Real4)) Vector4 {
  Real4 x, y, z;
};
PLIANT_INLINE Vector4 operator+(const Vector4& a, const Vector4& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
PLIANT_INLINE Vector4 operator-(const Vector4& a, const Vector4& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
PLIANT_INLINE Vector4 operator*(const Real4& s, const Vector4& a) { return {s * a.x, s * a.y, s * a.z}; }
PLIANT_INLINE Real4 dot(const Vector4& a, const Vector4& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
PLIANT_INLINE Vector4 cross(const Vector4& a, const Vector4& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
PLIANT_INLINE Real4 lanes(const std::array<Real, 4>& a) { return Real4{a[0], a[1], a[2], a[3]}; }

/// A face of four particles.
struct alignas(sizeof(Real4)) Face4 {
  Vector4 n;        ///< normal; its length is twice the area of the face
  Real4 inverse;    ///< 1/length of n
  Real4 dots[3];    ///< at each vertex, the scalar product of the edges to the two others
  Real4 stiffness;  ///< times the dot at a vertex: force in the opposite edge over the length of that edge
};

/// A hinge of four particles.
struct alignas(sizeof(Real4)) Bending4 {
  Real4 value;  ///< k_b times the sine of the angle over the length of the edge
};

/// Memory of a thread, which grows to the size of its largest mesh.
struct Scratch {
  std::vector<Vector4> r, f;  ///< [points] positions, relative to the first point of each particle, and forces
  std::vector<Face4> faces;
  std::vector<Bending4> bending;  ///< [hinges]
};

/// Finds the faces. Returns the force of the volume over a sixth of the normal of each face.
PLIANT_INLINE Real4 find_faces(const SurfaceForces& s, const SurfaceBatch& batch, const Vector4* r, Face4* faces) {
  const Real4 scale = lanes(batch.scale), inverse_square = 1 / (scale * scale);
  Real4 sixfold{};
  for (std::size_t k = 0; k < s.mesh.faces.size(); ++k) {
    const auto& [a, b, c] = s.mesh.faces[k];
    const Vector4 u = r[b] - r[a], v = r[c] - r[a], n = cross(u, v);
    sixfold += dot(r[a], n);
    const Real4 at_a = dot(u, v), squared = dot(n, n), inverse = 1 / square_root(squared);
    const Real4 stretch = squared * inverse * (inverse_square * s.half_inverse_area[k]) - 1;
    // −∂area/∂a = Σ cot (opposite angle) (other end − a)/2 over the two edges at a.
    faces[k] = {
        n, inverse, {at_a, dot(u, u) - at_a, dot(v, v) - at_a}, (s.law.k_a * stretch + s.law.gamma) * inverse / 2};
  }
  return s.law.k_v * (sixfold / 6 - lanes(batch.volume));
}

/// Adds the forces along the edges, of lengths and areas, and finds the bending of the hinges.
PLIANT_INLINE void add_edges(const SurfaceForces& s, const SurfaceBatch& batch, const Vector4* r, Vector4* f,
                             const Face4* faces, Bending4* bending) {
  const Real4 scale = lanes(batch.scale);
  for (std::size_t k = 0; k < s.mesh.hinges.size(); ++k) {
    const Hinge& h = s.mesh.hinges[k];
    const auto [c, d] = s.mesh.corners[k];
    const Vector4 e = r[h.b] - r[h.a];
    const Real4 inverse = 1 / square_root(dot(e, e));
    const Face4 &left = faces[h.left], &right = faces[h.right];
    const Real4 stiffness = s.law.k_l * (1 - scale * s.mesh.rest_length[k] * inverse) + left.stiffness * left.dots[c] +
                            right.stiffness * right.dots[d];
    const Vector4 towards_b = stiffness * e;
    f[h.a] = f[h.a] + towards_b;
    f[h.b] = f[h.b] - towards_b;
    if (s.law.k_b != 0) {
      const Real4 both = left.inverse * right.inverse;
      Real4 sine = dot(e, cross(left.n, right.n)) * (inverse * both);
      if (s.law.rest_angles) sine = sine * s.rest[k].cosine - dot(left.n, right.n) * both * s.rest[k].sine;
      bending[k].value = s.law.k_b * sine * inverse;
    }
  }
}

/// Adds the forces along the normals of the faces, of the volume and of bending. A hinge pushes the opposite vertex c
/// of a face by bending · L² n/|n|², and pulls its own ends back by the parts that balance force and torque: s L² at b
/// and (1 − s) L² at a (HingeAngle), which are the dots at a and b.
PLIANT_INLINE void add_normals(const SurfaceForces& s, Real4 volume_force, Vector4* f, const Face4* faces,
                               const Bending4* bending) {
  const Real4 pressure = volume_force / 6;
  for (std::size_t k = 0; k < s.mesh.faces.size(); ++k) {
    const auto& [a, b, c] = s.mesh.faces[k];
    const Face4& face = faces[k];
    Real4 on_a = -pressure, on_b = on_a, on_c = on_a;
    if (s.law.k_b != 0) {
      const auto& [to_a, to_b, to_c] = s.mesh.opposite[k];
      const Real4 p = face.dots[0] * (bending[to_b].value - bending[to_c].value),
                  q = face.dots[1] * (bending[to_c].value - bending[to_a].value),
                  w = face.dots[2] * (bending[to_a].value - bending[to_b].value);
      const Real4 inverse_square = face.inverse * face.inverse;
      on_a += (w - q) * inverse_square;
      on_b += (p - w) * inverse_square;
      on_c += (q - p) * inverse_square;
    }
    f[a] = f[a] + on_a * face.n;
    f[b] = f[b] + on_b * face.n;
    f[c] = f[c] + on_c * face.n;
  }
}

PLIANT_INLINE void add_forces(const SurfaceForces& s, const SurfaceBatch& batch, const Real* x, Real* f, Vector4* r,
                              Vector4* sum, Face4* faces, Bending4* bending) {
  // Missing particles of a batch are copies of its last one.
  const Real* from[SurfaceBatch::most];
  for (int k = 0; k < SurfaceBatch::most; ++k)
    from[k] = x + static_cast<std::size_t>(batch.first[k < batch.count ? k : batch.count - 1]) * 3;
  for (Index i = 0; i < s.mesh.points; ++i) {
    const auto at = [&](int axis) PLIANT_INLINE_LAMBDA {
      const Index j = 3 * i + axis;
      return Real4{from[0][j] - from[0][axis], from[1][j] - from[1][axis], from[2][j] - from[2][axis],
                   from[3][j] - from[3][axis]};
    };
    r[i] = {at(0), at(1), at(2)};
    sum[i] = Vector4{};
  }
  const Real4 volume_force = find_faces(s, batch, r, faces);
  add_edges(s, batch, r, sum, faces, bending);
  add_normals(s, volume_force, sum, faces, bending);
  for (int k = 0; k < batch.count; ++k) {
    Real* const to = f + static_cast<std::size_t>(batch.first[k]) * 3;
    for (Index i = 0; i < s.mesh.points; ++i) {
      to[3 * i] += sum[i].x[k];
      to[3 * i + 1] += sum[i].y[k];
      to[3 * i + 2] += sum[i].z[k];
    }
  }
}

}  // namespace

SurfaceForces::SurfaceForces(const SurfaceLaw& coefficients, const SurfaceMesh& shape)
    : law(coefficients), mesh(shape) {
  half_inverse_area.reserve(mesh.faces.size());
  for (std::size_t k = 0; k < mesh.faces.size(); ++k) half_inverse_area.push_back(1 / (2 * mesh.rest_area[k]));
  if (!law.rest_angles) return;
  rest.reserve(mesh.hinges.size());
  for (std::size_t k = 0; k < mesh.hinges.size(); ++k)
    rest.push_back({std::cos(mesh.rest_angle[k]), std::sin(mesh.rest_angle[k])});
}

void SurfaceForces::add(const SurfaceBatch& batch, const Real* x, Real* f) const {
  thread_local Scratch scratch;
  const auto points = static_cast<std::size_t>(mesh.points);
  if (scratch.r.size() < points) scratch.r.resize(points), scratch.f.resize(points);
  if (scratch.faces.size() < mesh.faces.size()) scratch.faces.resize(mesh.faces.size());
  if (scratch.bending.size() < mesh.hinges.size()) scratch.bending.resize(mesh.hinges.size());
  SurfaceBatch whole = batch;
  for (int k = batch.count; k < SurfaceBatch::most; ++k)
    whole.scale[k] = batch.scale[batch.count - 1], whole.volume[k] = batch.volume[batch.count - 1];
  Vector4 *const r = scratch.r.data(), *const sum = scratch.f.data();
  Face4* const faces = scratch.faces.data();
  Bending4* const bending = scratch.bending.data();
  simd::run_fast([&]() PLIANT_INLINE_LAMBDA { add_forces(*this, whole, x, f, r, sum, faces, bending); });
}

}  // namespace pliant
