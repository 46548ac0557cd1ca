#include <pliant/system/jacobian.h>

#include <algorithm>
#include <numeric>
#include <span>
#include <stdexcept>

#include <pliant/system/particle_pc.h>
#include <pliant/system/particle_system.h>

namespace pliant {
namespace {

/// Where a matrix of D × D blocks has entries: rows of the own points, columns of these and of ghosts.
class BlockPattern {
 public:
  /// within: blocks that couple different particles are left out.
  template <int D>
  void build(const StateView<D>& s, const ElementCoupling& coupling, bool within) {
    const Index own = s.topology.owned_points();
    start_.assign(static_cast<std::size_t>(own) + 2, 0);
    for_each(s, coupling, within, [&](Index i, Index) { ++start_[i + 2]; });
    std::partial_sum(start_.begin(), start_.end(), start_.begin());
    column_.resize(start_.back());
    for_each(s, coupling, within,
             [&](Index i, Index j) { column_[start_[i + 1]++] = j; });  // shifts start_ to its place
    start_.pop_back();
    auto end = column_.begin();
    for (Index i = 0; i < own; ++i) {
      const auto first = column_.begin() + start_[i], last = column_.begin() + start_[i + 1];
      std::sort(first, last);
      start_[i] = static_cast<Index>(end - column_.begin());
      end = std::copy(first, std::unique(first, last), end);
    }
    start_[own] = static_cast<Index>(end - column_.begin());
    column_.erase(end, column_.end());
  }

  Index blocks() const { return start_.back(); }
  Index rows() const { return static_cast<Index>(start_.size()) - 1; }
  Range row(Index i) const { return {start_[i], start_[i + 1]}; }
  Index column(Index k) const { return column_[k]; }
  /// Number of block (i, j), −1 without a block.
  Index find(Index i, Index j) const {
    const auto first = column_.begin() + start_[i], last = column_.begin() + start_[i + 1];
    const auto at = std::lower_bound(first, last, j);
    return at != last && *at == j ? static_cast<Index>(at - column_.begin()) : -1;
  }

 private:
  template <int D, class Visit>
  static void for_each(const StateView<D>& s, const ElementCoupling& coupling, bool within, Visit&& visit) {
    const Topology& topology = s.topology;
    const Index own = topology.owned_points();
    const auto couple = [&](Index i, Index j) {
      if (i < own && !(within && topology.id[topology.particle[i]] != topology.id[topology.particle[j]])) visit(i, j);
    };
    for (Index i = 0; i < own; ++i) {
      const Index m = topology.particle[i];
      const Range with = coupling.particles ? Range{topology.offset[m], topology.offset[m + 1]} : Range{i, i + 1};
      for (Index j = with.first; j < with.last; ++j) visit(i, j);
    }
    for_each_kind([&]<class Kind>(Kind) {
      if constexpr (Kind::couples == Couples::stencil)
        if (coupling.has(Kind()))
          for (const Pair& pair : s.neighbours.*Kind::list) {
            const auto points = Kind::stencil(topology, pair);
            for (const Index i : points)
              for (const Index j : points) couple(i, j);
          }
    });
  }

  std::vector<Index> start_{0}, column_;
};

/// Adds blocks to their places in an array of values, row by row within a block.
template <int D>
struct Fill final : BlockSink<D> {
  const BlockPattern& pattern;
  Real* values;
  bool drop;  ///< blocks without a place
  Fill(const BlockPattern& places, Real* to, bool drop_others) : pattern(places), values(to), drop(drop_others) {}
  void add(Index i, Index j, const Mat<D>& block) override {
    const Index k = pattern.find(i, j);
    if (k >= 0)
      Eigen::Map<Eigen::Matrix<Real, D, D, Eigen::RowMajor>>(values + static_cast<std::size_t>(k) * D * D) += block;
    else if (!drop)
      throw std::logic_error("a term has put a block where its kind of elements has none");
  }
};

/// Adds factor · block · w.
template <int D>
struct Multiply final : BlockSink<D> {
  Real factor;
  const Real* w;
  Real* out;
  Multiply(Real f, const Real* vector, Real* result) : factor(f), w(vector), out(result) {}
  void add(Index i, Index j, const Mat<D>& block) override { point<D>(out, i) += factor * (block * point<D>(w, j)); }
};

template <int D>
class ParticleJacobian final : public Jacobian {
 public:
  ParticleJacobian(ParticleSystem<D>& system, JacobianForm form, JacobianKind kind, TermGroup group)
      : system_(system), form_(form), kind_(kind), group_(group) {
    const auto n = static_cast<PetscInt>(system.size() * (form == JacobianForm::first_order ? 2 : 1));
    const MPI_Comm comm = system.ranks().comm();
    petsc_check(MatCreate(comm, blocks_.out()));
    petsc_check(MatSetSizes(blocks_, n, n, PETSC_DETERMINE, PETSC_DETERMINE));
    petsc_check(MatSetType(blocks_, MATAIJ));
    // Rows have no numbers before the first pattern otherwise.
    PetscLayout rows = nullptr, columns = nullptr;
    petsc_check(MatGetLayouts(blocks_, &rows, &columns));
    petsc_check(PetscLayoutSetUp(rows));
    petsc_check(PetscLayoutSetUp(columns));
    if (kind == JacobianKind::assembled) return;
    petsc_check(MatCreateShell(comm, n, n, PETSC_DETERMINE, PETSC_DETERMINE, this, shell_.out()));
    petsc_check(MatShellSetOperation(shell_, MATOP_MULT, reinterpret_cast<void (*)()>(multiply)));
    petsc_check(MatSetUp(shell_));
  }

  void update(Real t, const Real* x, const Real* v, const JacobianWeights& weights) override {
    const StateView<D> s = system_.view(x, v, t);
    weights_ = weights;
    if (s.neighbours.version() != version_) set_pattern(s);
    const std::size_t n = system_.size(), lead = first_order() ? 2 * n : 0;
    values_.assign(values_.size(), 0);
    Real* const dx = values_.data() + lead;
    Real* const dv = dx + static_cast<std::size_t>(x_.blocks()) * D * D;
    Fill<D> fill_x(x_, dx, kind_ == JacobianKind::matrix_free), fill_v(v_, dv, kind_ == JacobianKind::matrix_free);
    system_.field().derivatives(s, group_, fill_x, fill_v);
    scale(s.topology, x_, weights.x, dx);
    scale(s.topology, v_, weights.v, dv);
    if (first_order()) {
      std::fill_n(values_.begin(), n, weights.identity);
      std::fill_n(values_.begin() + static_cast<std::ptrdiff_t>(n), n, weights.x);
    }
    for (Index i = 0; i < v_.rows(); ++i)
      for (int k = 0; k < D; ++k) dv[static_cast<std::size_t>(v_.find(i, i)) * D * D + k * (D + 1)] += weights.identity;
    petsc_check(MatSetValuesCOO(blocks_, values_.data(), INSERT_VALUES));
    if (!shell_) return;
    at_t_ = t;
    at_x_.assign(x, x + n);
    at_v_.assign(v, v + n);
    // Drops the scale and shift of PETSc.
    petsc_check(MatAssemblyBegin(shell_, MAT_FINAL_ASSEMBLY));
    petsc_check(MatAssemblyEnd(shell_, MAT_FINAL_ASSEMBLY));
  }

 private:
  bool first_order() const { return form_ == JacobianForm::first_order; }

  void set_pattern(const StateView<D>& s) {
    const Couplings couplings = system_.field().couplings(s, group_);
    x_.build(s, couplings.x, kind_ == JacobianKind::matrix_free);
    v_.build(s, couplings.v, kind_ == JacobianKind::matrix_free);
    version_ = s.neighbours.version();

    const std::size_t n = system_.size(), lead = first_order() ? 2 * n : 0;
    PetscInt first = 0;
    petsc_check(MatGetOwnershipRange(blocks_, &first, nullptr));
    // Columns of x and of v of each point, ghosts too: the halo carries numbers of that size without rounding.
    std::vector<Real> own(n), with_ghosts;
    for (std::size_t k = 0; k < n; k += D) {
      own[k] = first + static_cast<Real>(k);
      own[k + 1] = own[k] + (first_order() ? static_cast<Real>(n) : 0);
    }
    const Real* columns = system_.with_ghosts(own.data(), with_ghosts);

    values_.resize(lead + static_cast<std::size_t>(x_.blocks() + v_.blocks()) * D * D);
    std::vector<PetscInt> i(values_.size()), j(values_.size());
    std::size_t entry = 0;
    const auto add = [&](PetscInt row, PetscInt column) {
      i[entry] = row;
      j[entry++] = column;
    };
    const auto length = static_cast<PetscInt>(n), rows_of_v = first_order() ? first + length : first;
    if (first_order()) {
      for (PetscInt k = 0; k < length; ++k) add(first + k, first + k);
      for (PetscInt k = 0; k < length; ++k) add(first + k, first + length + k);
    }
    const auto add_blocks = [&](const BlockPattern& pattern, int of_v) {
      for (Index row = 0; row < pattern.rows(); ++row) {
        const Range blocks = pattern.row(row);
        for (Index k = blocks.first; k < blocks.last; ++k) {
          const auto column = static_cast<PetscInt>(columns[static_cast<std::size_t>(pattern.column(k)) * D + of_v]);
          for (int a = 0; a < D; ++a)
            for (int b = 0; b < D; ++b) add(rows_of_v + row * D + a, column + b);
        }
      }
    };
    add_blocks(x_, 0);
    add_blocks(v_, 1);
    petsc_check(MatSetPreallocationCOO(blocks_, static_cast<PetscCount>(entry), i.data(), j.data()));
    set_particle_blocks(blocks_, form_, s.topology, D);
  }

  void scale(const Topology& topology, const BlockPattern& pattern, Real weight, Real* values) const {
    for (Index row = 0; row < pattern.rows(); ++row) {
      const Real factor = weight * topology.inverse_mass(row);
      const Range blocks = pattern.row(row);
      std::for_each(values + static_cast<std::size_t>(blocks.first) * D * D,
                    values + static_cast<std::size_t>(blocks.last) * D * D, [&](Real& a) { a *= factor; });
    }
  }

  static PetscErrorCode multiply(::Mat shell, ::Vec in, ::Vec out) {
    return petsc_callback([&] {
      void* context = nullptr;
      petsc_check(MatShellGetContext(shell, &context));
      const PetscScalar* w = nullptr;
      PetscScalar* result = nullptr;
      petsc_check(VecGetArrayRead(in, &w));
      petsc_check(VecGetArrayWrite(out, &result));
      static_cast<ParticleJacobian*>(context)->product(w, result);
      petsc_check(VecRestoreArrayWrite(out, &result));
      petsc_check(VecRestoreArrayRead(in, &w));
    });
  }

  void product(const Real* w, Real* out) {
    const std::size_t n = system_.size();
    const Real* w_v = first_order() ? w + n : w;
    Real* out_v = first_order() ? out + n : out;
    const StateView<D> s = system_.view(at_x_.data(), at_v_.data(), at_t_);
    std::fill_n(out_v, n, 0);
    Multiply<D> by_x(weights_.x, system_.with_ghosts(w, w_x_), out_v),
        by_v(weights_.v, first_order() ? system_.with_ghosts(w_v, w_v_) : by_x.w, out_v);
    system_.field().derivatives(s, group_, by_x, by_v);
    for (Index i = 0; i < s.topology.owned_points(); ++i) point<D>(out_v, i) *= s.topology.inverse_mass(i);
    for (std::size_t k = 0; k < n; ++k) out_v[k] += weights_.identity * w_v[k];
    if (first_order())
      for (std::size_t k = 0; k < n; ++k) out[k] = weights_.identity * w[k] + weights_.x * w_v[k];
  }

  ParticleSystem<D>& system_;
  JacobianForm form_;
  JacobianKind kind_;
  TermGroup group_;
  JacobianWeights weights_{};
  std::int64_t version_ = -1;  ///< version of the lists behind the pattern
  BlockPattern x_, v_;
  std::vector<Real> values_;  ///< of blocks_, in the order of its COO entries
  Real at_t_ = 0;             ///< matrix_free: when and where
  std::vector<Real> at_x_, at_v_;
  std::vector<Real> w_x_, w_v_;  ///< with ghosts
};

}  // namespace

template <int D>
std::unique_ptr<Jacobian> make_jacobian(ParticleSystem<D>& system, JacobianForm form, JacobianKind kind,
                                        TermGroup group) {
  return std::make_unique<ParticleJacobian<D>>(system, form, kind, group);
}

template std::unique_ptr<Jacobian> make_jacobian(ParticleSystem<2>&, JacobianForm, JacobianKind, TermGroup);
template std::unique_ptr<Jacobian> make_jacobian(ParticleSystem<3>&, JacobianForm, JacobianKind, TermGroup);

}  // namespace pliant
