#include <pliant/jamming/stiffness_factors.h>

#include <algorithm>
#include <array>

namespace pliant {

template <int D>
StiffnessFactors<D>::StiffnessFactors(const Stiffness<D>& h) : diagonal_(static_cast<std::size_t>(h.size() / D)) {
  std::vector<std::array<Index, 2>> places;
  h.for_each_block([&](Index i, Index j, const Mat<D>&) {
    if (j < i) places.push_back({i, j});
  });
  order_ = order_with_few_blocks(h.size() / D, places);
  below_.reserve(places.size());
  h.for_each_block([&](Index i, Index j, const Mat<D>& block) {
    const Index row = order_[i], column = order_[j];
    if (row == column) diagonal_[row] = block;
    if (row > column) below_.push_back({row, column, block});
  });
}

template <int D>
bool StiffnessFactors<D>::factorise(Real shift, const Eigen::VectorXd& last, Real corner) {
  std::vector<Mat<D>> diagonal = diagonal_;
  for (Mat<D>& block : diagonal) block.diagonal().array() += shift;
  std::vector<Vec<D>> row(last.size() > 0 ? order_.size() : 0);
  for (std::size_t i = 0; i < row.size(); ++i) row[order_[i]] = point<D>(last.data(), static_cast<Index>(i));
  return factors_.factorise(diagonal, below_, row, corner + shift);
}

template class StiffnessFactors<2>;
template class StiffnessFactors<3>;

}  // namespace pliant
