#include <pliant/ts/ts_verlet.h>

#include <petsc/private/tsimpl.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include <pliant/kernels/verlet.h>

namespace pliant {
namespace {

struct Tolerance {
  ::Vec each = nullptr;
  PetscReal number = NAN;  // the complete vector
};

struct Verlet {
  ::Vec y_old = nullptr, f_old = nullptr;  // start of the last step and the right-hand side there
  ::Vec f = nullptr;                       // right-hand side at its end, carried on to the next step
  ::Vec predicted = nullptr;
  Tolerance absolute, relative;
  bool carried = false;
};

Verlet& data_of(TS ts) { return *static_cast<Verlet*>(ts->data); }

/// One step of the length ts->time_step from the right-hand side in f_old. If it is accepted the solution is new and
/// next_step is set, else nothing has changed but ts->time_step.
PetscErrorCode attempt(TS ts, PetscReal* next_step, PetscBool* accept) {
  Verlet& d = data_of(ts);
  const PetscReal h = ts->time_step;
  PetscInt n;
  PetscScalar *y, *p;
  const PetscScalar *f, *f_old;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(ts->vec_sol, &n));
  n /= 2;

  PetscCall(VecGetArrayRead(d.f_old, &f_old));
  PetscCall(VecGetArray(ts->vec_sol, &y));
  PetscCall(VecGetArrayWrite(d.predicted, &p));
  verlet_predict(n, h, y + n, f_old + n, p + n);
  verlet_drift(n, h, y, y + n, p + n, p);
  PetscCall(VecRestoreArrayWrite(d.predicted, &p));
  PetscCall(VecRestoreArray(ts->vec_sol, &y));
  PetscCall(VecRestoreArrayRead(d.f_old, &f_old));

  PetscCall(TSPostStage(ts, ts->ptime + h, 0, &d.predicted));
  PetscCall(TSAdaptCheckStage(ts->adapt, ts, ts->ptime + h, d.predicted, accept));
  if (!*accept) PetscFunctionReturn(0);
  PetscCall(TSComputeRHSFunction(ts, ts->ptime + h, d.predicted, d.f));

  // The solution changes only here, so that it is the last accepted one if an evaluation fails.
  PetscCall(VecCopy(ts->vec_sol, d.y_old));
  PetscCall(VecGetArrayRead(d.f, &f));
  PetscCall(VecGetArray(d.predicted, &p));
  PetscCall(VecGetArray(ts->vec_sol, &y));
  std::copy_n(p, n, y);
  verlet_kick(n, h, y + n, f + n, p + n);
  PetscCall(VecRestoreArray(ts->vec_sol, &y));
  PetscCall(VecRestoreArray(d.predicted, &p));
  PetscCall(VecRestoreArrayRead(d.f, &f));

  PetscCall(TSAdaptChoose(ts->adapt, ts, h, nullptr, next_step, accept));
  if (!*accept) {
    PetscCall(VecCopy(d.y_old, ts->vec_sol));
    ts->time_step = *next_step;
  }
  PetscFunctionReturn(0);
}

PetscErrorCode step(TS ts) {
  Verlet& d = data_of(ts);
  PetscBool accept = PETSC_FALSE;
  PetscInt rejections = 0;

  PetscFunctionBegin;
  PetscCall(TSPreStage(ts, ts->ptime));
  if (!d.carried || ts->steprestart || ts->steprollback)
    PetscCall(TSComputeRHSFunction(ts, ts->ptime, ts->vec_sol, d.f));
  d.carried = false;  // until this step is complete
  std::swap(d.f, d.f_old);
  while (!ts->reason) {
    PetscReal next_step = ts->time_step;
    PetscCall(attempt(ts, &next_step, &accept));
    if (accept) {
      d.carried = true;
      ts->ptime += ts->time_step;
      ts->time_step = next_step;
      break;
    }
    ++ts->reject;
    if (++rejections > ts->max_reject && ts->max_reject >= 0) ts->reason = TS_DIVERGED_STEP_REJECTED;
  }
  PetscFunctionReturn(0);
}

// The tolerance of each unknown, where TS has but a number too.
PetscErrorCode get(TS ts, ::Vec given, PetscReal number, Tolerance& own, const PetscScalar** values) {
  PetscFunctionBegin;
  if (given == nullptr) {
    if (own.each == nullptr) PetscCall(VecDuplicate(ts->vec_sol, &own.each));
    if (own.number != number) PetscCall(VecSet(own.each, number));
    own.number = number;
  }
  PetscCall(VecGetArrayRead(given != nullptr ? given : own.each, values));
  PetscFunctionReturn(0);
}
PetscErrorCode restore(::Vec given, Tolerance& own, const PetscScalar** values) {
  PetscFunctionBegin;
  PetscCall(VecRestoreArrayRead(given != nullptr ? given : own.each, values));
  PetscFunctionReturn(0);
}

// With the accelerations a and a' at both ends: x lacks h² (a' − a)/6, the next term of its series; v differs from the
// prediction by h (a' − a)/2. The latter overstates the error, by one order: the step is controlled by the change
// of the force in a step, the onset of a contact above all. The norm equals TSErrorWeightedNorm, which takes longer
// than the forces.
PetscErrorCode evaluate_error(TS ts, NormType norm, PetscInt* order, PetscReal* error) {
  Verlet& d = data_of(ts);
  const PetscReal h = ts->time_step;
  const PetscScalar *f, *f_old, *y, *y_old, *absolute, *relative;
  PetscInt n, all;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(ts->vec_sol, &n));
  PetscCall(VecGetSize(ts->vec_sol, &all));
  n /= 2;
  PetscCall(VecGetArrayRead(d.f_old, &f_old));
  PetscCall(VecGetArrayRead(d.f, &f));
  PetscCall(VecGetArrayRead(d.y_old, &y_old));
  PetscCall(VecGetArrayRead(ts->vec_sol, &y));
  PetscCall(get(ts, ts->vatol, ts->atol, d.absolute, &absolute));
  PetscCall(get(ts, ts->vrtol, ts->rtol, d.relative, &relative));
  const WeightedSquares x = weighted_squares(n, h * h / 6, f + n, f_old + n, y, y_old, absolute, relative),
                        v = weighted_squares(n, h / 2, f + n, f_old + n, y + n, y_old + n, absolute + n, relative + n);
  PetscCall(restore(ts->vrtol, d.relative, &relative));
  PetscCall(restore(ts->vatol, d.absolute, &absolute));
  PetscCall(VecRestoreArrayRead(ts->vec_sol, &y));
  PetscCall(VecRestoreArrayRead(d.y_old, &y_old));
  PetscCall(VecRestoreArrayRead(d.f, &f));
  PetscCall(VecRestoreArrayRead(d.f_old, &f_old));
  const bool largest = norm == NORM_INFINITY;
  const PetscReal here = largest ? std::max(x.largest, v.largest) : (x.sum + v.sum) / all;
  PetscCall(
      MPIU_Allreduce(&here, error, 1, MPIU_REAL, largest ? MPIU_MAX : MPIU_SUM, PetscObjectComm((PetscObject)ts)));
  *error = std::sqrt(*error);
  if (order) *order = 2;
  PetscFunctionReturn(0);
}

// Cubic Hermite: x from its ends and velocities, v from its ends and accelerations.
PetscErrorCode interpolate(TS ts, PetscReal t, ::Vec u) {
  Verlet& d = data_of(ts);
  const PetscReal h = ts->ptime - ts->ptime_prev, s = (t - ts->ptime_prev) / h;
  const PetscReal y1 = s * s * (3 - 2 * s), y0 = 1 - y1, f0 = h * s * (1 - s) * (1 - s), f1 = h * s * s * (s - 1);
  const PetscScalar *yo, *yn, *fo, *fn;
  PetscScalar* out;
  PetscInt n;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(u, &n));
  n /= 2;
  PetscCall(VecGetArrayRead(d.y_old, &yo));
  PetscCall(VecGetArrayRead(ts->vec_sol, &yn));
  PetscCall(VecGetArrayRead(d.f_old, &fo));
  PetscCall(VecGetArrayRead(d.f, &fn));
  PetscCall(VecGetArrayWrite(u, &out));
  for (PetscInt i = 0; i < n; ++i) {
    // The velocity in f belongs to the predictor, the velocity in y to the method.
    out[i] = y0 * yo[i] + y1 * yn[i] + f0 * yo[n + i] + f1 * yn[n + i];
    out[n + i] = y0 * yo[n + i] + y1 * yn[n + i] + f0 * fo[n + i] + f1 * fn[n + i];
  }
  PetscCall(VecRestoreArrayWrite(u, &out));
  PetscCall(VecRestoreArrayRead(d.f, &fn));
  PetscCall(VecRestoreArrayRead(d.f_old, &fo));
  PetscCall(VecRestoreArrayRead(ts->vec_sol, &yn));
  PetscCall(VecRestoreArrayRead(d.y_old, &yo));
  PetscFunctionReturn(0);
}

PetscErrorCode roll_back(TS ts) {
  PetscFunctionBegin;
  PetscCall(VecCopy(data_of(ts).y_old, ts->vec_sol));
  data_of(ts).carried = false;
  PetscFunctionReturn(0);
}

PetscErrorCode reset(TS ts) {
  Verlet& d = data_of(ts);
  PetscFunctionBegin;
  PetscCall(VecDestroy(&d.y_old));
  PetscCall(VecDestroy(&d.f_old));
  PetscCall(VecDestroy(&d.f));
  PetscCall(VecDestroy(&d.predicted));
  for (Tolerance* tolerance : {&d.absolute, &d.relative}) {
    PetscCall(VecDestroy(&tolerance->each));
    tolerance->number = NAN;
  }
  d.carried = false;
  PetscFunctionReturn(0);
}

PetscErrorCode set_up(TS ts) {
  Verlet& d = data_of(ts);
  TSRHSFunction rhs;
  DM dm;
  PetscInt n;

  PetscFunctionBegin;
  PetscCall(TSCheckImplicitTerm(ts));
  PetscCall(TSGetDM(ts, &dm));
  PetscCall(DMTSGetRHSFunction(dm, &rhs, nullptr));
  PetscCheck(rhs, PetscObjectComm((PetscObject)ts), PETSC_ERR_ARG_WRONGSTATE,
             "TS type verlet needs a right-hand side; call TSSetRHSFunction() with [v; a]");
  PetscCall(VecGetLocalSize(ts->vec_sol, &n));
  PetscCheck(n % 2 == 0, PETSC_COMM_SELF, PETSC_ERR_ARG_SIZ,
             "TS type verlet needs y = [x; v], but the local length %" PetscInt_FMT " is odd", n);
  PetscCall(reset(ts));
  PetscCall(VecDuplicate(ts->vec_sol, &d.y_old));
  PetscCall(VecDuplicate(ts->vec_sol, &d.f_old));
  PetscCall(VecDuplicate(ts->vec_sol, &d.f));
  PetscCall(VecDuplicate(ts->vec_sol, &d.predicted));
  PetscCall(TSGetAdapt(ts, &ts->adapt));
  PetscCall(TSAdaptCandidatesClear(ts->adapt));
  PetscFunctionReturn(0);
}

PetscErrorCode destroy(TS ts) {
  PetscFunctionBegin;
  PetscCall(reset(ts));
  delete static_cast<Verlet*>(ts->data);
  ts->data = nullptr;
  PetscFunctionReturn(0);
}

PetscErrorCode set_from_options(TS, PetscOptionItems* PetscOptionsObject) {
  PetscFunctionBegin;
  PetscOptionsHeadBegin(PetscOptionsObject, "Velocity Verlet (no options of its own)");
  PetscOptionsHeadEnd();
  PetscFunctionReturn(0);
}

PetscErrorCode view(TS, PetscViewer viewer) {
  PetscBool ascii;
  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
  if (ascii)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  velocity Verlet with predicted velocity, one evaluation per step\n"));
  PetscFunctionReturn(0);
}

PetscErrorCode create(TS ts) {
  PetscFunctionBegin;
  ts->data = new Verlet;
  ts->ops->setup = set_up;
  ts->ops->step = step;
  ts->ops->interpolate = interpolate;
  ts->ops->rollback = roll_back;
  ts->ops->evaluatewlte = evaluate_error;
  ts->ops->reset = reset;
  ts->ops->destroy = destroy;
  ts->ops->setfromoptions = set_from_options;
  ts->ops->view = view;
  ts->default_adapt_type = TSADAPTNONE;
  ts->usessnes = PETSC_FALSE;
  PetscFunctionReturn(0);
}

}  // namespace

PetscErrorCode ts_verlet_register() {
  PetscFunctionBegin;
  PetscCall(TSRegister(ts_verlet, create));
  PetscFunctionReturn(0);
}

}  // namespace pliant
