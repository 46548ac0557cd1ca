// Polygons that keep a rest shape of any outline, nearly as rigid bodies.
#pragma once

#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <pliant/model/parameter.h>
#include <pliant/model/polygon.h>
#include <pliant/model/term.h>

namespace pliant {

/// Outlines at rest: for each number of vertices their places, counterclockwise, about their mean, in units of the
/// length of an edge (Topology::l0); empty for numbers that no polygon has.
using RestOutlines = std::vector<std::vector<Vec<2>>>;

/// U = k/2 Σ_i |r_i − c − R s_i|², s_i the places of the outline, c the mean of the vertices and R the rotation for
/// which U is least [shape matching: M. Müller, B. Heidelberger, M. Teschner, M. Gross, ACM Trans. Graph. 24, 471
/// (2005)]. So the outline may be any, and moves and turns freely; a vertex yields by its force over k, wherever it is,
/// and no mode is faster than √(k/m). With d_i = r_i − c and Z = Σ_i s_i* d_i as complex numbers,
///   U = k/2 Σ_i (|d_i|² + |s_i|²) − k |Z|,  ∂U/∂r_i = k (d_i − ẑ s_i),  ẑ = Z/|Z|,
///   ∂²U/∂r_i∂r_j = k [(δ_ij − 1/n) 1 − (J ẑ s_i)(J ẑ s_j)ᵀ/|Z|],  J a turn by 90°.
/// Smooth where Z is not 0. Elements: particles.
struct RestShape {
  Real k = 0;
  std::shared_ptr<const RestOutlines> outlines = nullptr;

  static constexpr Elements elements = Elements::particles;
  static std::string_view name() { return "rest_shape"; }
  /// contacts: the stiffness of contacts, ε/δ².
  void read(ParameterReader& p, Real contacts) {
    k = contacts * p.number({.name = "shape_stiffness",
                             .symbol = "k_s/k_n",
                             .help = "stiffness of springs that keep the shape, divided by the contact stiffness",
                             .value = 1,
                             .min_open = true,
                             .role = Role::rest_shape});
  }

  bool enabled(const StateView<2>&) const { return k > 0; }
  static Index particle(const StateView<2>&, Index m) { return m; }

  Real energy(const StateView<2>& s, Index m) const {
    const Fit fit(s, m, outline(s.topology, m));
    Real sum = 0;
    for (Index a = 0; a < fit.n; ++a) sum += fit.off(s, a).squaredNorm();
    return k / 2 * sum;
  }

  template <class G>
  void add_gradient(const StateView<2>& s, Index m, G& grad) const {
    const Fit fit(s, m, outline(s.topology, m));
    for (Index a = 0; a < fit.n; ++a) grad.add(fit.first + a, Vec<2>(k * fit.off(s, a)));
  }

  void add_hessian(const StateView<2>& s, Index m, BlockSink<2>& h) const {
    const Fit fit(s, m, outline(s.topology, m));
    for (Index a = 0; a < fit.n; ++a)
      for (Index b = 0; b < fit.n; ++b) {
        const Vec<2> u = quarter(fit.turned(a)), w = quarter(fit.turned(b));
        h.add(fit.first + a, fit.first + b,
              k * ((a == b ? 1.0 : 0.0) - 1.0 / fit.n) * Mat<2>::Identity() - k / fit.size * u * w.transpose());
      }
  }

  Real max_rate(const Topology& topology) const {
    return k > 0 ? std::sqrt(k / smallest_over_points(topology, [&](Index i) { return topology.mass(i); })) : 0;
  }

 private:
  static Vec<2> quarter(const Vec<2>& a) { return {-a[1], a[0]}; }

  const std::vector<Vec<2>>& outline(const Topology& topology, Index m) const {
    const auto n = static_cast<std::size_t>(topology.points_of(m));
    if (outlines == nullptr || n >= outlines->size() || (*outlines)[n].size() != n)
      throw std::logic_error("there is no outline of " + std::to_string(n) + " vertices for polygons to keep");
    return (*outlines)[n];
  }

  /// The outline, where it fits a particle best.
  struct Fit {
    const std::vector<Vec<2>>& outline;
    Index first, n;
    Vec<2> mean, turn;  ///< ẑ, times the length of an edge
    Real size;          ///< |Z|

    Fit(const StateView<2>& s, Index m, const std::vector<Vec<2>>& shape)
        : outline(shape),
          first(s.topology.offset[m]),
          n(s.topology.points_of(m)),
          mean(mean_of_points<2>(s.x, s.topology, m)) {
      Vec<2> z = Vec<2>::Zero();
      for (Index a = 0; a < n; ++a) {
        const Vec<2>&p = outline[a], d = s.position(first + a) - mean;
        z += Vec<2>(p.dot(d), p[0] * d[1] - p[1] * d[0]);
      }
      const Real l0 = s.topology.l0[m], norm = z.norm();
      size = l0 * norm;
      turn = norm > 0 ? Vec<2>(l0 / norm * z) : Vec<2>(l0, 0);
    }
    /// ẑ s_a
    Vec<2> turned(Index a) const {
      const Vec<2>& p = outline[a];
      return {turn[0] * p[0] - turn[1] * p[1], turn[0] * p[1] + turn[1] * p[0]};
    }
    Vec<2> off(const StateView<2>& s, Index a) const { return s.position(first + a) - mean - turned(a); }
  };
};

}  // namespace pliant
