// A PETSc TS type as an integrator of ẍ = a(t, x, ẋ) and of ẋ = f(t, x).
#pragma once

#include <memory>
#include <span>
#include <string>

#include <pliant/base/petsc.h>
#include <pliant/system/implicit_system.h>
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
  Real length = 1;     ///< mean diameter (droplets: radius): positions with errors as large are unknown
  Real dt = 1e-3;      ///< -ts_dt, the first step, or the fixed one, in t0
  /// -ts_adapt_dt_max, of a controlled step: free flight has no error that would shorten a step before it jumps over an
  /// obstacle.
  Real longest_dt = std::numeric_limits<Real>::infinity();
  /// For the same reason, of a controlled step: no coordinate and no wall is expected to move by more than this, at the
  /// speeds after the last step and accelerations during it.
  Real longest_move = std::numeric_limits<Real>::infinity();
  /// Implicit part of an implicit type: all forces, or the shape energy only, with explicit other forces (IMEX).
  TermGroup implicit = TermGroup::all;
  JacobianKind jacobian = JacobianKind::assembled;
  /// Whether forces are defined at the positions of a trial step; if not, the step is rejected and repeated with a
  /// shorter length. Collective. Empty: forces are defined everywhere.
  std::function<bool(const Real* x)> admissible = {};
};

/// Integrates y = [x; v] with ẏ = [v; a(t, x, v)] by PETSc TS. Motion without inertia is y = x with ẋ = f(t, x) and
/// does not write State::v. Other unknowns than the coordinates have the tolerances of coordinates. PETSc keeps
/// separate vectors: each accepted step is copied to the state.
///
/// Explicit types: rk (all tables), ssp, euler, verlet. Implicit types, for an ImplicitSystem: alpha, alpha2, arkimex,
/// beuler, bdf, cn, rosw, theta. Implicit types get an IFunction ẏ − [v; a] and its IJacobian. The type alpha2 gets ẍ −
/// a = 0, with -ts_atol for positions and velocities. Other types registered with TSRegister get [v; a] as the
/// right-hand side, and its Jacobian if there is one. With TermGroup::shape (arkimex, arkode) the shape energy and ẋ =
/// v are the IFunction, the rest is the right-hand side. Solvers are PETSc's: -snes_…, -ksp_…, -pc_…, by default
/// Newton, GMRES and -pc_type particle. If a solve fails, the step is repeated with a shorter length; a fixed step has
/// its full length again after that. The end of a run is matched exactly; the last, shortened step does not become the
/// first step of the next run. Every run starts afresh (first-same-as-last stages and step-size history of the run
/// before are dropped), so `fresh` makes no difference, and a chain of runs differs from one long run within the
/// tolerance.
///
/// After a failure the state is the state after the last accepted step.
class TsIntegrator : public Integrator {
 public:
  /// Reads all -ts_… options, so that unused options can be reported before any work starts.
  /// Errors: InputError for a type that is unknown or solves other problems, a split that the type does not support, an
  /// option that PETSc refuses or that the program sets itself, an adaptive step without error estimate, a tolerance or
  /// step that is not positive. comm: communicator of the ranks of the systems to integrate. Collective, as is run().
  explicit TsIntegrator(TsOptions options = {}, MPI_Comm comm = PETSC_COMM_SELF);

  /// As Integrator::run. Exceptions of the system or the observer arrive unchanged.
  /// Errors: InputError if the state does not fit the system, or an implicit type gets a system that is not an
  /// ImplicitSystem; NumericalError, with the time, if an acceleration is not finite (with an implicit type:
  /// repeatedly), a step is rejected too often, dt underflows, or -ts_max_steps is reached.
  void run(SecondOrderSystem& system, State& state, Real t_end, bool fresh, const StepObserver& observer) override;
  void run(FirstOrderSystem& system, State& state, Real t_end, const StepObserver& observer) override;
  void check_system(const FirstOrderSystem& system) const override;
  const IntegratorStatistics& statistics() const override { return statistics_; }
  std::string name() const override;

  bool first_same_as_last() const override { return first_same_as_last_; }
  bool explicit_fixed_step() const override;
  /// Whether the method solves equations, for which the system must compute derivatives.
  bool needs_jacobian() const;
  Real next_dt() const override { return dt_; }
  /// Of rk, ssp, euler, verlet and arkode with explicit tables; infinite for others.
  Real longest_stable_step(const FastestRates& rates) const override;
  Real shortest_controlled_step() const override;
  /// -ts_adapt_dt_max, or TsOptions::longest_dt; infinite without error control.
  Real longest_controlled_step() const;

 private:
  struct Run;  // data of the callbacks
  using Choose = PetscErrorCode (*)(TSAdapt, TS, PetscReal, PetscInt*, PetscReal*, PetscBool*, PetscReal*, PetscReal*,
                                    PetscReal*);

  void configure();
  void check_control(TSAdapt adapt, bool estimate);
  void check_arkode_splits() const;
  void configure_solvers();
  void check_solvers() const;
  void set_tolerances(::Vec y, std::size_t positions, std::size_t n, std::size_t unknowns);
  /// Until t_end, a stop or a new order of the state; true for the last.
  bool solve(FirstOrderSystem& system, State& state, Real t_end, const StepObserver& observer);
  /// Sets the functions of the problem in PETSc.
  void set_functions(Run& run);
  static PetscErrorCode right_hand_side(TS ts, PetscReal t, ::Vec y, ::Vec ydot, void* context);
  static PetscErrorCode right_hand_side_jacobian(TS ts, PetscReal t, ::Vec y, ::Mat a, ::Mat p, void* context);
  static PetscErrorCode implicit_function(TS ts, PetscReal t, ::Vec y, ::Vec ydot, ::Vec f, void* context);
  static PetscErrorCode implicit_jacobian(TS ts, PetscReal t, ::Vec y, ::Vec ydot, PetscReal shift, ::Mat a, ::Mat p,
                                          void* context);
  static PetscErrorCode second_order_function(TS ts, PetscReal t, ::Vec x, ::Vec v, ::Vec a, ::Vec f, void* context);
  static PetscErrorCode second_order_jacobian(TS ts, PetscReal t, ::Vec x, ::Vec v, ::Vec acceleration,
                                              PetscReal shift_v, PetscReal shift_a, ::Mat a, ::Mat p, void* context);
  static PetscErrorCode function_domain(TS ts, PetscReal t, ::Vec y, PetscBool* inside);
  /// The step controller's decision, with a count of steps that it accepts above the tolerance.
  static PetscErrorCode choose(TSAdapt adapt, TS ts, PetscReal h, PetscInt* scheme, PetscReal* next_h,
                               PetscBool* accept, PetscReal* error, PetscReal* absolute, PetscReal* relative);
  static PetscErrorCode post_step(TS ts);
  /// Where rates leave the domain of a formula, a controlled step is tried again, shorter.
  template <class Evaluate>
  void evaluate_stage(Run& run, Real t, std::span<Real> rates, Evaluate&& evaluate);
  void evaluate_implicit(Run& run, Real t, const Real* x, const Real* v, Real* a);
  void update_jacobian(::Mat a, Real t, const Real* x, const Real* v, const JacobianWeights& weights);
  void accept_step(Run& run);
  bool limits_motion() const { return adaptive_ && std::isfinite(options_.longest_move); }
  static std::pair<Real, Real> motion_in_step(const Run& run, Real dt);
  /// Limits the next steps by TsOptions::longest_move. change: of a velocity in the last step, of length dt. Returns
  /// the longest step.
  Real limit_motion(Run& run, Real speed, Real change, Real dt);
  std::string failure_of_trial() const;  ///< for messages; empty without one

  TsOptions options_;
  MPI_Comm comm_;
  std::unique_ptr<Jacobian> jacobian_;  // Jacobian of the system of the current run
  PetscTs ts_;
  std::string type_;
  bool adaptive_ = false;
  bool explicit_ = false;    // every part of the step
  bool fixed_ = false;       // explicit method without error control
  Choose choose_ = nullptr;  // PETSc's
  bool first_same_as_last_ = false;
  bool second_order_ = false;  // alpha2
  bool reusable_ = true;       // false after a failure: PETSc's objects may be in an inconsistent state
  static constexpr int most_shortened = 8;
  int shortened_ = 0;  // times that the first step has been divided by four
  std::size_t configured_size_ = 0;
  Real dt_ = 0;
  Real longest_dt_ = 0;       // of controlled steps, whatever the motion
  std::string last_failure_;  // message of a failed evaluation at a trial state
  bool outside_ = false;      // a stage of the step being tried had no forces
  IntegratorStatistics statistics_;
};

}  // namespace pliant
