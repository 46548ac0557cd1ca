#include <pliant/jamming/modes.h>
#include <pliant/jamming/stiffness_factors.h>

#include <slepceps.h>

#include <algorithm>
#include <cmath>

namespace pliant {
namespace {

using PetscEps = Handle<EPS, EPSDestroy>;

/// [rows] 1/√m of the point of each row, or 1.
template <int D>
Eigen::VectorXd row_scales(const Topology& topology, const std::vector<Index>& points, ModeMass mass) {
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(points.size()) * D);
  if (mass == ModeMass::vibrations)
    for (std::size_t k = 0; k < points.size(); ++k)
      scale.segment<D>(static_cast<Eigen::Index>(k) * D).setConstant(std::sqrt(topology.inverse_mass(points[k])));
  return scale;
}

void start_slepc() {
  PetscBool running = PETSC_FALSE;
  petsc_check(SlepcInitialized(&running));
  if (running == PETSC_FALSE) petsc_check(SlepcInitializeNoArguments());
}

/// The first eigenvalues of a solver and their vectors.
void take_pairs(EPS eps, ::Mat matrix, Index number, Modes& modes) {
  PetscInt found = 0, rows = 0;
  petsc_check(EPSGetConverged(eps, &found));
  petsc_check(MatGetSize(matrix, &rows, nullptr));
  if (found < number)
    throw NumericalError("SLEPc found {} of {} modes; ask for fewer, or minimise the energy further", found, number);
  modes.eigenvalues.resize(number);
  modes.vectors.resize(rows, number);
  for (Index k = 0; k < number; ++k) {
    PetscVec vector;
    petsc_check(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, rows, modes.vectors.col(k).data(), vector.out()));
    petsc_check(EPSGetEigenpair(eps, k, &modes.eigenvalues[k], nullptr, vector, nullptr));
    // The sign is the solver's choice; a rule makes it the same everywhere.
    auto mode = modes.vectors.col(k);
    Eigen::Index largest = 0;
    mode.cwiseAbs().maxCoeff(&largest);
    if (mode[largest] < 0) mode = -mode;
  }
}

/// By LAPACK, which finds all eigenvalues.
void solve_dense(::Mat matrix, Index number, Modes& modes) {
  start_slepc();
  PetscEps eps;
  petsc_check(EPSCreate(PETSC_COMM_SELF, eps.out()));
  petsc_check(EPSSetOperators(eps, matrix, nullptr));
  petsc_check(EPSSetProblemType(eps, EPS_HEP));
  petsc_check(EPSSetType(eps, EPSLAPACK));
  petsc_check(EPSSetWhichEigenpairs(eps, EPS_SMALLEST_REAL));
  petsc_check(EPSSolve(eps));
  take_pairs(eps, matrix, number, modes);
}

/// Prepares a solver of a symmetric matrix whose lowest eigenvalues it finds by the inverse of matrix − shift. Returns
/// the number of eigenvalues below the shift.
PetscInt set_up(EPS eps, ::Mat matrix, Real shift, PetscInt number) {
  petsc_check(EPSSetOperators(eps, matrix, nullptr));
  petsc_check(EPSSetProblemType(eps, EPS_HEP));
  petsc_check(EPSSetType(eps, EPSKRYLOVSCHUR));
  petsc_check(EPSSetTarget(eps, shift));
  petsc_check(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  petsc_check(EPSSetDimensions(eps, number, PETSC_DEFAULT, PETSC_DEFAULT));
  petsc_check(EPSSetTolerances(eps, 1e-11, 1000));
  ST transform = nullptr;
  KSP solver = nullptr;
  PC factors = nullptr;
  petsc_check(EPSGetST(eps, &transform));
  petsc_check(STSetType(transform, STSINVERT));
  petsc_check(STSetShift(transform, shift));
  petsc_check(STGetKSP(transform, &solver));
  petsc_check(KSPSetType(solver, KSPPREONLY));
  petsc_check(KSPGetPC(solver, &factors));
  petsc_check(PCSetType(factors, PCCHOLESKY));
  PetscBool mumps = PETSC_FALSE;
  petsc_check(MatGetFactorAvailable(matrix, MATSOLVERMUMPS, MAT_FACTOR_CHOLESKY, &mumps));
  if (mumps == PETSC_TRUE) {
    petsc_check(PCFactorSetMatSolverType(factors, MATSOLVERMUMPS));
    petsc_check(STGetOperator(transform, nullptr));  // makes the matrix that the factors are of
    petsc_check(PCFactorSetUpMatSolverType(factors));
    ::Mat parts = nullptr;
    petsc_check(PCFactorGetMatrix(factors, &parts));
    petsc_check(MatMumpsSetIcntl(parts, 13, 1));  // counts negative pivots
  } else {
    petsc_check(PCFactorSetMatOrderingType(factors, MATORDERINGND));
  }
  petsc_check(EPSSetUp(eps));
  ::Mat parts = nullptr;
  petsc_check(PCFactorGetMatrix(factors, &parts));
  PetscInt below = 0;
  petsc_check(MatGetInertia(parts, &below, nullptr, nullptr));
  return below;
}

/// The lowest eigenvalues. bound: of the absolute values of all.
void solve_lowest(::Mat matrix, Real bound, Index number, Modes& modes) {
  start_slepc();
  // Close to the lowest eigenvalue, and below it: 0 for a stable packing.
  PetscEps eps;
  Real shift = -1e-8 * bound;
  for (;; shift *= 100) {
    petsc_check(EPSCreate(PETSC_COMM_SELF, eps.out()));
    if (set_up(eps, matrix, shift, number) == 0) break;
    if (shift < -bound) throw NumericalError("no shift below all eigenvalues was found; are the forces finite?");
  }
  petsc_check(EPSSolve(eps));
  take_pairs(eps, matrix, number, modes);  // in the order of the distance from the shift
}

template <int D>
std::vector<Real> participation_ratios(const Topology& topology, const Modes& modes) {
  std::vector<Real> ratios(static_cast<std::size_t>(modes.vectors.cols()));
  std::vector<Real> squares(static_cast<std::size_t>(topology.owned()));
  const auto particles =
      static_cast<Real>(std::count(topology.active.begin(), topology.active.begin() + topology.owned(), 1));
  for (std::size_t k = 0; k < ratios.size(); ++k) {
    std::fill(squares.begin(), squares.end(), 0);
    const auto mode = modes.vectors.col(static_cast<Eigen::Index>(k));
    for (std::size_t p = 0; p < modes.points.size(); ++p)
      squares[topology.particle[modes.points[p]]] +=
          mode.template segment<D>(static_cast<Eigen::Index>(p) * D).squaredNorm();
    Real sum = 0, fourth = 0;
    for (const Real a : squares) sum += a, fourth += a * a;
    ratios[k] = sum * sum / (particles * fourth);
  }
  return ratios;
}

}  // namespace

std::vector<Real> Modes::frequencies() const {
  std::vector<Real> all;
  for (const Real a : eigenvalues) all.push_back(std::copysign(std::sqrt(std::abs(a)), a));
  return all;
}

template <int D>
Modes modes(ParticleSystem<D>& system, std::span<const Real> x, const ModesOptions& options) {
  if (options.lowest < 0)
    throw InputError("{} modes are asked for; ask for a positive number, or 0 for all", options.lowest);
  constexpr Index largest_matrix = 20000;
  Stiffness<D> h(system, x, options.pre_stress);
  const Index rows = h.size(), number = options.lowest == 0 ? rows : std::min(options.lowest, rows);
  if (rows == 0) throw InputError("no particle is left in the run; modes need a packing");
  if (number == rows && rows > largest_matrix)
    throw InputError("all modes of {} coordinates are asked for, more than {}; ask for the lowest modes", rows,
                     largest_matrix);
  const Topology& topology = system.topology();
  Modes found;
  found.mass = options.mass;
  found.points = h.points();
  const Eigen::VectorXd scale = row_scales<D>(topology, h.points(), options.mass);
  h.scale(scale);
  const Real bound = h.bound();
  // A Krylov space holds less than all vectors.
  if (rows <= options.largest_dense || number > rows / 2)
    solve_dense(h.petsc(), number, found);
  else
    solve_lowest(h.petsc(), bound, number, found);

  found.zero_limit = options.zero_threshold * bound;
  for (const Real value : found.eigenvalues) {
    if (std::abs(value) <= found.zero_limit) ++found.zero;
    if (value < -found.zero_limit) ++found.unstable;
  }
  const Eigen::MatrixXd left = h.matrix() * found.vectors - found.vectors * found.eigenvalues.asDiagonal();
  found.residual = bound > 0 ? largest_column(left) / bound : 0;
  found.participation = participation_ratios<D>(topology, found);
  return found;
}

template <int D>
bool is_stable(ParticleSystem<D>& system, std::span<const Real> x) {
  const ModesOptions options;
  Stiffness<D> h(system, x);
  if (h.size() == 0) return false;
  h.scale(row_scales<D>(system.topology(), h.points(), options.mass));
  return StiffnessFactors<D>(h).factorise(options.zero_threshold * h.bound());
}

template <int D>
std::vector<Real> mode_displacements(const ParticleSystem<D>& system, const Modes& modes, Index k) {
  const Topology& topology = system.topology();
  const Eigen::VectorXd rows = row_scales<D>(topology, modes.points, modes.mass).cwiseProduct(modes.vectors.col(k));
  std::vector<Real> all(static_cast<std::size_t>(topology.owned_points()) * D);
  Real most = 0;
  for (std::size_t p = 0; p < modes.points.size(); ++p)
    most = std::max(most, rows.template segment<D>(static_cast<Eigen::Index>(p) * D).norm());
  for (std::size_t p = 0; p < modes.points.size(); ++p)
    point<D>(all.data(), modes.points[p]) = rows.template segment<D>(static_cast<Eigen::Index>(p) * D) / most;
  return all;
}

DensityOfStates density_of_states(std::span<const Real> frequencies, Real lowest, Real highest, Index bins) {
  if (bins < 1 || !(highest > 0))
    throw InputError("a density of states has {} bins up to the frequency {}; both must be positive", bins, highest);
  DensityOfStates states{std::vector<Real>(bins + 1), std::vector<Real>(bins)};
  for (Index k = 0; k <= bins; ++k) states.edges[k] = highest * k / bins;
  Index counted = 0;
  for (const Real frequency : frequencies) {
    if (!(frequency > lowest)) continue;
    ++counted;
    if (frequency < highest) ++states.density[static_cast<std::size_t>(frequency / highest * bins)];
  }
  for (Real& a : states.density) a *= counted > 0 ? bins / (highest * counted) : 0;
  return states;
}

template <int D>
std::vector<PackingEnergy> energies_along(ParticleSystem<D>& system, std::span<const Real> x,
                                          std::span<const Real> direction, std::span<const Real> amplitudes) {
  std::vector<PackingEnergy> all;
  std::vector<Real> moved;
  const std::vector<Real> at_rest(x.size());  // for terms with dissipation
  for (const Real amplitude : amplitudes) {
    moved.assign(x.begin(), x.end());
    for (std::size_t k = 0; k < direction.size(); ++k) moved[k] += amplitude * direction[k];
    PackingEnergy& energy = all.emplace_back();
    for (const TermReport& term : system.field().report(system.view(moved.data(), at_rest.data()))) {
      if (!term.is_energy) continue;
      energy.total += term.energy;
      if (term.particle_energy.empty()) energy.contacts += term.energy;
    }
  }
  return all;
}

template Modes modes(ParticleSystem<2>&, std::span<const Real>, const ModesOptions&);
template Modes modes(ParticleSystem<3>&, std::span<const Real>, const ModesOptions&);
template bool is_stable(ParticleSystem<2>&, std::span<const Real>);
template bool is_stable(ParticleSystem<3>&, std::span<const Real>);
template std::vector<Real> mode_displacements(const ParticleSystem<2>&, const Modes&, Index);
template std::vector<Real> mode_displacements(const ParticleSystem<3>&, const Modes&, Index);
template std::vector<PackingEnergy> energies_along(ParticleSystem<2>&, std::span<const Real>, std::span<const Real>,
                                                   std::span<const Real>);
template std::vector<PackingEnergy> energies_along(ParticleSystem<3>&, std::span<const Real>, std::span<const Real>,
                                                   std::span<const Real>);

}  // namespace pliant
