#include <pliant/geometry/overlap.h>

#include <algorithm>
#include <array>

namespace pliant {
namespace {

// The sphere of radius R stands on the plane as the density f(s) = 2 sqrt(R² − s²), s the distance from its centre p.
// With W the layer's cross-section and n its outward normal,
//   ∇V = −∮ f n dl,   ∇∇V = ∮ n ∇f dl,   V = ∮ (2/3)(R² − s²)^{3/2} (p − q)·n/s² dl  over the points q of W's rim,
// the last by the field −(2/3)(R² − s²)^{3/2} (q − p)/s², whose divergence is f in W as long as p is outside.

/// The straight part of the rim at the height `height` over a face, from the tip (x = 0) on.
void add_face(const Vec<2>& p, const Vec<2>& along, const Vec<2>& out, Real radius, Real height, Expansion<2>& sum) {
  const Real d = p.dot(out) - height, rho2 = square(radius) - square(d);
  if (rho2 <= 0) return;
  const Real rho = std::sqrt(rho2), s = std::max(-p.dot(along), -rho);
  if (s >= rho) return;
  const Real q = std::sqrt((rho - s) * (rho + s)), angle = std::acos(s / rho);
  sum.value += (2 * radius * square(radius) * std::atan2(d * q, radius * s) +
                d * (-4 * square(radius) * angle + 2 * square(d) * angle + rho2 * angle + s * q)) /
               3;
  sum.gradient -= (rho2 * angle - s * q) * out;
  sum.hessian += 2 * out * (d * angle * out - q * along).transpose();
}

/// Nodes and weights of tanh–sinh quadrature over −1 … 1, which does not mind singular ends.
struct Quadrature {
  static constexpr int half = 32, n = 2 * half + 1;
  std::array<Real, n> node, weight;

  Quadrature() {
    constexpr Real h = 0.1;
    for (int k = 0; k < n; ++k) {
      const Real t = (k - half) * h, s = pi / 2 * std::sinh(t);
      node[k] = std::tanh(s);
      weight[k] = h * pi / 2 * std::cosh(t) / square(std::cosh(s));
    }
  }
};

/// The round part of the rim: radius `layer` about the tip, from the normal of the first face to the normal of the
/// second. With φ the angle from the direction of p, R² − s² = 4 l D (k² − sin²(φ/2)), D = |p|, l the layer. The
/// substitution sin(φ/2) = min(k, 1) sin t makes the integrands smooth where the sphere ends within the arc.
void add_edge(const Vec<2>& p, Real opening, Real radius, Real layer, Expansion<2>& sum) {
  static const Quadrature quadrature;
  const Real distance = p.norm(), product = 4 * layer * distance;
  const Real k2 = (radius - distance + layer) * (radius + distance - layer) / product;
  if (k2 <= 0) return;
  const Real kappa = std::sqrt(std::min(k2, Real(1))), limit = 2 * std::asin(kappa);
  const Vec<2> to = p / distance, left(-to[1], to[0]);
  const Real start = std::remainder(pi / 2 - std::atan2(p[1], p[0]), 2 * pi);
  for (const Real first : {start, start - 2 * pi}) {
    const Real last = first + pi - opening;
    if (first >= limit || last <= -limit) continue;
    const auto parameter = [&](Real phi) {
      return std::asin(std::clamp(std::sin(phi / 2) / kappa, Real(-1), Real(1)));
    };
    const Real a = first <= -limit ? -pi / 2 : parameter(first), b = last >= limit ? pi / 2 : parameter(last);
    for (int k = 0; k < Quadrature::n; ++k) {
      const Real t = (a + b) / 2 + (b - a) / 2 * quadrature.node[k];
      const Real c = std::cos(t), half_sine = kappa * std::sin(t);
      const Real half_cosine = std::sqrt(1 - square(kappa) + square(kappa * c));
      const Real cosine = 1 - 2 * square(half_sine), sine = 2 * half_sine * half_cosine;
      const Real q = std::sqrt(product * (std::max(k2 - 1, Real(0)) + square(kappa * c)));
      const Real length = layer * 2 * kappa * c / half_cosine * (b - a) / 2 * quadrature.weight[k];
      const Real s2 = square(distance - layer) + product * square(half_sine);
      const Vec<2> out = cosine * to + sine * left;
      sum.value += length * 2 / 3 * q * q * q * (distance * cosine - layer) / s2;
      sum.gradient -= length * 2 * q * out;
      sum.hessian += length * 2 / q * out * (p - layer * out).transpose();
    }
  }
}

}  // namespace

Expansion<2> wedge_overlap(const Vec<2>& p, Real opening, Real radius, Real layer) {
  Expansion<2> sum;
  add_face(p, {1, 0}, {0, 1}, radius, layer, sum);
  add_face(p, {std::cos(opening), -std::sin(opening)}, {-std::sin(opening), -std::cos(opening)}, radius, layer, sum);
  add_edge(p, opening, radius, layer, sum);
  sum.hessian = (sum.hessian + sum.hessian.transpose()).eval() / 2;
  return sum;
}

}  // namespace pliant
