#include <cvode/cvode.h>
#include <petsc/private/tsimpl.h>
#include <pliant/base/petsc.h>
#include <pliant/ts/sundials/common.h>
#include <pliant/ts/sundials/cvode.h>
#include <sunlinsol/sunlinsol_spgmr.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

#include <algorithm>
#include <climits>
#include <cmath>

namespace pliant::sundials {
namespace cvode {
namespace {

constexpr const char* types[] = {"adams", "bdf"};
constexpr const char* nonlinear_solvers[] = {"fixedpoint", "newton", "snes"};
constexpr const char* linear_solvers[] = {"ksp", "spgmr"};
enum : PetscInt { adams, bdf };
enum : PetscInt { fixedpoint, newton, snes };
enum : PetscInt { ksp, spgmr };

struct Counts {
  long steps = 0, evaluations = 0, error_failures = 0, iterations = 0, failed_solves = 0, linear_iterations = 0;
};

void free_cvode(void* memory) { CVodeFree(&memory); }

struct Cvode : Link {
  // Options; PETSC_DECIDE where not set.
  PetscInt type = bdf, max_order = PETSC_DECIDE, nonlinear_solver = PETSC_DECIDE, linear_solver = PETSC_DECIDE;
  PetscInt anderson = 0;
  PetscBool stab_limit = PETSC_FALSE;

  PetscVec previous;         // solution at the start of the last step of the TS
  PetscReal reached = 0;     // CVODE's time, at or ahead of the TS's
  PetscReal left = 0;        // the TS's time after the last step
  PetscObjectState state{};  // state number of the solution at the last step
  PetscObjectId id{};
  bool started = false;
  Counts last, total;  // CVODE's own since the last restart; all
  std::unique_ptr<void, Free<free_cvode>> memory;
};

Cvode& data_of(TS ts) { return static_cast<Cvode&>(link_of(ts)); }

PetscInt nonlinear_of(const Cvode& d) {
  if (d.nonlinear_solver != PETSC_DECIDE) return d.nonlinear_solver;
  return d.type == adams ? fixedpoint : newton;
}

ImplicitSystem implicit_system(void* memory) {
  ImplicitSystem system{};
  N_Vector y, f, zn1;
  realtype rl1;
  void* user;
  (void)CVodeGetNonlinearSystemData(memory, &system.t, &system.predicted, &y, &f, &system.gamma, &rl1, &zn1, &user);
  return system;
}

int cvode_linear_system(realtype t, N_Vector y, N_Vector, SUNMatrix, booleantype jok, booleantype* jcur, realtype gamma,
                        void* link, N_Vector, N_Vector, N_Vector) {
  return linear_system(*static_cast<Link*>(link), t, y, jok, jcur, gamma);
}

PetscErrorCode reset(TS ts) {
  Cvode& d = data_of(ts);
  PetscFunctionBegin;
  d.memory.reset();
  d.close();
  d.previous = PetscVec();
  d.started = false;
  d.last = d.total = {};
  PetscFunctionReturn(0);
}

PetscErrorCode set_up_solvers(TS ts, Cvode& d) {
  void* memory = d.memory.get();
  PetscInt linear = d.linear_solver;
  PetscBool jacobian;
  PetscFunctionBegin;
  switch (nonlinear_of(d)) {
    case fixedpoint:
      d.nonlinear.reset(SUNNonlinSol_FixedPoint(d.y.get(), static_cast<int>(d.anderson), d.context.get()));
      break;
    case newton:
      d.nonlinear.reset(SUNNonlinSol_Newton(d.y.get(), d.context.get()));
      break;
    default:
      PetscCall(d.use_snes(implicit_system));
  }
  PetscCheck(d.nonlinear, PETSC_COMM_SELF, PETSC_ERR_LIB, "SUNDIALS could not make a nonlinear solver");
  PetscCall(d.check(CVodeSetNonlinearSolver(memory, d.nonlinear.get())));
  if (nonlinear_of(d) != newton) PetscFunctionReturn(0);

  if (linear == PETSC_DECIDE) {
    PetscCall(d.has_jacobian(&jacobian));
    linear = jacobian ? ksp : spgmr;
  }
  if (linear == ksp) {
    ts->usessnes = PETSC_TRUE;
    PetscCall(d.use_ksp());
  } else {
    d.linear.reset(SUNLinSol_SPGMR(d.y.get(), SUN_PREC_NONE, 0, d.context.get()));
    PetscCheck(d.linear, PETSC_COMM_SELF, PETSC_ERR_LIB, "SUNDIALS could not make a linear solver");
  }
  PetscCall(d.check(CVodeSetLinearSolver(memory, d.linear.get(), d.matrix.get())));
  if (linear == ksp) PetscCall(d.check(CVodeSetLinSysFn(memory, cvode_linear_system)));
  PetscFunctionReturn(0);
}

PetscErrorCode set_up(TS ts) {
  Cvode& d = data_of(ts);
  DM dm;
  TSRHSFunction rhs;
  TSIFunction implicit;
  ::SNES unused;

  PetscFunctionBegin;
  PetscCall(TSGetDM(ts, &dm));
  PetscCall(DMTSGetRHSFunction(dm, &rhs, nullptr));
  PetscCall(DMTSGetIFunction(dm, &implicit, nullptr));
  PetscCheck(rhs && !implicit, PetscObjectComm((PetscObject)ts), PETSC_ERR_ARG_WRONGSTATE,
             "TS type cvode solves y' = f(t, y): give f by TSSetRHSFunction(), and nothing by TSSetIFunction()");
  PetscCall(reset(ts));
  PetscCall(d.open(ts));
  PetscCall(TSGetSNES(ts, &unused));
  PetscCall(VecDuplicate(ts->vec_sol, d.previous.out()));
  PetscCall(VecCopy(ts->vec_sol, N_VGetVector_Petsc(d.y.get())));

  d.memory.reset(CVodeCreate(d.type == adams ? CV_ADAMS : CV_BDF, d.context.get()));
  void* memory = d.memory.get();
  PetscCheck(memory, PETSC_COMM_SELF, PETSC_ERR_MEM, "SUNDIALS could not make an integrator");
  PetscCall(d.check(CVodeSetErrHandlerFn(memory, keep_message, static_cast<Link*>(&d))));
  PetscCall(d.check(CVodeInit(memory, right_hand_side, ts->ptime, d.y.get())));
  PetscCall(d.check(CVodeSetUserData(memory, static_cast<Link*>(&d))));
  PetscCall(d.check(CVodeWFtolerances(memory, error_weights)));
  if (d.max_order != PETSC_DECIDE) PetscCall(d.check(CVodeSetMaxOrd(memory, static_cast<int>(d.max_order))));
  if (d.stab_limit) PetscCall(d.check(CVodeSetStabLimDet(memory, SUNTRUE)));
  PetscCall(d.check(CVodeSetMaxErrTestFails(memory, ts->max_reject < 0 ? INT_MAX : std::max(1, ts->max_reject))));
  PetscCall(set_up_solvers(ts, d));
  PetscFunctionReturn(0);
}

// Brings the counters of the TS and our own up to date.
PetscErrorCode count(TS ts) {
  Cvode& d = data_of(ts);
  void* memory = d.memory.get();
  Counts now;
  PetscFunctionBegin;
  PetscCall(d.check(CVodeGetNumSteps(memory, &now.steps)));
  PetscCall(d.check(CVodeGetNumRhsEvals(memory, &now.evaluations)));
  PetscCall(d.check(CVodeGetNumErrTestFails(memory, &now.error_failures)));
  PetscCall(d.check(CVodeGetNonlinSolvStats(memory, &now.iterations, &now.failed_solves)));
  if (d.linear && !d.matrix) PetscCall(d.check(CVodeGetNumLinIters(memory, &now.linear_iterations)));
  for (long Counts::*which : {&Counts::steps, &Counts::evaluations, &Counts::error_failures, &Counts::iterations,
                              &Counts::failed_solves, &Counts::linear_iterations})
    d.total.*which += now.*which - d.last.*which;
  ts->reject += static_cast<PetscInt>(now.error_failures - d.last.error_failures);
  ts->snes_its += static_cast<PetscInt>(now.iterations - d.last.iterations);
  ts->num_snes_failures += static_cast<PetscInt>(now.failed_solves - d.last.failed_solves);
  ts->ksp_its += static_cast<PetscInt>(now.linear_iterations - d.last.linear_iterations);
  d.last = now;
  PetscFunctionReturn(0);
}

PetscErrorCode dense_output(Cvode& d, PetscReal t, ::Vec y) {
  PetscFunctionBegin;
  PetscCall(d.check(CVodeGetDky(d.memory.get(), t, 0, d.y.get())));
  PetscCall(VecCopy(N_VGetVector_Petsc(d.y.get()), y));
  PetscFunctionReturn(0);
}

PetscErrorCode remember(TS ts, PetscReal t) {
  Cvode& d = data_of(ts);
  PetscFunctionBegin;
  d.left = t;
  PetscCall(PetscObjectStateGet((PetscObject)ts->vec_sol, &d.state));
  PetscCall(PetscObjectGetId((PetscObject)ts->vec_sol, &d.id));
  PetscFunctionReturn(0);
}

// Whether CVODE's history does not belong to the solution: after TSRestartStep, or if time or solution were set, on any
// rank.
PetscErrorCode must_restart(TS ts, bool& restart) {
  Cvode& d = data_of(ts);
  PetscObjectState state;
  PetscObjectId id;
  PetscBool here[2], any[2], equal;
  PetscFunctionBegin;
  PetscCall(PetscObjectStateGet((PetscObject)ts->vec_sol, &state));
  PetscCall(PetscObjectGetId((PetscObject)ts->vec_sol, &id));
  here[0] = ts->steprestart || !d.started || ts->ptime != d.left ? PETSC_TRUE : PETSC_FALSE;
  here[1] = state != d.state || id != d.id ? PETSC_TRUE : PETSC_FALSE;
  PetscCall(MPIU_Allreduce(here, any, 2, MPIU_BOOL, MPI_LOR, PetscObjectComm((PetscObject)ts)));
  restart = any[0];
  if (!restart && any[1]) {  // many callbacks write unchanged values
    PetscCall(d.check(CVodeGetDky(d.memory.get(), ts->ptime, 0, d.y.get())));
    PetscCall(VecEqual(ts->vec_sol, N_VGetVector_Petsc(d.y.get()), &equal));
    restart = !equal;
  }
  PetscFunctionReturn(0);
}

// First step of a restart, at order 1: CVODE's next step, of order q, was chosen for an error of the tolerance, so that
// for a solution of one scale of time the step of order 1 with that error is shorter by tol^(1/2 − 1/(q + 1)).
PetscErrorCode first_step(TS ts, PetscReal* h) {
  Cvode& d = data_of(ts);
  void* memory = d.memory.get();
  ::Vec scaled = N_VGetVector_Petsc(d.y.get());
  int order;
  PetscInt n;
  PetscReal next, norm;
  PetscFunctionBegin;
  *h = ts->time_step;
  if (!d.started || ts->steps == 0 || d.last.steps == 0) PetscFunctionReturn(0);
  PetscCall(d.check(CVodeGetCurrentStep(memory, &next)));
  PetscCall(d.check(CVodeGetLastOrder(memory, &order)));
  PetscCall(d.check(CVodeGetErrWeights(memory, d.y.get())));
  PetscCall(VecPointwiseMult(scaled, scaled, ts->vec_sol));
  PetscCall(VecNorm(scaled, NORM_2, &norm));
  PetscCall(VecGetSize(scaled, &n));
  norm = std::max(1., norm / std::sqrt(n));  // of the solution, in tolerances
  *h = std::min(*h, next * std::pow(norm, 1. / (order + 1) - 0.5));
  PetscFunctionReturn(0);
}

PetscErrorCode restart(TS ts) {
  Cvode& d = data_of(ts);
  PetscReal h;
  PetscFunctionBegin;
  PetscCall(first_step(ts, &h));
  PetscCall(VecCopy(ts->vec_sol, N_VGetVector_Petsc(d.y.get())));
  PetscCall(d.check(CVodeReInit(d.memory.get(), ts->ptime, d.y.get())));
  PetscCall(d.check(CVodeSetInitStep(d.memory.get(), h)));
  d.last = {};
  d.reached = ts->ptime;
  d.started = true;
  PetscFunctionReturn(0);
}

// One step of CVODE from ts->ptime, into d.y; not beyond t_max.
PetscErrorCode advance(TS ts, PetscReal t_max) {
  Cvode& d = data_of(ts);
  void* memory = d.memory.get();
  PetscReal shortest, longest, t = ts->ptime;
  PetscFunctionBegin;
  PetscCall(TSAdaptGetStepLimits(ts->adapt, &shortest, &longest));
  PetscCall(d.check(CVodeSetMinStep(memory, shortest)));
  PetscCall(d.check(CVodeSetMaxStep(memory, longest)));
  PetscCall(d.check(CVodeSetStopTime(memory, t_max)));
  // CVODE needs a time scale to estimate the first step.
  const PetscReal towards = ts->time_step > 0 ? ts->ptime + ts->time_step : std::min(t_max, ts->ptime + 1);
  const int flag = CVode(memory, towards, d.y.get(), &t, CV_ONE_STEP);
  PetscCall(count(ts));
  if (flag < 0 || d.error != 0) {
    d.started = false;
    PetscCall(d.failed(flag));
  } else if (t <= ts->ptime) {
    d.started = false;
    ts->reason = TS_DIVERGED_STEP_REJECTED;
    PetscCall(PetscInfo(ts, "The step at t = %g is lost in rounding\n", (double)t));
  }
  d.reached = t;
  PetscFunctionReturn(0);
}

PetscErrorCode step(TS ts) {
  Cvode& d = data_of(ts);
  const bool events = ts->event != nullptr && ts->event->status != TSEVENT_NONE;
  const bool match = ts->exact_final_time == TS_EXACTFINALTIME_MATCHSTEP && ts->max_time > ts->ptime;
  const PetscReal t_max = match ? ts->max_time : PETSC_MAX_REAL;
  bool again;

  PetscFunctionBegin;
  PetscCall(TSPreStage(ts, ts->ptime));
  PetscCall(must_restart(ts, again));
  if (again) PetscCall(restart(ts));
  const bool ahead = d.reached > ts->ptime;
  if (!ahead) PetscCall(advance(ts, t_max));
  if (ts->reason < 0) PetscFunctionReturn(0);

  PetscReal t = std::min(d.reached, t_max);
  if (ts->tspan != nullptr && ts->tspan->spanctr < ts->tspan->num_span_times)
    t = std::min(t, ts->tspan->span_times[ts->tspan->spanctr]);
  if (events) t = std::min(t, ts->ptime + ts->time_step);
  // No steps of the size of rounding.
  if (d.reached - t <= 10 * PETSC_MACHINE_EPSILON * PetscAbsReal(t)) t = d.reached;
  if (ahead || t < d.reached) PetscCall(d.check(CVodeGetDky(d.memory.get(), t, 0, d.y.get())));
  PetscCall(VecCopy(ts->vec_sol, d.previous));
  PetscCall(VecCopy(N_VGetVector_Petsc(d.y.get()), ts->vec_sol));
  PetscCall(TSPostStage(ts, t, 0, &ts->vec_sol));
  ts->ptime = t;
  // TSEvent sets steps during its search for a zero.
  if (!events) PetscCall(d.check(CVodeGetCurrentStep(d.memory.get(), &ts->time_step)));
  PetscCall(remember(ts, t));
  PetscFunctionReturn(0);
}

PetscErrorCode interpolate(TS ts, PetscReal t, ::Vec u) {
  PetscFunctionBegin;
  PetscCall(dense_output(data_of(ts), t, u));
  PetscFunctionReturn(0);
}

// CVODE stays at its later time.
PetscErrorCode roll_back(TS ts) {
  PetscFunctionBegin;
  PetscCall(VecCopy(data_of(ts).previous, ts->vec_sol));
  PetscCall(remember(ts, ts->ptime_prev));
  PetscFunctionReturn(0);
}

PetscErrorCode destroy(TS ts) {
  PetscFunctionBegin;
  PetscCall(reset(ts));
  delete &data_of(ts);
  ts->data = nullptr;
  PetscFunctionReturn(0);
}

PetscErrorCode set_from_options(TS ts, PetscOptionItems* PetscOptionsObject) {
  Cvode& d = data_of(ts);
  PetscFunctionBegin;
  PetscOptionsHeadBegin(PetscOptionsObject, "CVODE: variable-order Adams and BDF methods");
  PetscCall(PetscOptionsEList("-ts_cvode_type", "Multistep method: adams (not stiff) or bdf (stiff)", "", types, 2,
                              types[d.type], &d.type, nullptr));
  const PetscInt highest = d.type == adams ? 12 : 5;
  const PetscInt order = d.max_order == PETSC_DECIDE ? highest : std::min(d.max_order, highest);
  PetscCall(PetscOptionsRangeInt("-ts_cvode_max_order", "Highest order, up to 12 (adams) or 5 (bdf)", "", order,
                                 &d.max_order, nullptr, 1, highest));
  PetscCall(PetscOptionsEList(
      "-ts_cvode_nonlinear", "Nonlinear solver: fixedpoint (the default for adams), newton (for bdf), or PETSc's snes",
      "", nonlinear_solvers, 3, nonlinear_solvers[nonlinear_of(d)], &d.nonlinear_solver, nullptr));
  PetscCall(PetscOptionsBoundedInt("-ts_cvode_anderson", "Vectors of Anderson acceleration of fixedpoint", "",
                                   d.anderson, &d.anderson, nullptr, 0));
  PetscCall(PetscOptionsEList(
      "-ts_cvode_linear", "Linear solver of newton: PETSc's ksp (the default with a Jacobian), or matrix-free spgmr",
      "", linear_solvers, 2, linear_solvers[std::max(d.linear_solver, 0)], &d.linear_solver, nullptr));
  PetscCall(PetscOptionsBool("-ts_cvode_stab_limit", "Lower the order of bdf where it is not stable", "", d.stab_limit,
                             &d.stab_limit, nullptr));
  PetscOptionsHeadEnd();
  ts->usessnes = nonlinear_of(d) == snes ? PETSC_TRUE : PETSC_FALSE;
  if (d.memory) {  // set up for other options
    PetscCall(reset(ts));
    ts->setupcalled = PETSC_FALSE;
  }
  PetscFunctionReturn(0);
}

PetscErrorCode view(TS ts, PetscViewer viewer) {
  Cvode& d = data_of(ts);
  PetscBool ascii;
  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  PetscCall(PetscViewerASCIIPrintf(viewer, "CVODE %s, %s\n", types[d.type], nonlinear_solvers[nonlinear_of(d)]));
  if (nonlinear_of(d) == newton && d.memory)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  linear solver: %s\n", linear_solvers[d.matrix ? ksp : spgmr]));
  if (d.memory) {
    const Counts& c = d.total;
    int order = 0;
    PetscReal last = 0, next = 0;
    PetscCall(d.check(CVodeGetLastOrder(d.memory.get(), &order)));
    PetscCall(d.check(CVodeGetLastStep(d.memory.get(), &last)));
    PetscCall(d.check(CVodeGetCurrentStep(d.memory.get(), &next)));
    PetscCall(PetscViewerASCIIPrintf(viewer, "  steps=%ld, right-hand sides=%ld, error test failures=%ld\n", c.steps,
                                     c.evaluations, c.error_failures));
    PetscCall(PetscViewerASCIIPrintf(viewer,
                                     "  nonlinear iterations=%ld, failures=%ld; linear iterations=%" PetscInt_FMT
                                     ", Jacobians=%" PetscInt_FMT "\n",
                                     c.iterations, c.failed_solves, ts->ksp_its, ts->rhsjacs + ts->ijacs));
    PetscCall(PetscViewerASCIIPrintf(viewer, "  last order=%d, last step=%g, next step=%g\n", order, (double)last,
                                     (double)next));
  }
  PetscFunctionReturn(0);
}

}  // namespace
}  // namespace cvode

PetscErrorCode cvode_create(TS ts) {
  using namespace cvode;
  PetscFunctionBegin;
  ts->data = static_cast<Link*>(new Cvode);
  ts->ops->setup = set_up;
  ts->ops->step = step;
  ts->ops->interpolate = interpolate;
  ts->ops->rollback = roll_back;
  ts->ops->reset = reset;
  ts->ops->destroy = destroy;
  ts->ops->setfromoptions = set_from_options;
  ts->ops->view = view;
  ts->ops->snesfunction = snes_function;
  ts->ops->snesjacobian = snes_jacobian;
  ts->default_adapt_type = TSADAPTBASIC;  // used only for the limits of the step
  PetscFunctionReturn(0);
}

}  // namespace pliant::sundials
