#include <petsc/private/tsimpl.h>
#include <pliant/base/petsc.h>
#include <pliant/ts/sundials/common.h>

namespace pliant::sundials {

// State of the solvers over KSP and SNES.
struct Link::Implicit {
  PetscBool implicit_part = PETSC_FALSE;
  PetscVec zero;  // ydot: the right-hand side does not see it

  PetscReal ksp_atol = 0;  // the user's
  PetscReal shift = 0;     // σ of the present matrix; 0 before the first
  PetscInt linear_iterations = 0;

  ImplicitSystem (*query)(void* memory) = nullptr;
  SUNNonlinSolSysFn system = nullptr;
  SUNNonlinSolConvTestFn test = nullptr;
  void* test_data = nullptr;
  // State of the present solve:
  void* memory = nullptr;
  N_Vector weights = nullptr;
  realtype tolerance = 0;
  PetscInt iteration = 0;
  bool converged = false;
  PetscVec state;
  Owned<N_Vector, N_VDestroy> x, f;  // shells for the vectors of SNES
};

namespace {

// nvector_petsc wraps a Vec in a struct whose name its macros need not spell.
::Vec vec(N_Vector v) { return N_VGetVector_Petsc(v); }

// The function of nvector_petsc calls VecAXPBYPCZ with a factor 0 for the old values, which keeps an Inf or NaN of a
// failed step in all later steps.
void linear_sum(realtype a, N_Vector x, realtype b, N_Vector y, N_Vector z) {
  if (x != y && z != x && z != y && (a == 1 || b == 1)) {
    if (a == 1)
      (void)VecWAXPY(vec(z), b, vec(y), vec(x));
    else
      (void)VecWAXPY(vec(z), a, vec(x), vec(y));
  } else {
    N_VLinearSum_Petsc(a, x, b, y, z);
  }
}

PetscErrorCode compute(Link& link, Compute* function, PetscReal t, ::Vec y, ::Vec f, bool& valid) {
  PetscBool inside = PETSC_TRUE;
  PetscReal norm;
  PetscFunctionBegin;
  valid = false;
  PetscCall(TSFunctionDomainError(link.ts, t, y, &inside));
  if (!inside) PetscFunctionReturn(0);
  PetscCall(function(link.ts, t, y, f));
  PetscCall(VecNorm(f, NORM_1, &norm));  // the maximum norm may lose a NaN
  valid = !PetscIsInfOrNanReal(norm);
  PetscFunctionReturn(0);
}

PetscErrorCode weigh(TS ts, ::Vec y, ::Vec w) {
  PetscReal smallest;
  PetscFunctionBegin;
  PetscCall(VecCopy(y, w));
  PetscCall(VecAbs(w));
  if (ts->vrtol != nullptr)
    PetscCall(VecPointwiseMult(w, w, ts->vrtol));
  else
    PetscCall(VecScale(w, ts->rtol));
  if (ts->vatol != nullptr)
    PetscCall(VecAXPY(w, 1, ts->vatol));
  else
    PetscCall(VecShift(w, ts->atol));
  PetscCall(VecMin(w, nullptr, &smallest));
  PetscCheck(smallest > 0, PetscObjectComm((PetscObject)ts), PETSC_ERR_ARG_OUTOFRANGE,
             "The tolerance rtol |y| + atol is %g for an entry of the solution; it must be positive everywhere",
             static_cast<double>(smallest));
  PetscCall(VecReciprocal(w));
  PetscFunctionReturn(0);
}

// The KSP of the TS and its operators.
PetscErrorCode operators(TS ts, KSP* ksp, ::Mat* a, ::Mat* p) {
  SNES snes;
  PetscFunctionBegin;
  PetscCall(TSGetSNES(ts, &snes));
  PetscCall(SNESGetKSP(snes, ksp));
  PetscCall(SNESGetJacobian(snes, a, p, nullptr, nullptr));
  PetscFunctionReturn(0);
}

PetscErrorCode assemble(Link& link, PetscReal t, ::Vec y, bool reuse, PetscReal shift) {
  Link::Implicit& implicit = *link.implicit;
  TS ts = link.ts;
  KSP ksp;
  ::Mat a, p;
  PetscFunctionBegin;
  PetscCall(operators(ts, &ksp, &a, &p));
  if (reuse) {
    PetscCall(MatShift(a, shift - implicit.shift));
    if (p != a) PetscCall(MatShift(p, shift - implicit.shift));
    if (a == ts->Arhs) ts->rhsjacobian.shift = shift;  // TS also counts
  } else {
    PetscCall(TSComputeIJacobian(ts, t, y, implicit.zero, shift, a, p, implicit.implicit_part));
  }
  implicit.shift = shift;
  PetscFunctionReturn(0);
}

// Solves (I − γJ) x = b as (σI − J) x/σ = b.
PetscErrorCode solve(Link& link, ::Vec x, ::Vec b, PetscReal tolerance, bool& converged) {
  Link::Implicit& implicit = *link.implicit;
  KSP ksp;
  ::Mat a, p;
  KSPNormType norm;
  KSPConvergedReason reason;
  PetscFunctionBegin;
  PetscCall(operators(link.ts, &ksp, &a, &p));
  PetscCall(KSPSetOperators(ksp, a, p));
  // b is the residual of the integrator's system; a preconditioner makes it x/σ.
  PetscCall(KSPGetNormType(ksp, &norm));
  if (norm == KSP_NORM_PRECONDITIONED) tolerance /= implicit.shift;
  PetscCall(KSPSetTolerances(ksp, PETSC_DEFAULT, tolerance, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPSolve(ksp, b, x));
  PetscCall(VecScale(x, implicit.shift));
  PetscCall(KSPGetIterationNumber(ksp, &implicit.linear_iterations));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  link.ts->ksp_its += implicit.linear_iterations;
  converged = reason > 0;
  if (!converged) PetscCall(PetscInfo(link.ts, "The linear solve ended with %s\n", KSPConvergedReasons[reason]));
  PetscFunctionReturn(0);
}

Link& link_of(SUNLinearSolver solver) { return *static_cast<Link*>(solver->content); }
Link& link_of(SUNNonlinearSolver solver) { return *static_cast<Link*>(solver->content); }

int solve_linear(SUNLinearSolver solver, SUNMatrix, N_Vector x, N_Vector b, realtype tolerance) {
  Link& link = link_of(solver);
  bool converged = false;
  const PetscErrorCode code = solve(link, vec(x), vec(b), tolerance, converged);
  switch (outcome(link, code, converged)) {
    case 0:
      return SUNLS_SUCCESS;
    case 1:
      return SUNLS_CONV_FAIL;
    default:
      return SUNLS_PACKAGE_FAIL_UNREC;
  }
}

// A solve is as exact as the integrator requires: Newton stops by the integrator's test of the full (not damped)
// update. A small step of another method is not a measure of its error; these methods stop when the residual is below
// the tolerance.
PetscErrorCode test_convergence(SNES snes, PetscInt iteration, PetscReal, PetscReal, PetscReal norm,
                                SNESConvergedReason* reason, void* context) {
  Link& link = *static_cast<Link*>(context);
  Link::Implicit& implicit = *link.implicit;
  ::Vec correction, update, residual;
  PetscBool newton;
  int flag = SUN_NLS_CONTINUE;
  PetscFunctionBegin;
  *reason = SNES_CONVERGED_ITERATING;
  if (PetscIsInfOrNanReal(norm)) *reason = SNES_DIVERGED_FNORM_NAN;
  if (*reason || iteration == 0) PetscFunctionReturn(0);
  PetscCall(PetscObjectTypeCompare((PetscObject)snes, SNESNEWTONLS, &newton));
  if (newton) {
    PetscCall(SNESGetSolution(snes, &correction));
    PetscCall(SNESGetSolutionUpdate(snes, &update));
    N_VSetVector_Petsc(implicit.x.get(), correction);
    N_VSetVector_Petsc(implicit.f.get(), update);
    implicit.iteration = iteration - 1;
    flag = implicit.test(link.nonlinear.get(), implicit.x.get(), implicit.f.get(), implicit.tolerance, implicit.weights,
                         implicit.test_data);
  } else {
    PetscCall(SNESGetFunction(snes, &residual, nullptr, nullptr));
    N_VSetVector_Petsc(implicit.f.get(), residual);
    const realtype gamma = implicit.query(implicit.memory).gamma;
    if (gamma * N_VWrmsNorm(implicit.f.get(), implicit.weights) <= implicit.tolerance) flag = SUN_NLS_SUCCESS;
  }
  if (flag == SUN_NLS_SUCCESS) *reason = SNES_CONVERGED_SNORM_RELATIVE;
  if (flag == SUN_NLS_CONV_RECVR) *reason = SNES_DIVERGED_DTOL;
  PetscCheck(flag >= 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "SUNDIALS' test of convergence failed with flag %d", flag);
  PetscFunctionReturn(0);
}

PetscErrorCode solve_snes(Link& link, ::Vec correction, bool& converged) {
  Link::Implicit& implicit = *link.implicit;
  SNES snes;
  SNESConvergedReason reason;
  PetscInt linear;
  PetscFunctionBegin;
  PetscCall(TSGetSNES(link.ts, &snes));
  PetscCall(SNESSolve(snes, nullptr, correction));
  PetscCall(SNESGetConvergedReason(snes, &reason));
  PetscCall(SNESGetIterationNumber(snes, &implicit.iteration));
  PetscCall(SNESGetLinearSolveIterations(snes, &linear));
  link.ts->ksp_its += linear;
  converged = reason > 0;
  if (!converged) PetscCall(PetscInfo(link.ts, "The nonlinear solve ended with %s\n", SNESConvergedReasons[reason]));
  PetscFunctionReturn(0);
}

int solve_nonlinear(SUNNonlinearSolver solver, N_Vector, N_Vector correction, N_Vector weights, realtype tolerance,
                    booleantype, void* memory) {
  Link& link = link_of(solver);
  Link::Implicit& implicit = *link.implicit;
  implicit.memory = memory;
  implicit.weights = weights;
  implicit.tolerance = tolerance;
  implicit.converged = false;
  const PetscErrorCode code = solve_snes(link, vec(correction), implicit.converged);
  switch (outcome(link, code, implicit.converged)) {
    case 0:
      return SUN_NLS_SUCCESS;
    case 1:
      return SUN_NLS_CONV_RECVR;
    default:
      return SUN_NLS_EXT_FAIL;
  }
}

}  // namespace

Link::Link() = default;
Link::~Link() { close(); }

PetscErrorCode Link::open(TS owner) {
  SUNContext made = nullptr;
  MPI_Comm comm = PetscObjectComm((PetscObject)owner);
  PetscFunctionBegin;
  ts = owner;
  error = 0;
  PetscCheck(SUNContext_Create(&comm, &made) == 0, comm, PETSC_ERR_LIB, "SUNDIALS could not make a context");
  context.reset(made);
  const Owned<N_Vector, N_VDestroy> like(N_VMake_Petsc(ts->vec_sol, made));
  PetscCheck(like, comm, PETSC_ERR_LIB, "SUNDIALS could not wrap the solution");
  PetscCall(check(N_VEnableFusedOps_Petsc(like.get(), SUNTRUE)));
  like->ops->nvlinearsum = linear_sum;
  y.reset(N_VClone(like.get()));
  PetscCheck(y, comm, PETSC_ERR_MEM, "SUNDIALS could not clone the solution");
  PetscFunctionReturn(0);
}

void Link::close() {
  if (nonlinear && nonlinear->content == this)
    (void)SNESSetConvergenceTest(ts->snes, SNESConvergedDefault, nullptr, nullptr);
  if (linear && linear->content == this) {
    KSP ksp = nullptr;
    (void)SNESGetKSP(ts->snes, &ksp);
    (void)KSPSetTolerances(ksp, PETSC_DEFAULT, implicit->ksp_atol, PETSC_DEFAULT, PETSC_DEFAULT);
  }
  nonlinear.reset();
  linear.reset();
  matrix.reset();
  implicit.reset();
  y.reset();
  context.reset();
}

PetscErrorCode Link::has_jacobian(PetscBool* yes) const {
  DM dm;
  SNES snes;
  TSRHSJacobian rhs;
  TSIFunction function;
  TSIJacobian implicit_jacobian;
  ::Mat p;
  PetscFunctionBegin;
  PetscCall(TSGetDM(ts, &dm));
  PetscCall(DMTSGetRHSJacobian(dm, &rhs, nullptr));
  PetscCall(DMTSGetIFunction(dm, &function, nullptr));
  PetscCall(DMTSGetIJacobian(dm, &implicit_jacobian, nullptr));
  PetscCall(TSGetSNES(ts, &snes));
  PetscCall(SNESGetJacobian(snes, nullptr, &p, nullptr, nullptr));
  *yes = p && (implicit_jacobian || (rhs && !function)) ? PETSC_TRUE : PETSC_FALSE;
  PetscFunctionReturn(0);
}

PetscErrorCode Link::use_ksp(PetscBool implicit_part) {
  KSP ksp;
  DM dm;
  ::Mat a, p;
  TSIJacobian jacobian;
  PetscBool matrix_free, operator_free;
  PetscFunctionBegin;
  PetscCall(operators(ts, &ksp, &a, &p));
  PetscCall(TSGetDM(ts, &dm));
  PetscCall(DMTSGetIJacobian(dm, &jacobian, nullptr));
  PetscCall(SNESGetUseMatrixFree(ts->snes, &operator_free, &matrix_free));
  PetscCheck(
      !matrix_free && !operator_free && jacobian != TSComputeIJacobianDefaultColor, PetscObjectComm((PetscObject)ts),
      PETSC_ERR_ARG_INCOMP,
      "-snes_mf, -snes_mf_operator and -snes_fd_color work where SNES is the nonlinear solver; choose that, or a "
      "matrix-free linear solver");
  PetscCheck(a && p, PetscObjectComm((PetscObject)ts), PETSC_ERR_ARG_WRONGSTATE,
             "The linear solver KSP needs a matrix; give one to TSSetRHSJacobian() or TSSetIJacobian(), or choose a "
             "matrix-free solver");
  implicit = std::make_unique<Implicit>();
  implicit->implicit_part = implicit_part;
  PetscCall(KSPGetTolerances(ksp, nullptr, &implicit->ksp_atol, nullptr, nullptr));
  PetscCall(VecDuplicate(ts->vec_sol, implicit->zero.out()));
  PetscCall(VecZeroEntries(implicit->zero));

  matrix.reset(SUNMatNewEmpty(context.get()));
  linear.reset(SUNLinSolNewEmpty(context.get()));
  PetscCheck(matrix && linear, PETSC_COMM_SELF, PETSC_ERR_MEM, "SUNDIALS could not make a linear solver");
  matrix->ops->getid = [](SUNMatrix) { return SUNMATRIX_CUSTOM; };
  matrix->ops->destroy = SUNMatFreeEmpty;
  linear->content = this;
  linear->ops->gettype = [](SUNLinearSolver) { return SUNLINEARSOLVER_MATRIX_ITERATIVE; };
  linear->ops->getid = [](SUNLinearSolver) { return SUNLINEARSOLVER_CUSTOM; };
  linear->ops->solve = solve_linear;
  linear->ops->numiters = [](SUNLinearSolver s) { return static_cast<int>(link_of(s).implicit->linear_iterations); };
  linear->ops->free = [](SUNLinearSolver s) {
    s->content = nullptr;  // not its own
    SUNLinSolFreeEmpty(s);
    return 0;
  };
  PetscFunctionReturn(0);
}

PetscErrorCode Link::use_snes(ImplicitSystem (*query)(void* memory), PetscBool implicit_part) {
  SNES snes;
  PetscFunctionBegin;
  implicit = std::make_unique<Implicit>();
  implicit->implicit_part = implicit_part;
  implicit->query = query;
  PetscCall(VecDuplicate(ts->vec_sol, implicit->zero.out()));
  PetscCall(VecZeroEntries(implicit->zero));
  PetscCall(VecDuplicate(ts->vec_sol, implicit->state.out()));
  implicit->x.reset(N_VCloneEmpty(y.get()));
  implicit->f.reset(N_VCloneEmpty(y.get()));
  nonlinear.reset(SUNNonlinSolNewEmpty(context.get()));
  PetscCheck(nonlinear && implicit->x && implicit->f, PETSC_COMM_SELF, PETSC_ERR_MEM,
             "SUNDIALS could not make a nonlinear solver");
  PetscCall(TSGetSNES(ts, &snes));
  PetscCall(SNESSetConvergenceTest(snes, test_convergence, this, nullptr));

  nonlinear->content = this;
  SUNNonlinearSolver_Ops ops = nonlinear->ops;
  ops->gettype = [](SUNNonlinearSolver) { return SUNNONLINEARSOLVER_ROOTFIND; };
  ops->solve = solve_nonlinear;
  ops->setsysfn = [](SUNNonlinearSolver s, SUNNonlinSolSysFn system) {
    link_of(s).implicit->system = system;
    return SUN_NLS_SUCCESS;
  };
  ops->setctestfn = [](SUNNonlinearSolver s, SUNNonlinSolConvTestFn test, void* data) {
    link_of(s).implicit->test = test;
    link_of(s).implicit->test_data = data;
    return SUN_NLS_SUCCESS;
  };
  ops->getnumiters = [](SUNNonlinearSolver s, long* count) {
    *count = link_of(s).implicit->iteration;
    return SUN_NLS_SUCCESS;
  };
  ops->getcuriter = [](SUNNonlinearSolver s, int* count) {
    *count = static_cast<int>(link_of(s).implicit->iteration);
    return SUN_NLS_SUCCESS;
  };
  ops->getnumconvfails = [](SUNNonlinearSolver s, long* count) {
    *count = link_of(s).implicit->converged ? 0 : 1;
    return SUN_NLS_SUCCESS;
  };
  ops->free = [](SUNNonlinearSolver s) {
    s->content = nullptr;  // not its own
    SUNNonlinSolFreeEmpty(s);
    return SUN_NLS_SUCCESS;
  };
  PetscFunctionReturn(0);
}

PetscErrorCode Link::check(int flag) const {
  PetscFunctionBegin;
  PetscCheck(flag >= 0, PetscObjectComm((PetscObject)ts), PETSC_ERR_LIB, "SUNDIALS refused with flag %d: %s", flag,
             message.c_str());
  PetscFunctionReturn(0);
}

PetscErrorCode Link::failed(int flag) {
  PetscFunctionBegin;
  PetscCall(std::exchange(error, 0));
  switch (flag) {
    case -2:   // the requested accuracy is too high
    case -3:   // error test
    case -9:   // right-hand side not valid at the first call
    case -10:  // not valid again and again
    case -11:  // not valid where the step cannot be taken back
    case -27:  // step lost in rounding
      ts->reason = TS_DIVERGED_STEP_REJECTED;
      break;
    case -4:  // no convergence
    case -6:  // set-up of the linear solver
    case -7:  // the linear solver
      ts->reason = TS_DIVERGED_NONLINEAR_SOLVE;
      break;
    default:
      PetscCall(check(flag));
  }
  PetscCall(PetscInfo(ts, "Step %" PetscInt_FMT " at t = %g failed, %s: %s\n", ts->steps, (double)ts->ptime,
                      TSConvergedReasons[ts->reason], message.c_str()));
  PetscFunctionReturn(0);
}

Link& link_of(TS ts) { return *static_cast<Link*>(ts->data); }

int outcome(Link& link, PetscErrorCode code, bool valid) {
  if (code == 0) return valid ? 0 : 1;
  if (link.error == 0) link.error = code;
  return -1;
}

int evaluate(Link& link, Compute* function, realtype t, N_Vector y, N_Vector f) {
  if (link.error != 0) return -1;  // some solvers of SUNDIALS try again
  bool valid = false;
  const PetscErrorCode code = compute(link, function, t, vec(y), vec(f), valid);
  return outcome(link, code, valid);
}

int right_hand_side(realtype t, N_Vector y, N_Vector ydot, void* link) {
  return evaluate(*static_cast<Link*>(link), TSComputeRHSFunction, t, y, ydot);
}

int error_weights(N_Vector y, N_Vector weights, void* link) {
  Link& l = *static_cast<Link*>(link);
  return outcome(l, weigh(l.ts, vec(y), vec(weights)), true);
}

void keep_message(int code, const char*, const char* function, char* message, void* link) {
  Link& l = *static_cast<Link*>(link);
  if (code < 0) l.message = message;  // else a warning
  (void)PetscInfo(l.ts, "%s: %s\n", function, message);
}

int linear_system(Link& link, realtype t, N_Vector y, booleantype jok, booleantype* jcur, realtype gamma) {
  const bool reuse = jok && link.implicit->shift != 0;
  *jcur = reuse ? SUNFALSE : SUNTRUE;
  return outcome(link, assemble(link, t, vec(y), reuse, 1 / gamma), true);
}

PetscErrorCode snes_function(SNES snes, ::Vec correction, ::Vec residual, TS ts) {
  Link& link = link_of(ts);
  PetscFunctionBegin;
  PetscCheck(link.implicit && link.implicit->memory, PETSC_COMM_SELF, PETSC_ERR_ORDER,
             "SNES has a function within steps only");
  Link::Implicit& implicit = *link.implicit;
  N_VSetVector_Petsc(implicit.x.get(), correction);
  N_VSetVector_Petsc(implicit.f.get(), residual);
  const int flag = implicit.system(implicit.x.get(), implicit.f.get(), implicit.memory);
  if (flag < 0) PetscCall(link.error);
  PetscCheck(flag >= 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "SUNDIALS' residual failed with flag %d", flag);
  if (flag > 0) PetscCall(SNESSetFunctionDomainError(snes));
  // Scaled as the Jacobian σI − J.
  PetscCall(VecScale(residual, 1 / implicit.query(implicit.memory).gamma));
  PetscFunctionReturn(0);
}

PetscErrorCode snes_jacobian(SNES, ::Vec correction, ::Mat a, ::Mat p, TS ts) {
  Link::Implicit& implicit = *link_of(ts).implicit;  // SNES has already evaluated the function
  const ImplicitSystem system = implicit.query(implicit.memory);
  PetscFunctionBegin;
  PetscCall(VecWAXPY(implicit.state, 1, vec(system.predicted), correction));
  PetscCall(
      TSComputeIJacobian(ts, system.t, implicit.state, implicit.zero, 1 / system.gamma, a, p, implicit.implicit_part));
  PetscFunctionReturn(0);
}

}  // namespace pliant::sundials
