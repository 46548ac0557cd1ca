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
PLIANT_INLINE Vector4 operator-(const Vector4& a) { return {-a.x, -a.y, -a.z}; }
PLIANT_INLINE Vector4 operator*(const Real4& s, const Vector4& a) { return {s * a.x, s * a.y, s * a.z}; }
PLIANT_INLINE Real4 dot(const Vector4& a, const Vector4& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
PLIANT_INLINE Vector4 cross(const Vector4& a, const Vector4& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
PLIANT_INLINE void add(Vector4& sum, const Vector4& a) {
  sum.x += a.x;
  sum.y += a.y;
  sum.z += a.z;
}
PLIANT_INLINE void subtract(Vector4& sum, const Vector4& a) {
  sum.x -= a.x;
  sum.y -= a.y;
  sum.z -= a.z;
}
PLIANT_INLINE Real4 lanes(const std::array<Real, 4>& a) { return Real4{a[0], a[1], a[2], a[3]}; }

/// A face of four particles.
struct alignas(sizeof(Real4)) Normal4 {
  Vector4 n;      ///< normal; its length is twice the area of the face
  Real4 inverse;  ///< 1/length of n
};

/// Memory of a thread, which grows to the size of its largest mesh.
struct Scratch {
  std::vector<Vector4> r, f;  ///< [points] positions, relative to the first point of each particle, and forces
  std::vector<Normal4> face;
  std::vector<Real> inverse_area;
};

/// Volume and areas: forces of the faces. Also finds the normals. Roots and divisions are computed one face ahead, so
/// that fewer operations wait for them.
PLIANT_INLINE void add_faces(const SurfaceLaw& law, const SurfaceMesh& mesh, const SurfaceBatch& batch,
                             const Vector4* r, Vector4* f, Normal4* face, Real* inverse_area) {
  Real4 sixfold{};
  for (std::size_t k = 0; k < mesh.faces.size(); ++k) {
    const auto& [a, b, c] = mesh.faces[k];
    const Vector4 n = cross(r[b] - r[a], r[c] - r[a]);
    sixfold += dot(r[a], n);
    face[k].n = n;
    inverse_area[k] = 1 / mesh.rest_area[k];
  }
  const Real4 pressure = law.k_v / 6 * (sixfold / 6 - lanes(batch.volume));
  const Real4 scale = lanes(batch.scale), inverse_square = 1 / (scale * scale);
  const auto inverse_length = [&](std::size_t k) PLIANT_INLINE_LAMBDA {
    const Vector4& n = face[k < mesh.faces.size() ? k : 0].n;
    return 1 / square_root(dot(n, n));
  };
  Real4 next = inverse_length(0);
  for (std::size_t k = 0; k < mesh.faces.size(); ++k) {
    const auto& [a, b, c] = mesh.faces[k];
    const Vector4 n = face[k].n;
    const Real4 inverse = face[k].inverse = next;
    next = inverse_length(k + 1);
    // Half of the tension over twice the area: the force on a is −tension/2 n̂ × (c − b).
    const Real4 area = dot(n, n) * inverse / 2;
    const Real4 tension = law.k_a * (area * (inverse_square * inverse_area[k]) - 1) + law.gamma;
    const Vector4 pull = (tension * inverse / 2) * n, push = pressure * n;
    subtract(f[a], push + cross(pull, r[c] - r[b]));
    subtract(f[b], push + cross(pull, r[a] - r[c]));
    subtract(f[c], push + cross(pull, r[b] - r[a]));
  }
}

/// Lengths and bending: forces of the edges, as in HingeAngle. Roots and divisions are computed one
/// edge ahead.
PLIANT_INLINE void add_edges(const SurfaceLaw& law, const SurfaceMesh& mesh, const SurfaceBatch& batch,
                             const Vector4* r, Vector4* f, const Normal4* face) {
  const Real4 scale = lanes(batch.scale);
  const auto inverse_length = [&](std::size_t k) PLIANT_INLINE_LAMBDA {
    const Hinge& h = mesh.hinges[k < mesh.hinges.size() ? k : 0];
    const Vector4 e = r[h.b] - r[h.a];
    return 1 / square_root(dot(e, e));
  };
  Real4 next = inverse_length(0);
  for (std::size_t k = 0; k < mesh.hinges.size(); ++k) {
    const Hinge& h = mesh.hinges[k];
    const Vector4 e = r[h.b] - r[h.a];
    const Real4 squared = dot(e, e), inverse = next;
    next = inverse_length(k + 1);
    Vector4 towards_b = (law.k_l * (1 - scale * mesh.rest_length[k] * inverse)) * e;
    if (law.k_b != 0) {
      const Normal4 &left = face[h.left], &right = face[h.right];
      const Real4 both = left.inverse * right.inverse;
      Real4 sine = dot(e, cross(left.n, right.n)) * (inverse * both);
      if (law.rest_angles) {
        const Real4 cosine = dot(left.n, right.n) * both;
        sine = sine * std::cos(mesh.rest_angle[k]) - cosine * std::sin(mesh.rest_angle[k]);
      }
      const Real4 moment = law.k_b * sine * (squared * inverse), along = inverse * inverse;
      const Vector4 on_c = (moment * left.inverse * left.inverse) * left.n,
                    on_d = (moment * right.inverse * right.inverse) * right.n;
      const Real4 s = dot(r[h.c] - r[h.a], e) * along, t = dot(r[h.d] - r[h.a], e) * along;
      add(towards_b, s * on_c);
      add(towards_b, t * on_d);
      subtract(f[h.a], on_c + on_d);
      add(f[h.c], on_c);
      add(f[h.d], on_d);
    }
    add(f[h.a], towards_b);
    subtract(f[h.b], towards_b);
  }
}

PLIANT_MULTIVERSION void add_forces(const SurfaceLaw& law, const SurfaceMesh& mesh, const SurfaceBatch& batch,
                                    const Real* x, Real* f, Vector4* r, Vector4* sum, Normal4* face,
                                    Real* inverse_area) {
  // Missing particles of a batch are copies of its last one.
  const Real* from[SurfaceBatch::most];
  for (int k = 0; k < SurfaceBatch::most; ++k)
    from[k] = x + static_cast<std::size_t>(batch.first[k < batch.count ? k : batch.count - 1]) * 3;
  for (Index i = 0; i < mesh.points; ++i) {
    const auto at = [&](int axis) PLIANT_INLINE_LAMBDA {
      const Index j = 3 * i + axis;
      return Real4{from[0][j] - from[0][axis], from[1][j] - from[1][axis], from[2][j] - from[2][axis],
                   from[3][j] - from[3][axis]};
    };
    r[i] = {at(0), at(1), at(2)};
    sum[i] = Vector4{};
  }
  add_faces(law, mesh, batch, r, sum, face, inverse_area);
  if (law.k_l != 0 || law.k_b != 0) add_edges(law, mesh, batch, r, sum, face);
  for (int k = 0; k < batch.count; ++k) {
    Real* const to = f + static_cast<std::size_t>(batch.first[k]) * 3;
    for (Index i = 0; i < mesh.points; ++i) {
      to[3 * i] += sum[i].x[k];
      to[3 * i + 1] += sum[i].y[k];
      to[3 * i + 2] += sum[i].z[k];
    }
  }
}

}  // namespace

void add_surface_forces(const SurfaceLaw& law, const SurfaceMesh& mesh, const SurfaceBatch& batch, const Real* x,
                        Real* f) {
  thread_local Scratch scratch;
  const auto points = static_cast<std::size_t>(mesh.points);
  if (scratch.r.size() < points) scratch.r.resize(points), scratch.f.resize(points);
  if (scratch.face.size() < mesh.faces.size()) scratch.face.resize(mesh.faces.size());
  if (scratch.inverse_area.size() < mesh.faces.size()) scratch.inverse_area.resize(mesh.faces.size());
  SurfaceBatch whole = batch;
  for (int k = batch.count; k < SurfaceBatch::most; ++k)
    whole.scale[k] = batch.scale[batch.count - 1], whole.volume[k] = batch.volume[batch.count - 1];
  add_forces(law, mesh, whole, x, f, scratch.r.data(), scratch.f.data(), scratch.face.data(),
             scratch.inverse_area.data());
}

}  // namespace pliant
