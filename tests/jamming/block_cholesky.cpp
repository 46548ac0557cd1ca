// Solutions by sparse factors of blocks equal solutions by dense factors.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <random>

#include <pliant/jamming/block_cholesky.h>

namespace pliant::test::block_cholesky_test {

TEMPLATE_TEST_CASE_SIG("block Cholesky factors solve a sparse system", "[jamming]", ((int D), D), 2, 3) {
  constexpr Index n = 40;
  std::mt19937 random(7);
  std::uniform_real_distribution<Real> number(-1, 1);
  const bool with_last = GENERATE(true, false);
  const Index size = n * D + (with_last ? 1 : 0);
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(size, size);
  std::vector<typename BlockCholesky<D>::Entry> below;
  std::vector<Mat<D>> diagonal(n, Mat<D>::Zero());
  std::vector<Vec<D>> last;
  const auto random_block = [&] { return Mat<D>(Mat<D>::NullaryExpr([&] { return number(random); })); };
  for (Index k = 0; k < 3 * n; ++k) {
    const auto [column, row] = std::minmax({static_cast<Index>(random() % n), static_cast<Index>(random() % n)});
    if (row == column) continue;
    below.push_back({row, column, random_block()});
    if (k % 10 == 0) below.push_back({row, column, random_block()});  // the same place again
  }
  for (const auto& e : below) {
    dense.block<D, D>(e.row * D, e.column * D) += e.block;
    dense.block<D, D>(e.column * D, e.row * D) += e.block.transpose();
  }
  for (Index j = 0; j < n && with_last; ++j) {
    last.push_back(random_block().col(0));
    dense.block<1, D>(n * D, j * D) = last.back().transpose();
    dense.block<D, 1>(j * D, n * D) = last.back();
  }
  const Real more = 2 * dense.cwiseAbs().rowwise().sum().maxCoeff();  // makes it positive definite
  for (Index j = 0; j < n; ++j) {
    const Mat<D> half = random_block();
    diagonal[j] = half + half.transpose() + more * Mat<D>::Identity();
    dense.block<D, D>(j * D, j * D) = diagonal[j];
  }
  if (with_last) dense(n * D, n * D) = more;
  BlockCholesky<D> factors;
  for (int repetition = 0; repetition < 2; ++repetition) {  // the second with the memory of the first
    REQUIRE(factors.factorise(diagonal, below, last, with_last ? more : 0));
    Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(size, [&] { return number(random); });
    const Eigen::VectorXd expected = dense.llt().solve(b);
    factors.solve(b.data());
    CHECK((b - expected).norm() < 1e-13 * expected.norm());
  }
  SECTION("a matrix that is not positive definite has no factors") {
    diagonal[n / 2] *= -1;
    CHECK_FALSE(factors.factorise(diagonal, below, last, more));
  }
  if (with_last) CHECK_FALSE(factors.factorise(diagonal, below, last, -1));
}

}  // namespace pliant::test::block_cholesky_test
