#include <pliant/jamming/block_cholesky.h>

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

namespace pliant {
namespace {

/// The inverse of the Cholesky factor of a; false if a is not positive definite. Not by Eigen, whose factors of
/// matrices of any size take long to compile.
template <int D>
bool invert_factor(const Mat<D>& a, Mat<D>& inverse) {
  Mat<D> factor;
  inverse.setZero();
  for (int i = 0; i < D; ++i) {
    for (int j = 0; j <= i; ++j) {
      Real sum = 0;
      for (int k = 0; k < j; ++k) sum += factor(i, k) * factor(j, k);
      const Real rest = a(i, j) - sum;
      if (i == j && !(rest > 0)) return false;
      factor(i, j) = i == j ? std::sqrt(rest) : rest / factor(j, j);
    }
    const Real part = 1 / factor(i, i);
    for (int j = 0; j <= i; ++j) {
      Real rest = i == j;
      for (int k = j; k < i; ++k) rest -= factor(i, k) * inverse(k, j);
      inverse(i, j) = rest * part;
    }
  }
  return true;
}

}  // namespace

std::vector<Index> order_with_few_blocks(Index n, std::span<const std::array<Index, 2>> below) {
  Eigen::SparseMatrix<Real> graph(n, n);
  std::vector<Eigen::Triplet<Real>> entries;
  for (Index i = 0; i < n; ++i) entries.emplace_back(i, i, 1);
  for (const auto& [i, j] : below) {
    entries.emplace_back(i, j, 1);
    entries.emplace_back(j, i, 1);
  }
  graph.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> inverse;
  Eigen::AMDOrdering<int>()(graph, inverse);
  std::vector<Index> places(static_cast<std::size_t>(n));
  for (Index k = 0; k < n; ++k) places[inverse.indices()[k]] = k;
  return places;
}

/// Column j of L has the rows of column j of A, and the rows of earlier columns of L whose first row is j.
template <int D>
void BlockCholesky<D>::find_structure(Index n, std::span<const Entry> below) {
  first_entry_.assign(n + 1, 0);
  for (const Entry& e : below) ++first_entry_[e.column + 1];
  std::partial_sum(first_entry_.begin(), first_entry_.end(), first_entry_.begin());
  entry_.resize(below.size());
  std::vector<Index> next(first_entry_.begin(), first_entry_.end() - 1);
  for (Index k = 0; k < static_cast<Index>(below.size()); ++k) entry_[next[below[k].column]++] = k;

  start_.assign(1, 0);
  row_.clear();
  std::vector<Index> child(n, -1), sibling(n, -1), own, both;
  first_in_row_.assign(n + 1, 0);
  for (Index j = 0; j < n; ++j) {
    own.clear();
    for (Index k = first_entry_[j]; k < first_entry_[j + 1]; ++k) own.push_back(below[entry_[k]].row);
    std::ranges::sort(own);
    own.erase(std::unique(own.begin(), own.end()), own.end());
    for (Index c = child[j]; c >= 0; c = sibling[c]) {
      both.clear();
      std::set_union(own.begin(), own.end(), row_.begin() + start_[c] + 1, row_.begin() + start_[c + 1],
                     std::back_inserter(both));
      own.swap(both);
    }
    if (!own.empty()) {
      sibling[j] = child[own.front()];
      child[own.front()] = j;
    }
    row_.insert(row_.end(), own.begin(), own.end());
    start_.push_back(static_cast<Index>(row_.size()));
    for (const Index i : own) ++first_in_row_[i + 1];
  }
  std::partial_sum(first_in_row_.begin(), first_in_row_.end(), first_in_row_.begin());
  column_in_row_.resize(row_.size());
  place_in_row_.resize(row_.size());
  next.assign(first_in_row_.begin(), first_in_row_.end() - 1);
  for (Index j = 0; j < n; ++j)
    for (Index p = start_[j]; p < start_[j + 1]; ++p) {
      const Index at = next[row_[p]]++;
      column_in_row_[at] = j;
      place_in_row_[at] = p;
    }
}

template <int D>
bool BlockCholesky<D>::factorise(std::span<const Mat<D>> diagonal, std::span<const Entry> below,
                                 std::span<const Vec<D>> last, Real corner) {
  const auto n = static_cast<Index>(diagonal.size());
  find_structure(n, below);
  below_.resize(row_.size());
  inverse_.resize(diagonal.size());
  last_.assign(last.begin(), last.end());
  corner_ = corner;
  work_.assign(diagonal.size(), Mat<D>::Zero());
  for (Index j = 0; j < n; ++j) {
    Mat<D> own = diagonal[j];
    for (Index k = first_entry_[j]; k < first_entry_[j + 1]; ++k) work_[below[entry_[k]].row] += below[entry_[k]].block;
    for (Index k = first_in_row_[j]; k < first_in_row_[j + 1]; ++k) {
      const Index earlier = column_in_row_[k], place = place_in_row_[k];
      const Mat<D> factor = below_[place].transpose();
      own.noalias() -= below_[place] * factor;
      for (Index p = place + 1; p < start_[earlier + 1]; ++p) work_[row_[p]].noalias() -= below_[p] * factor;
      if (!last_.empty()) last_[j].noalias() -= below_[place] * last_[earlier];
    }
    if (!invert_factor<D>(own, inverse_[j])) return false;
    const Mat<D> factor = inverse_[j].transpose();
    for (Index p = start_[j]; p < start_[j + 1]; ++p) {
      below_[p].noalias() = work_[row_[p]] * factor;
      work_[row_[p]].setZero();
    }
    if (last_.empty()) continue;
    last_[j] = inverse_[j] * last_[j];
    corner_ -= last_[j].squaredNorm();
  }
  return last_.empty() || corner_ > 0;
}

template <int D>
void BlockCholesky<D>::solve(Real* b) const {
  const auto n = static_cast<Index>(inverse_.size());
  Real dot = 0;
  for (Index j = 0; j < n; ++j) {
    const Vec<D> own = inverse_[j] * point<D>(b, j);
    point<D>(b, j) = own;
    for (Index p = start_[j]; p < start_[j + 1]; ++p) point<D>(b, row_[p]).noalias() -= below_[p] * own;
    if (!last_.empty()) dot += last_[j].dot(own);
  }
  Real end = 0;
  if (!last_.empty()) end = b[n * D] = (b[n * D] - dot) / corner_;
  for (Index j = n; j-- > 0;) {
    Vec<D> own = point<D>(b, j);
    if (!last_.empty()) own -= last_[j] * end;
    for (Index p = start_[j]; p < start_[j + 1]; ++p) own.noalias() -= below_[p].transpose() * point<D>(b, row_[p]);
    point<D>(b, j).noalias() = inverse_[j].transpose() * own;
  }
}

template <int D>
void BlockCholesky<D>::solve(std::span<const Index> order, Eigen::VectorXd& b) {
  ordered_.assign(b.data(), b.data() + b.size());  // with the number of the last row
  for (std::size_t i = 0; i < order.size(); ++i)
    point<D>(ordered_.data(), order[i]) = point<D>(b.data(), static_cast<Index>(i));
  solve(ordered_.data());
  b[b.size() - 1] = ordered_.back();
  for (std::size_t i = 0; i < order.size(); ++i)
    point<D>(b.data(), static_cast<Index>(i)) = point<D>(ordered_.data(), order[i]);
}

template class BlockCholesky<2>;
template class BlockCholesky<3>;

}  // namespace pliant
