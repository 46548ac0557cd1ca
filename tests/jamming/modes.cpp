// Vibrations against closed forms, and of dense against sparse solvers.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>

#include <pliant/jamming/backbone.h>
#include <pliant/jamming/contact_network.h>
#include <pliant/jamming/minimise.h>
#include <pliant/jamming/modes.h>
#include <pliant/jamming/moduli.h>
#include <pliant/jamming/saddle.h>

#include "jamming/packing.h"

namespace pliant::test::modes_test {
using Catch::Matchers::Contains;

namespace {

template <int D>
Modes modes_of(const Packing<D>& packing, const ModesOptions& options = {}) {
  auto system = packing.system();
  return modes<D>(system, packing.x, options);
}

/// ω² of all plane waves of a triangular lattice in its box: eigenvalues of the dynamical matrix
/// Σ_bonds 2 (1 − cos q·r) [k n nᵀ + V'/a (1 − n nᵀ)]/m over the three bonds r = a n of a site.
std::vector<Real> bands(const Packing<2>& lattice, Index columns, Index rows, Real a, bool pre_stress) {
  const Real k = parameters.epsilon, slope = pre_stress ? -parameters.epsilon * (1 - a) : 0;
  std::vector<Real> all;
  for (Index u = 0; u < columns; ++u)
    for (Index v = 0; v < rows; ++v) {
      const pliant::Vec<2> q(2 * pi * u / lattice.box.length()[0], 2 * pi * v / lattice.box.length()[1]);
      Eigen::Matrix2d dynamical = Eigen::Matrix2d::Zero();
      for (int bond = 0; bond < 3; ++bond) {
        const pliant::Vec<2> n = at_angle(bond * pi / 3);
        const Eigen::Matrix2d along = n * n.transpose();
        dynamical += 2 * (1 - std::cos(a * q.dot(n))) *
                     (k * along + slope / a * (Eigen::Matrix2d::Identity() - along)) / lattice.topology.mass(0);
      }
      const Eigen::Vector2d values = dynamical.selfadjointView<Eigen::Lower>().eigenvalues();
      all.insert(all.end(), {values[0], values[1]});
    }
  std::ranges::sort(all);
  return all;
}

}  // namespace

TEST_CASE("vibrations of a triangular lattice are plane waves", "[modes]") {
  constexpr Index columns = 5, rows = 6;
  for (const PreStress pre_stress : {PreStress::kept, PreStress::dropped}) {
    const Packing<2> lattice = triangular_lattice(columns, rows, 0.95);
    const Modes m = modes_of(lattice, {.pre_stress = pre_stress});
    const auto expected = bands(lattice, columns, rows, 0.95, pre_stress == PreStress::kept);
    REQUIRE(m.eigenvalues.size() == static_cast<Index>(expected.size()));
    for (std::size_t k = 0; k < expected.size(); ++k)
      CHECK(std::abs(m.eigenvalues[static_cast<Index>(k)] - expected[k]) < 1e-11 * expected.back());
    CHECK(m.zero == 2);
    CHECK(m.unstable == 0);
    CHECK(m.residual < 1e-12);
    // All disks have the same mass.
    const Modes plain = modes_of(lattice, {.mass = ModeMass::plain, .pre_stress = pre_stress});
    CHECK((plain.eigenvalues - m.eigenvalues * lattice.topology.mass(0)).norm() < 1e-11 * plain.eigenvalues.norm());
    CHECK(std::accumulate(m.participation.begin(), m.participation.end(), 0.0) / m.eigenvalues.size() > 0.5);
    CHECK(m.frequencies().back() == Approx(std::sqrt(expected.back())));
  }
  // The highest of the density of states, and its sum.
  const std::vector<Real> frequencies{-1, 0, 2, 3, 5, 8};
  const DensityOfStates states = density_of_states(frequencies, 1e-6, 6, 3);
  CHECK(states.edges == std::vector<Real>{0, 2, 4, 6});
  CHECK(states.density == std::vector<Real>{0, 0.25, 0.125});
  CHECK_THROWS_WITH(density_of_states(frequencies, 0, 3, 0), Contains("0 bins"));
}

TEST_CASE("sparse and dense solvers find the same modes", "[modes]") {
  const auto check = [&]<int D>(Packing<D> packing) {
    REQUIRE(std::isfinite(packing.relax(1e-11)));
    for (const ModeMass mass : {ModeMass::vibrations, ModeMass::plain}) {
      const Modes all = modes_of(packing, {.mass = mass}), dense = modes_of(packing, {.mass = mass, .lowest = 12}),
                  sparse = modes_of(packing, {.mass = mass, .lowest = 12, .largest_dense = 0});
      CHECK(all.zero == D);
      CHECK(all.unstable == 0);
      CHECK(dense.zero == D);
      CHECK(sparse.zero == D);
      const Real scale = all.eigenvalues.tail(1)[0];
      CHECK((dense.eigenvalues - all.eigenvalues.head(12)).norm() == 0);
      REQUIRE(sparse.eigenvalues.size() == 12);
      CHECK((sparse.eigenvalues - all.eigenvalues.head(12)).norm() < 1e-10 * scale);
      CHECK(sparse.residual < 1e-10);
      CHECK((sparse.vectors.transpose() * sparse.vectors - MatrixXd::Identity(12, 12)).norm() < 1e-8);
      for (Index k = D; k < 12; ++k) CHECK(sparse.participation[k] == Approx(all.participation[k]).epsilon(1e-4));
      // A mode moves the energy by ω²/2 per square of its amplitude.
      auto system = packing.system();
      const auto displacement = mode_displacements<D>(system, sparse, D);
      Real inertia = 0;
      for (Index i = 0; i < packing.topology.points(); ++i)
        inertia +=
            (mass == ModeMass::plain ? 1 : packing.topology.mass(i)) * point<D>(displacement.data(), i).squaredNorm();
      constexpr Real small = 1e-5;
      const std::vector<Real> amplitudes{-small, 0, small};
      const auto u = energies_along<D>(system, packing.x, displacement, amplitudes);
      CHECK(u[1].total == Approx(u[1].contacts));
      CHECK((u[0].total + u[2].total - 2 * u[1].total) / square(small) ==
            Approx(inertia * sparse.eigenvalues[D]).epsilon(1e-3));
    }
  };
  check(disordered<2>(1, 32, 0.95));
  check(disordered<3>(2, 32, 0.8));
}

TEST_CASE("polygons that press each other only translate freely, also without bending", "[modes]") {
  for (const ModelKind kind : {ModelKind::rough, ModelKind::smooth})
    for (const Real k_b : {0.02, 0.0}) {
      ModelParameters p = parameters;
      p.k_b = k_b;
      Packing<2> packing = octagons(kind, p);
      REQUIRE(std::isfinite(packing.relax(1e-11)));
      const Modes m = modes_of(packing);
      CHECK(m.zero == 2);
      CHECK(m.unstable == 0);
      CHECK(m.participation[0] == Approx(1));
    }
}

TEST_CASE("rattlers add zero modes, and unstable packings have negative eigenvalues", "[modes]") {
  Packing<2> packing = disordered<2>(6, 32, 0.86);
  REQUIRE(std::isfinite(packing.relax(1e-12)));
  auto system = packing.system();
  const auto network = contact_network<2>(system, packing.x);
  REQUIRE(network.rattlers.size() == 1);
  const auto zero_modes = [&](Index largest_dense) {
    return modes<2>(system, packing.x, {.lowest = 8, .zero_threshold = 1e-8, .largest_dense = largest_dense}).zero;
  };
  CHECK(zero_modes(600) > 2);
  CHECK(zero_modes(0) == zero_modes(600));
  {
    const Backbone<2> backbone(system, network.rattlers);
    CHECK(zero_modes(600) == 2);
    CHECK(zero_modes(0) == 2);
  }
  const Packing<2> lattice = triangular_lattice(4, 4, 0.72);
  const Modes dense = modes_of(lattice, {.lowest = 10}), sparse = modes_of(lattice, {.lowest = 10, .largest_dense = 0});
  CHECK(dense.unstable > 0);
  CHECK(sparse.unstable == dense.unstable);
  CHECK((sparse.eigenvalues - dense.eigenvalues).norm() < 1e-9 * dense.eigenvalues.norm());
  CHECK(sparse.frequencies()[0] < 0);
}

TEST_CASE("a minimisation from a saddle point ends at a minimum", "[modes]") {
  Packing<2> lattice = triangular_lattice(4, 4, 0.72);
  REQUIRE(modes_of(lattice, {.lowest = 1}).unstable > 0);
  auto system = lattice.system();
  MinimiserOptions options;
  options.force_tolerance = 1e-12;
  REQUIRE(minimise<2>(system, lattice.x, options).converged);
  REQUIRE(modes_of(lattice, {.lowest = 1}).unstable > 0);  // the minimisation has kept the symmetry
  int saddles = 0;
  while (saddles < 10 && leave_saddle<2>(system, lattice.x, {})) {
    REQUIRE(minimise<2>(system, lattice.x, options).converged);
    ++saddles;
  }
  CHECK(saddles > 0);
  CHECK(saddles < 10);
  CHECK(modes_of(lattice, {.lowest = 1}).unstable == 0);
}

TEST_CASE("packings are analysed on one rank", "[ranks][modes]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  const Packing<2> lattice = triangular_lattice(4, 4, 0.95);
  ParticleSystem<2> system(lattice.topology, {}, make_force_field<2>(ModelKind::sp, parameters, {0, 0}), skin, ranks,
                           lattice.box);
  const auto check = [&](auto&& analyse) {
    if (ranks.several())
      CHECK_THROWS_WITH(analyse(), Contains("on one rank, not on " + std::to_string(ranks.size())));
    else
      CHECK_NOTHROW(analyse());
  };
  check([&] { return modes<2>(system, lattice.x); });
  check([&] { return contact_network<2>(system, lattice.x); });
  check([&] { return moduli<2>(system, lattice.x); });
}

TEST_CASE("modes refuse numbers out of range", "[modes]") {
  const Packing<2> lattice = triangular_lattice(4, 4, 0.95);
  CHECK_THROWS_WITH(modes_of(lattice, {.lowest = -1}), Contains("-1 modes"));
  CHECK(modes_of(lattice, {.lowest = 1000}).eigenvalues.size() == 32);
}

}  // namespace pliant::test::modes_test
