// Particles in a box, without walls and gravity.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <pliant/system/fire.h>

#include "support/twins.h"

namespace pliant::test {

template <int D>
struct Packing {
  using Deformation = Eigen::Matrix<Real, D, D>;

  Topology topology;
  std::vector<Real> x;
  Box<D> box;
  ModelKind kind = ModelKind::sp;
  ModelParameters p = parameters;

  Packing(const Configuration<D>& c, const Box<D>& in, ModelKind model, const ModelParameters& of_model = parameters)
      : topology(c.topology), x(c.x), box(in), kind(model), p(of_model) {}

  Index size() const { return static_cast<Index>(x.size()); }
  Index particles() const { return topology.particles(); }
  ParticleSystem<D> system() const {
    return ParticleSystem<D>(topology, {}, make_force_field<D>(kind, p, pliant::Vec<D>::Zero()), skin, Ranks(), box);
  }
  /// r → F r of the particles and the box.
  Packing deformed(const Deformation& f) const {
    Packing other = *this;
    if (!box.open()) other.box = Box<D>(f * box.origin(), box.length(), box.tilt()).deformed(f);
    for (Index i = 0; i < topology.points(); ++i) point<D>(other.x.data(), i) = f * point<D>(x.data(), i);
    return other;
  }
  /// Energy, and elastic forces on the points.
  Real energy(VectorXd& force) const {
    auto s = system();
    const StateView<D> view = s.view(x.data(), nullptr);
    VectorXd all(view.topology.points() * D);
    const Real u = s.field().energy(view, all.data());
    force = all.head(size());
    return u;
  }
  /// Moves the particles to a minimum of the energy. Returns the energy.
  Real relax(Real force_tolerance) {
    auto s = system();
    std::vector<Real> all;
    const auto energy_and_force = [&](const Real* at, Real* f) {
      const StateView<D> view = s.view(at, nullptr);
      all.resize(static_cast<std::size_t>(view.topology.points()) * D);
      const Real u = s.field().energy(view, all.data());
      std::copy_n(all.begin(), x.size(), f);
      return u;
    };
    const Real fastest = 2 / s.field().critical_step(topology).elastic;
    const std::vector<Real> mass{1};
    FireOptions options{.dt = 0.1 / fastest, .dt_max = 1 / fastest, .force_tolerance = force_tolerance};
    options.max_iterations = 200000;
    const FireResult result = fire(x, mass, energy_and_force, options);
    return result.converged ? result.energy : std::nan("");
  }
};

/// Triangular lattice of columns · rows disks of diameter 1 at this distance, rows along x; rows even.
inline Packing<2> triangular_lattice(Index columns, Index rows, Real distance, const ModelParameters& p = parameters) {
  Configuration<2> c;
  const Real height = distance * std::sqrt(0.75);
  for (Index k = 0; k < columns * rows; ++k) {
    const Index row = k / columns;
    c.add_soft(1, {distance * (k % columns + (row % 2) / 2.0), height * row});
  }
  return {c, Box<2>({0, 0}, {columns * distance, rows * height}), ModelKind::sp, p};
}

/// n disks or spheres, half of them 1.4 times as wide, at this fraction of the volume, relaxed from random places.
template <int D>
Packing<D> disordered(std::uint64_t seed, Index n, Real fraction) {
  Random random(seed);
  Configuration<D> c;
  Real volume = 0;
  for (Index m = 0; m < n; ++m) {
    const Real sigma = m % 2 == 0 ? 1 / 1.2 : 1.4 / 1.2;
    volume += D == 2 ? pi / 4 * square(sigma) : pi / 6 * sigma * square(sigma);
    c.add_soft(sigma, pliant::Vec<D>::Zero());
  }
  const Real length = std::pow(volume / fraction, 1.0 / D);
  for (Real& a : c.x) a = random(0, length);
  return {c, Box<D>(pliant::Vec<D>::Zero(), pliant::Vec<D>::Constant(length)), ModelKind::sp};
}

/// Four octagons, which press each other.
inline Packing<2> octagons(ModelKind kind, const ModelParameters& p = parameters) {
  Random random(5);
  Configuration<2> c;
  for (Index m = 0; m < 4; ++m) {
    c.add_polygon(regular_polygon(8, 0.5, {1.05 * (m % 2) + random(-0.1, 0.1), 0.98 * (m / 2)}, random(0, 1)), 0.2);
    c.topology.a0[m] /= 0.85;
    c.topology.l0[m] /= 0.85;
  }
  return {c, Box<2>({0, 0}, {2.1, 1.96}), kind, p};
}

}  // namespace pliant::test
