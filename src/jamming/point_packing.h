// Energy or enthalpy of few points with contacts in a periodic box, for many evaluations one after the other.
#pragma once

#include <optional>
#include <vector>

#include <pliant/jamming/block_cholesky.h>
#include <pliant/jamming/descent.h>
#include <pliant/kernels/pair_forces.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// Points whose forces are contacts of one law, in a periodic box that is not tilted. Coordinates y: the positions in
/// the box at the start; at a pressure, then the logarithm of the box length over the one at the start, times factor().
/// The sums are the same for any number of threads. Evaluations need neither ghosts nor lists of the system.
template <int D>
class PointPacking final : public ApproximateHessian {
 public:
  /// Whether a system is of this kind, and so small that factors of its Hessian cost less than the iterations of FIRE
  /// that they save.
  static bool suits(const ParticleSystem<D>& system);

  PointPacking(const ParticleSystem<D>& system, const PairContactLaw& law, std::optional<Real> pressure);

  /// The energy, at a pressure with p V, and the forces.
  Real operator()(const Real* y, Real* f);
  Real factor() const { return factor_; }
  /// The box length over the one at the start.
  Real scale(const Real* y) const;
  /// Of the contacts at the last evaluation, if the box is as at the start.
  Real pressure() const;
  /// The mean relative overlap of contacts at the last evaluation.
  Real mean_overlap() const;
  /// The positions in the present box.
  void place(const Real* y, Real* x) const;

  /// Without pre-stress, and so without negative eigenvalues, plus a small number, and in a box that is smaller by the
  /// mean overlap: pairs that will soon touch have a stiffness, too, without which steps would be too long.
  bool factorise(const Real* y) override;
  void solve(Eigen::VectorXd& b) override { factors_.solve(order_, b); }

 private:
  struct Pair {
    Index i, j;
    Real range;
    Vec<D> shift;  ///< from point j to its image
  };

  /// Whether the list has all pairs that may touch at y.
  bool holds(const Real* y, Real scale) const;
  void find_pairs(const Real* y, Real scale);
  void find_order();
  template <class Law>
  void evaluate(const Real* y, Real scale, Real* f);

  PairContactLaw law_;
  std::optional<Real> pressure_;
  Box<D> box_;
  std::vector<Real> radius_;
  Real widest_ = 0, factor_ = 1;
  std::size_t numbers_;  ///< number of coordinates without the one of the box
  std::vector<Pair> pairs_;
  std::vector<Real> reference_;
  Real listed_scale_ = 0;
  Real energy_ = 0, virial_ = 0;  ///< Σ V and Σ r V'
  std::vector<Index> order_;      ///< place of each point in the factors, which have few blocks then
  BlockCholesky<D> factors_;
  std::vector<typename BlockCholesky<D>::Entry> entries_;
  std::vector<Mat<D>> own_;
  std::vector<Vec<D>> by_box_;
};

extern template class PointPacking<2>;
extern template class PointPacking<3>;

}  // namespace pliant
