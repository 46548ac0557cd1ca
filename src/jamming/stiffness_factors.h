// Cholesky factors of the Hessian of a packing.
#pragma once

#include <vector>

#include <pliant/jamming/block_cholesky.h>
#include <pliant/jamming/stiffness.h>

namespace pliant {

/// Factors of the matrix of a Stiffness plus a multiple of the unit matrix, with one more row and column of numbers,
/// which there may be.
template <int D>
class StiffnessFactors {
 public:
  explicit StiffnessFactors(const Stiffness<D>& h);

  /// shift: the multiple of the unit matrix. last: the last row [h.size()] without its corner, or empty. False if the
  /// matrix is not positive definite.
  bool factorise(Real shift, const Eigen::VectorXd& last = {}, Real corner = 0);
  /// b [h.size(), then one more if there is a last row] becomes the solution.
  void solve(Eigen::VectorXd& b) { factors_.solve(order_, b); }

 private:
  std::vector<Index> order_;  ///< place of each block in the factors, which have few blocks then
  std::vector<Mat<D>> diagonal_;
  std::vector<typename BlockCholesky<D>::Entry> below_;
  BlockCholesky<D> factors_;
};

extern template class StiffnessFactors<2>;
extern template class StiffnessFactors<3>;

}  // namespace pliant
