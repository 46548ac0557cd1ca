// Cholesky factors of a sparse matrix of small blocks, with one more row and column.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

/// An order of the n rows of blocks of a symmetric matrix in which its factors have few blocks, by approximate minimum
/// degree. Returns the place of each row in this order. below: row and column of each block on one side of the
/// diagonal; blocks may be listed on either side, and several times.
std::vector<Index> order_with_few_blocks(Index n, std::span<const std::array<Index, 2>> below);

/// L with L Lᵀ = A for a symmetric positive definite matrix A of n · n blocks of D · D numbers, most of which are zero,
/// and of a last row and column of single numbers, which there may be. Blocks need fewer indices and instructions than
/// numbers one by one. The fill depends on the order of the blocks, which is the caller's: see
/// order_with_few_blocks.
template <int D>
class BlockCholesky {
 public:
  /// A block below the diagonal.
  struct Entry {
    Index row, column;
    Mat<D> block;
  };

  /// diagonal: [n], whose lower triangles are read; below: entries of one place are added; last: the last row
  /// [n], without its corner, or empty. False if A is not positive definite.
  bool factorise(std::span<const Mat<D>> diagonal, std::span<const Entry> below, std::span<const Vec<D>> last,
                 Real corner);
  /// b [n · D, then one more if there is a last row] becomes A⁻¹ b.
  void solve(Real* b) const;
  /// The same for numbers in another order: row i of the caller is row order[i] of the factors.
  void solve(std::span<const Index> order, Eigen::VectorXd& b);

 private:
  void find_structure(Index n, std::span<const Entry> below);

  /// Column j has its blocks below the diagonal from start_[j] on, sorted by their rows.
  std::vector<Index> start_, row_;
  std::vector<Mat<D>> below_, inverse_;  ///< blocks of L below its diagonal; inverses of those on it
  std::vector<Vec<D>> last_;
  Real corner_ = 0;
  /// Entries of A by columns, and blocks of L by rows: first of each, and places in the order of the columns.
  std::vector<Index> first_entry_, entry_, first_in_row_, column_in_row_, place_in_row_;
  std::vector<Mat<D>> work_;
  std::vector<Real> ordered_;
};

extern template class BlockCholesky<2>;
extern template class BlockCholesky<3>;

}  // namespace pliant
