#include <pliant/jamming/stiffness.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace pliant {
namespace {

/// For each point of a view, the block of rows that it belongs to; −1 for points of inactive particles.
template <int D>
std::vector<Index> rows_of_points(const ParticleSystem<D>& system, std::span<const Index> points) {
  const Topology& topology = system.topology();
  std::vector<Real> own(static_cast<std::size_t>(topology.owned_points()) * D, -1), storage;
  for (std::size_t row = 0; row < points.size(); ++row)
    own[static_cast<std::size_t>(points[row]) * D] = static_cast<Real>(row);
  const Real* const all = system.with_ghosts(own.data(), storage);
  std::vector<Index> rows(static_cast<std::size_t>(topology.points()));
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<Index>(all[i * D]);
  return rows;
}

/// Collects which blocks there are.
template <int D>
struct BlockPlaces final : BlockSink<D> {
  const std::vector<Index>& rows;
  std::vector<std::uint64_t> places = {};  ///< row and column
  std::size_t limit = 1 << 16;

  explicit BlockPlaces(const std::vector<Index>& rows_of_all) : rows(rows_of_all) {}
  void add(Index i, Index j, const Mat<D>&) override {
    if (rows[i] < 0 || rows[j] < 0) return;
    if (places.size() >= limit) {
      unite();
      limit = std::max(limit, 2 * places.size());
    }
    places.push_back(std::uint64_t{static_cast<std::uint32_t>(rows[i])} << 32 | static_cast<std::uint32_t>(rows[j]));
  }
  void unite() {
    std::ranges::sort(places);
    places.erase(std::unique(places.begin(), places.end()), places.end());
  }
};

/// Adds blocks to rows of scalars, and their products with the strained positions to the derivatives by strains.
template <int D>
struct BlockValues final : BlockSink<D> {
  const std::vector<Index>& rows;
  const std::vector<PetscInt>&start, &column;
  std::vector<Real>& values;
  const Real* x;
  /// Of all points: for a row of the system, and for the position of the image.
  Eigen::MatrixXd mixed;

  BlockValues(const std::vector<Index>& rows_of_all, const std::vector<PetscInt>& starts,
              const std::vector<PetscInt>& columns, std::vector<Real>& to, const Real* positions)
      : rows(rows_of_all), start(starts), column(columns), values(to), x(positions) {
    mixed.setZero(static_cast<Eigen::Index>(rows.size()) * D, D * D);
  }
  void add(Index i, Index j, const Mat<D>& block) override {
    if (rows[i] < 0 || rows[j] < 0) return;
    for (int a = 0; a < D; ++a) {
      const auto first = column.begin() + start[rows[i] * D + a], last = column.begin() + start[rows[i] * D + a + 1];
      Real* const to = values.data() + (std::lower_bound(first, last, rows[j] * D) - column.begin());
      for (int b = 0; b < D; ++b) to[b] += block(a, b);
    }
    for (int a = 0; a < D; ++a)
      for (int b = 0; b < D; ++b)
        mixed.template block<D, 1>(static_cast<Eigen::Index>(i) * D, a * D + b) += block.col(a) * point<D>(x, j)[b];
  }
};

}  // namespace

Real largest_column(const Eigen::MatrixXd& matrix) {
  Real largest = 0;
  for (Eigen::Index k = 0; k < matrix.cols(); ++k) largest = std::max(largest, matrix.col(k).norm());
  return largest;
}

template <int D>
Stiffness<D>::Stiffness(ParticleSystem<D>& system, std::span<const Real> x, PreStress pre_stress) {
  if (system.ranks().several())
    throw InputError("the Hessian of a packing is computed on one rank, not on {}; use one process",
                     system.ranks().size());
  if (system.rotates_or_remembers())
    throw InputError(
        "particles that rotate and contacts with history have no Hessian; use a model whose forces depend on "
        "positions");
  const StateView<D> s = system.view(x.data(), nullptr);
  const Topology& topology = s.topology;
  own_points_ = static_cast<std::size_t>(topology.owned_points());
  for (Index i = 0; i < topology.owned_points(); ++i)
    if (topology.active[topology.particle[i]] != 0) points_.push_back(i);

  const auto visit = [&](BlockSink<D>& sink) { system.field().hessian(s, sink, pre_stress); };
  const std::vector<Index> rows = rows_of_points<D>(system, points_);
  BlockPlaces<D> found(rows);
  for (const Index i : points_) found.add(i, i, Mat<D>::Zero());
  visit(found);
  found.unite();
  if (found.places.size() * D * D > std::numeric_limits<PetscInt>::max())
    throw MemoryError(
        fmt::format("a matrix of {} blocks has more entries than indices can count", found.places.size()));

  start_.reserve(static_cast<std::size_t>(size()) + 1);
  start_.push_back(0);
  column_.reserve(found.places.size() * D * D);
  for (std::size_t k = 0, end = 0; k < found.places.size(); k = end) {
    const std::uint64_t row = found.places[k] >> 32;
    while (end < found.places.size() && found.places[end] >> 32 == row) ++end;
    for (int a = 0; a < D; ++a) {
      for (std::size_t l = k; l < end; ++l)
        for (int b = 0; b < D; ++b) column_.push_back(static_cast<PetscInt>(found.places[l] & 0xffffffffU) * D + b);
      start_.push_back(static_cast<PetscInt>(column_.size()));
    }
  }
  found.places = {};
  values_.assign(column_.size(), 0);
  BlockValues<D> blocks(rows, start_, column_, values_, s.x);
  visit(blocks);

  strain_.mixed.setZero(size(), D * D);
  strain_.affine.setZero();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i] < 0) continue;
    const auto at = static_cast<Index>(i);
    const auto of_point = blocks.mixed.template middleRows<D>(static_cast<Eigen::Index>(i) * D);
    strain_.mixed.template middleRows<D>(static_cast<Eigen::Index>(rows[i]) * D) += of_point;
    for (int a = 0; a < D; ++a)
      for (int b = 0; b < D; ++b) strain_.affine.row(a * D + b) += point<D>(s.x, at)[b] * of_point.row(a);
  }
}

template <int D>
PetscMat Stiffness<D>::petsc() {
  PetscMat matrix;
  petsc_check(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, size(), size(), start_.data(), column_.data(), values_.data(),
                                        matrix.out()));
  petsc_check(MatSetOption(matrix, MAT_SYMMETRIC, PETSC_TRUE));
  petsc_check(MatSetOption(matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  return matrix;
}

template <int D>
void Stiffness<D>::scale(const Eigen::VectorXd& factors) {
  for (Index row = 0; row < size(); ++row)
    for (PetscInt k = start_[row]; k < start_[row + 1]; ++k) values_[k] *= factors[row] * factors[column_[k]];
}

template <int D>
Real Stiffness<D>::bound() const {
  Real most = 0;
  for (Index row = 0; row < size(); ++row) {
    Real sum = 0;
    for (PetscInt k = start_[row]; k < start_[row + 1]; ++k) sum += std::abs(values_[k]);
    most = std::max(most, sum);
  }
  return most;
}

template <int D>
std::vector<Real> Stiffness<D>::displacements(const Eigen::Ref<const Eigen::VectorXd>& rows) const {
  std::vector<Real> all(own_points_ * D);
  for (std::size_t k = 0; k < points_.size(); ++k)
    point<D>(all.data(), points_[k]) = rows.template segment<D>(static_cast<Eigen::Index>(k) * D);
  return all;
}

template class Stiffness<2>;
template class Stiffness<3>;

}  // namespace pliant
