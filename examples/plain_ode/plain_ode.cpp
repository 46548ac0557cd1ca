// y' = -y from y(0) = 1 to t = 1 by PETSc TS with CVODE of SUNDIALS. All options of PETSc work: -ts_type arkode
// -ts_rtol 1e-9 -ts_monitor
#include <petscts.h>
#include <pliant/ts/sundials/sundials.h>

PetscErrorCode decay(TS, PetscReal, Vec y, Vec f, void*) { return VecAXPBY(f, -1, 0, y); }

int main(int argc, char** argv) {
  PetscCall(PetscInitialize(&argc, &argv, nullptr, nullptr));
  PetscCall(pliant::sundials_register());
  Vec y = nullptr;
  TS ts = nullptr;
  PetscCall(VecCreateMPI(PETSC_COMM_WORLD, PETSC_DECIDE, 1, &y));
  PetscCall(VecSet(y, 1));
  PetscCall(TSCreate(PETSC_COMM_WORLD, &ts));
  PetscCall(TSSetType(ts, pliant::ts_cvode));
  PetscCall(TSSetRHSFunction(ts, nullptr, decay, nullptr));
  PetscCall(TSSetMaxTime(ts, 1));
  PetscCall(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_MATCHSTEP));
  PetscCall(TSSetTimeStep(ts, 0.01));
  PetscCall(TSSetTolerances(ts, 1e-8, nullptr, 1e-8, nullptr));
  PetscCall(TSSetFromOptions(ts));
  PetscCall(TSSolve(ts, y));
  PetscCall(VecView(y, PETSC_VIEWER_STDOUT_WORLD));  // 0.367879 = exp(-1)
  PetscCall(TSDestroy(&ts));
  PetscCall(VecDestroy(&y));
  return PetscFinalize();
}
