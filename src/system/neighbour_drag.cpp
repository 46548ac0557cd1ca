#include <pliant/system/neighbour_drag.h>

#include <petscksp.h>

#include <algorithm>
#include <cmath>

#include <pliant/base/petsc.h>
#include <pliant/base/petsc_views.h>

namespace pliant {

template <int D>
struct NeighbourDrag<D>::Solver {
  Handle<KSP, KSPDestroy> ksp;
  PetscMat matrix;
  PetscVec right, solution;
  std::vector<PetscScalar> values;
  bool patterned = false;  ///< the matrix has the pattern of the present lists
};

template <int D>
NeighbourDrag<D>::NeighbourDrag(const NeighbourDragOptions& options)
    : options_(options), solver_(std::make_unique<Solver>()) {
  if (!(options.b > 0)) throw InputError("the drag coefficient b is {}, but it must be positive", options.b);
  if (!(options.beyond_contact > 0))
    throw InputError("the range of neighbours beyond contact is {}, but it must be positive", options.beyond_contact);
  petsc_check(KSPCreate(PETSC_COMM_SELF, solver_->ksp.out()));
  KSP ksp = solver_->ksp;
  PC pc = nullptr;
  constexpr const char* prefix = "mobility_";
  petsc_check(KSPSetOptionsPrefix(ksp, prefix));
  // The neighbours stay the same for many evaluations, and the factors of B with them.
  petsc_check(KSPSetType(ksp, KSPPREONLY));
  // Forces may be negligible next to the previous velocities, which must not count as divergence.
  petsc_check(KSPSetTolerances(ksp, 1e-12, PETSC_DEFAULT, 1e100, PETSC_DEFAULT));
  petsc_check(KSPGetPC(ksp, &pc));
  petsc_check(PCSetType(pc, PCCHOLESKY));
  petsc_check(KSPSetFromOptions(ksp));
  read_views(PETSC_COMM_SELF, ksp_views, prefix);
  PetscBool direct = PETSC_FALSE;  // then PETSc refuses a guess
  petsc_check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(ksp), KSPPREONLY, &direct));
  petsc_check(KSPSetInitialGuessNonzero(ksp, direct == PETSC_TRUE ? PETSC_FALSE : PETSC_TRUE));
}

template <int D>
NeighbourDrag<D>::~NeighbourDrag() = default;

template <int D>
void NeighbourDrag<D>::set_numbers(std::vector<Index> numbers) {
  numbers_ = std::move(numbers);
  solver_->patterned = false;
}

template <int D>
template <class Visit>
void NeighbourDrag<D>::for_each_neighbour(const StateView<D>& s, Visit&& visit) {
  const PairList& list = s.neighbours.point_pairs;
  for (Index c = 0; c < s.neighbours.chunks(); ++c) {
    const Range inside = list.inside(c), across = list.across(c);
    for (Index e = inside.first; e < inside.last; ++e) {
      visit(list[e].first, list[e].second, e);
      visit(list[e].second, list[e].first, e);
    }
    for (Index e = across.first; e < across.last; ++e) visit(list[e].first, list[e].second, e);
  }
}

template <int D>
template <class Visit>
void NeighbourDrag<D>::for_each_wall(const StateView<D>& s, Visit&& visit) const {
  if (!options_.walls) return;
  for (const auto [i, part] : s.neighbours.walls) {
    if (!s.walls.carries(s.position(i), part, s.t)) continue;
    Real d;
    Vec<D> n;
    s.walls.nearest(s.position(i), part, s.t, d, n);
    if (d < s.topology.diameter[i] / 2 + options_.beyond_contact)
      visit(i, s.walls.velocity(s.position(i) - d * n, part, s.t));
  }
}

/// The listed pairs and walls that are in range.
template <int D>
void NeighbourDrag<D>::find_coupling(const StateView<D>& s) {
  const auto n = static_cast<std::size_t>(s.topology.owned_points());
  coupled_.clear();
  diagonal_.assign(n, 1);
  push_.assign(n * D, 0);
  for_each_neighbour(s, [&](Index i, Index j, Index e) {
    const bool near = in_range(s, i, j, e);
    coupled_.push_back(near);
    diagonal_[i] += near;
  });
  for_each_wall(s, [&](Index i, const Vec<D>& velocity) {
    diagonal_[i] += 1;
    point<D>(push_.data(), i) += velocity;
  });
}

template <int D>
Real NeighbourDrag<D>::power(const StateView<D>& s) const {
  Real sum = 0;
  for (Index i = 0; i < s.topology.owned_points(); ++i) sum += s.velocity(i).squaredNorm();
  for_each_neighbour(s, [&](Index i, Index j, Index e) {
    if (in_range(s, i, j, e)) sum += (s.velocity(i) - s.velocity(j)).squaredNorm() / 2;
  });
  for_each_wall(s, [&](Index i, const Vec<D>& velocity) { sum += (s.velocity(i) - velocity).squaredNorm(); });
  return options_.b * sum;
}

template <int D>
void NeighbourDrag<D>::find_velocities(const ForceField<D>& field, const StateView<D>& s, Real* v) {
  force_.resize(static_cast<std::size_t>(s.topology.points()) * D);
  field.forces(s, force_.data());
  solve(s, force_.data(), v);
}

template <int D>
void NeighbourDrag<D>::solve(const StateView<D>& s, const Real* force, Real* v) {
  const Topology& topology = s.topology;
  const Index n = topology.owned_points();
  const std::vector<std::uint8_t> coupled_before = coupled_;
  const std::vector<Real> diagonal_before = diagonal_;
  find_coupling(s);
  const auto load = [&](Index i) -> Vec<D> {
    if (topology.inverse_mass(i) == 0) return Vec<D>::Zero();
    return point<D>(force, i) / options_.b + point<D>(push_.data(), i);
  };

  if (options_.coupling != Coupling::exact) {
    std::vector<Real> sum(static_cast<std::size_t>(n) * D);
    std::vector<Index> neighbours(n);
    std::size_t entry = 0;
    for_each_neighbour(s, [&](Index i, Index j, Index) {
      if (coupled_[entry++] == 0) return;
      point<D>(sum.data(), i) += s.velocity(j);
      ++neighbours[i];
    });
    for (Index i = 0; i < n; ++i) {
      const Real weight = options_.coupling == Coupling::mean ? std::max<Index>(neighbours[i], 1) : 1;
      point<D>(v, i) = (point<D>(sum.data(), i) / weight + load(i)) / diagonal_[i];
    }
    return;
  }

  Solver& solver = *solver_;
  const bool same = solver.patterned && coupled_ == coupled_before && diagonal_ == diagonal_before;
  if (!solver.patterned) {
    std::vector<PetscInt> row(numbers_.begin(), numbers_.begin() + n), column = row;
    for_each_neighbour(s, [&](Index i, Index j, Index) {
      row.push_back(numbers_[i]);
      column.push_back(numbers_[j]);
    });
    if (std::ranges::any_of(column, [n](PetscInt k) { return k >= n; }))
      throw InputError("viscous friction of neighbours works on one rank only; start without mpiexec");
    petsc_check(MatCreate(PETSC_COMM_SELF, solver.matrix.out()));
    petsc_check(MatSetSizes(solver.matrix, n, n, PETSC_DETERMINE, PETSC_DETERMINE));
    petsc_check(MatSetType(solver.matrix, MATAIJ));
    petsc_check(MatSetPreallocationCOO(solver.matrix, static_cast<PetscCount>(row.size()), row.data(), column.data()));
    petsc_check(MatSetOption(solver.matrix, MAT_SPD, PETSC_TRUE));
    petsc_check(MatCreateVecs(solver.matrix, solver.solution.out(), solver.right.out()));
    petsc_check(KSPReset(solver.ksp));  // KSPReset drops the views set by options
    petsc_check(KSPMonitorCancel(solver.ksp));
    petsc_check(KSPSetFromOptions(solver.ksp));
    petsc_check(KSPSetOperators(solver.ksp, solver.matrix, solver.matrix));
    solver.patterned = true;
  }
  if (!same) {
    solver.values.assign(diagonal_.begin(), diagonal_.end());
    for (const std::uint8_t near : coupled_) solver.values.push_back(near != 0 ? -1 : 0);
    petsc_check(MatSetValuesCOO(solver.matrix, solver.values.data(), INSERT_VALUES));
  }

  for (int k = 0; k < D; ++k) {
    PetscScalar *right = nullptr, *guess = nullptr;
    petsc_check(VecGetArrayWrite(solver.right, &right));
    petsc_check(VecGetArrayWrite(solver.solution, &guess));
    for (Index i = 0; i < n; ++i) {
      right[i] = load(i)[k];
      guess[i] = v[static_cast<std::size_t>(i) * D + k];
    }
    petsc_check(VecRestoreArrayWrite(solver.right, &right));
    petsc_check(VecRestoreArrayWrite(solver.solution, &guess));
    petsc_check(KSPSolve(solver.ksp, solver.right, solver.solution));
    KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
    PetscInt iterations = 0;
    petsc_check(KSPGetConvergedReason(solver.ksp, &reason));
    petsc_check(KSPGetIterationNumber(solver.ksp, &iterations));
    iterations_ += iterations;
    if (reason < 0)
      throw NumericalError(
          "the velocities of the droplets were not found at t = {}: {} after {} iterations; check the initial state "
          "and "
          "the options of its linear solver",
          s.t, KSPConvergedReasons[reason], iterations);
    const PetscScalar* found = nullptr;
    petsc_check(VecGetArrayRead(solver.solution, &found));
    for (Index i = 0; i < n; ++i) v[static_cast<std::size_t>(i) * D + k] = found[i];
    petsc_check(VecRestoreArrayRead(solver.solution, &found));
  }
}

template class NeighbourDrag<2>;
template class NeighbourDrag<3>;

}  // namespace pliant
