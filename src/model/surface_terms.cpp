#include <pliant/model/surface_terms.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <pliant/geometry/distance.h>

namespace pliant {

void Volume::add_hessian(const StateView<3>& s, Index m, BlockSink<3>& h) const {
  const Shape p = shape(s, m);
  const Index n = p.surface.points();
  std::vector<Vec<3>> gradient(n, Vec<3>::Zero());
  for (const auto& [a, b, c] : p.surface.faces) {
    const Vec<3> normal = face_normal(p.at(a), p.at(b), p.at(c)) / 6;
    for (const Index i : {a, b, c}) gradient[i] += normal;
  }
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < n; ++j) h.add(p.first + i, p.first + j, k_v * gradient[i] * gradient[j].transpose());
  const Real sixth = k_v * excess(s, m) / 6;
  for (const Hinge& k : p.surface.hinges) {
    const Mat<3> block = -sixth * skew(p.at(k.c) - p.at(k.d));
    h.add(p.first + k.a, p.first + k.b, block);
    h.add(p.first + k.b, p.first + k.a, block.transpose());
  }
}

Real Volume::max_rate(const Topology& topology) const {
  Real fastest = 0;
  for (Index m = 0; topology.surfaces && m < topology.particles(); ++m) {
    const Real area =
        topology.surfaces->of(topology, m).total_rest_area() * square(topology.surfaces->scale(topology, m));
    fastest = std::max(fastest, k_v * square(area) / (topology.mass(topology.offset[m]) * topology.points_of(m)));
  }
  return std::sqrt(fastest);
}

Real EdgeLength::energy(const StateView<3>& s, Index m) const {
  const Shape p = shape(s, m);
  Real sum = 0;
  for (std::size_t k = 0; k < p.surface.hinges.size(); ++k) {
    const Hinge& h = p.surface.hinges[k];
    sum += square((p.at(h.b) - p.at(h.a)).norm() - p.rest_length(k));
  }
  return k_l / 2 * sum;
}

void EdgeLength::add_hessian(const StateView<3>& s, Index m, BlockSink<3>& sink) const {
  const Shape p = shape(s, m);
  for (std::size_t k = 0; k < p.surface.hinges.size(); ++k) {
    const Index a = p.surface.hinges[k].a, b = p.surface.hinges[k].b;
    const Vec<3> l = p.at(b) - p.at(a);
    const Real length = l.norm();
    const Vec<3> n = l / length;
    const Mat<3> block = k_l * (n * n.transpose() + (length - p.rest_length(k)) * distance_curvature<3>(n, length));
    for (const Index i : {a, b})
      for (const Index j : {a, b}) sink.add(p.first + i, p.first + j, i == j ? block : Mat<3>(-block));
  }
}

HingeBending::Turn HingeBending::rest(const Surface& surface, std::size_t hinge) const {
  if (!with_rest) return {};
  return {std::cos(surface.rest_angle[hinge]), std::sin(surface.rest_angle[hinge])};
}

Real HingeBending::energy(const StateView<3>& s, Index m) const {
  const Shape p = shape(s, m);
  Real sum = 0;
  for (std::size_t k = 0; k < p.surface.hinges.size(); ++k) {
    const HingeAngle angle = p.angle(p.surface.hinges[k]);
    const Turn from = rest(p.surface, k);
    // 1 − cos(θ − θ0) without a difference of nearly equal numbers.
    sum += (square(angle.cosine - from.cosine) + square(angle.sine - from.sine)) / 2;
  }
  return k_b * sum;
}

void HingeBending::add_hessian(const StateView<3>& s, Index m, BlockSink<3>& sink) const {
  const Shape p = shape(s, m);
  for (std::size_t k = 0; k < p.surface.hinges.size(); ++k) {
    const Hinge& h = p.surface.hinges[k];
    const HingeAngle angle = p.angle(h);
    const Turn turn = bent(angle, rest(p.surface, k));
    const auto second = angle.hessian();
    const std::array<Index, 4> points = p.points(h);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        sink.add(points[i], points[j],
                 k_b * (turn.cosine * angle.gradient[i] * angle.gradient[j].transpose() + turn.sine * second[i][j]));
  }
}

Real HingeBending::max_rate(const Topology& topology) const {
  Real fastest = 0;
  for (Index m = 0; m < topology.particles(); ++m)
    fastest = std::max(fastest, 37 * k_b / (square(topology.l0[m]) * topology.mass(topology.offset[m])));
  return std::sqrt(fastest);
}

}  // namespace pliant
