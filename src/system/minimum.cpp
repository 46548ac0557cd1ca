#include <pliant/system/minimum.h>

#include <Eigen/Cholesky>

namespace pliant {
namespace {

/// Rows and columns of inactive points remain rows and columns of the unit matrix.
template <int D>
struct DenseHessian final : BlockSink<D> {
  explicit DenseHessian(const Topology& t) : topology(t), matrix(t.points() * D, t.points() * D) {
    matrix.setZero();
    for (Index i = 0; i < t.points(); ++i)
      if (t.inverse_mass(i) == 0) matrix.template block<D, D>(i * D, i * D).setIdentity();
  }
  void add(Index i, Index j, const Mat<D>& block) override {
    if (topology.inverse_mass(i) != 0 && topology.inverse_mass(j) != 0)
      matrix.template block<D, D>(i * D, j * D) += block;
  }
  const Topology& topology;
  Eigen::MatrixXd matrix;
};

}  // namespace

template <int D>
bool next_to_minimum(ParticleSystem<D>& system, std::span<const Real> x, Real t, Real reach) {
  constexpr int most_steps = 20;
  constexpr Real converged = 1e-6;  // of the reach, by a method of second order
  if (!system.box().open()) return false;
  const Topology& topology = system.topology();
  const Eigen::Map<const Eigen::VectorXd> start(x.data(), static_cast<Eigen::Index>(x.size()));
  Eigen::VectorXd at = start, force(at.size());
  for (int step = 0; step < most_steps; ++step) {
    const StateView<D> s = system.view(at.data(), nullptr, t);
    system.field().energy(s, force.data());
    for (Index i = 0; i < topology.points(); ++i)
      if (topology.inverse_mass(i) == 0) force.template segment<D>(i * D).setZero();
    DenseHessian<D> hessian(topology);
    system.field().hessian(s, hessian);
    const Eigen::LLT<Eigen::MatrixXd> factors(hessian.matrix);
    if (factors.info() != Eigen::Success) return false;
    const Eigen::VectorXd move = factors.solve(force);
    at += move;
    if (!((at - start).template lpNorm<Eigen::Infinity>() < reach)) return false;
    if (move.template lpNorm<Eigen::Infinity>() < converged * reach) return true;
  }
  return false;
}

template bool next_to_minimum<2>(ParticleSystem<2>&, std::span<const Real>, Real, Real);
template bool next_to_minimum<3>(ParticleSystem<3>&, std::span<const Real>, Real, Real);

}  // namespace pliant
