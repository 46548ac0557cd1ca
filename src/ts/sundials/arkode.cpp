// A TS step is a step of ARKODE, or a part of one where TS has to stop inside it.
#include <arkode/arkode_arkstep.h>
#include <arkode/arkode_erkstep.h>
#include <arkode/arkode_mristep.h>
#include <petsc/private/tsimpl.h>
#include <pliant/base/petsc.h>
#include <pliant/ts/sundials/arkode.h>
#include <pliant/ts/sundials/common.h>
#include <sunlinsol/sunlinsol_spgmr.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

#include <algorithm>
#include <cctype>
#include <climits>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pliant::sundials {
namespace arkode {
namespace {

// ---- Methods and their tables ----

struct Table {
  const char* name;  // ARKODE's, without its prefix
  int id;            // ARKODE's; of the implicit table where there are two
  int order;         // that -ts_arkode_order selects it by; 0 for tables that have to be named
  int explicit_id = ARKODE_ERK_NONE;
};

#define PLIANT_TABLE(name, order) \
  { #name, ARKODE_##name, order }
constexpr Table erk_tables[] = {
    PLIANT_TABLE(HEUN_EULER_2_1_2, 2),      PLIANT_TABLE(BOGACKI_SHAMPINE_4_2_3, 3),
    PLIANT_TABLE(ARK324L2SA_ERK_4_2_3, 0),  PLIANT_TABLE(KNOTH_WOLKE_3_3, 0),
    PLIANT_TABLE(ZONNEVELD_5_3_4, 4),       PLIANT_TABLE(ARK436L2SA_ERK_6_3_4, 0),
    PLIANT_TABLE(ARK437L2SA_ERK_7_3_4, 0),  PLIANT_TABLE(SAYFY_ABURUB_6_3_4, 0),
    PLIANT_TABLE(DORMAND_PRINCE_7_4_5, 5),  PLIANT_TABLE(CASH_KARP_6_4_5, 0),
    PLIANT_TABLE(FEHLBERG_6_4_5, 0),        PLIANT_TABLE(ARK548L2SA_ERK_8_4_5, 0),
    PLIANT_TABLE(ARK548L2SAb_ERK_8_4_5, 0), PLIANT_TABLE(VERNER_8_5_6, 6),
    PLIANT_TABLE(FEHLBERG_13_7_8, 8),
};
constexpr Table dirk_tables[] = {
    PLIANT_TABLE(SDIRK_2_1_2, 2),
    PLIANT_TABLE(BILLINGTON_3_3_2, 0),
    PLIANT_TABLE(TRBDF2_3_3_2, 0),
    PLIANT_TABLE(ESDIRK324L2SA_4_2_3, 3),
    PLIANT_TABLE(ESDIRK325L2SA_5_2_3, 0),
    PLIANT_TABLE(ESDIRK32I5L2SA_5_2_3, 0),
    PLIANT_TABLE(KVAERNO_4_2_3, 0),
    PLIANT_TABLE(ARK324L2SA_DIRK_4_2_3, 0),
    PLIANT_TABLE(CASH_5_2_4, 0),
    PLIANT_TABLE(CASH_5_3_4, 0),
    PLIANT_TABLE(SDIRK_5_3_4, 0),
    PLIANT_TABLE(KVAERNO_5_3_4, 0),
    PLIANT_TABLE(ARK436L2SA_DIRK_6_3_4, 0),
    PLIANT_TABLE(ARK437L2SA_DIRK_7_3_4, 0),
    PLIANT_TABLE(ESDIRK436L2SA_6_3_4, 4),
    PLIANT_TABLE(ESDIRK43I6L2SA_6_3_4, 0),
    PLIANT_TABLE(QESDIRK436L2SA_6_3_4, 0),
    PLIANT_TABLE(ESDIRK437L2SA_7_3_4, 0),
    PLIANT_TABLE(KVAERNO_7_4_5, 0),
    PLIANT_TABLE(ARK548L2SA_DIRK_8_4_5, 0),
    PLIANT_TABLE(ARK548L2SAb_DIRK_8_4_5, 0),
    PLIANT_TABLE(ESDIRK547L2SA_7_4_5, 5),
    PLIANT_TABLE(ESDIRK547L2SA2_7_4_5, 0),
};
constexpr Table imex_tables[] = {
    {"ARK324L2SA_4_2_3", ARKODE_ARK324L2SA_DIRK_4_2_3, 3, ARKODE_ARK324L2SA_ERK_4_2_3},
    {"ARK436L2SA_6_3_4", ARKODE_ARK436L2SA_DIRK_6_3_4, 4, ARKODE_ARK436L2SA_ERK_6_3_4},
    {"ARK437L2SA_7_3_4", ARKODE_ARK437L2SA_DIRK_7_3_4, 0, ARKODE_ARK437L2SA_ERK_7_3_4},
    {"ARK548L2SA_8_4_5", ARKODE_ARK548L2SA_DIRK_8_4_5, 5, ARKODE_ARK548L2SA_ERK_8_4_5},
    {"ARK548L2SAb_8_4_5", ARKODE_ARK548L2SAb_DIRK_8_4_5, 0, ARKODE_ARK548L2SAb_ERK_8_4_5},
};
constexpr Table mri_tables[] = {PLIANT_TABLE(MIS_KW3, 3), PLIANT_TABLE(MRI_GARK_ERK33a, 0),
                                PLIANT_TABLE(MRI_GARK_ERK45a, 4)};
#undef PLIANT_TABLE

enum Method { erk, dirk, imex, mri };
constexpr const char* method_names[] = {"erk", "dirk", "imex", "mri"};

std::span<const Table> tables_of(Method method) {
  constexpr std::span<const Table> tables[] = {erk_tables, dirk_tables, imex_tables, mri_tables};
  return tables[method];
}

// Small letters, without ARKODE's prefix.
std::string plain(std::string_view name) {
  std::string text;
  for (const char c : name) text += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text.starts_with("arkode_") ? text.substr(7) : text;
}

// The table of that name, or of the only name that begins with it and "_"; else the one for that order.
PetscErrorCode find_table(MPI_Comm comm, Method method, const std::string& name, PetscInt order, const Table** table) {
  std::string known, orders;
  int candidates = 0;
  PetscFunctionBegin;
  for (const Table& t : tables_of(method)) {
    const std::string full = plain(t.name);
    known += (known.empty() ? "" : ", ") + full;
    if (t.order != 0) orders += (orders.empty() ? "" : ", ") + std::to_string(t.order);
    if (name.empty() ? t.order == order : full == plain(name) || full.starts_with(plain(name) + "_")) {
      *table = &t;
      ++candidates;
    }
  }
  if (name.empty())
    PetscCheck(candidates == 1, comm, PETSC_ERR_ARG_OUTOFRANGE,
               "-ts_arkode_order %" PetscInt_FMT ": the type %s has a default table for the orders %s", order,
               method_names[method], orders.c_str());
  else
    PetscCheck(candidates == 1, comm, PETSC_ERR_ARG_OUTOFRANGE, "\"%s\" names %s table of the type %s; there are %s",
               name.c_str(), candidates == 0 ? "no" : "more than one", method_names[method], known.c_str());
  PetscFunctionReturn(0);
}

// ---- The three steppers of ARKODE: the same functions under different names ----

struct Stepper {
  int (*evolve)(void*, realtype, N_Vector, realtype*, int);
  int (*dense_output)(void*, realtype, int, N_Vector);
  int (*reset)(void*, realtype, N_Vector);
  int (*stop_time)(void*, realtype);
  int (*fixed_step)(void*, realtype);
  int (*weights)(void*, ARKEwtFn);
  int (*user_data)(void*, void*);
  int (*error_handler)(void*, ARKErrHandlerFn, void*);
  int (*steps)(void*, long*);
  int (*last_step)(void*, realtype*);
  void (*free)(void**);
  // MRIStep takes fixed steps only and lacks these functions.
  int (*initial_step)(void*, realtype) = nullptr;
  int (*min_step)(void*, realtype) = nullptr;
  int (*max_step)(void*, realtype) = nullptr;
  int (*max_error_test_fails)(void*, int) = nullptr;
  int (*safety)(void*, realtype) = nullptr;
  int (*adaptivity)(void*, int, int, int, realtype*) = nullptr;
  int (*next_step)(void*, realtype*) = nullptr;
  int (*attempts)(void*, long*) = nullptr;
  int (*error_test_fails)(void*, long*) = nullptr;
};

#define PLIANT_COMMON(P)                                                                            \
  P##Evolve, P##GetDky, P##Reset, P##SetStopTime, P##SetFixedStep, P##WFtolerances, P##SetUserData, \
      P##SetErrHandlerFn, P##GetNumSteps, P##GetLastStep, P##Free
#define PLIANT_ADAPTIVE(P)                                                                                         \
  P##SetInitStep, P##SetMinStep, P##SetMaxStep, P##SetMaxErrTestFails, P##SetSafetyFactor, P##SetAdaptivityMethod, \
      P##GetCurrentStep, P##GetNumStepAttempts, P##GetNumErrTestFails
constexpr Stepper erk_step = {PLIANT_COMMON(ERKStep), PLIANT_ADAPTIVE(ERKStep)};
constexpr Stepper ark_step = {PLIANT_COMMON(ARKStep), PLIANT_ADAPTIVE(ARKStep)};
constexpr Stepper mri_step = {PLIANT_COMMON(MRIStep)};
#undef PLIANT_COMMON
#undef PLIANT_ADAPTIVE

// ---- The TS type ----

// In the order of ARKODE's constants.
constexpr const char* adaptivity_names[] = {"pid", "pi", "i", "exp_gus", "imp_gus", "imex_gus"};
enum Nonlinear { newton, fixedpoint };
constexpr const char* nonlinear_names[] = {"newton", "fixedpoint"};
enum Linear { ksp, spgmr };
constexpr const char* linear_names[] = {"ksp", "spgmr"};

struct Arkode : Link {
  // Options.
  PetscInt method = erk;
  std::string table_name, fast_table_name;
  PetscInt order = 0;        // 0: by the name, or the default of the method
  PetscInt adaptivity = -1;  // −1: ARKODE's default
  PetscReal safety = 0;      // 0: ARKODE's default
  PetscBool fixed = PETSC_FALSE;
  PetscInt nonlinear_solver = newton, anderson = 0;
  PetscInt linear_solver = PETSC_DECIDE;  // ksp where there is a Jacobian
  PetscInt max_iterations = 0;            // limit of iterations of a nonlinear solve; 0: ARKODE's default

  // From TSSetUp to TSReset.
  const Stepper* stepper = nullptr;
  const Table *table = nullptr, *fast_table = nullptr;
  void *memory = nullptr, *fast_memory = nullptr;  // memory of ARKODE and of the inner integrator of a multirate method
  MRIStepInnerStepper fast = nullptr;
  PetscVec y_old;                     // start of the last TS step
  PetscVec zero;                      // ẏ of an implicit function
  Owned<N_Vector, N_VDestroy> shell;  // for other vectors

  PetscReal t_end = 0;  // where ARKODE is; TS may be behind it, inside the last step
  PetscReal h = 0;      // ARKODE's next step; the last one where steps are fixed
  long attempts = 0, iterations = 0;

  // Time, id and state number of the TS solution at the last step: if one has changed since, ARKODE restarts.
  PetscReal t_seen = std::numeric_limits<PetscReal>::quiet_NaN();
  PetscObjectId id_seen = 0;
  PetscObjectState state_seen = 0;

  bool implicit_steps() const { return method == dirk || method == imex; }
  bool fixed_steps() const { return fixed || method == mri; }
};

Arkode& data_of(TS ts) { return static_cast<Arkode&>(link_of(ts)); }

// The table that the options select.
PetscErrorCode find_table(TS ts, const Table** table) {
  const Arkode& d = data_of(ts);
  constexpr PetscInt default_orders[] = {5, 4, 4, 3};
  PetscFunctionBegin;
  PetscCall(find_table(PetscObjectComm((PetscObject)ts), static_cast<Method>(d.method), d.table_name,
                       d.order > 0 ? d.order : default_orders[d.method], table));
  PetscFunctionReturn(0);
}

// −F(t, y, 0), of F(t, y, ẏ) = ẏ − f(t, y); with a dirk method F holds the right-hand side, too, if there is one.
PetscErrorCode compute_implicit_part(TS ts, PetscReal t, ::Vec y, ::Vec f) {
  Arkode& d = data_of(ts);
  PetscFunctionBegin;
  PetscCall(TSComputeIFunction(ts, t, y, d.zero, f, d.method == dirk ? PETSC_FALSE : PETSC_TRUE));
  PetscCall(VecScale(f, -1));
  PetscFunctionReturn(0);
}

int implicit_part(realtype t, N_Vector y, N_Vector ydot, void* link) {
  return evaluate(*static_cast<Link*>(link), compute_implicit_part, t, y, ydot);
}

int arkode_linear_system(realtype t, N_Vector y, N_Vector, SUNMatrix, SUNMatrix, booleantype jok, booleantype* jcur,
                         realtype gamma, void* link, N_Vector, N_Vector, N_Vector) {
  return linear_system(*static_cast<Link*>(link), t, y, jok, jcur, gamma);
}

int nothing_after_step(realtype, N_Vector, void*) { return 0; }

// ARKODE gets ẏ = f(t, y) only: F(t, y, f) must vanish for f = −F(t, y, 0).
PetscErrorCode check_mass(TS ts) {
  Arkode& d = data_of(ts);
  TSIFunction function;
  PetscReal size, defect;
  PetscVec f, g;
  PetscFunctionBegin;
  PetscCall(TSGetIFunction(ts, nullptr, &function, nullptr));
  if (function == nullptr) PetscFunctionReturn(0);
  PetscCall(VecDuplicate(ts->vec_sol, f.out()));
  PetscCall(VecDuplicate(ts->vec_sol, g.out()));
  PetscCall(compute_implicit_part(ts, ts->ptime, ts->vec_sol, f));
  PetscCall(TSComputeIFunction(ts, ts->ptime, ts->vec_sol, f, g, d.method == dirk ? PETSC_FALSE : PETSC_TRUE));
  PetscCall(VecNorm(f, NORM_2, &size));
  PetscCall(VecNorm(g, NORM_2, &defect));
  PetscCheck(!(defect > 1e-3 * size), PetscObjectComm((PetscObject)ts), PETSC_ERR_ARG_INCOMP,
             "ARKODE needs F(t, y, ydot) = ydot - f(t, y), but F(t, y, -F(t, y, 0)) is %g where F(t, y, 0) is %g: "
             "multiply the equation by the inverse of its mass matrix",
             static_cast<double>(defect), static_cast<double>(size));
  PetscFunctionReturn(0);
}

PetscErrorCode remember_solution(TS ts, PetscReal t) {
  Arkode& d = data_of(ts);
  PetscFunctionBegin;
  d.t_seen = t;
  PetscCall(PetscObjectGetId((PetscObject)ts->vec_sol, &d.id_seen));
  PetscCall(PetscObjectStateGet((PetscObject)ts->vec_sol, &d.state_seen));
  PetscFunctionReturn(0);
}

// Whether ARKODE's solution differs from the solution of TS: after TSRestartStep, or if time or solution were set.
PetscErrorCode must_restart(TS ts, PetscBool* restart) {
  Arkode& d = data_of(ts);
  PetscObjectId id;
  PetscObjectState state;
  PetscFunctionBegin;
  PetscCall(PetscObjectGetId((PetscObject)ts->vec_sol, &id));
  PetscCall(PetscObjectStateGet((PetscObject)ts->vec_sol, &state));
  const PetscBool here =
      ts->steprestart || ts->ptime != d.t_seen || id != d.id_seen || state != d.state_seen ? PETSC_TRUE : PETSC_FALSE;
  PetscCall(MPIU_Allreduce(&here, restart, 1, MPIU_BOOL, MPI_LOR, PetscObjectComm((PetscObject)ts)));
  PetscFunctionReturn(0);
}

// ARKODE restarts at the present solution with the step h. Its counters continue.
PetscErrorCode restart(TS ts, PetscReal h) {
  Arkode& d = data_of(ts);
  PetscFunctionBegin;
  PetscCall(VecCopy(ts->vec_sol, N_VGetVector_Petsc(d.y.get())));
  PetscCall(d.check(d.stepper->reset(d.memory, ts->ptime, d.y.get())));
  if (!d.fixed_steps()) {
    PetscCall(d.check(d.stepper->initial_step(d.memory, h)));
    PetscCall(d.check(d.stepper->max_step(d.memory, 0)));  // none, for any minimum to be possible
    PetscCall(d.check(d.stepper->min_step(d.memory, ts->adapt->dt_min)));
    PetscCall(d.check(d.stepper->max_step(d.memory, ts->adapt->dt_max)));
    const PetscInt most = ts->max_reject < 0 ? INT_MAX : std::max(ts->max_reject, PetscInt{1});
    PetscCall(d.check(d.stepper->max_error_test_fails(d.memory, static_cast<int>(most))));
  }
  d.t_end = ts->ptime;
  PetscFunctionReturn(0);
}

PetscErrorCode count(TS ts) {
  Arkode& d = data_of(ts);
  long attempts, steps, iterations;
  PetscFunctionBegin;
  if (d.stepper->attempts != nullptr) {
    PetscCall(d.check(d.stepper->attempts(d.memory, &attempts)));
    PetscCall(d.check(d.stepper->steps(d.memory, &steps)));
    ts->reject += static_cast<PetscInt>(attempts - steps - d.attempts);
    d.attempts = attempts - steps;
  }
  if (d.implicit_steps()) {
    PetscCall(d.check(ARKStepGetNumNonlinSolvIters(d.memory, &iterations)));
    ts->snes_its += static_cast<PetscInt>(iterations - d.iterations);
    d.iterations = iterations;
  }
  PetscFunctionReturn(0);
}

// One step of ARKODE from the solution of TS.
PetscErrorCode evolve(TS ts) {
  Arkode& d = data_of(ts);
  PetscFunctionBegin;
  for (PetscInt rejected = 0;; ++rejected) {
    PetscReal t = ts->ptime, h = ts->time_step;
    if (d.fixed_steps())
      PetscCall(d.check(d.stepper->fixed_step(d.memory, h)));
    else
      PetscCall(d.check(d.stepper->max_step(d.memory, ts->adapt->dt_max)));  // may change from step to step
    if (ts->exact_final_time == TS_EXACTFINALTIME_MATCHSTEP) {
      const bool span = ts->tspan && ts->tspan->spanctr < ts->tspan->num_span_times;
      PetscCall(
          d.check(d.stepper->stop_time(d.memory, span ? ts->tspan->span_times[ts->tspan->spanctr] : ts->max_time)));
    }
    // ARKODE needs a time scale to estimate the first step.
    const PetscReal towards = h > 0 ? t + h : std::min(ts->max_time, t + 1);
    int flag = d.stepper->evolve(d.memory, towards, d.y.get(), &t, ARK_ONE_STEP);
    PetscCall(count(ts));
    if (flag >= 0 && t == ts->ptime) flag = ARK_TOO_CLOSE;  // the step is lost in rounding
    if (flag >= 0 && d.error == 0) {                        // some solvers of SUNDIALS try again after an error
      if (!d.fixed_steps()) PetscCall(d.check(d.stepper->next_step(d.memory, &h)));
      d.t_end = t;
      d.h = h;
      PetscFunctionReturn(0);
    }
    // Where an explicit stage meets values that are not valid ARKODE gives up; a smaller step may do.
    const bool invalid = d.error == 0 && (flag == ARK_RHSFUNC_FAIL || flag == ARK_UNREC_RHSFUNC_ERR);
    if (!invalid || d.fixed_steps() || rejected == ts->max_reject) {
      if (invalid) flag = ARK_REPTD_RHSFUNC_ERR;
      if (flag == ARK_INNERSTEP_FAIL) flag = ARK_ERR_FAILURE;
      d.t_seen = std::numeric_limits<PetscReal>::quiet_NaN();
      PetscCall(d.failed(flag));
      PetscFunctionReturn(0);
    }
    PetscCall(d.check(d.stepper->next_step(d.memory, &h)));  // the step that failed
    PetscCall(restart(ts, h / 4));
  }
}

PetscErrorCode step(TS ts) {
  Arkode& d = data_of(ts);
  PetscBool fresh;
  PetscFunctionBegin;
  PetscCall(TSPreStage(ts, ts->ptime));
  PetscCall(must_restart(ts, &fresh));
  if (fresh) {
    if (std::isnan(d.t_seen)) PetscCall(check_mass(ts));
    // After an event TS proposes the rest of the step before: no measure for the next one.
    const bool remainder =
        ts->event && ts->event->status == TSEVENT_RESET_NEXTSTEP && ts->event->timestep_postevent == 0;
    PetscCall(restart(ts, remainder ? std::max(ts->time_step, d.h) : ts->time_step));
  }
  PetscCall(VecCopy(ts->vec_sol, d.y_old));
  if (ts->ptime == d.t_end) {
    PetscCall(evolve(ts));
    if (ts->reason < 0) PetscFunctionReturn(0);
  }

  const PetscReal t = ts->time_step > 0 ? ts->ptime + ts->time_step : d.t_end;
  if (d.t_end - t <= 1e-10 * (d.t_end - ts->ptime)) {
    PetscCall(VecCopy(N_VGetVector_Petsc(d.y.get()), ts->vec_sol));
    ts->ptime = d.t_end;
    ts->time_step = d.h;
  } else {
    N_VSetVector_Petsc(d.shell.get(), ts->vec_sol);
    const int flag = d.stepper->dense_output(d.memory, t, 0, d.shell.get());
    if (flag < 0) {
      PetscCall(VecCopy(d.y_old, ts->vec_sol));
      PetscCall(d.failed(flag == ARK_RHSFUNC_FAIL && d.error == 0 ? ARK_REPTD_RHSFUNC_ERR : flag));
      PetscFunctionReturn(0);
    }
    ts->ptime = t;
    ts->time_step = d.t_end - t;
  }
  PetscCall(TSPostStage(ts, ts->ptime, 0, &ts->vec_sol));
  PetscCall(remember_solution(ts, ts->ptime));
  PetscFunctionReturn(0);
}

PetscErrorCode interpolate(TS ts, PetscReal t, ::Vec u) {
  Arkode& d = data_of(ts);
  PetscFunctionBegin;
  N_VSetVector_Petsc(d.shell.get(), u);
  const int flag = d.stepper->dense_output(d.memory, t, 0, d.shell.get());
  if (flag < 0) PetscCall(std::exchange(d.error, 0));
  PetscCall(d.check(flag));
  PetscFunctionReturn(0);
}

PetscErrorCode roll_back(TS ts) {
  PetscFunctionBegin;
  PetscCall(VecCopy(data_of(ts).y_old, ts->vec_sol));
  PetscCall(remember_solution(ts, ts->ptime_prev));
  PetscFunctionReturn(0);
}

PetscErrorCode reset(TS ts) {
  Arkode& d = data_of(ts);
  PetscFunctionBegin;
  if (d.memory != nullptr) d.stepper->free(&d.memory);
  if (d.fast != nullptr) MRIStepInnerStepper_Free(&d.fast);
  if (d.fast_memory != nullptr) ARKStepFree(&d.fast_memory);
  d.shell.reset();
  d.close();
  d.y_old = {};
  d.zero = {};
  d.attempts = d.iterations = 0;
  d.t_seen = std::numeric_limits<PetscReal>::quiet_NaN();
  PetscFunctionReturn(0);
}

PetscErrorCode check_functions(TS ts) {
  Arkode& d = data_of(ts);
  MPI_Comm comm = PetscObjectComm((PetscObject)ts);
  TSRHSFunction rhs;
  TSIFunction function;
  DM dm;
  PetscFunctionBegin;
  PetscCall(TSGetDM(ts, &dm));
  PetscCall(DMTSGetRHSFunction(dm, &rhs, nullptr));
  PetscCall(DMTSGetIFunction(dm, &function, nullptr));
  switch (d.method) {
    case erk:
      PetscCall(TSCheckImplicitTerm(ts));
      PetscCheck(rhs, comm, PETSC_ERR_ARG_WRONGSTATE, "-ts_arkode_type erk needs TSSetRHSFunction()");
      break;
    case dirk:
      PetscCheck(rhs || function, comm, PETSC_ERR_ARG_WRONGSTATE,
                 "-ts_arkode_type dirk needs TSSetRHSFunction() or TSSetIFunction()");
      break;
    default:
      PetscCheck(rhs && function, comm, PETSC_ERR_ARG_WRONGSTATE,
                 "-ts_arkode_type %s needs both parts of the right-hand side: TSSetRHSFunction() and TSSetIFunction()",
                 method_names[d.method]);
  }
  PetscFunctionReturn(0);
}

PetscErrorCode set_up_linear(TS ts) {
  Arkode& d = data_of(ts);
  PetscBool jacobian = PETSC_FALSE;
  PetscFunctionBegin;
  if (d.linear_solver == PETSC_DECIDE) PetscCall(d.has_jacobian(&jacobian));
  if (d.linear_solver == ksp || jacobian) {
    ts->usessnes = PETSC_TRUE;
    PetscCall(d.use_ksp(d.method == imex ? PETSC_TRUE : PETSC_FALSE));
  } else {
    d.linear.reset(SUNLinSol_SPGMR(d.y.get(), SUN_PREC_NONE, 0, d.context.get()));
  }
  PetscCheck(d.linear, PETSC_COMM_SELF, PETSC_ERR_MEM, "SUNDIALS could not make a linear solver");
  PetscCall(d.check(ARKStepSetLinearSolver(d.memory, d.linear.get(), d.matrix.get())));
  if (d.matrix) {
    PetscCall(d.check(ARKStepSetLinSysFn(d.memory, arkode_linear_system)));
    // A matrix for every γ: after solves that needed one iteration ARKODE trusts one with the matrix of another γ, too.
    PetscCall(d.check(ARKStepSetDeltaGammaMax(d.memory, 1e-10)));
  }
  PetscFunctionReturn(0);
}

PetscErrorCode set_up_solvers(TS ts) {
  Arkode& d = data_of(ts);
  PetscFunctionBegin;
  d.nonlinear.reset(d.nonlinear_solver == fixedpoint
                        ? SUNNonlinSol_FixedPoint(d.y.get(), static_cast<int>(d.anderson), d.context.get())
                        : SUNNonlinSol_Newton(d.y.get(), d.context.get()));
  PetscCheck(d.nonlinear, PETSC_COMM_SELF, PETSC_ERR_MEM, "SUNDIALS could not make a nonlinear solver");
  PetscCall(d.check(ARKStepSetNonlinearSolver(d.memory, d.nonlinear.get())));
  PetscCall(d.check(ARKStepSetMaxNonlinIters(d.memory, static_cast<int>(d.max_iterations))));
  if (d.nonlinear_solver == newton) PetscCall(set_up_linear(ts));
  // f at a stage from the equation that it solves: saves an evaluation, and a stiff f does not blow up the error of the
  // solve.
  PetscCall(d.check(ARKStepSetDeduceImplicitRhs(d.memory, SUNTRUE)));
  PetscFunctionReturn(0);
}

// Settings of every integrator.
PetscErrorCode set_up_memory(TS ts, const Stepper& stepper, void* memory) {
  Link* link = &link_of(ts);
  PetscFunctionBegin;
  PetscCheck(memory != nullptr, PetscObjectComm((PetscObject)ts), PETSC_ERR_LIB, "ARKODE could not be set up");
  PetscCall(link->check(stepper.error_handler(memory, keep_message, link)));
  PetscCall(link->check(stepper.user_data(memory, link)));
  PetscCall(link->check(stepper.weights(memory, error_weights)));
  PetscFunctionReturn(0);
}

PetscErrorCode set_up_erk(TS ts) {
  Arkode& d = data_of(ts);
  PetscFunctionBegin;
  d.memory = ERKStepCreate(right_hand_side, ts->ptime, d.y.get(), d.context.get());
  PetscCall(set_up_memory(ts, erk_step, d.memory));
  PetscCall(d.check(ERKStepSetTableNum(d.memory, static_cast<ARKODE_ERKTableID>(d.table->id))));

  // ERKStep takes f at the last stage for f at the end of the step as soon as both are at the same time. Where the last
  // stage is not the end, a function after the step makes it evaluate there, for the first stage of the next step.
  const ARKodeButcherTable b = ARKodeButcherTable_LoadERK(static_cast<ARKODE_ERKTableID>(d.table->id));
  const int last = b->stages - 1;
  const bool first_same_as_last = std::equal(b->b, b->b + b->stages, b->A[last]);
  const bool embedded = b->p > 0;
  ARKodeButcherTable_Free(b);
  PetscCheck(embedded || d.fixed, PetscObjectComm((PetscObject)ts), PETSC_ERR_ARG_INCOMP,
             "The table %s estimates no errors; use it with -ts_arkode_fixed_step", d.table->name);
  if (!first_same_as_last) PetscCall(d.check(ERKStepSetPostprocessStepFn(d.memory, nothing_after_step)));
  PetscFunctionReturn(0);
}

PetscErrorCode set_up_ark(TS ts) {
  Arkode& d = data_of(ts);
  PetscFunctionBegin;
  d.memory =
      ARKStepCreate(d.method == imex ? right_hand_side : nullptr, implicit_part, ts->ptime, d.y.get(), d.context.get());
  PetscCall(set_up_memory(ts, ark_step, d.memory));
  PetscCall(d.check(ARKStepSetTableNum(d.memory, static_cast<ARKODE_DIRKTableID>(d.table->id),
                                       static_cast<ARKODE_ERKTableID>(d.table->explicit_id))));
  PetscCall(set_up_solvers(ts));
  PetscFunctionReturn(0);
}

PetscErrorCode set_up_mri(TS ts) {
  Arkode& d = data_of(ts);
  PetscFunctionBegin;
  PetscCall(find_table(PetscObjectComm((PetscObject)ts), erk, d.fast_table_name, 5, &d.fast_table));
  d.fast_memory = ARKStepCreate(implicit_part, nullptr, ts->ptime, d.y.get(), d.context.get());
  PetscCall(set_up_memory(ts, ark_step, d.fast_memory));
  PetscCall(
      d.check(ARKStepSetTableNum(d.fast_memory, ARKODE_DIRK_NONE, static_cast<ARKODE_ERKTableID>(d.fast_table->id))));
  PetscCall(d.check(ARKStepSetMaxNumSteps(d.fast_memory, -1)));  // no limit
  PetscCall(d.check(ARKStepCreateMRIStepInnerStepper(d.fast_memory, &d.fast)));

  d.memory = MRIStepCreate(right_hand_side, nullptr, ts->ptime, d.y.get(), d.fast, d.context.get());
  PetscCall(set_up_memory(ts, mri_step, d.memory));
  MRIStepCoupling coupling = MRIStepCoupling_LoadTable(static_cast<ARKODE_MRITableID>(d.table->id));
  const int flag = MRIStepSetCoupling(d.memory, coupling);
  MRIStepCoupling_Free(coupling);
  PetscCall(d.check(flag));
  PetscFunctionReturn(0);
}

PetscErrorCode set_up(TS ts) {
  Arkode& d = data_of(ts);
  const auto method = static_cast<Method>(d.method);
  PetscFunctionBegin;
  PetscCall(reset(ts));
  PetscCall(check_functions(ts));
  PetscCall(find_table(ts, &d.table));
  PetscCall(d.open(ts));
  PetscCall(VecCopy(ts->vec_sol, N_VGetVector_Petsc(d.y.get())));
  PetscCall(VecDuplicate(ts->vec_sol, d.y_old.out()));
  PetscCall(VecDuplicate(ts->vec_sol, d.zero.out()));
  PetscCall(VecZeroEntries(d.zero));
  d.shell.reset(N_VCloneEmpty(d.y.get()));
  PetscCheck(d.shell, PETSC_COMM_SELF, PETSC_ERR_MEM, "SUNDIALS could not wrap a vector");

  switch (method) {
    case erk:
      d.stepper = &erk_step;
      PetscCall(set_up_erk(ts));
      break;
    case dirk:
    case imex:
      d.stepper = &ark_step;
      PetscCall(set_up_ark(ts));
      break;
    case mri:
      d.stepper = &mri_step;
      PetscCall(set_up_mri(ts));
  }
  if (!d.fixed_steps()) {
    if (d.adaptivity >= 0)
      PetscCall(d.check(d.stepper->adaptivity(d.memory, static_cast<int>(d.adaptivity), 1, 0, nullptr)));
    PetscCall(d.check(d.stepper->safety(d.memory, d.safety)));
  }
  PetscFunctionReturn(0);
}

PetscErrorCode destroy(TS ts) {
  PetscFunctionBegin;
  PetscCall(reset(ts));
  delete &data_of(ts);
  ts->data = nullptr;
  PetscFunctionReturn(0);
}

PetscErrorCode string_option(PetscOptionItems* PetscOptionsObject, const char* name, const char* help,
                             std::string& value) {
  char text[128];
  PetscBool set;
  PetscFunctionBegin;
  PetscCall(PetscOptionsString(name, help, "", value.c_str(), text, sizeof text, &set));
  if (set) value = text;
  PetscFunctionReturn(0);
}

PetscErrorCode set_from_options(TS ts, PetscOptionItems* PetscOptionsObject) {
  Arkode& d = data_of(ts);
  const auto count = [](const auto& names) { return static_cast<PetscInt>(std::size(names)); };
  PetscFunctionBegin;
  PetscOptionsHeadBegin(PetscOptionsObject, "ARKODE of SUNDIALS: Runge-Kutta methods");
  PetscCall(PetscOptionsEList("-ts_arkode_type", "Explicit, diagonally implicit, additive or multirate", "",
                              method_names, count(method_names), method_names[d.method], &d.method, nullptr));
  PetscCall(string_option(PetscOptionsObject, "-ts_arkode_table",
                          "Coefficients by ARKODE's name or its beginning, e.g. dormand_prince", d.table_name));
  PetscCall(PetscOptionsBoundedInt("-ts_arkode_order", "Order, where no table is named (0: the default of the type)",
                                   "", d.order, &d.order, nullptr, 0));
  PetscCall(string_option(PetscOptionsObject, "-ts_arkode_fast_table", "Explicit table of the fast part (mri)",
                          d.fast_table_name));
  PetscCall(PetscOptionsBool("-ts_arkode_fixed_step", "All steps as the TS time step, no error control", "", d.fixed,
                             &d.fixed, nullptr));
  PetscCall(PetscOptionsEList("-ts_arkode_adapt", "Step size controller", "", adaptivity_names, count(adaptivity_names),
                              d.adaptivity < 0 ? "pid" : adaptivity_names[d.adaptivity], &d.adaptivity, nullptr));
  PetscCall(PetscOptionsReal("-ts_arkode_safety", "Safety factor of the steps, below 1 (0: ARKODE's)", "", d.safety,
                             &d.safety, nullptr));
  PetscCall(PetscOptionsEList("-ts_arkode_nonlinear", "Solver of implicit stages", "", nonlinear_names,
                              count(nonlinear_names), nonlinear_names[d.nonlinear_solver], &d.nonlinear_solver,
                              nullptr));
  PetscCall(PetscOptionsBoundedInt("-ts_arkode_max_iterations", "Most nonlinear iterations (0: ARKODE's)", "",
                                   d.max_iterations, &d.max_iterations, nullptr, 0));
  PetscCall(PetscOptionsBoundedInt("-ts_arkode_anderson", "Vectors of Anderson acceleration (fixedpoint)", "",
                                   d.anderson, &d.anderson, nullptr, 0));
  PetscCall(PetscOptionsEList(
      "-ts_arkode_linear", "Linear solver of newton: PETSc's ksp (the default with a Jacobian), or matrix-free spgmr",
      "", linear_names, count(linear_names), linear_names[std::max(d.linear_solver, PetscInt{ksp})], &d.linear_solver,
      nullptr));
  PetscOptionsHeadEnd();
  if (d.memory != nullptr) {  // set up for other options
    PetscCall(reset(ts));
    ts->setupcalled = PETSC_FALSE;
  }
  ts->usessnes = PETSC_FALSE;
  PetscFunctionReturn(0);
}

PetscErrorCode view_statistics(TS ts, PetscViewer viewer) {
  Arkode& d = data_of(ts);
  long steps, fails = 0, first, second = 0;
  PetscReal last;
  PetscFunctionBegin;
  PetscCall(d.check(d.stepper->steps(d.memory, &steps)));
  PetscCall(d.check(d.stepper->last_step(d.memory, &last)));
  if (d.stepper->error_test_fails != nullptr) PetscCall(d.check(d.stepper->error_test_fails(d.memory, &fails)));
  PetscCall(PetscViewerASCIIPrintf(viewer, "  steps=%ld, error test failures=%ld, last step=%g, next step=%g\n", steps,
                                   fails, static_cast<double>(last), static_cast<double>(d.h)));
  if (d.method == erk) {
    PetscCall(d.check(ERKStepGetNumRhsEvals(d.memory, &first)));
    PetscCall(PetscViewerASCIIPrintf(viewer, "  right-hand sides=%ld\n", first));
  } else if (d.method == mri) {
    long fast, fast_steps, fast_fails;
    PetscCall(d.check(MRIStepGetNumRhsEvals(d.memory, &first, &second)));
    PetscCall(d.check(ARKStepGetNumRhsEvals(d.fast_memory, &fast, &second)));
    PetscCall(d.check(ARKStepGetNumSteps(d.fast_memory, &fast_steps)));
    PetscCall(d.check(ARKStepGetNumErrTestFails(d.fast_memory, &fast_fails)));
    PetscCall(PetscViewerASCIIPrintf(viewer, "  right-hand sides: slow=%ld, fast=%ld\n", first, fast));
    PetscCall(PetscViewerASCIIPrintf(viewer, "  fast part: table %s, fast steps=%ld, fast error test failures=%ld\n",
                                     d.fast_table->name, fast_steps, fast_fails));
  } else {
    long iterations, failures;
    PetscCall(d.check(ARKStepGetNumRhsEvals(d.memory, &first, &second)));
    PetscCall(d.check(ARKStepGetNonlinSolvStats(d.memory, &iterations, &failures)));
    PetscCall(PetscViewerASCIIPrintf(viewer, "  right-hand sides: explicit=%ld, implicit=%ld\n", first, second));
    PetscCall(PetscViewerASCIIPrintf(viewer, "  %s: nonlinear iterations=%ld, failures=%ld\n",
                                     nonlinear_names[d.nonlinear_solver], iterations, failures));
    if (d.linear) {
      PetscCall(d.check(ARKStepGetNumJacEvals(d.memory, &first)));
      PetscCall(d.check(ARKStepGetNumLinIters(d.memory, &second)));
      PetscCall(PetscViewerASCIIPrintf(viewer, "  %s: linear iterations=%ld, Jacobians=%ld\n",
                                       linear_names[d.matrix ? ksp : spgmr], second, first));
    }
  }
  PetscFunctionReturn(0);
}

PetscErrorCode view(TS ts, PetscViewer viewer) {
  Arkode& d = data_of(ts);
  PetscBool ascii;
  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (!ascii) PetscFunctionReturn(0);
  PetscCall(PetscViewerASCIIPrintf(viewer, "ARKODE %s, table %s, %s\n", method_names[d.method],
                                   d.table != nullptr ? d.table->name : "not chosen yet",
                                   d.fixed_steps() ? "fixed steps" : "adaptive steps"));
  if (d.memory != nullptr) PetscCall(view_statistics(ts, viewer));
  PetscFunctionReturn(0);
}

}  // namespace
}  // namespace arkode

PetscErrorCode explicit_table(TS ts, ArkodeTable* table) {
  using namespace arkode;
  const Arkode& d = data_of(ts);
  const Table* found = nullptr;
  PetscFunctionBegin;
  *table = {d.fixed == PETSC_TRUE};
  if (d.method != erk) PetscFunctionReturn(0);
  PetscCall(find_table(ts, &found));
  const ARKodeButcherTable t = ARKodeButcherTable_LoadERK(static_cast<ARKODE_ERKTableID>(found->id));
  PetscCheck(t != nullptr, PETSC_COMM_SELF, PETSC_ERR_LIB, "ARKODE has no table %s", found->name);
  for (int i = 0; i < t->stages; ++i) table->a.insert(table->a.end(), t->A[i], t->A[i] + t->stages);
  table->b.assign(t->b, t->b + t->stages);
  ARKodeButcherTable_Free(t);
  PetscFunctionReturn(0);
}

PetscErrorCode arkode_create(TS ts) {
  using namespace arkode;
  PetscFunctionBegin;
  ts->data = static_cast<Link*>(new Arkode);
  ts->ops->setup = set_up;
  ts->ops->step = step;
  ts->ops->interpolate = interpolate;
  ts->ops->rollback = roll_back;
  ts->ops->reset = reset;
  ts->ops->destroy = destroy;
  ts->ops->setfromoptions = set_from_options;
  ts->ops->view = view;
  ts->default_adapt_type = TSADAPTBASIC;  // for the limits of steps and the exact final time; ARKODE adapts itself
  PetscFunctionReturn(0);
}

}  // namespace pliant::sundials
