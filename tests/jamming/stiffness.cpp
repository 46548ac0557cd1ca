// Second derivatives against differences of forces and energies.
#include <catch2/catch.hpp>

#include <cmath>
#include <functional>
#include <utility>

#include <pliant/jamming/backbone.h>
#include <pliant/jamming/stiffness.h>
#include <pliant/model/polygon.h>

#include "jamming/packing.h"

namespace pliant::test::stiffness_test {
using Catch::Matchers::Contains;

namespace {

template <int D>
void check_derivatives(const Packing<D>& cell) {
  Random random(3);
  auto system = cell.system();
  Stiffness<D> stiffness(system, cell.x);
  const Index n = cell.size();
  REQUIRE(stiffness.size() == n);
  const MatrixXd hessian = stiffness.matrix();
  CHECK((hessian - hessian.transpose()).norm() <= 1e-13 * hessian.norm());
  CHECK(stiffness.bound() >= hessian.template selfadjointView<Eigen::Lower>().eigenvalues().cwiseAbs().maxCoeff());

  constexpr Real h = 1e-6;
  VectorXd ahead, behind;
  const auto slope = [&](auto&& change) {
    change(h, ahead);
    change(-h, behind);
    return VectorXd((behind - ahead) / (2 * h));
  };
  const VectorXd p = random_direction(random, n);
  const VectorXd by_points = slope([&](Real step, VectorXd& force) {
    Packing<D> moved = cell;
    Eigen::Map<VectorXd>(moved.x.data(), n) += step * p;
    moved.energy(force);
  });
  CHECK((by_points - hessian * p).norm() < 1e-7 * (hessian * p).norm());

  // A box keeps its first edge along x: strains are upper triangular there.
  for (int a = 0; a < D; ++a)
    for (int b = cell.box.open() ? 0 : a; b < D; ++b) {
      const auto strained = [&](Real step, VectorXd& force) {
        typename Packing<D>::Deformation f = Packing<D>::Deformation::Identity();
        f(a, b) += step;
        return cell.deformed(f).energy(force);
      };
      INFO("strain " << a << b);
      const auto mixed = stiffness.strain().mixed.col(a * D + b);
      CHECK((slope(strained) - mixed).norm() < 1e-6 * mixed.norm());
      constexpr Real wide = 1e-4;
      VectorXd unused;
      const Real curvature =
          (strained(wide, unused) + strained(-wide, unused) - 2 * strained(0, unused)) / square(wide);
      CHECK(stiffness.strain().affine(a * D + b, a * D + b) == Approx(curvature).epsilon(1e-4));
    }
  CHECK((stiffness.strain().affine - stiffness.strain().affine.transpose()).norm() <
        1e-12 * stiffness.strain().affine.norm());

  // Products by PETSc.
  const PetscMat matrix = stiffness.petsc();
  PetscVec in, out;
  VectorXd product(n);
  petsc_check(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, n, p.data(), in.out()));
  petsc_check(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, n, product.data(), out.out()));
  petsc_check(MatMult(matrix, in, out));
  CHECK((product - hessian * p).norm() < 1e-13 * hessian.norm());
}

}  // namespace

TEST_CASE("derivatives by positions and strains in periodic and open boxes", "[stiffness]") {
  Random random(1);
  const auto check = [&]<int D>(const Configuration<D>& c, ModelKind kind, const pliant::Vec<D>& length,
                                const pliant::Vec<D>& origin) {
    INFO(to_string(kind) << " in " << D << "D");
    check_derivatives(Packing<D>(c, Box<D>(origin, length), kind));
    check_derivatives(Packing<D>(c, Box<D>(), kind));
  };
  check(soft_rows<2>(random, 4, 5), ModelKind::sp, pliant::Vec<2>(3.8, 4.75), pliant::Vec<2>(-1.9, 0));
  check(soft_cluster<2>(random, 2), ModelKind::sp, pliant::Vec<2>(1.1, 0.9), pliant::Vec<2>(0, 0));
  check(soft_rows<3>(random, 4, 2), ModelKind::sp, pliant::Vec<3>(3.8, 3.8, 1.9), pliant::Vec<3>(-1.9, -1.9, 0));
  for (const ModelKind kind : {ModelKind::rough, ModelKind::smooth})
    check(polygon_rows(random, 3, 3), kind, pliant::Vec<2>(3.15, 3.15), pliant::Vec<2>(-1.575, 0));
  check(soft_rows<2>(random, 4, 4), ModelKind::bubble, pliant::Vec<2>(3.8, 3.8), pliant::Vec<2>(-1.9, 0));
}

TEST_CASE("particles taken out of the run have no rows, and come back", "[stiffness]") {
  Random random(2);
  const Packing<2> cell(soft_rows<2>(random, 4, 4), Box<2>({-1.9, 0}, {3.8, 3.8}), ModelKind::sp);
  auto system = cell.system();
  const Stiffness<2> all(system, cell.x);
  {
    const std::vector<Index> without{3, 7};
    const Backbone<2> backbone(system, without);
    const Stiffness<2> some(system, cell.x);
    CHECK(some.size() == 28);
    CHECK(some.points()[3] == 4);
    const VectorXd ones = VectorXd::Ones(28);
    const auto moved = some.displacements(ones);
    CHECK(moved.size() == 32);
    CHECK(moved[6] == 0);
    CHECK(moved[8] == 1);
    // Without the contacts of the others: translations cost nothing.
    CHECK((some.matrix() * ones).norm() < 1e-10);
    CHECK_THROWS_WITH(Backbone<2>(system, without), Contains("particle 3 "));
  }
  const Stiffness<2> again(system, cell.x);
  CHECK((MatrixXd(again.matrix()) - MatrixXd(all.matrix())).norm() == 0);
}

TEST_CASE("without pre-stress contacts are springs at rest", "[stiffness]") {
  Random random(4);
  const Packing<2> cell(soft_rows<2>(random, 4, 4), Box<2>({-1.9, 0}, {3.8, 3.8}), ModelKind::sp);
  auto system = cell.system();
  const Stiffness<2> springs(system, cell.x, PreStress::dropped);
  MatrixXd expected = MatrixXd::Zero(32, 32);
  const StateView<2> s = system.view(cell.x.data(), nullptr);
  const Index n = cell.topology.points();
  system.field().for_each_contact(s, [&](const Contact<2>& c) {
    const Real k = parameters.epsilon / square(c.reach);
    VectorXd stretch = VectorXd::Zero(32);
    const auto original = [&](Index m) { return m < n ? m : s.topology.id[m]; };
    stretch.segment<2>(2 * original(c.first)) += c.normal;
    stretch.segment<2>(2 * original(c.second)) -= c.normal;
    expected += k * stretch * stretch.transpose();
  });
  CHECK((MatrixXd(springs.matrix()) - expected).norm() < 1e-12 * expected.norm());
  Configuration<2> walled;
  walled.add_soft(1, {0, 0.3});
  walled.walls.add(Solid<2>::half_space({0, -0.1}, {0, 1}));
  auto other = system_of<2>(walled, ModelKind::sp, Ranks(), parameters, {}, pliant::Vec<2>::Zero());
  CHECK_THROWS_WITH(Stiffness<2>(other, walled.x, PreStress::dropped), Contains("term wall cannot be dropped"));
}

TEST_CASE("without pre-stress polygons are springs at rest", "[stiffness]") {
  // Σ V''(q) ∇q ∇qᵀ of all contacts, edges, areas and angles q, by differences of q.
  ModelParameters p = parameters;
  p.k_b = 0.3;
  p.rough_edges = false;
  const Packing<2> cell = octagons(ModelKind::rough, p);
  auto system = cell.system();
  const MatrixXd found = MatrixXd(Stiffness<2>(system, cell.x, PreStress::dropped).matrix());
  const Topology& t = cell.topology;
  const auto vertex = [&](const std::vector<Real>& x, Index i) { return point<2>(x.data(), i); };
  using Measure = std::function<Real(const std::vector<Real>&)>;
  std::vector<std::pair<Real, Measure>> springs;  // V'' and q
  for (Index m = 0; m < t.particles(); ++m) {
    springs.emplace_back(p.k_a, [&, m](const auto& x) { return polygon_area(x.data(), t, m); });
    for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i) {
      const Index j = t.next[i], k = t.next[j];
      const Real vertices = t.points_of(m);
      springs.emplace_back(p.k_l * vertices, [&, i, j](const auto& x) { return (vertex(x, j) - vertex(x, i)).norm(); });
      const auto angle = [&, i, j, k](const auto& x) {
        const pliant::Vec<2> u = vertex(x, j) - vertex(x, i), w = vertex(x, k) - vertex(x, j);
        return std::atan2(u[0] * w[1] - u[1] * w[0], u.dot(w));
      };
      springs.emplace_back(p.k_b / (vertices * square(t.l0[m])) * std::cos(angle(cell.x)), angle);
    }
  }
  Index contacts = 0;
  for (Index i = 0; i < t.points(); ++i)
    for (Index j = 0; j < i; ++j) {
      if (t.particle[i] == t.particle[j]) continue;
      const Real reach = (t.diameter[i] + t.diameter[j]) / 2;
      const Image image = [&] {
        Image n{};
        const pliant::Vec<2> r = vertex(cell.x, i) - vertex(cell.x, j);
        for (int k = 0; k < 2; ++k) n[k] = static_cast<std::int64_t>(std::nearbyint(r[k] / cell.box.length()[k]));
        return n;
      }();
      const pliant::Vec<2> shift = cell.box.shift(image);
      const auto distance = [&, i, j, shift](const auto& x) { return (vertex(x, i) - vertex(x, j) - shift).norm(); };
      if (distance(cell.x) >= reach) continue;
      ++contacts;
      springs.emplace_back(p.epsilon / square(reach), distance);
    }
  CHECK(contacts > 4);
  MatrixXd expected = MatrixXd::Zero(found.rows(), found.cols());
  for (const auto& [stiffness, q] : springs) {
    VectorXd gradient(found.rows());
    constexpr Real h = 1e-6;
    for (Index k = 0; k < gradient.size(); ++k) {
      std::vector<Real> up = cell.x, down = cell.x;
      up[k] += h;
      down[k] -= h;
      gradient[k] = (q(up) - q(down)) / (2 * h);
    }
    expected += stiffness * gradient * gradient.transpose();
  }
  CHECK((found - expected).norm() < 1e-7 * expected.norm());
}

}  // namespace pliant::test::stiffness_test
