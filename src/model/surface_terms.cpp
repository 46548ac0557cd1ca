#include <pliant/model/surface_terms.h>

#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <vector>

#include <pliant/base/rng.h>
#include <pliant/geometry/distance.h>
#include <pliant/model/resting_surface.h>

namespace pliant {
namespace {

/// A sparse matrix made of blocks.
class SparseSink final : public BlockSink<3> {
 public:
  void add(Index i, Index j, const Mat<3>& block) override {
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) entries_.emplace_back(3 * i + a, 3 * j + b, block(a, b));
  }

  /// Largest absolute value of an eigenvalue, which is too small by a percent at most.
  Real largest_eigenvalue(Index points) const {
    constexpr int iterations = 400;
    Eigen::SparseMatrix<Real, Eigen::RowMajor> matrix(3 * points, 3 * points);
    matrix.setFromTriplets(entries_.begin(), entries_.end());
    Eigen::VectorXd v(3 * points);
    for (Index k = 0; k < 3 * points; ++k) v[k] = rng::uniform(1, 0, static_cast<std::uint64_t>(k)) - 0.5;
    Real largest = 0;
    for (int k = 0; k < iterations; ++k) {
      v = matrix * v.normalized();
      largest = v.norm();
      if (!(largest > 0)) return 0;
    }
    return largest;
  }

 private:
  std::vector<Eigen::Triplet<Real>> entries_;
};

/// ∂V/∂r_i; at(i): position of vertex i.
template <class At>
std::vector<Vec<3>> volume_gradient(const Surface& surface, At&& at) {
  std::vector<Vec<3>> gradient(static_cast<std::size_t>(surface.points()), Vec<3>::Zero());
  for (const auto& [a, b, c] : surface.faces) {
    const Vec<3> normal = face_normal(at(a), at(b), at(c)) / 6;
    for (const Index i : {a, b, c}) gradient[i] += normal;
  }
  return gradient;
}

}  // namespace

Real SurfaceTerm::largest_of_kinds(const Topology& topology, Real in_icospheres,
                                   const std::function<Real(const Surface&)>& value) {
  Real most = in_icospheres;
  if (topology.surfaces)
    for (const Surface& surface : topology.surfaces->kinds) most = std::max(most, value(surface));
  return most;
}

Real SurfaceTerm::stiffest_mode(const Surface& surface,
                                const std::function<void(const StateView<3>&, BlockSink<3>&)>& add_hessian) {
  SparseSink sink;
  const RestingSurface resting(surface);
  add_hessian(resting.view(), sink);
  return sink.largest_eigenvalue(surface.points());
}

void Volume::add_hessian(const StateView<3>& s, Index m, BlockSink<3>& h, PreStress pre_stress) const {
  const Shape p = shape(s, m);
  const Index n = p.surface.points();
  const std::vector<Vec<3>> gradient = volume_gradient(p.surface, [&](Index i) { return p.at(i); });
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < n; ++j) h.add(p.first + i, p.first + j, k_v * gradient[i] * gradient[j].transpose());
  const Real sixth = slope_factor(pre_stress) * k_v * excess(s, m) / 6;
  for (const Hinge& k : p.surface.hinges) {
    const Mat<3> block = -sixth * skew(p.at(k.c) - p.at(k.d));
    h.add(p.first + k.a, p.first + k.b, block);
    h.add(p.first + k.b, p.first + k.a, block.transpose());
  }
}

Real Volume::max_rate(const Topology& topology) const {
  // |∇V|², in units of S0²/Nv.
  const auto square_gradient = [](const Surface& surface) {
    const RestingSurface resting(surface);
    Real sum = 0;
    for (const Vec<3>& g : volume_gradient(surface, [&](Index i) { return resting.view().position(i); }))
      sum += g.squaredNorm();
    return sum * surface.points() / square(surface.total_rest_area());
  };
  const Real unevenness = largest_of_kinds(topology, 1, square_gradient);
  Real fastest = 0;
  for (Index m = 0; topology.surfaces && m < topology.particles(); ++m) {
    const Real area =
        topology.surfaces->of(topology, m).total_rest_area() * square(topology.surfaces->scale(topology, m));
    fastest = std::max(fastest,
                       unevenness * k_v * square(area) / (topology.mass(topology.offset[m]) * topology.points_of(m)));
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

void EdgeLength::add_hessian(const StateView<3>& s, Index m, BlockSink<3>& sink, PreStress pre_stress) const {
  const Shape p = shape(s, m);
  for (std::size_t k = 0; k < p.surface.hinges.size(); ++k) {
    const Index a = p.surface.hinges[k].a, b = p.surface.hinges[k].b;
    const Vec<3> l = p.at(b) - p.at(a);
    const Real length = l.norm();
    const Vec<3> n = l / length;
    const Mat<3> block = k_l * (n * n.transpose() + slope_factor(pre_stress) * (length - p.rest_length(k)) *
                                                        distance_curvature<3>(n, length));
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

void HingeBending::add_hessian(const StateView<3>& s, Index m, BlockSink<3>& sink, PreStress pre_stress) const {
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
                 k_b * (turn.cosine * angle.gradient[i] * angle.gradient[j].transpose() +
                        slope_factor(pre_stress) * turn.sine * second[i][j]));
  }
}

Real HingeBending::max_rate(const Topology& topology) const {
  HingeBending unit = *this;
  unit.k_b = 1;
  const Real stiffest = largest_of_kinds(topology, 37, [&](const Surface& surface) {
    return square(surface.mean_rest_length()) *
           stiffest_mode(surface, [&](const StateView<3>& s, BlockSink<3>& sink) { unit.add_hessian(s, 0, sink); });
  });
  Real fastest = 0;
  for (Index m = 0; m < topology.particles(); ++m)
    fastest = std::max(fastest, stiffest * k_b / (square(topology.l0[m]) * topology.mass(topology.offset[m])));
  return std::sqrt(fastest);
}

}  // namespace pliant
