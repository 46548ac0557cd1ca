#include <pliant/jamming/trust_region.h>

#include <petsctao.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/base/petsc_views.h>

namespace pliant {
namespace {

using PetscTao = Handle<Tao, TaoDestroy>;

// The minimisation has its own test of convergence and limits, and its Hessian is exact.
constexpr std::array own_settings = {"-tao_max_it",     "-tao_max_funcs",  "-tao_gatol", "-tao_grtol",
                                     "-tao_gttol",      "-tao_catol",      "-tao_crtol", "-tao_steptol",
                                     "-tao_fd_hessian", "-tao_mf_hessian", "-tao_fmin",  "-tao_fd_gradient"};
constexpr std::array tao_views = {"tao_view", "tao_view_solution", "tao_view_gradient", "tao_converged_reason"};

/// Errors: InputError for a type that is not among those that work with PETSc 3.18.
void check_one_of(std::string_view option, std::string_view type, std::string_view first, std::string_view second) {
  if (type != first && type != second)
    throw InputError("{} {}: packings are minimised with {} or {}; use one of them", option, type, first, second);
}

PetscTao make_tao() {
  PetscTao tao;
  petsc_check(TaoCreate(PETSC_COMM_SELF, tao.out()));
  std::array<char, 64> type{TAONTR};
  petsc_check(PetscOptionsGetString(nullptr, nullptr, "-tao_type", type.data(), type.size(), nullptr));
  // With a line search, too, ntl needs the preconditioner lmvm, and bntl may repeat a step without end.
  check_one_of("-tao_type", type.data(), TAONTR, TAOBNTR);
  petsc_check(TaoSetType(tao, type.data()));
  KSP ksp = nullptr;
  PC pc = nullptr;
  petsc_check(TaoGetKSP(tao, &ksp));
  petsc_check(KSPGetPC(ksp, &pc));
  petsc_check(PCSetType(pc, PCSHELL));
  petsc_check(TaoSetFromOptions(tao));
  const char *prefix = nullptr, *solver = nullptr;
  petsc_check(KSPGetOptionsPrefix(ksp, &prefix));
  petsc_check(KSPGetType(ksp, &solver));
  check_one_of(fmt::format("-{}ksp_type", prefix), solver, KSPSTCG, KSPNASH);  // gltr frees memory twice
  return tao;
}

/// The Hessian is not positive definite even with a large multiple of the unit matrix.
struct NoFactors {};

/// An energy in the form of TAO. TAO treats changes of the energy below fixed limits as rounding errors; therefore the
/// unit of its energies is a small part of the energy at the start.
class Problem {
 public:
  Problem(std::span<Real> x, const EnergyAndForce& energy_and_force, ExactHessian& hessian, const DescentOptions& o)
      : energy_and_force_(energy_and_force),
        hessian_(hessian),
        o_(o),
        x_(x.begin(), x.end()),
        force_(x.size()),
        expanded_at_(x_),
        solution_(static_cast<Eigen::Index>(x.size())) {
    constexpr Real part = 1e-8;
    evaluate();
    start_energy_ = energy_;
    if (energy_ != 0) unit_ = part * std::abs(energy_);
  }

  void connect(Tao tao, ::Vec x, ::Mat matrix);
  const DescentResult& result() const { return result_; }

 private:
  static Problem& of(void* context) { return *static_cast<Problem*>(context); }
  void evaluate();
  void evaluate(::Vec at);
  bool far(::Vec at) const;
  void expand(::Vec at, ::Mat matrix);
  void precondition(::Vec b, ::Vec to);
  TaoConvergedReason test(Tao tao);

  const EnergyAndForce& energy_and_force_;
  ExactHessian& hessian_;
  const DescentOptions& o_;
  std::vector<Real> x_, force_;    ///< of the last evaluation
  std::vector<Real> expanded_at_;  ///< place of the last Hessian, from which TAO tries steps
  Eigen::VectorXd solution_;
  Real energy_ = 0, start_energy_ = 0, unit_ = 1;
  std::int64_t evaluations_before_ = 0;  ///< until the last Hessian
  DescentResult result_;
};

template <class Use>
auto with_values(::Vec vec, Use&& use) {
  const PetscScalar* values = nullptr;
  petsc_check(VecGetArrayRead(vec, &values));
  use(values);
  petsc_check(VecRestoreArrayRead(vec, &values));
}

template <class Write>
void write_values(::Vec vec, Write&& write) {
  PetscScalar* values = nullptr;
  petsc_check(VecGetArrayWrite(vec, &values));
  write(values);
  petsc_check(VecRestoreArrayWrite(vec, &values));
}

void Problem::evaluate() {
  ++result_.evaluations;
  energy_ = energy_and_force_(x_.data(), force_.data());
}

/// TAO asks for the energy and the gradient at a place one after the other.
void Problem::evaluate(::Vec at) {
  bool same = false;
  with_values(at, [&](const Real* x) {
    same = std::equal(x_.begin(), x_.end(), x);
    std::copy_n(x, x_.size(), x_.begin());
  });
  if (!same) evaluate();
}

/// Whether a coordinate is more than max_move from the place of the last Hessian.
bool Problem::far(::Vec at) const {
  bool is_far = false;
  with_values(at, [&](const Real* x) {
    for (std::size_t k = 0; k < x_.size(); ++k) is_far = is_far || !(std::abs(x[k] - expanded_at_[k]) <= o_.max_move);
  });
  return is_far;
}

void Problem::expand(::Vec at, ::Mat matrix) {
  with_values(at, [&](const Real* x) { std::copy_n(x, x_.size(), expanded_at_.begin()); });
  evaluations_before_ = result_.evaluations;
  ++result_.iterations;
  if (!hessian_.factorise(expanded_at_.data())) throw NoFactors();
  hessian_.fill(matrix);
  petsc_check(MatScale(matrix, 1 / unit_));
}

void Problem::precondition(::Vec b, ::Vec to) {
  with_values(b, [&](const Real* values) { std::copy_n(values, x_.size(), solution_.begin()); });
  hessian_.solve(solution_);
  write_values(to, [&](Real* values) { Eigen::Map<Eigen::VectorXd>(values, solution_.size()) = unit_ * solution_; });
}

TaoConvergedReason Problem::test(Tao tao) {
  constexpr std::int64_t most_trials = 60;  // with so many the radius is within rounding errors
  ::Vec x = nullptr;
  petsc_check(TaoGetSolution(tao, &x));
  evaluate(x);
  result_.max_force = 0;
  for (const Real f : force_) result_.max_force = std::max(result_.max_force, std::abs(f));
  result_.converged = result_.max_force <= o_.force_tolerance;
  if (result_.converged) return TAO_CONVERGED_USER;
  result_.stopped = o_.stop && o_.stop();
  if (result_.stopped) return TAO_DIVERGED_USER;
  if (result_.evaluations >= o_.max_evaluations) return TAO_DIVERGED_MAXFCN;
  return result_.evaluations > evaluations_before_ + most_trials ? TAO_DIVERGED_TR_REDUCTION : TAO_CONTINUE_ITERATING;
}

void Problem::connect(Tao tao, ::Vec x, ::Mat matrix) {
  petsc_check(TaoSetSolution(tao, x));
  petsc_check(TaoSetObjective(
      tao,
      [](Tao, ::Vec at, PetscReal* energy, void* context) {
        return petsc_callback([&] {
          constexpr Real refused = 1e20;  // no method accepts a step to here
          Problem& p = of(context);
          const bool far = p.far(at);
          if (!far) p.evaluate(at);
          *energy = far ? refused : (p.energy_ - p.start_energy_) / p.unit_;
        });
      },
      this));
  petsc_check(TaoSetGradient(
      tao, nullptr,
      [](Tao, ::Vec at, ::Vec gradient, void* context) {
        return petsc_callback([&] {
          Problem& p = of(context);
          p.evaluate(at);
          write_values(gradient, [&](Real* g) {
            for (std::size_t k = 0; k < p.force_.size(); ++k) g[k] = -p.force_[k] / p.unit_;
          });
        });
      },
      this));
  petsc_check(TaoSetHessian(
      tao, matrix, matrix,
      [](Tao, ::Vec at, ::Mat hessian, ::Mat, void* context) {
        return petsc_callback([&] { of(context).expand(at, hessian); });
      },
      this));
  petsc_check(TaoSetConvergenceTest(
      tao,
      [](Tao of_test, void* context) {
        return petsc_callback([&] { petsc_check(TaoSetConvergedReason(of_test, of(context).test(of_test))); });
      },
      this));
  KSP ksp = nullptr;
  PC pc = nullptr;
  petsc_check(TaoGetKSP(tao, &ksp));
  petsc_check(KSPGetPC(ksp, &pc));
  petsc_check(PCShellSetContext(pc, this));  // no effect on a type that the options name
  petsc_check(PCShellSetName(pc, "factors of the Hessian"));
  petsc_check(PCShellSetApply(pc, [](PC shell, ::Vec b, ::Vec to) {
    return petsc_callback([&] {
      void* context = nullptr;
      petsc_check(PCShellGetContext(shell, &context));
      of(context).precondition(b, to);
    });
  }));
}

}  // namespace

void check_trust_region_options() {
  for (const char* name : own_settings)
    if (has_petsc_option(name))
      throw InputError("{} cannot be set here, because the minimisation sets it; leave the option out", name);
  const PetscTao tao = make_tao();
  KSP ksp = nullptr;
  const char* prefix = nullptr;
  petsc_check(TaoGetKSP(tao, &ksp));
  petsc_check(KSPGetOptionsPrefix(ksp, &prefix));
  read_views(PETSC_COMM_SELF, tao_views);
  read_views(PETSC_COMM_SELF, ksp_views, prefix);
}

DescentResult trust_region(std::span<Real> x, const EnergyAndForce& energy_and_force, ExactHessian& hessian,
                           const DescentOptions& options) {
  const auto n = static_cast<PetscInt>(x.size());
  PetscVec solution;
  PetscMat matrix;
  petsc_check(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, n, x.data(), solution.out()));
  petsc_check(MatCreate(PETSC_COMM_SELF, matrix.out()));
  petsc_check(MatSetSizes(matrix, n, n, n, n));
  petsc_check(MatSetType(matrix, MATSEQAIJ));
  petsc_check(MatSetOption(matrix, MAT_SYMMETRIC, PETSC_TRUE));
  petsc_check(MatSetOption(matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  Problem problem(x, energy_and_force, hessian, options);
  const PetscTao tao = make_tao();
  problem.connect(tao, solution, matrix);
  try {
    petsc_check(TaoSolve(tao));
  } catch (const NoFactors&) {
  }
  return problem.result();
}

}  // namespace pliant
