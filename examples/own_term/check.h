// Checks the derivatives of the line tension by finite differences, and lets a polygon relax: at rest the pressure
// inside balances the line tension.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <vector>

#include <pliant/base/console.h>
#include <pliant/model/area.h>
#include <pliant/model/polygon.h>
#include <pliant/system/fire.h>
#include <pliant/system/particle_system.h>

#include "line_tension.h"

namespace check {

using namespace pliant;

constexpr Index vertices = 24;
constexpr Real area_stiffness = 100;

inline ParticleSystem<2> polygon(Real tension) {
  Topology topology;
  const Real a0 = pi / 4, l0 = pi / vertices, delta = 0.1 * l0, mass = a0;
  topology.add_polygon(vertices, a0, l0, delta, mass);
  auto model = std::make_unique<Model<2, Area, LineTension>>(Area{area_stiffness}, LineTension{tension});
  return ParticleSystem<2>(topology, Walls<2>(), std::move(model), 0.1);
}

/// An ellipse, twice as long as wide, with unequal edges.
inline std::vector<Real> stretched() {
  std::vector<Real> x;
  for (Index i = 0; i < vertices; ++i) {
    const Real angle = 2 * pi * (i + 0.3 * std::sin(3.0 * i)) / vertices;
    x.push_back(std::cos(angle) / std::sqrt(2));
    x.push_back(std::sin(angle) / std::sqrt(8));
  }
  return x;
}

struct DenseHessian final : BlockSink<2> {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(2 * vertices, 2 * vertices);
  void add(Index i, Index j, const pliant::Mat<2>& block) override { matrix.block<2, 2>(2 * i, 2 * j) += block; }
};

/// Largest error of the forces against differences of the energy, and of the Hessian against differences of the forces,
/// both relative to the largest entry.
struct DerivativeErrors {
  Real force = 0, hessian = 0;
};

inline DerivativeErrors derivative_errors(const Model<2, LineTension>& term, ParticleSystem<2>& system,
                                          std::vector<Real> x) {
  const Real h = 2e-6;
  const std::size_t n = x.size();
  const auto energy = [&] { return term.energy(system.view(x.data(), nullptr), nullptr); };
  const auto force = [&] {
    Eigen::VectorXd f(n);
    term.energy(system.view(x.data(), nullptr), f.data());
    return f;
  };
  const Eigen::VectorXd f = force();
  DenseHessian exact;
  term.hessian(system.view(x.data(), nullptr), exact);
  DerivativeErrors errors;
  for (std::size_t k = 0; k < n; ++k) {
    const Real middle = x[k];
    x[k] = middle + h;
    const Real energy_above = energy();
    const Eigen::VectorXd force_above = force();
    x[k] = middle - h;
    const Real slope = (energy_above - energy()) / (2 * h);
    const Eigen::VectorXd column = -(force_above - force()) / (2 * h);
    x[k] = middle;
    errors.force = std::max(errors.force, std::abs(slope + f[k]) / f.lpNorm<Eigen::Infinity>());
    errors.hessian = std::max(errors.hessian, (column - exact.matrix.col(k)).lpNorm<Eigen::Infinity>() /
                                                  exact.matrix.lpNorm<Eigen::Infinity>());
  }
  return errors;
}

inline bool within(const char* what, Real value, Real limit) {
  say("{:<44} {:9.2e}  (limit {:.0e})  {}\n", what, value, limit, value <= limit ? "ok" : "TOO LARGE");
  return value <= limit;
}

/// Whether all checks pass; prints faults.
inline bool passes(Real tension) {
  ParticleSystem<2> system = polygon(tension);
  std::vector<Real> x = stretched();
  const Topology& topology = system.topology();
  const DerivativeErrors errors = derivative_errors(Model<2, LineTension>(LineTension{tension}), system, x);
  bool good = within("force against differences of the energy", errors.force, 1e-8);
  good = within("Hessian against differences of the force", errors.hessian, 1e-8) && good;

  const auto shape = [&] {
    return square(polygon_perimeter(x.data(), topology, 0)) / (4 * pi * polygon_area(x.data(), topology, 0));
  };
  const Real before = shape();
  const FireResult rest = fire(
      x, topology.point_mass, [&](const Real* r, Real* f) { return system.field().energy(system.view(r, nullptr), f); },
      {.dt = 0.01, .dt_max = 0.25 * system.field().critical_step(topology).one_contact(), .force_tolerance = 1e-9});
  const Real area = polygon_area(x.data(), topology, 0), perimeter = polygon_perimeter(x.data(), topology, 0);
  // For a regular polygon the radius in Laplace's law is the radius of the inscribed circle, 2 a/p.
  const Real pressure = area_stiffness * (topology.a0[0] - area), laplace = tension * perimeter / (2 * area);
  say("polygon of {} vertices: {} steps of FIRE, {}\n", vertices, rest.iterations, rest.reason);
  say("  shape p²/(4π a)   {:.6f} -> {:.6f}   (regular polygon: {:.6f})\n", before, shape(),
      vertices / pi * std::tan(pi / vertices));
  say("  pressure          {:.6f}   (gamma/r: {:.6f})\n", pressure, laplace);
  good = rest.converged && good;
  good = within("shape against the regular polygon", std::abs(shape() / (vertices / pi * std::tan(pi / vertices)) - 1),
                1e-8) &&
         good;
  return within("pressure against Laplace's law", std::abs(pressure / laplace - 1), 1e-8) && good;
}

}  // namespace check
