// Moduli by linear response against closed forms and finite strains.
#include <catch2/catch.hpp>

#include <pliant/jamming/backbone.h>
#include <pliant/jamming/contact_network.h>
#include <pliant/jamming/minimise.h>
#include <pliant/jamming/moduli.h>

#include "jamming/packing.h"

namespace pliant::test::moduli_test {
using Catch::Matchers::Contains;

namespace {

template <int D>
Moduli<D> moduli_of(const Packing<D>& packing, PreStress pre_stress = PreStress::kept) {
  auto system = packing.system();
  return moduli<D>(system, packing.x, pre_stress);
}

template <int D>
Mat<D> relaxed_stress(Packing<D> packing, Real force_tolerance) {
  REQUIRE(std::isfinite(packing.relax(force_tolerance)));
  auto system = packing.system();
  return stress_of<D>(system, packing.x.data()).stress;
}

/// The mean of the modulus against simple shear over all pairs of orthogonal directions.
template <int D>
Real mean_over_directions(const Moduli<D>& m) {
  const auto along = [&](const pliant::Vec<D>& u, const pliant::Vec<D>& v) {
    Real sum = 0;
    for (int a = 0; a < D; ++a)
      for (int b = 0; b < D; ++b)
        for (int c = 0; c < D; ++c)
          for (int d = 0; d < D; ++d) sum += m.stiffness(a, b, c, d) * u[a] * v[b] * u[c] * v[d];
    return sum;
  };
  constexpr int turns = 8, heights = D == 2 ? 1 : 100;
  Real sum = 0;
  for (int k = 0; k < turns; ++k) {
    const pliant::Vec<2> u = at_angle(2 * pi * k / turns);
    if constexpr (D == 2) {
      sum += along(u, left_of(u)) * turns;
    } else {
      for (int l = 0; l < heights; ++l) {
        const Real z = (2 * l + 1.0) / heights - 1, r = std::sqrt(1 - z * z);
        const pliant::Vec<3> n(r * u[0], r * u[1], z), e(-u[1], u[0], 0), f = n.cross(e);
        for (int j = 0; j < turns; ++j)
          sum += along(n, std::cos(2 * pi * j / turns) * e + std::sin(2 * pi * j / turns) * f);
      }
    }
  }
  return sum / (turns * turns * heights);
}

/// Against stresses of minima at strains ±h.
template <int D>
void check_finite_strains(const Packing<D>& packing, Real force_tolerance, Real h = 1e-6, Real tolerance = 1e-5) {
  const Moduli<D> m = moduli_of(packing);
  CHECK(m.max_force <= force_tolerance);
  CHECK(m.residual < 1e-8);
  CHECK(m.pressure() > 0);
  const auto slope = [&](auto&& deformation) {
    const auto at = [&](Real step) { return relaxed_stress<D>(packing.deformed(deformation(step)), force_tolerance); };
    return Mat<D>((at(h) - at(-h)) / (2 * h));
  };
  using Deformation = typename Packing<D>::Deformation;
  const Mat<D> unit = Mat<D>::Identity();
  const Real volume_rate = D;  // of the volume, by a relative length
  CHECK(
      m.bulk() ==
      Approx(slope([&](Real e) { return Deformation((1 + e) * unit); }).trace() / D / volume_rate).epsilon(tolerance));
  CHECK(m.shear() == Approx(mean_over_directions<D>(m)).epsilon(1e-3));
  // A relaxed packing is softer.
  CHECK(m.affine(1, 1) > m.simple_shear(0, 1));
  const Real scale = m.voigt().cwiseAbs().maxCoeff();
  for (int b = 0; b < D; ++b)
    for (int a = 0; a < b; ++a) {
      const Mat<D> simple = slope([&](Real gamma) {
        Deformation f = unit;
        f(a, b) = gamma;
        return f;
      });
      CHECK(std::abs(simple(a, b) - m.simple_shear(a, b)) < tolerance * scale);
      const Mat<D> pure = slope([&](Real gamma) {
        Deformation f = unit;
        f(a, a) = std::exp(gamma / 2), f(b, b) = std::exp(-gamma / 2);
        return f;
      });
      CHECK(std::abs((pure(a, a) - pure(b, b)) / 2 - m.pure_shear(a, b)) < tolerance * scale);
    }
  for (int b = 0; b < D; ++b) {
    const Mat<D> uniaxial = slope([&](Real e) {
      Deformation f = unit;
      f(b, b) += e;
      return f;
    });
    const auto voigt = m.voigt();
    for (int a = 0; a < D; ++a) CHECK(std::abs(uniaxial(a, a) - voigt(a, b)) < tolerance * scale);
    CHECK(std::abs(uniaxial(0, 1) - voigt(Moduli<D>::voigt_size - 1, b)) < tolerance * scale);
  }
}

}  // namespace

TEST_CASE("moduli of a triangular lattice with pre-stress", "[moduli]") {
  for (const Real a : {0.99, 0.85}) {
    const Packing<2> lattice = triangular_lattice(4, 4, a);
    const Moduli<2> m = moduli_of(lattice);
    const Real k = parameters.epsilon, slope = -parameters.epsilon * (1 - a), root = std::sqrt(3.0);
    CHECK(m.pressure() == Approx(-root * slope / a));
    CHECK(m.bulk() == Approx(root / 2 * (k - slope / a)));
    const Real g = root / 4 * (k + 3 * slope / a);
    CHECK(m.simple_shear(0, 1) == Approx(g));
    CHECK(m.simple_shear(1, 0) == Approx(g));
    CHECK(m.pure_shear(0, 1) == Approx(g));
    CHECK(m.shear() == Approx(g));
    CHECK((m.tangent - m.affine).norm() < 1e-9 * m.affine.norm());
    const auto voigt = m.voigt();
    CHECK((voigt - voigt.transpose()).norm() < 1e-10 * voigt.norm());
    CHECK(voigt(0, 0) == Approx(m.bulk() + g));
    CHECK(voigt(0, 1) == Approx(m.bulk() - g));
    CHECK(std::abs(voigt(0, 2)) < 1e-9);
    const Moduli<2> springs = moduli_of(lattice, PreStress::dropped);
    CHECK(springs.pressure() == 0);
    CHECK(springs.shear() == Approx(root / 4 * k));
    CHECK(springs.bulk() == Approx(root / 2 * k));
  }
}

TEST_CASE("moduli agree with finite strains of minima", "[moduli]") {
  const auto check = [&]<int D>(Packing<D> packing) {
    constexpr Real force_tolerance = 1e-11;
    REQUIRE(std::isfinite(packing.relax(force_tolerance)));
    auto system = packing.system();
    REQUIRE(contact_network<D>(system, packing.x).rattlers.empty());
    check_finite_strains<D>(packing, force_tolerance);
  };
  SECTION("disks") { check(disordered<2>(1, 32, 0.95)); }
  SECTION("spheres") { check(disordered<3>(2, 32, 0.8)); }
  for (const ModelKind kind : {ModelKind::rough, ModelKind::smooth}) SECTION(std::string(to_string(kind))) {
      check(octagons(kind));
    }
}

TEST_CASE("packings at a small pressure are isostatic", "[moduli][contact_network]") {
  for (const std::uint64_t seed : {1, 2}) {
    Packing<2> packing = disordered<2>(seed, 32, 0.9);
    REQUIRE((packing.p.mu > 0 && packing.p.zeta > 0));  // which minima do not depend on
    auto system = packing.system();
    REQUIRE(minimise<2>(system, packing.x, {.pressure = {}, .force_tolerance = 1e-6}).converged);
    const auto minimum =
        minimise<2>(system, packing.x, {.pressure = 1e-6 * parameters.epsilon, .force_tolerance = 1e-13});
    REQUIRE(minimum.converged);
    const auto network = contact_network<2>(system, packing.x, 1e-3);
    CHECK(network.contacts == network.isostatic());
    const Backbone<2> backbone(system, network.rattlers);
    const Moduli<2> m = moduli<2>(system, packing.x);
    CHECK(m.pressure() == Approx(1e-6 * parameters.epsilon));
    CHECK(m.bulk() > 20 * m.shear());
    CHECK(m.shear() > 0);
  }
}

TEST_CASE("rattlers without contacts change no modulus", "[moduli]") {
  Packing<2> packing = disordered<2>(6, 32, 0.86);
  REQUIRE(std::isfinite(packing.relax(1e-12)));
  auto system = packing.system();
  const auto network = contact_network<2>(system, packing.x);
  REQUIRE(!network.rattlers.empty());
  const Moduli<2> all = moduli<2>(system, packing.x);
  const Backbone<2> backbone(system, network.rattlers);
  const Moduli<2> some = moduli<2>(system, packing.x);
  CHECK((all.tangent - some.tangent).norm() < 1e-6 * all.tangent.norm());
  CHECK((all.stress - some.stress).norm() < 1e-9 * all.stress.norm());
}

TEST_CASE("moduli refuse open boxes, and packings that are unstable or do not touch", "[moduli]") {
  Packing<2> lattice = triangular_lattice(4, 4, 0.72);  // G < 0
  CHECK_THROWS_WITH(moduli_of(lattice), Contains("unstable") && Contains("eigenvalues"));
  CHECK_THROWS_AS(moduli_of(lattice), NumericalError);
  lattice = triangular_lattice(4, 4, 1.01);
  CHECK_THROWS_WITH(moduli_of(lattice), Contains("no particles touch"));
  lattice = triangular_lattice(4, 4, 0.95);
  lattice.box = Box<2>({0, 0}, {lattice.box.length()[0], Box<2>::infinite});
  CHECK_THROWS_WITH(moduli_of(lattice), Contains("direction 1 of the box is open"));
}

}  // namespace pliant::test::moduli_test
