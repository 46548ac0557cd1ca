// Jacobians against finite differences, against each other and against those on one rank; the preconditioner.
#include <pliant/system/jacobian.h>
#include <pliant/system/particle_pc.h>
#include <catch2/catch.hpp>

#include "support/model_parameters.h"
#include "support/problems.h"
#include "support/twins.h"

namespace pliant::test::jacobian_test {

namespace {

constexpr auto first_order = JacobianForm::first_order, second_order = JacobianForm::second_order;
constexpr auto assembled = JacobianKind::assembled, matrix_free = JacobianKind::matrix_free;

VectorXd product(::Mat matrix, const VectorXd& w) {
  PetscVec in, out;
  petsc_check(MatCreateVecs(matrix, in.out(), out.out()));
  PetscScalar* values = nullptr;
  petsc_check(VecGetArray(in, &values));
  std::copy(w.begin(), w.end(), values);
  petsc_check(VecRestoreArray(in, &values));
  petsc_check(MatMult(matrix, in, out));
  petsc_check(VecGetArray(out, &values));
  const VectorXd result = Eigen::Map<VectorXd>(values, w.size());
  petsc_check(VecRestoreArray(out, &values));
  return result;
}

/// M⁻¹ w by the preconditioner alone.
VectorXd precondition(::Mat matrix, const VectorXd& w) {
  petsc_check(particle_pc_register());
  Handle<PC, PCDestroy> pc;
  petsc_check(PCCreate(PetscObjectComm(reinterpret_cast<PetscObject>(matrix)), pc.out()));
  petsc_check(PCSetType(pc, particle_pc));
  petsc_check(PCSetOperators(pc, matrix, matrix));
  PetscVec in, out;
  petsc_check(MatCreateVecs(matrix, in.out(), out.out()));
  PetscScalar* values = nullptr;
  petsc_check(VecGetArray(in, &values));
  std::copy(w.begin(), w.end(), values);
  petsc_check(VecRestoreArray(in, &values));
  petsc_check(PCSetUp(pc));
  petsc_check(PCApply(pc, in, out));
  petsc_check(VecGetArray(out, &values));
  const VectorXd result = Eigen::Map<VectorXd>(values, w.size());
  petsc_check(VecRestoreArray(out, &values));
  return result;
}

VectorXd random_vector(Random& random, std::size_t n) { return random_direction(random, static_cast<Index>(n)); }

/// Calls check(system, y, part) for systems with every term, and the parts of their forces.
template <class Check>
void for_all_systems(Random& random, Check&& check) {
  const auto both = [&]<int D>(const Configuration<D>& c, ModelKind kind, FrictionPoint where = FrictionPoint::contact,
                               const Box<D>& box = {}, Friction friction = Friction::whole) {
    ModelParameters p = parameters;
    p.friction_point = where;
    p.friction = friction;
    auto system = system_of<D>(c, kind, Ranks(), p, box);
    VectorXd y(2 * c.x.size());
    y << Eigen::Map<const VectorXd>(c.x.data(), c.x.size()), Eigen::Map<const VectorXd>(c.v.data(), c.v.size());
    for (const TermGroup part : {TermGroup::all, TermGroup::shape, TermGroup::rest}) {
      if (kind == ModelKind::sp && part == TermGroup::shape) continue;
      INFO(to_string(kind) << ", part " << static_cast<int>(part));
      check(system, y, part);
    }
  };
  both(soft_rows<2>(random, 5, 5), ModelKind::sp);
  both(soft_rows<3>(random, 4, 2), ModelKind::sp);
  both(polygon_rows(random, 3, 3), ModelKind::rough);
  both(polygon_rows(random, 3, 3), ModelKind::smooth);
  both(polygon_rows(random, 3, 3), ModelKind::smooth, FrictionPoint::vertex);
  both(soft_rows<2>(random, 5, 5), ModelKind::sp, {}, {}, Friction::tangential);
  both(soft_rows<3>(random, 4, 2), ModelKind::sp, {}, {}, Friction::tangential);
  for (const FrictionPoint where : {FrictionPoint::contact, FrictionPoint::vertex})
    both(polygon_rows(random, 3, 3), ModelKind::smooth, where, {}, Friction::tangential);
  // Periodic; in the smaller boxes particles touch several images, also their own images.
  const auto boxed = [&]<int D>(Configuration<D> c, ModelKind kind, const pliant::Vec<D>& length) {
    INFO("box " << length.transpose());
    c.walls = {};
    both(c, kind, FrictionPoint::contact, Box<D>(pliant::Vec<D>::Constant(-0.4), length));
  };
  constexpr Real infinite = Box<2>::infinite;
  boxed(soft_rows<2>(random, 4, 4), ModelKind::sp, pliant::Vec<2>(3.8, infinite));
  boxed(soft_rows<2>(random, 4, 1), ModelKind::sp, pliant::Vec<2>(1.2, 0.7));
  boxed(soft_cluster<3>(random, 4), ModelKind::sp, pliant::Vec<3>(0.9, 1.1, 0.8));
  boxed(polygon_rows(random, 3, 3), ModelKind::rough, pliant::Vec<2>(3.15, 3.15));
  boxed(polygon_rows(random, 3, 1), ModelKind::rough, pliant::Vec<2>(infinite, 0.95));
  boxed(polygon_rows(random, 3, 3), ModelKind::smooth, pliant::Vec<2>(infinite, 3.15));
  boxed(polygon_rows(random, 3, 1), ModelKind::smooth, pliant::Vec<2>(2.1, 0.9));
}

/// [v; a] of a part of the forces.
VectorXd rate(ImplicitSystem& system, TermGroup part, const VectorXd& y) {
  const auto n = static_cast<Index>(system.size());
  VectorXd result(2 * n);
  result.head(n) = y.tail(n);
  if (part == TermGroup::all)
    system.acceleration(0, y.data(), y.data() + n, result.data() + n);
  else
    system.group_acceleration(part, 0, y.data(), y.data() + n, result.data() + n);
  return result;
}

}  // namespace

TEST_CASE("the assembled Jacobian is the derivative of the right-hand side") {
  Random random(1);
  for_all_systems(random, [&](auto& system, const VectorXd& y, TermGroup part) {
    const auto n = static_cast<Index>(system.size());
    const auto jacobian = system.jacobian(first_order, assembled, part);
    jacobian->update(0, y.data(), y.data() + n, {0, 1, 1});
    for (int k = 0; k < 6; ++k) {
      VectorXd w = random_vector(random, 2 * n);
      if (k == 0) w.tail(n).setZero();
      if (k == 1) w.head(n).setZero();
      // Along a random direction kinks are farther than this step; rounding is some 1e-16 · 1e3/h.
      constexpr Real h = 1e-6;
      const VectorXd expected = (rate(system, part, y + h * w) - rate(system, part, y - h * w)) / (2 * h);
      REQUIRE(expected.norm() > 0.01);
      CHECK((product(jacobian->matrix(), w) - expected).norm() < 1e-6 * (1 + expected.norm()));
    }
  });
}

TEST_CASE("parts of the acceleration sum up to all of it") {
  Random random(2);
  for_all_systems(random, [&](auto& system, const VectorXd& y, TermGroup part) {
    const Index n = static_cast<Index>(system.size());
    const VectorXd all = rate(system, TermGroup::all, y).tail(n), shape = rate(system, TermGroup::shape, y).tail(n),
                   rest = rate(system, TermGroup::rest, y).tail(n);
    CHECK((shape + rest - all).cwiseAbs().maxCoeff() <= 1e-13 * (shape.cwiseAbs() + rest.cwiseAbs()).maxCoeff());
    if (part == TermGroup::shape) CHECK(shape.norm() > 1);
    CHECK(rest.norm() > 1);
  });
}

TEST_CASE("assembled and matrix-free Jacobians are one operator, scaled and shifted too") {
  Random random(3);
  for_all_systems(random, [&](auto& system, const VectorXd& y, TermGroup part) {
    const auto n = static_cast<Index>(system.size());
    for (const JacobianForm form : {first_order, second_order}) {
      const auto one = system.jacobian(form, assembled, part), other = system.jacobian(form, matrix_free, part);
      for (const auto& jacobian : {one.get(), other.get()}) {
        jacobian->update(0, y.data(), y.data() + n, {0.7, -1.3, form == first_order ? -1.3 : 0.4});
        petsc_check(MatScale(jacobian->matrix(), 0.5));
        petsc_check(MatShift(jacobian->matrix(), 2));
      }
      const auto compare = [&] {
        const VectorXd w = random_vector(random, form == first_order ? 2 * n : n);
        const VectorXd expected = product(one->matrix(), w);
        CHECK((product(other->matrix(), w) - expected).norm() < 1e-12 * expected.norm());
      };
      compare();
      // An update drops the scale of PETSc.
      for (const auto& jacobian : {one.get(), other.get()}) jacobian->update(0, y.data(), y.data() + n, {3, -1, -2});
      compare();
    }
  });
}

TEST_CASE("the second-order form is the first-order one with the velocities eliminated") {
  Random random(4);
  for_all_systems(random, [&](auto& system, const VectorXd& y, TermGroup part) {
    const auto n = static_cast<Index>(system.size());
    constexpr Real sigma = 7;
    const auto first = system.jacobian(first_order, assembled, part),
               second = system.jacobian(second_order, assembled, part);
    first->update(0, y.data(), y.data() + n, {sigma, -1, -1});
    second->update(0, y.data(), y.data() + n, {sigma * sigma, -1, -sigma});
    VectorXd w(2 * n);
    w.head(n) = random_vector(random, n);
    w.tail(n) = sigma * w.head(n);
    const VectorXd both = product(first->matrix(), w), one = product(second->matrix(), w.head(n));
    CHECK(both.head(n).norm() < 1e-14 * w.norm());
    CHECK((both.tail(n) - one).norm() < 1e-12 * one.norm());
  });
}

TEST_CASE("the pattern of the Jacobian follows the lists") {
  Random random(5);
  Configuration<2> c = polygon_rows(random, 3, 3);
  auto system = system_of(c, ModelKind::smooth);
  const auto n = static_cast<Index>(system.size());
  const auto jacobian = system.jacobian(first_order, assembled, TermGroup::all);
  const auto update = [&] {
    jacobian->update(0, c.x.data(), c.v.data(), {5, -1, -1});
    PetscObjectState state = 0;
    petsc_check(MatGetNonzeroState(jacobian->matrix(), &state));
    return state;
  };
  const auto check = [&] {
    const auto fresh = system.jacobian(first_order, assembled, TermGroup::all);
    fresh->update(0, c.x.data(), c.v.data(), {5, -1, -1});
    const VectorXd w = random_vector(random, 2 * n), expected = product(fresh->matrix(), w);
    CHECK((product(jacobian->matrix(), w) - expected).norm() <= 1e-14 * expected.norm());
  };
  const PetscObjectState before = update();
  check();
  // Lists are still valid: the pattern is the same for any contacts.
  for (Real& a : c.x) a += random(-0.2, 0.2) * skin;
  const std::int64_t rebuilds = system.neighbours().rebuilds();
  CHECK(update() == before);
  CHECK(system.neighbours().rebuilds() == rebuilds);
  check();
  // One particle moves to the other side.
  for (Index i = c.topology.offset[4]; i < c.topology.offset[5]; ++i) point<2>(c.x.data(), i) += pliant::Vec<2>(1.2, 3);
  CHECK(update() != before);
  CHECK(system.neighbours().rebuilds() > rebuilds);
  check();
}

TEST_CASE("the Jacobian follows a particle that was put elsewhere without a rebuild") {
  Random random(6);
  Configuration<2> c = soft_rows<2>(random, 5, 5);
  auto system = system_of(c, ModelKind::sp);
  const auto jacobian = system.jacobian(second_order, assembled, TermGroup::all);
  jacobian->update(0, c.x.data(), c.v.data(), {0, 1, 1});
  const std::int64_t rebuilds = system.neighbours().rebuilds();
  point<2>(c.x.data(), 3) = point<2>(c.x.data(), 21) + pliant::Vec<2>(0.3, 0.5);
  system.relist(c.x.data(), 3);
  jacobian->update(0, c.x.data(), c.v.data(), {0, 1, 1});
  CHECK(system.neighbours().rebuilds() == rebuilds);
  const auto free = system.jacobian(second_order, matrix_free, TermGroup::all);
  free->update(0, c.x.data(), c.v.data(), {0, 1, 1});
  const VectorXd w = random_vector(random, c.x.size()), expected = product(free->matrix(), w);
  CHECK((product(jacobian->matrix(), w) - expected).norm() < 1e-12 * expected.norm());
}

TEST_CASE("the preconditioner solves exactly for a particle that touches nothing") {
  Random random(7);
  for (const bool compressed : {false, true}) {
    Configuration<2> c;
    c.add_polygon(regular_polygon(9, 0.5, {0, 3}), 0.2);
    c.add_polygon(regular_polygon(4, 0.5, {3, 4}), 0.2);
    if (compressed) c.topology.a0[0] *= 4, c.topology.l0[0] *= 2;  // edges that push buckle
    c.random_velocities(random);
    auto system = system_of(c, ModelKind::rough);
    const auto n = static_cast<Index>(system.size());
    const Real sigma = 2;
    for (const JacobianForm form : {first_order, second_order}) {
      const bool first = form == first_order;
      const auto jacobian = system.jacobian(form, assembled, TermGroup::all);
      jacobian->update(0, c.x.data(), c.v.data(),
                       first ? JacobianWeights{sigma, -1, -1} : JacobianWeights{sigma * sigma, -1, -sigma});
      if (!first) {
        MatrixXd dense(n, n);
        for (Index k = 0; k < n; ++k) dense.col(k) = product(jacobian->matrix(), VectorXd::Unit(n, k));
        const Real least = Eigen::SelfAdjointEigenSolver<MatrixXd>((dense + dense.transpose()) / 2).eigenvalues()[0];
        REQUIRE(dense.allFinite());
        CHECK((least < 0) == compressed);  // Cholesky for one, LU for the other
      }
      petsc_check(MatScale(jacobian->matrix(), -0.3));  // 1 − γJ and the like
      const VectorXd w = random_vector(random, first ? 2 * n : n);
      CHECK((precondition(jacobian->matrix(), product(jacobian->matrix(), w)) - w).norm() < 1e-10);
    }
    // A matrix without preparation is refused.
    PetscMat other;
    petsc_check(MatCreateSeqAIJ(PETSC_COMM_SELF, n, n, 1, nullptr, other.out()));
    petsc_check(MatAssemblyBegin(other, MAT_FINAL_ASSEMBLY));
    petsc_check(MatAssemblyEnd(other, MAT_FINAL_ASSEMBLY));
    CHECK_THROWS_WITH(precondition(other, VectorXd::Ones(n)), Catch::Contains("-pc_type particle"));
  }
}

TEST_CASE("the blocks behind a matrix-free Jacobian are those of the assembled one") {
  Random random(8);
  for_all_systems(random, [&](auto& system, const VectorXd& y, TermGroup part) {
    const auto n = static_cast<Index>(system.size());
    const auto one = system.jacobian(first_order, assembled, part),
               other = system.jacobian(first_order, matrix_free, part);
    for (const auto& jacobian : {one.get(), other.get()}) jacobian->update(0, y.data(), y.data() + n, {9, -1, -1});
    const VectorXd w = random_vector(random, 2 * n), expected = precondition(one->preconditioner(), w);
    CHECK((precondition(other->preconditioner(), w) - expected).norm() < 1e-11 * expected.norm());
    MatInfo all, blocks;
    petsc_check(MatGetInfo(one->preconditioner(), MAT_LOCAL, &all));
    petsc_check(MatGetInfo(other->preconditioner(), MAT_LOCAL, &blocks));
    if (part == TermGroup::shape)
      CHECK(blocks.nz_used == all.nz_used);  // nothing couples particles
    else
      CHECK(blocks.nz_used < all.nz_used);
  });
}

namespace {

template <int D>
void check_ranks(Random& random, Configuration<D> c, ModelKind kind, const Box<D>& box = {}) {
  INFO(to_string(kind) << ", " << D << "D");
  if (!box.open()) c.walls = {};
  Twins<D> twins(c, kind, box);
  for (const bool sort : {false, true}) {
    if (sort) twins.sort();
    for (const JacobianForm form : {first_order, second_order})
      for (const JacobianKind how : {assembled, matrix_free}) {
        const auto whole = twins.whole.jacobian(form, how, TermGroup::all),
                   shared = twins.shared.jacobian(form, how, TermGroup::all);
        CAPTURE(sort, form == first_order, how == assembled);
        const JacobianWeights weights{40, -1, form == first_order ? -1.0 : -0.5};
        whole->update(0, twins.whole_state.x().data(), twins.whole_state.v().data(), weights);
        shared->update(0, twins.state.x().data(), twins.state.v().data(), weights);
        const std::size_t n = twins.whole_state.size(), own = twins.state.size(), parts = form == first_order ? 2 : 1;
        const VectorXd w = random_vector(random, parts * n);
        // The same vector, distributed over ranks.
        VectorXd mine(parts * own);
        const Topology& t = twins.shared.topology();
        for (std::size_t part = 0; part < parts; ++part)
          for (Index m = 0; m < t.owned(); ++m)
            std::copy_n(w.data() + part * n + twins.first(m), D * t.points_of(m),
                        mine.data() + part * own + t.offset[m] * D);
        const auto compare = [&](const VectorXd& result, const VectorXd& expected) {
          for (std::size_t part = 0; part < parts; ++part)
            CHECK(twins.difference(std::span(result.data() + part * own, own),
                                   std::span(expected.data() + part * n, n)) < 1e-12 * expected.cwiseAbs().maxCoeff());
        };
        const VectorXd expected = product(whole->matrix(), w);
        CHECK(expected.norm() > 10 * w.norm());
        compare(product(shared->matrix(), mine), expected);
        compare(precondition(shared->preconditioner(), mine), precondition(whole->preconditioner(), w));
      }
  }
}

}  // namespace

TEST_CASE("a Jacobian on ranks is the same Jacobian", "[ranks]") {
  Random random(9);
  check_ranks(random, soft_rows<2>(random, 8, 12), ModelKind::sp);
  check_ranks(random, soft_rows<3>(random, 5, 6), ModelKind::sp);
  check_ranks(random, polygon_rows(random, 5, 9), ModelKind::rough);
  check_ranks(random, polygon_rows(random, 5, 9), ModelKind::smooth);
  check_ranks(random, soft_rows<2>(random, 6, 6), ModelKind::sp, Box<2>({-2, 0}, {1.1, 5.7}));
  check_ranks(random, polygon_rows(random, 4, 4), ModelKind::smooth, Box<2>({-2.1, 0}, {4.2, 4.2}));
}

}  // namespace pliant::test::jacobian_test
