// Contact of the round lips of walls in space, for example at an orifice, with the edges of closed surfaces.
#pragma once

#include <array>

#include <pliant/geometry/circle.h>
#include <pliant/kernels/contact_law.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/term.h>

namespace pliant {

/// Without it a lip enters a face between its vertices. For a lip, the circle C, and an edge e from a to b:
///   U = m_q [V(d(e, C)) − V(d(a, C)) − V(d(b, C))], V as for walls.
/// Vertices feel the lip already as points near the wall's end (LipContact). The nearest place of an edge along the lip
/// jumps; therefore m_q = t² (3 − 2 t), t = (s − s1)/(3 s1) between 0 and 1, with s = sin² of the angle between the
/// edge and the lip at the middle of the edge, and s1 = (width of the edge/mean rest length)². U is C¹.
struct RimContact : LipSettings {
  using Law = HarmonicOverlap;

  Real s1 = 0;  ///< 0: from the width

  Real energy(const StateView<3>& s, Index e) const {
    const Rim rim(*this, s, e);
    return rim.touches() ? rim.factor().value * rim.sum() : 0;
  }

  template <class G>
  void add_gradient(const StateView<3>& s, Index e, G& grad) const {
    const Rim rim(*this, s, e);
    if (!rim.touches()) return;
    const auto by_points = rim.gradient();
    for (int k = 0; k < 2; ++k) grad.add(rim.points[k], rim.pose.direction(by_points[k]));
  }

  /// Force of the lip on the edge; the wall that ends in it feels the opposite.
  Vec<3> force(const StateView<3>& s, Index e) const {
    const Rim rim(*this, s, e);
    if (!rim.touches()) return Vec<3>::Zero();
    const auto by_points = rim.gradient();
    return -rim.pose.direction(by_points[0] + by_points[1]);
  }

  void add_hessian(const StateView<3>& s, Index e, BlockSink<3>& h) const {
    const Rim rim(*this, s, e);
    if (!rim.touches()) return;
    for (int k = 0; k < 2; ++k)
      for (int l = 0; l < 2; ++l) h.add(rim.points[k], rim.points[l], rim.pose.matrix(rim.hessian(k, l)));
  }

  Real max_rate(const Topology& topology) const { return rate_of(Law::stiffness, topology); }

 private:
  /// A place p and the circle: distance, direction from the circle, and second derivatives of the distance.
  struct Near {
    Real d;
    Vec<3> n;
    Mat<3> curvature;
    Near(const Circle& circle, const Vec<3>& p) : d(circle.distance(p)) {
      n = direction<3>(p - circle.nearest(p), d);
      const Real rho = length_of(p[0], p[1]);
      const Vec<3> radial(p[0] / rho, p[1] / rho, 0), around(-radial[1], radial[0], 0);
      const Real out = n.dot(radial);
      const Vec<3> across = out * Vec<3>(0, 0, 1) - n[2] * radial;
      curvature = out / rho * around * around.transpose();
      if (d > 0) curvature += across * across.transpose() / d;
    }
  };

  /// An edge and a lip, in the frame of the walls.
  struct Rim {
    Pose<3> pose;
    Circle circle;
    std::array<Index, 2> points;
    std::array<Vec<3>, 2> r;
    Law v;
    Real s1;
    bool near;   ///< whether the edge may touch the lip
    Real t = 0;  ///< the nearest place is r[0] + t (r[1] − r[0])

    Rim(const RimContact& term, const StateView<3>& s, Index e) : v{term.epsilon, 0} {
      const auto [lip, edge] = s.neighbours.lips[e];
      pose = s.walls.lip_pose(lip, s.t);
      circle = s.walls.lip_circle(lip);
      points = points_of_edge(s.topology, edge);
      for (int k = 0; k < 2; ++k) r[k] = pose.back(s.position(points[k]));
      const Real width = s.topology.diameter[points[0]];
      v.delta = (width + term.thickness) / 2;
      s1 = term.s1 > 0 ? term.s1 : square(width / s.topology.l0[s.topology.particle[points[0]]]);
      near = circle.distance((r[0] + r[1]) / 2) < v.delta + (r[1] - r[0]).norm() / 2;
      if (near) t = nearest_to_circle(circle, r[0], r[1]);
    }

    Vec<3> edge() const { return r[1] - r[0]; }
    Vec<3> place() const { return r[0] + t * edge(); }
    bool inside() const { return t > 0 && t < 1; }
    std::array<Real, 2> weights() const { return {1 - t, t}; }
    static Real side(int k) { return k == 0 ? -1 : 1; }
    bool touches() const { return near && v.touches(circle.distance(place())); }

    /// V(edge) − Σ V(end).
    Real sum() const {
      return v.value(circle.distance(place())) - v.value(circle.distance(r[0])) - v.value(circle.distance(r[1]));
    }
    std::array<Vec<3>, 2> sum_gradient() const {
      const Near at(circle, place());
      std::array<Vec<3>, 2> by_points;
      for (int k = 0; k < 2; ++k) {
        const Near end(circle, r[k]);
        by_points[k] = weights()[k] * v.slope(at.d) * at.n - v.slope(end.d) * end.n;
      }
      return by_points;
    }
    Mat<3> sum_hessian(int k, int l) const {
      const Near at(circle, place());
      const auto w = weights();
      Mat<3> of_distance = w[k] * w[l] * at.curvature;
      if (inside()) {  // the place wanders
        const Vec<3> bent = at.curvature * edge();
        const auto mixed = [&](int i) { return Vec<3>(w[i] * bent + side(i) * at.n); };
        if (const Real along = edge().dot(bent); along > 0) of_distance -= mixed(k) * mixed(l).transpose() / along;
      }
      Mat<3> h = v.curvature(at.d) * w[k] * w[l] * at.n * at.n.transpose() + v.slope(at.d) * of_distance;
      if (k == l) {
        const Near end(circle, r[k]);
        h -= v.curvature(end.d) * end.n * end.n.transpose() + v.slope(end.d) * end.curvature;
      }
      return h;
    }

    /// m_q and its derivatives by s.
    struct Factor {
      Real value, slope, curvature;
    };
    Factor factor() const {
      const Real x = std::clamp((1 - square(cosine()) - s1) / (3 * s1), Real(0), Real(1));
      return {square(x) * (3 - 2 * x), 6 * x * (1 - x) / (3 * s1), x > 0 && x < 1 ? (6 - 12 * x) / square(3 * s1) : 0};
    }

    // Cosine of the angle between the edge and the lip, c = û·φ̂, with the directions ρ̂ and φ̂ at the middle of the edge;
    // derivatives by the edge u and by its middle M.
    Real rho() const { return length_of(r[0][0] + r[1][0], r[0][1] + r[1][1]) / 2; }
    Vec<3> radial() const { return Vec<3>(r[0][0] + r[1][0], r[0][1] + r[1][1], 0) / (2 * rho()); }
    Vec<3> around() const {
      const Vec<3> out = radial();
      return {-out[1], out[0], 0};
    }
    Real cosine() const { return edge().normalized().dot(around()); }
    Vec<3> by_edge() const { return (around() - cosine() * edge().normalized()) / edge().norm(); }
    Vec<3> by_middle() const { return -edge().normalized().dot(radial()) / rho() * around(); }
    Vec<3> cosine_gradient(int k) const { return side(k) * by_edge() + by_middle() / 2; }
    Mat<3> cosine_hessian(int k, int l) const {
      const Vec<3> u = edge().normalized(), out = radial(), phi = around(), turned = phi - cosine() * u;
      const Real length = edge().norm(), c = cosine(), outwards = u.dot(out);
      const Mat<3> edge_edge =
          -(turned * u.transpose() + u * turned.transpose() + c * (Mat<3>::Identity() - u * u.transpose())) /
          square(length);
      const Mat<3> edge_middle = -(out * phi.transpose() / rho() + u * by_middle().transpose()) / length;
      const Mat<3> middle_middle =
          (outwards * (out * phi.transpose() + phi * out.transpose()) - c * phi * phi.transpose()) / square(rho());
      return side(k) * side(l) * edge_edge + (side(k) * edge_middle + side(l) * edge_middle.transpose()) / 2 +
             middle_middle / 4;
    }

    std::array<Vec<3>, 2> gradient() const {
      const Factor m = factor();
      std::array<Vec<3>, 2> by_points = sum_gradient();
      const Real turning = -2 * cosine() * m.slope * sum();
      for (int k = 0; k < 2; ++k) by_points[k] = m.value * by_points[k] + turning * cosine_gradient(k);
      return by_points;
    }
    Mat<3> hessian(int k, int l) const {
      const Factor m = factor();
      const auto by_points = sum_gradient();
      const Real c = cosine();
      const Vec<3> first = -2 * c * cosine_gradient(k), second = -2 * c * cosine_gradient(l);  // derivatives of s
      const Mat<3> of_s = -2 * (cosine_gradient(k) * cosine_gradient(l).transpose() + c * cosine_hessian(k, l));
      return m.value * sum_hessian(k, l) +
             m.slope * (first * by_points[l].transpose() + by_points[k] * second.transpose() + sum() * of_s) +
             m.curvature * sum() * first * second.transpose();
    }
  };
};

}  // namespace pliant
