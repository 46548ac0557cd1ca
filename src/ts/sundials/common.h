// Shared code of the TS types over SUNDIALS: vectors, callbacks, solvers, errors.
#pragma once

#include <nvector/nvector_petsc.h>
#include <petscts.h>
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_nonlinearsolver.h>

#include <memory>
#include <string>
#include <type_traits>

namespace pliant::sundials {

/// Deleter that calls a SUNDIALS function.
template <auto free>
struct Free {
  template <class T>
  void operator()(T* object) const {
    free(object);
  }
};
/// Owner of a SUNDIALS handle, which is a pointer: Owned<N_Vector, N_VDestroy>.
template <class Handle, auto free>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Free<free>>;

inline void free_context(SUNContext context) { (void)SUNContext_Free(&context); }

/// Input of the nonlinear solver from the integrator: the present system.
struct ImplicitSystem {
  realtype t;          ///< time of the stage
  N_Vector predicted;  ///< the unknown is the correction to this state
  realtype gamma;      ///< the system is y − γ f(t, y) = known
};

/// Link between a TS and a SUNDIALS integrator. A TS type derives its data from it, and stores it by
/// `ts->data = static_cast<Link*>(data)`; the integrator gets it as user data (void* of a Link*).
///
/// Errors in callbacks: SUNDIALS retries recoverable errors (TSFunctionDomainError, values that are not finite) with
/// a smaller step. A PETSc error ends the step; the code is stored in `error` and returned by `failed`.
struct Link {
  Link();
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;
  ~Link();

  TS ts = nullptr;
  PetscErrorCode error = 0;  ///< the first PETSc error in a callback of this step
  std::string message;       ///< the last error message of SUNDIALS

  // Objects that SUNDIALS refers to; its integrator must be destroyed before them (Link::close).
  Owned<SUNContext, free_context> context;
  Owned<N_Vector, N_VDestroy> y;  ///< work and output of the integrator; ts->vec_sol keeps the accepted solution during
                                  ///< a step
  Owned<SUNMatrix, SUNMatDestroy> matrix;
  Owned<SUNLinearSolver, SUNLinSolFree> linear;
  Owned<SUNNonlinearSolver, SUNNonlinSolFree> nonlinear;

  /// Context and y (like ts->vec_sol, with fused operations, not set).
  PetscErrorCode open(TS owner);
  /// Frees all objects above; the TS's SNES gets its objects back.
  void close();

  /// Whether the KSP of the TS has a matrix and a function that makes it a Jacobian.
  PetscErrorCode has_jacobian(PetscBool* yes) const;
  /// `linear` and `matrix`: the KSP of the TS's SNES, to be used with `linear_system`. The operator is σI − J, from
  /// TSSetRHSJacobian or TSSetIJacobian, which must have been given a matrix. implicit_part: only the Jacobian of the
  /// implicit function, for a split right-hand side.
  /// A solve ends at the tolerance of the integrator, which replaces -ksp_atol, at the latest at -ksp_rtol.
  PetscErrorCode use_ksp(PetscBool implicit_part = PETSC_FALSE);
  /// `nonlinear`: the TS's SNES, with all its options. The integrator's test ends the iteration. query returns the
  /// system being solved by the integrator `memory`; the TS type sets ts->ops->snesfunction = snes_function and
  /// ts->ops->snesjacobian = snes_jacobian.
  PetscErrorCode use_snes(ImplicitSystem (*query)(void* memory), PetscBool implicit_part = PETSC_FALSE);

  /// For calls into SUNDIALS other than steps: flag < 0 becomes PETSC_ERR_LIB with SUNDIALS' message.
  PetscErrorCode check(int flag) const;
  /// For steps with flag < 0: returns the PETSc error of a callback, else sets ts->reason (TS_DIVERGED_…) and prints
  /// the reason by PetscInfo; a flag that does not mean a failed step becomes PETSC_ERR_LIB. Flags as CVODE's and
  /// ARKODE's.
  PetscErrorCode failed(int flag);

  struct Implicit;
  std::unique_ptr<Implicit> implicit;  ///< state of the solvers
};

/// The Link of a TS whose type derives from it.
Link& link_of(TS ts);

/// Return value of a callback: −1 for a PETSc error (stored in the link), 1 for an error that a smaller step may avoid,
/// else 0.
int outcome(Link& link, PetscErrorCode code, bool valid);

/// A function like TSComputeRHSFunction.
using Compute = PetscErrorCode(TS ts, PetscReal t, ::Vec y, ::Vec f);

/// Body of a CVRhsFn or ARKRhsFn.
int evaluate(Link& link, Compute* function, realtype t, N_Vector y, N_Vector f);

/// f(t, y) by TSComputeRHSFunction: a CVRhsFn, ARKRhsFn.
int right_hand_side(realtype t, N_Vector y, N_Vector ydot, void* link);

/// Error weights 1/(rtol |y| + atol) by the tolerances of the TS, scalars or vectors: a CVEwtFn, ARKEwtFn.
/// PETSc error PETSC_ERR_ARG_OUTOFRANGE where rtol |y| + atol is not positive.
int error_weights(N_Vector y, N_Vector weights, void* link);

/// Error handler of an integrator: stores the message for `check` and `failed`, passes it to PetscInfo, prints nothing.
void keep_message(int code, const char* module, const char* function, char* message, void* link);

/// Body of a CVLsLinSysFn or ARKLsLinSysFn: assembles σI − J, σ = 1/γ, or with jok only moves the last one to the new
/// σ.
int linear_system(Link& link, realtype t, N_Vector y, booleantype jok, booleantype* jcur, realtype gamma);

PetscErrorCode snes_function(SNES snes, ::Vec correction, ::Vec residual, TS ts);
PetscErrorCode snes_jacobian(SNES snes, ::Vec correction, ::Mat a, ::Mat p, TS ts);

}  // namespace pliant::sundials
