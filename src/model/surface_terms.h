// Terms of the shape energy of closed surfaces: volume, areas of faces, surface tension, lengths of edges and bending.
#pragma once

#include <array>
#include <functional>

#include <pliant/base/errors.h>
#include <pliant/geometry/hinge.h>
#include <pliant/model/parameter.h>
#include <pliant/model/surface.h>
#include <pliant/model/term.h>

namespace pliant {

/// Base of the terms: their elements are particles, whose faces and edges they visit. Without Topology::surfaces the
/// terms are switched off.
struct SurfaceTerm {
  static constexpr Elements elements = Elements::particles;
  static Index particle(const StateView<3>&, Index m) { return m; }

 protected:
  /// A particle with its surface.
  struct Shape {
    const StateView<3>& state;
    const Surface& surface;
    Index m, first;
    Real scale;

    Vec<3> at(Index vertex) const { return state.position(first + vertex); }
    TriangleArea area(std::size_t face) const {
      const auto& [a, b, c] = surface.faces[face];
      return {at(a), at(b), at(c)};
    }
    Real rest_area(std::size_t face) const { return surface.rest_area[face] * square(scale); }
    Real rest_length(std::size_t hinge) const { return surface.rest_length[hinge] * scale; }
    HingeAngle angle(const Hinge& h) const { return {at(h.a), at(h.b), at(h.c), at(h.d)}; }
    /// The vertices a, b, c, d.
    std::array<Index, 4> points(const Hinge& h) const { return {first + h.a, first + h.b, first + h.c, first + h.d}; }
  };
  Shape shape(const StateView<3>& s, Index m) const {
    const Surfaces& all = *s.topology.surfaces;
    return {s, all.of(s.topology, m), m, s.topology.offset[m], all.scale(s.topology, m)};
  }
  /// The largest value of any kind of surface; at least the value in icospheres.
  static Real largest_of_kinds(const Topology& topology, Real in_icospheres,
                               const std::function<Real(const Surface&)>& value);
  /// Largest eigenvalue of the Hessian of a surface alone and at rest.
  static Real stiffest_mode(const Surface& surface,
                            const std::function<void(const StateView<3>&, BlockSink<3>&)>& add_hessian);
  /// Largest eigenvalue of the Hessian of a term, over all kinds of surfaces at rest.
  template <class Term>
  static Real stiffest_mode_of(const Topology& topology, Real in_icospheres, const Term& term) {
    return largest_of_kinds(topology, in_icospheres, [&](const Surface& surface) {
      return stiffest_mode(surface, [&](const StateView<3>& s, BlockSink<3>& sink) { term.add_hessian(s, 0, sink); });
    });
  }
  /// ω where ω² = k/m with the smallest mass of a vertex.
  static Real rate(const Topology& topology, Real k) {
    return topology.surfaces && k > 0
               ? std::sqrt(k / smallest_over_points(topology, [&](Index i) { return topology.mass(i); }))
               : 0;
  }
};

/// U = k_v/2 (V − V0)², V the signed volume inside the faces, V0 the rest volume. Smooth. ∂V/∂r_i = n_i/6, n_i the sum
/// of the normals of the faces at vertex i, each of length twice the area of the face: differences of positions within
/// the particle, so that no digits are lost far from the origin. ∂²V/∂r_a∂r_b = −[c − d]×/6 for the vertices a, b of an
/// edge and the third vertices c, d of its two faces. The Hessian of U is dense in a particle.
struct Volume : SurfaceTerm {
  Real k_v = 0;

  static std::string_view name() { return "volume"; }
  void read(ParameterReader& p) {
    k_v = p.number({.name = "k_v",
                    .symbol = "K_v",
                    .unit = {1, -5, 0},
                    .help = "volume stiffness K_v: K_v/2 (V - V0)^2",
                    .value = 2e4,
                    .alias = "kv",
                    .role = Role::volume});
  }

  bool enabled(const StateView<3>& s) const { return s.topology.surfaces && k_v > 0; }
  Real energy(const StateView<3>& s, Index m) const { return k_v / 2 * square(excess(s, m)); }
  template <class G>
  void add_gradient(const StateView<3>& s, Index m, G& grad) const {
    const Shape p = shape(s, m);
    const Real sixth = k_v * excess(s, m) / 6;
    for (const auto& [a, b, c] : p.surface.faces) {
      const Vec<3> push = sixth * face_normal(p.at(a), p.at(b), p.at(c));
      for (const Index i : {a, b, c}) grad.add(p.first + i, push);
    }
  }
  void add_hessian(const StateView<3>& s, Index m, BlockSink<3>& h, PreStress pre_stress = PreStress::kept) const;
  /// Breathing mode: ω² = k_v S0²/M in an icosphere, S0 the rest area of the surface.
  Real max_rate(const Topology& topology) const;

 private:
  Real excess(const StateView<3>& s, Index m) const {
    return surface_volume(s.x, s.topology, s.topology.surfaces->of(s.topology, m), m) - s.topology.a0[m];
  }
};

/// U = Σ_f e(a_f), with the area a_f of face f and the function e that `Energy` defines by value(a, a0), slope(a, a0)
/// and curvature(a, a0), a0 the rest area. Smooth while no area is 0.
template <class Energy>
struct FaceEnergy : SurfaceTerm {
  Real energy(const StateView<3>& s, Index m) const {
    const Shape p = shape(s, m);
    Real sum = 0;
    for (std::size_t f = 0; f < p.surface.faces.size(); ++f) sum += own().value(p.area(f).area, p.rest_area(f));
    return sum;
  }
  template <class G>
  void add_gradient(const StateView<3>& s, Index m, G& grad) const {
    const Shape p = shape(s, m);
    for (std::size_t f = 0; f < p.surface.faces.size(); ++f) {
      const TriangleArea a = p.area(f);
      const Real tension = own().slope(a.area, p.rest_area(f));
      for (int k = 0; k < 3; ++k) grad.add(p.first + p.surface.faces[f][k], Vec<3>(tension * a.gradient[k]));
    }
  }
  void add_hessian(const StateView<3>& s, Index m, BlockSink<3>& h, PreStress pre_stress = PreStress::kept) const {
    const Shape p = shape(s, m);
    for (std::size_t f = 0; f < p.surface.faces.size(); ++f) {
      const TriangleArea a = p.area(f);
      const Real tension = slope_factor(pre_stress) * own().slope(a.area, p.rest_area(f)),
                 k = own().curvature(a.area, p.rest_area(f));
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          h.add(p.first + p.surface.faces[f][i], p.first + p.surface.faces[f][j],
                k * a.gradient[i] * a.gradient[j].transpose() + tension * a.hessian(i, j));
    }
  }

 private:
  const Energy& own() const { return static_cast<const Energy&>(*this); }
};

/// U = k_a/2 Σ_f (a_f − a_f0)²/a_f0. In a flat triangulation k_a is the area modulus; shear costs no energy.
struct FaceArea : FaceEnergy<FaceArea> {
  Real k_a = 0;

  static std::string_view name() { return "area"; }
  void read(ParameterReader& p) {
    k_a = p.number({.name = "k_a",
                    .symbol = "K_a",
                    .unit = {1, -1, 0},
                    .help = "stiffness K_a of the areas of faces",
                    .value = 50,
                    .alias = "ka",
                    .role = Role::area});
  }
  bool enabled(const StateView<3>& s) const { return s.topology.surfaces && k_a > 0; }
  /// ω² = 4.62 k_a/m in an icosphere.
  Real max_rate(const Topology& topology) const {
    return rate(topology, stiffest_mode_of(topology, 4.62, FaceArea{{}, 1}) * k_a);
  }

  Real value(Real a, Real a0) const { return k_a / 2 * square(a - a0) / a0; }
  Real slope(Real a, Real a0) const { return k_a * (a - a0) / a0; }
  Real curvature(Real, Real a0) const { return k_a / a0; }
};

/// U = γ Σ_f a_f, the energy of an interface.
struct SurfaceTension : FaceEnergy<SurfaceTension> {
  Real gamma = 0;

  static std::string_view name() { return "tension"; }
  void read(ParameterReader& p) {
    gamma = p.number(
        {.name = "gamma", .symbol = "\\gamma", .unit = {1, -1, 0}, .help = "surface tension gamma", .value = 0});
  }
  bool enabled(const StateView<3>& s) const { return s.topology.surfaces && gamma > 0; }
  /// ω² = 5.2 γ/m in an icosphere.
  Real max_rate(const Topology& topology) const {
    return rate(topology, stiffest_mode_of(topology, 5.2, SurfaceTension{{}, 1}) * gamma);
  }

  Real value(Real a, Real) const { return gamma * a; }
  Real slope(Real, Real) const { return gamma; }
  static Real curvature(Real, Real) { return 0; }
};

/// U = k_l/2 Σ_e (l_e − l_e0)². In a flat triangulation of equilateral triangles the area modulus is (√3/2) k_l, the
/// shear modulus (√3/4) k_l. Smooth while no edge has the length 0.
struct EdgeLength : SurfaceTerm {
  Real k_l = 0;

  static std::string_view name() { return "edge"; }
  void read(ParameterReader& p) {
    k_l = p.number({.name = "k_l",
                    .symbol = "K_l",
                    .unit = {1, -1, 0},
                    .help = "stiffness K_l of the lengths of edges",
                    .value = 20,
                    .alias = "kl",
                    .role = Role::perimeter});
  }
  bool enabled(const StateView<3>& s) const { return s.topology.surfaces && k_l > 0; }
  Real energy(const StateView<3>& s, Index m) const;
  template <class G>
  void add_gradient(const StateView<3>& s, Index m, G& grad) const {
    const Shape p = shape(s, m);
    for (std::size_t k = 0; k < p.surface.hinges.size(); ++k) {
      const Hinge& h = p.surface.hinges[k];
      const Vec<3> l = p.at(h.b) - p.at(h.a), tension = k_l * (1 - p.rest_length(k) / l.norm()) * l;
      grad.add(p.first + h.b, tension);
      grad.add(p.first + h.a, -tension);
    }
  }
  void add_hessian(const StateView<3>& s, Index m, BlockSink<3>& sink, PreStress pre_stress = PreStress::kept) const;
  /// ω² = 6 k_l/m in an icosphere.
  Real max_rate(const Topology& topology) const {
    return rate(topology, stiffest_mode_of(topology, 6, EdgeLength{{}, 1}) * k_l);
  }
};

/// U = k_b Σ_h (1 − cos(θ_h − θ_h0)), θ_h the angle between the normals n̂, n̂' of the two faces of an edge, positive
/// where the edge is convex. By default θ_h0 = 0: then U = k_b/2 Σ_h |n̂ − n̂'|², and a flat surface has no energy. In a
/// triangulation of equilateral triangles the bending rigidity is κ = (√3/2) k_b, and −(4/3) κ for the Gaussian
/// curvature [H. S. Seung, D. R. Nelson, Phys. Rev. A 38, 1005 (1988)]. Smooth while no face has the area 0.
struct HingeBending : SurfaceTerm {
  Real k_b = 0;
  bool with_rest = false;  ///< rest angles of the surface, else 0

  static std::string_view name() { return "bending"; }
  void read(ParameterReader& p) {
    k_b = p.number({.name = "k_b",
                    .symbol = "K_b",
                    .unit = dimension::energy,
                    .help = "bending stiffness K_b of each edge",
                    .value = 0.1,
                    .alias = "kb",
                    .role = Role::bending});
    with_rest = p.flag({.name = "rest_angles", .help = "edges have rest angles theta0 (else 0: flat faces)"});
  }
  bool enabled(const StateView<3>& s) const { return s.topology.surfaces && k_b > 0; }
  Real energy(const StateView<3>& s, Index m) const;
  template <class G>
  void add_gradient(const StateView<3>& s, Index m, G& grad) const {
    const Shape p = shape(s, m);
    for (std::size_t k = 0; k < p.surface.hinges.size(); ++k) {
      const Hinge& h = p.surface.hinges[k];
      const HingeAngle angle = p.angle(h);
      const Real moment = k_b * bent(angle, rest(p.surface, k)).sine;
      const std::array<Index, 4> points = p.points(h);
      for (int i = 0; i < 4; ++i) grad.add(points[i], Vec<3>(moment * angle.gradient[i]));
    }
  }
  /// Without pre-stress the energy counts as a function of the angles.
  void add_hessian(const StateView<3>& s, Index m, BlockSink<3>& sink, PreStress pre_stress = PreStress::kept) const;
  /// ω² ≤ 37 k_b/(l² m) in icospheres, l the mean length of an edge.
  Real max_rate(const Topology& topology) const;

 private:
  struct Turn {
    Real cosine = 1, sine = 0;
  };
  Turn rest(const Surface& surface, std::size_t hinge) const;
  /// The angle θ − θ0.
  static Turn bent(const HingeAngle& angle, const Turn& rest) {
    return {angle.cosine * rest.cosine + angle.sine * rest.sine, angle.sine * rest.cosine - angle.cosine * rest.sine};
  }
};

/// Errors: InputError for tension without stiffness of areas and edges: vertices then move freely along the surface.
inline void check_tension(const SurfaceTension& tension, const FaceArea& area, const EdgeLength& edges) {
  if (tension.gamma > 0 && area.k_a == 0 && edges.k_l == 0)
    throw InputError(
        "gamma {} with k_a 0 and k_l 0: tension alone does not hold vertices in place along the surface; raise k_a or "
        "k_l",
        tension.gamma);
}

}  // namespace pliant
