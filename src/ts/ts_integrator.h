// Any explicit PETSc TS type as an integrator of ẍ = a(t, x, ẋ) and of ẋ = f(t, x).
#pragma once

#include <string>

#include <pliant/base/petsc.h>
#include <pliant/ts/integrator.h>

namespace pliant {

/// Defaults that the -ts_… options override.
struct TsOptions {
  std::string type = "rk";      ///< -ts_type
  std::string rk_type = "5dp";  ///< -ts_rk_type
  std::string adapt = "dsp";    ///< -ts_adapt_type where the type has an error estimate; fixed steps otherwise
  Real rtol = 1e-4;    ///< -ts_rtol, relative to the velocities; positions get none, as their origin is arbitrary
  Real atol_x = 1e-4;  ///< -ts_atol, absolute error of a position per step
  Real atol_v = 1e-4;  ///< -ts_atol, absolute error of a velocity per step
  Real dt = 1e-3;      ///< -ts_dt, the first step, or the fixed one, in t0
};

/// Integrates y = [x; v] with ẏ = [v; a(t, x, v)] by PETSc TS in the memory of the state, without a copy; motion
/// without inertia as y = x with ẋ = f(t, x), which leaves State::v alone.
///
/// Types: rk (all tables), ssp, euler, verlet, and any explicit type registered with TSRegister. The end of a run is
/// matched exactly; the step that this cuts short does not become the first one of the next run. Every run starts
/// afresh (first-same-as-last stages and step-size history of the run before are dropped), so `fresh` makes no
/// difference, and a chain of runs differs from one long run within the tolerance. State::a is not used.
///
/// After a failure x and v are those of the step that failed, t is the end of the last accepted step.
class TsIntegrator : public Integrator {
 public:
  /// Reads all -ts_… options, so that unused options can be reported before any work starts.
  /// Errors: InputError for an unknown or implicit type, an option that PETSc refuses or that the program sets itself,
  /// an adaptive step without error estimate, a tolerance or step that is not positive.
  /// comm: of the ranks of the systems that it will integrate. Collective, as is run().
  explicit TsIntegrator(TsOptions options = {}, MPI_Comm comm = PETSC_COMM_SELF);

  /// As Integrator::run. What the system or the observer throws arrives unchanged.
  /// Errors: InputError where the state does not fit the system; NumericalError, with the time, where an acceleration
  /// is not finite, a step is rejected too often, dt underflows, or -ts_max_steps is reached.
  void run(SecondOrderSystem& system, State& state, Real t_end, bool fresh, const StepObserver& observer) override;
  /// The same for any first-order system, whose y are the first entries of State::y.
  /// Errors: besides, InputError for -ts_type verlet where there are no velocities in y.
  void run(FirstOrderSystem& system, State& state, Real t_end, const StepObserver& observer);
  const IntegratorStatistics& statistics() const override { return statistics_; }
  std::string name() const override;

  /// The step that the next run starts with, in t0: save it for a restart (TsOptions::dt).
  Real next_dt() const { return dt_; }

 private:
  struct Run;  // what the callbacks see

  void configure();
  void set_tolerances(::Vec y, std::size_t n, std::size_t unknowns);
  /// Until t_end, a stop or a new order of the state; true for the last.
  bool solve(FirstOrderSystem& system, State& state, Real t_end, const StepObserver& observer);
  static PetscErrorCode right_hand_side(TS ts, PetscReal t, ::Vec y, ::Vec ydot, void* context);
  static PetscErrorCode post_step(TS ts);
  void accept_step(Run& run);

  TsOptions options_;
  MPI_Comm comm_;
  PetscTs ts_;
  bool adaptive_ = false;
  bool reusable_ = true;  // false after a failure: PETSc's objects may be in the middle of something
  std::size_t configured_size_ = 0;
  Real dt_ = 0;
  IntegratorStatistics statistics_;
};

}  // namespace pliant
