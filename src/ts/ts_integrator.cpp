#include <pliant/ts/ts_integrator.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <petsc/private/tsimpl.h>

#include <pliant/base/cure.h>
#include <pliant/base/petsc_views.h>
#include <pliant/kernels/arrays.h>
#include <pliant/system/particle_pc.h>
#include <pliant/ts/sundials/sundials.h>
#include <pliant/ts/ts_verlet.h>

namespace pliant {

struct TsIntegrator::Run {
  TsIntegrator& integrator;
  FirstOrderSystem& system;
  ImplicitSystem* implicit;  // the same, if it has derivatives
  State& state;
  const StepObserver& observer;
  ::Vec y, v;  // v: velocities for alpha2, whose y is x only
  Real t_end;
  Real t_before;
  PetscInt rejected_before;
  bool cut;        // the step about to be taken was shortened to match t_end
  bool reordered;  // the observer has reordered the state

  /// The state to PETSc's vectors and back.
  void load() const;
  void store() const;
  /// The unknowns after the coordinates in y. Empty if velocities have a separate vector.
  std::span<Real> behind_coordinates() const {
    if (!system.has_velocities()) return state.extra;
    return state.v().first(v == nullptr ? system.size() : 0);
  }
  /// Throws on all ranks if one of `rates` is not finite on any rank. first: number of the first of these unknowns.
  void check(std::span<const Real> rates, std::size_t first, Real t) const {
    const std::size_t bad = first_non_finite(rates.data(), rates.size()), coordinates = system.size();
    system.ranks().together([&] {
      if (bad == rates.size()) return;
      if (first + bad >= coordinates && !system.has_velocities())
        throw NumericalError("the rate of unknown {} beside the coordinates is {} at t = {}, in the step after t = {}",
                             first + bad - coordinates, rates[bad], t, state.t);
      throw NumericalError(
          "the {} of coordinate {} is {} at t = {}, in the step after t = {} (step {}); reduce the tolerances or the "
          "step, or check the initial state",
          first + bad < coordinates ? "velocity" : "acceleration", (first + bad) % coordinates, rates[bad], t, state.t,
          state.step);
    });
  }
};

namespace {

// PETSc's types that need another split than ours, no time, or more than y; two are not built.
constexpr std::array unsupported_types = {"basicsymplectic", "dirk", "discgrad", "eimex",  "glee",    "glle", "irk",
                                          "mimex",           "mprk", "pseudo",   "radau5", "sundials"};
constexpr std::array explicit_types = {"euler", "rk", "ssp", ts_verlet};
// Repeat a first step that fails at the same length, over and over.
constexpr std::array stubborn_types = {"alpha", "alpha2"};
constexpr std::array implicit_types = {"alpha", "alpha2", "arkimex", "bdf", "beuler", "cn", "rosw", "theta"};
constexpr std::array split_types = {"arkimex", "arkode"};
// Choose the next step themselves, and start afresh if PETSc's is another.
constexpr std::array self_controlled_types = {"arkode", "cvode"};
// Explicit types without an error estimate; rk has an estimate if its table is an embedded pair.
constexpr std::array fixed_types = {"euler", "ssp"};
constexpr std::array program_options = {"-ts_max_time", "-ts_final_time", "-ts_init_time", "-ts_time_span",
                                        "-ts_exact_final_time", "-ts_rk_multirate", "-ts_save_trajectory",
                                        // Ignored components have no error: large values remove error control.
                                        "-ts_adapt_max_ignore"};
constexpr std::array controllers = {TSADAPTBASIC, TSADAPTDSP};
constexpr Real largest_tolerance = 1;

// PETSc reads these options during the solve, which is later than the check for unused options. PETSc has no
// -ts_converged_reason.
constexpr const char* converged_reason = "ts_converged_reason";
constexpr std::array solve_views = {"ts_view", "ts_view_pre", "ts_view_solution", converged_reason};
constexpr std::array solver_views = {"snes_view", "snes_view_pre", "snes_view_solution", "snes_converged_reason",
                                     "mat_view"};

bool contains(const auto& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::string string_option(const char* name, const std::string& fallback) {
  std::array<char, 256> text{};
  PetscBool set = PETSC_FALSE;
  petsc_check(PetscOptionsGetString(nullptr, nullptr, name, text.data(), text.size(), &set));
  return set == PETSC_TRUE ? text.data() : fallback;
}

std::string supported_types() {
  const char** names = nullptr;
  int count = 0;
  petsc_check(PetscFunctionListGet(TSList, &names, &count));
  std::vector<std::string> types;
  for (int i = 0; names[i] != nullptr; ++i)  // count includes the null at the end
    if (!contains(unsupported_types, names[i])) types.emplace_back(names[i]);
  petsc_check(PetscFree(names));
  std::sort(types.begin(), types.end());
  return fmt::format("{}", fmt::join(types, ", "));
}

void check_type(const std::string& type) {
  const auto known = fmt::format(", {},", supported_types());
  if (known.find(fmt::format(" {},", type)) != std::string::npos) return;
  if (contains(unsupported_types, type))
    throw InputError("-ts_type {} is for problems of another form, or not built; use one of {}", type,
                     supported_types());
  throw InputError("-ts_type {} is not known; use one of {}", type, supported_types());
}

void copy_to(::Vec y, std::span<const Real> first, std::span<const Real> rest) {
  PetscScalar* values = nullptr;
  petsc_check(VecGetArrayWrite(y, &values));
  std::copy(first.begin(), first.end(), values);
  std::copy(rest.begin(), rest.end(), values + first.size());
  petsc_check(VecRestoreArrayWrite(y, &values));
}

void copy_from(::Vec y, std::span<Real> first, std::span<Real> rest) {
  const PetscScalar* values = nullptr;
  petsc_check(VecGetArrayRead(y, &values));
  std::copy_n(values, first.size(), first.begin());
  std::copy_n(values + first.size(), rest.size(), rest.begin());
  petsc_check(VecRestoreArrayRead(y, &values));
}

void check_positive(const char* name, Real value) {
  if (!std::isfinite(value) || value <= 0)
    throw InputError("{} is {}, but it must be positive and finite", name, value);
}

/// Errors: InputError for limits of controlled steps that no step fulfils, which PETSc would refuse without their
/// names.
void check_step_limits(TSAdapt adapt) {
  PetscReal least = 0, most = 0;
  PetscBool given = PETSC_FALSE;
  petsc_check(TSAdaptGetStepLimits(adapt, &least, &most));
  petsc_check(PetscOptionsGetReal(nullptr, nullptr, "-ts_adapt_dt_min", &least, nullptr));
  petsc_check(PetscOptionsGetReal(nullptr, nullptr, "-ts_adapt_dt_max", &most, &given));
  if (!(least < most))
    throw InputError("-ts_adapt_dt_min {:g} is not below the longest step, {:.3g} (-ts_adapt_dt_max{}); lower it",
                     least, most, given == PETSC_TRUE ? "" : ", by default");
}

}  // namespace

void TsIntegrator::Run::load() const {
  copy_to(y, state.x(), behind_coordinates());
  if (v != nullptr) copy_to(v, state.v(), {});
}

void TsIntegrator::Run::store() const {
  copy_from(y, state.x(), behind_coordinates());
  if (v != nullptr) copy_from(v, state.v(), {});
}

TsIntegrator::TsIntegrator(TsOptions options, MPI_Comm comm) : options_(std::move(options)), comm_(comm) {
  configure();
}

void TsIntegrator::configure() {
  for (const char* name : program_options)
    if (has_petsc_option(name))
      throw InputError("{} cannot be set here, because the run sets it; leave the option out", name);
  petsc_check(ts_verlet_register());
  petsc_check(sundials_register());
  ts_ = PetscTs();
  petsc_check(TSCreate(comm_, ts_.out()));
  petsc_check(TSSetProblemType(ts_, TS_NONLINEAR));
  petsc_check(TSSetMaxSteps(ts_, PETSC_MAX_INT));
  petsc_check(TSSetMaxStepRejections(ts_, 100));  // PETSc's 10 are too few for the onset of a stiff contact
  petsc_check(TSSetTimeStep(ts_, options_.dt));
  petsc_check(TSSetTolerances(ts_, options_.atol_x, nullptr, options_.rtol, nullptr));

  const std::string type = string_option("-ts_type", options_.type);
  check_type(type);
  petsc_check(TSSetType(ts_, type.c_str()));
  type_ = type;
  configure_solvers();
  if (contains(stubborn_types, type)) petsc_check(TSSetMaxStepRejections(ts_, 10));
  bool estimate = !contains(fixed_types, type);
  TSAdapt adapt = nullptr;
  petsc_check(TSGetAdapt(ts_, &adapt));
  if (type == TSRK) {
    petsc_check(TSRKSetType(ts_, string_option("-ts_rk_type", options_.rk_type).c_str()));
    const PetscReal* embedded = nullptr;
    PetscBool same = PETSC_FALSE;
    petsc_check(TSRKGetTableau(ts_, nullptr, nullptr, nullptr, nullptr, &embedded, nullptr, nullptr, &same));
    first_same_as_last_ = same == PETSC_TRUE;
    estimate = embedded != nullptr;
    if (estimate) petsc_check(TSAdaptSetType(adapt, options_.adapt.c_str()));
  }
  if (std::isfinite(options_.longest_dt)) petsc_check(TSAdaptSetStepLimits(adapt, PETSC_DEFAULT, options_.longest_dt));
  check_step_limits(adapt);
  petsc_check(TSSetFromOptions(ts_));
  if (dt_ == 0) {
    read_views(comm_, solve_views);
    if (needs_jacobian()) {
      read_views(comm_, solver_views);
      read_views(comm_, ksp_views);
    }
  }

  check_control(adapt, estimate);
  longest_dt_ = longest_controlled_step();
  explicit_ = contains(explicit_types, type);
  fixed_ = explicit_ && !adaptive_;
  if (type == ts_arkode) {
    ArkodeTable table;
    petsc_check(arkode_explicit_table(ts_, &table));
    explicit_ = !table.b.empty();
    fixed_ = explicit_ && table.fixed_step;
  }

  if (has_petsc_option("-ts_atol")) {
    petsc_check(TSGetTolerances(ts_, &options_.atol_x, nullptr, nullptr, nullptr));
    options_.atol_v = options_.atol_x;
  }
  petsc_check(TSGetTolerances(ts_, nullptr, nullptr, &options_.rtol, nullptr));
  petsc_check(TSGetTimeStep(ts_, &options_.dt));
  check_positive("the absolute tolerance of positions (-ts_atol)", options_.atol_x);
  check_positive("the absolute tolerance of velocities (-ts_atol)", options_.atol_v);
  if (!std::isfinite(options_.rtol) || options_.rtol < 0)
    throw InputError("the relative tolerance (-ts_rtol) is {}, but it must be 0 or more and finite", options_.rtol);
  for (const auto& [name, value, size] : {std::tuple("-ts_rtol", options_.rtol, largest_tolerance),
                                          {"-ts_atol", options_.atol_x, largest_tolerance * options_.length}})
    if (value >= size)
      throw InputError("{} {:g} does not control errors: it allows errors as large as the solution; use one below {:g}",
                       name, value, size);
  check_positive("the time step (-ts_dt)", options_.dt);
  if (needs_jacobian()) check_solvers();

  petsc_check(TSSetExactFinalTime(ts_, TS_EXACTFINALTIME_MATCHSTEP));
  petsc_check(TSSetErrorIfStepFails(ts_, PETSC_FALSE));  // run() reports the reason
  petsc_check(TSSetPostStep(ts_, post_step));
  petsc_check(TSSetFunctionDomainError(ts_, function_domain));
  configured_size_ = 0;
  reusable_ = true;
  if (dt_ == 0) dt_ = options_.dt;
}

/// Errors: InputError for a controller without an error estimate.
void TsIntegrator::check_control(TSAdapt adapt, bool estimate) {
  TSAdaptType name_of_type = nullptr;
  petsc_check(TSAdaptGetType(adapt, &name_of_type));
  const std::string_view adapt_type = name_of_type != nullptr ? name_of_type : TSADAPTNONE;
  adaptive_ = adapt_type != TSADAPTNONE;
  if (!adaptive_) return;
  if (!contains(controllers, adapt_type))
    throw InputError("-ts_adapt_type {} does not control the error of a step; use one of {}, {}", adapt_type,
                     fmt::join(controllers, ", "), TSADAPTNONE);
  if (!estimate)
    throw InputError("-ts_adapt_type {} needs an error estimate, which {} does not have; use -ts_adapt_type none",
                     adapt_type, name());
  choose_ = adapt->ops->choose;
  adapt->ops->choose = choose;
}

PetscErrorCode TsIntegrator::choose(TSAdapt adapt, TS ts, PetscReal h, PetscInt* scheme, PetscReal* next_h,
                                    PetscBool* accept, PetscReal* error, PetscReal* absolute, PetscReal* relative) {
  void* context = nullptr;
  PetscFunctionBegin;
  PetscCall(TSGetApplicationContext(ts, &context));
  TsIntegrator& integrator = static_cast<Run*>(context)->integrator;
  PetscCall(integrator.choose_(adapt, ts, h, scheme, next_h, accept, error, absolute, relative));
  // The controller dsp also accepts errors slightly above the tolerance.
  const bool forced = adapt->always_accept || h <= (1 + PETSC_SQRT_MACHINE_EPSILON) * adapt->dt_min;
  if (*accept && *error > 1 && forced) ++integrator.statistics_.above_tolerance;
  PetscFunctionReturn(0);
}

/// Errors: InputError for a method that would evaluate one part of the forces only.
void TsIntegrator::check_arkode_splits() const {
  std::array<char, 32> text{"erk"};
  petsc_check(PetscOptionsGetString(nullptr, nullptr, "-ts_arkode_type", text.data(), text.size(), nullptr));
  petsc_check(PetscStrtolower(text.data()));
  const std::string method = text.data();
  const bool splits = method == "imex" || method == "mri", split = options_.implicit != TermGroup::all;
  if (splits && !split)
    throw InputError("-ts_arkode_type {} needs forces in two parts; use {}", method, cures({Cure::split_forces}));
  if (split && !splits)
    throw InputError(
        "the forces are in two parts, which -ts_arkode_type {} cannot treat differently; use imex, mri or {}", method,
        cures({Cure::whole_forces}));
}

void TsIntegrator::configure_solvers() {
  second_order_ = type_ == TSALPHA2;
  if (options_.implicit != TermGroup::all && !contains(split_types, type_))
    throw InputError(
        "the forces are in two parts, which -ts_type {} cannot treat differently; use -ts_type arkimex or {}", type_,
        cures({Cure::whole_forces}));
  if (type_ == "arkode") check_arkode_splits();
  if (!needs_jacobian()) return;
  petsc_check(particle_pc_register());
  SNES snes = nullptr;
  KSP ksp = nullptr;
  PC pc = nullptr;
  petsc_check(TSGetSNES(ts_, &snes));
  petsc_check(SNESGetKSP(snes, &ksp));
  petsc_check(KSPGetPC(ksp, &pc));
  petsc_check(PCSetType(pc, particle_pc));
  petsc_check(TSSetMaxSNESFailures(ts_, -1));  // rejections are limited
  if (type_ == TSARKIMEX) petsc_check(TSARKIMEXSetFullyImplicit(ts_, PetscBool(options_.implicit == TermGroup::all)));
}

/// Errors: InputError for tolerances with which the first guess, the state before the step, counts as the solution.
void TsIntegrator::check_solvers() const {
  struct Limits {
    PetscReal rtol, atol;
    PetscInt iterations;
  } newton{}, linear{};
  SNES snes = nullptr;
  KSP ksp = nullptr;
  petsc_check(TSGetSNES(ts_, &snes));
  petsc_check(SNESGetKSP(snes, &ksp));
  petsc_check(SNESGetTolerances(snes, &newton.atol, &newton.rtol, nullptr, &newton.iterations, nullptr));
  petsc_check(KSPGetTolerances(ksp, &linear.rtol, &linear.atol, nullptr, &linear.iterations));
  const Real least = std::min(options_.atol_x, options_.atol_v);
  for (const auto& [name, of] : {std::pair("snes", newton), {"ksp", linear}}) {
    if (of.rtol >= largest_tolerance)
      throw InputError("-{}_rtol {:g} lets the solver stop before it has begun; use one below {:g}", name, of.rtol,
                       largest_tolerance);
    if (of.atol > least)
      throw InputError(
          "-{}_atol {:g} lets the solver stop before it has begun; use one below the tolerance of a step, {:g} "
          "(-ts_atol)",
          name, of.atol, least);
    if (of.iterations < 1)
      throw InputError("-{}_max_it {}: the solver needs at least one iteration", name, of.iterations);
  }
}

void TsIntegrator::set_tolerances(::Vec y, std::size_t positions, std::size_t n, std::size_t unknowns) {
  const auto make = [&](Real x, Real angle, Real v, Real spin) {
    PetscVec vec;
    PetscScalar* values = nullptr;
    petsc_check(VecDuplicate(y, vec.out()));
    petsc_check(VecGetArrayWrite(vec, &values));
    std::fill_n(values, n, angle);
    std::fill_n(values, positions, x);
    std::fill_n(values + n, unknowns - n, spin);
    std::fill_n(values + n, std::min(positions, unknowns - n), v);
    petsc_check(VecRestoreArrayWrite(vec, &values));
    return vec;
  };
  const PetscVec absolute = make(options_.atol_x, options_.atol_x / options_.length, options_.atol_v,
                                 options_.atol_v / options_.length),
                 relative = make(0, 0, options_.rtol, options_.rtol);
  petsc_check(TSSetTolerances(ts_, PETSC_DECIDE, absolute, PETSC_DECIDE, relative));
}

namespace {

/// The arrays of vectors while they are read or written.
class Read {
 public:
  explicit Read(::Vec vec) : vec_(vec) { petsc_check(VecGetArrayRead(vec, &data_)); }
  ~Read() { (void)VecRestoreArrayRead(vec_, &data_); }
  Read(const Read&) = delete;
  Read& operator=(const Read&) = delete;
  operator const Real*() const { return data_; }  // NOLINT: reads as the array it is

 private:
  ::Vec vec_;
  const PetscScalar* data_ = nullptr;
};
class Write {
 public:
  explicit Write(::Vec vec) : vec_(vec) { petsc_check(VecGetArrayWrite(vec, &data_)); }
  ~Write() { (void)VecRestoreArrayWrite(vec_, &data_); }
  Write(const Write&) = delete;
  Write& operator=(const Write&) = delete;
  operator Real*() const { return data_; }  // NOLINT

 private:
  ::Vec vec_;
  PetscScalar* data_ = nullptr;
};

}  // namespace

void TsIntegrator::set_functions(Run& run) {
  const bool implicit = contains(implicit_types, type_);
  if (!implicit || options_.implicit != TermGroup::all)
    petsc_check(TSSetRHSFunction(ts_, nullptr, right_hand_side, &run));
  if (!needs_jacobian() || run.implicit == nullptr) return;
  jacobian_ = run.implicit->jacobian(second_order_ ? JacobianForm::second_order : JacobianForm::first_order,
                                     options_.jacobian, options_.implicit);
  ::Mat a = jacobian_->matrix(), p = jacobian_->preconditioner();
  if (second_order_) {
    petsc_check(TSSetI2Function(ts_, nullptr, second_order_function, &run));
    petsc_check(TSSetI2Jacobian(ts_, a, p, second_order_jacobian, &run));
  } else if (implicit || options_.implicit != TermGroup::all) {
    petsc_check(TSSetIFunction(ts_, nullptr, implicit_function, &run));
    petsc_check(TSSetIJacobian(ts_, a, p, implicit_jacobian, &run));
  } else {
    petsc_check(TSSetRHSJacobian(ts_, a, p, right_hand_side_jacobian, &run));
  }
}

PetscErrorCode TsIntegrator::right_hand_side(TS, PetscReal t, ::Vec y, ::Vec ydot, void* context) {
  return petsc_callback([&] {
    Run& run = *static_cast<Run*>(context);
    const std::size_t n = run.system.size(), unknowns = run.system.unknowns();
    const Read in(y);
    const Write out(ydot);
    run.integrator.evaluate_stage(run, t, {+out, unknowns}, [&] {
      if (run.integrator.options_.implicit == TermGroup::all) {
        run.system.rate(t, in, out);
      } else {
        std::fill_n(+out, n, 0);
        run.implicit->group_acceleration(TermGroup::rest, t, in, in + n, out + n);
      }
      ++run.integrator.statistics_.force_evaluations;
      run.check({+out, unknowns}, 0, t);
    });
  });
}

template <class Evaluate>
void TsIntegrator::evaluate_stage(Run& run, Real t, std::span<Real> rates, Evaluate&& evaluate) {
  // SUNDIALS takes NaN for an error that a shorter step recovers from; PETSc's controllers accept NaN and reject large
  // errors.
  const bool petsc = type_.find("ode") == type_.npos;
  const Real outside = petsc ? 1e30 : std::numeric_limits<Real>::quiet_NaN();
  if (outside_ && petsc) {  // the rest of a step that will be rejected
    std::ranges::fill(rates, outside);
    return;
  }
  try {
    evaluate();
  } catch (const Error& error) {
    // Nothing is rejected with a fixed step, and a shorter one does not help where the step begins.
    if (error.code() != ExitCode::numerical_failure || !adaptive_ || t == run.state.t) throw;
    last_failure_ = error.what();
    outside_ = petsc;
    std::ranges::fill(rates, outside);
  }
}

void TsIntegrator::evaluate_implicit(Run& run, Real t, const Real* x, const Real* v, Real* a) {
  const std::size_t n = run.system.size();
  ++statistics_.force_evaluations;
  try {
    if (options_.implicit == TermGroup::all)
      run.implicit->acceleration(t, x, v, a);
    else
      run.implicit->group_acceleration(options_.implicit, t, x, v, a);
    run.check({a, n}, n, t);
  } catch (const Error& error) {
    // Trial states of a solver may be anywhere. NaN makes the solver fail, and the step is tried again, shorter.
    if (error.code() != ExitCode::numerical_failure) throw;
    last_failure_ = error.what();
    std::fill_n(a, n, std::numeric_limits<Real>::quiet_NaN());
  }
}

PetscErrorCode TsIntegrator::implicit_function(TS, PetscReal t, ::Vec y, ::Vec ydot, ::Vec f, void* context) {
  return petsc_callback([&] {
    Run& run = *static_cast<Run*>(context);
    const std::size_t n = run.system.size();
    const Read in(y), rate(ydot);
    const Write out(f);
    run.integrator.evaluate_implicit(run, t, in, in + n, out + n);
    for (std::size_t k = 0; k < n; ++k) {
      out[k] = rate[k] - in[n + k];
      out[n + k] = rate[n + k] - out[n + k];
    }
  });
}

PetscErrorCode TsIntegrator::second_order_function(TS, PetscReal t, ::Vec x, ::Vec v, ::Vec a, ::Vec f, void* context) {
  return petsc_callback([&] {
    Run& run = *static_cast<Run*>(context);
    const Read positions(x), velocities(v), rate(a);
    const Write out(f);
    run.integrator.evaluate_implicit(run, t, positions, velocities, out);
    for (std::size_t k = 0; k < run.system.size(); ++k) out[k] = rate[k] - out[k];
  });
}

void TsIntegrator::update_jacobian(::Mat a, Real t, const Real* x, const Real* v, const JacobianWeights& weights) {
  ++statistics_.jacobian_evaluations;
  jacobian_->update(t, x, v, weights);
  if (a == jacobian_->matrix()) return;
  // -snes_mf_operator: a matrix of PETSc's.
  petsc_check(MatAssemblyBegin(a, MAT_FINAL_ASSEMBLY));
  petsc_check(MatAssemblyEnd(a, MAT_FINAL_ASSEMBLY));
}

PetscErrorCode TsIntegrator::right_hand_side_jacobian(TS, PetscReal t, ::Vec y, ::Mat a, ::Mat, void* context) {
  return petsc_callback([&] {
    Run& run = *static_cast<Run*>(context);
    const Read in(y);
    run.integrator.update_jacobian(a, t, in, in + run.system.size(), {0, 1, 1});
  });
}

PetscErrorCode TsIntegrator::implicit_jacobian(TS, PetscReal t, ::Vec y, ::Vec, PetscReal shift, ::Mat a, ::Mat,
                                               void* context) {
  return petsc_callback([&] {
    Run& run = *static_cast<Run*>(context);
    const Read in(y);
    run.integrator.update_jacobian(a, t, in, in + run.system.size(), {shift, -1, -1});
  });
}

PetscErrorCode TsIntegrator::second_order_jacobian(TS, PetscReal t, ::Vec x, ::Vec v, ::Vec, PetscReal shift_v,
                                                   PetscReal shift_a, ::Mat a, ::Mat, void* context) {
  return petsc_callback([&] {
    Run& run = *static_cast<Run*>(context);
    const Read positions(x), velocities(v);
    run.integrator.update_jacobian(a, t, positions, velocities, {shift_a, -1, -shift_v});
  });
}

PetscErrorCode TsIntegrator::function_domain(TS ts, PetscReal, ::Vec y, PetscBool* inside) {
  return petsc_callback([&] {
    void* context = nullptr;
    petsc_check(TSGetApplicationContext(ts, &context));
    const Read in(y);
    TsIntegrator& integrator = static_cast<Run*>(context)->integrator;
    const auto& admissible = integrator.options_.admissible;
    // One stage has left the domain of a formula: the step is rejected before the next one.
    *inside = PetscBool(!std::exchange(integrator.outside_, false) && (!admissible || admissible(in)));
  });
}

PetscErrorCode TsIntegrator::post_step(TS ts) {
  return petsc_callback([&] {
    TSConvergedReason reason;
    petsc_check(TSGetConvergedReason(ts, &reason));
    if (reason < 0) return;  // PETSc calls this after a failed step as well
    void* context = nullptr;
    petsc_check(TSGetApplicationContext(ts, &context));
    Run& run = *static_cast<Run*>(context);
    run.integrator.accept_step(run);
  });
}

std::string TsIntegrator::failure_of_trial() const {
  return last_failure_.empty() ? "" : fmt::format("; last failure in a trial step: {}", last_failure_);
}

namespace {

Real largest_difference(std::size_t n, const Real* a, const Real* b) {
  Real most = 0;
  for (std::size_t i = 0; i < n; ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}
Real largest_magnitude(std::size_t n, const Real* a) {
  Real most = 0;
  for (std::size_t i = 0; i < n; ++i) most = std::max(most, std::abs(a[i]));
  return most;
}

}  // namespace

/// The largest speed of a coordinate after a step of length dt, which the state does not have yet, and the largest
/// change of a velocity in it (0 without inertia).
std::pair<Real, Real> TsIntegrator::motion_in_step(const Run& run, Real dt) {
  const std::size_t n = run.system.positions(), coordinates = run.system.size();
  const Read y(run.y);
  if (!run.system.has_velocities()) return {largest_difference(n, y, run.state.x().data()) / dt, 0};
  const Read separate(run.v != nullptr ? run.v : run.y);
  const Real* const v = run.v != nullptr ? separate : y + coordinates;
  return {largest_magnitude(n, v), largest_difference(n, v, run.state.v().data())};
}

Real TsIntegrator::limit_motion(Run& run, Real speed, Real change, Real dt) {
  const Real fastest =
                 run.system.ranks().max(std::max(speed, run.system.outside_speed(run.state.t, run.state.x().data()))),
             acceleration = dt > 0 ? run.system.ranks().max(change) / dt : 0;
  const Real sum = fastest + std::sqrt(square(fastest) + 2 * acceleration * options_.longest_move);
  TSAdapt adapt = nullptr;
  PetscReal least = 0;
  petsc_check(TSGetAdapt(ts_, &adapt));
  petsc_check(TSAdaptGetStepLimits(adapt, &least, nullptr));
  const Real in_time = sum > 0 ? 2 * options_.longest_move / sum : longest_dt_;
  const Real longest =
      std::min(longest_dt_, std::max(in_time, 2 * least));  // PETSc demands more than the shortest step
  petsc_check(TSAdaptSetStepLimits(adapt, PETSC_DEFAULT, longest));
  return longest;
}

void TsIntegrator::accept_step(Run& run) {
  PetscReal t = 0, dt_next = 0;
  PetscInt rejected = 0;
  petsc_check(TSGetTime(ts_, &t));
  petsc_check(TSGetTimeStep(ts_, &dt_next));
  petsc_check(TSGetStepRejections(ts_, &rejected));
  const Real dt = t - run.t_before;
  const Real left = run.t_end - t;
  if (limits_motion()) {
    const auto [speed, change] = motion_in_step(run, dt);
    const Real longest = limit_motion(run, speed, change, dt);
    if (dt_next > longest && !contains(self_controlled_types, type_)) {
      dt_next = longest;
      petsc_check(TSSetTimeStep(ts_, dt_next));
    }
  }
  // A last step that misses t_end by rounding would be followed by one of 1e-16.
  const bool end = left <= 4 * std::numeric_limits<Real>::epsilon() * std::abs(run.t_end);
  if (end) {
    t = run.t_end;
    petsc_check(TSSetConvergedReason(ts_, TS_CONVERGED_TIME));
  } else if (!(t + dt_next > t)) {
    throw NumericalError(
        "the time step fell to {} at t = {} (step {}), below the rounding of t; loosen the tolerances (-ts_rtol, "
        "-ts_atol) or look for a discontinuous force{}",
        dt_next, t, run.state.step + 1, failure_of_trial());
  }
  if (adaptive_) {
    // Keep the controller's proposal: a step cut to match t_end must not become the first step of the next run.
    const bool grown_from_cut = run.cut && rejected == run.rejected_before && dt_next >= dt;
    run.cut = !end && (dt_next == left || dt_next == left / 2);
    if (!run.cut) dt_ = grown_from_cut ? std::max(dt_, dt_next) : dt_next;
  }
  // A solve has failed: the shortened step still counts as fixed.
  if (!adaptive_ && !end && (rejected != run.rejected_before || shortened_ > 0))
    petsc_check(TSSetTimeStep(ts_, std::min(dt_, left)));
  shortened_ = 0;
  run.t_before = t;
  run.store();
  run.state.t = t;
  ++run.state.step;
  ++statistics_.steps;
  statistics_.rejected += rejected - run.rejected_before;
  run.rejected_before = rejected;
  statistics_.last_dt = dt;
  run.system.accepted(t, run.state.x().data(), run.state.v().data(), dt);

  if (!run.observer) return;
  const AfterStep after = run.observer(run.state);
  run.reordered = after == AfterStep::reordered;
  if (after == AfterStep::stop || run.reordered) petsc_check(TSSetConvergedReason(ts_, TS_CONVERGED_USER));
  if (after == AfterStep::changed) {
    run.load();
    petsc_check(TSRestartStep(ts_));
  }
}

void TsIntegrator::run(SecondOrderSystem& system, State& state, Real t_end, bool /*fresh*/,
                       const StepObserver& observer) {
  // A vector in another order, maybe of another length, is another vector to PETSc.
  while (solve(system, state, t_end, observer)) {
  }
}

void TsIntegrator::check_system(const FirstOrderSystem& system) const {
  if (type_ == ts_verlet && !system.has_velocities())
    throw InputError("-ts_type {} is for motion with inertia; use another explicit type, such as rk", ts_verlet);
  if (contains(implicit_types, type_) && dynamic_cast<const ImplicitSystem*>(&system) == nullptr) {
    std::vector<std::string_view> usable(explicit_types.begin(), explicit_types.end());
    if (!system.has_velocities()) std::erase(usable, ts_verlet);
    throw InputError("{} needs derivatives of the forces, which this system does not have; use -ts_type {}", name(),
                     fmt::join(usable, ", "));
  }
}

void TsIntegrator::run(FirstOrderSystem& system, State& state, Real t_end, const StepObserver& observer) {
  while (solve(system, state, t_end, observer)) {
  }
}

bool TsIntegrator::solve(FirstOrderSystem& system, State& state, Real t_end, const StepObserver& observer) {
  const std::size_t n = state.size();
  if (system.size() != n)
    throw InputError("the state has {} coordinates, but the system has {}; build both from one topology", n,
                     system.size());
  if (!system.has_velocities() && n + state.extra.size() != system.unknowns())
    throw InputError("the state has {} unknowns beside the coordinates, but the system has {}", state.extra.size(),
                     system.unknowns() - n);
  if (!std::isfinite(t_end)) throw InputError("the end of the run is {}, but it must be finite", t_end);
  check_system(system);
  auto* const with_derivatives = dynamic_cast<ImplicitSystem*>(&system);
  if (t_end - state.t <= 4 * std::numeric_limits<Real>::epsilon() * std::abs(t_end)) return false;
  const std::size_t unknowns = system.unknowns();
  const bool resized = system.ranks().any(configured_size_ != 0 && configured_size_ != unknowns);
  if (!reusable_ || resized) configure();

  PetscVec y, v;
  petsc_check(VecCreateMPI(comm_, static_cast<PetscInt>(second_order_ ? n : unknowns), PETSC_DECIDE, y.out()));
  if (second_order_) {
    petsc_check(VecDuplicate(y, v.out()));
    petsc_check(TS2SetSolution(ts_, y, v));
  } else {
    petsc_check(TSSetSolution(ts_, y));
  }
  if (resized || configured_size_ == 0)
    set_tolerances(y, system.has_velocities() ? system.positions() : unknowns, system.has_velocities() ? n : unknowns,
                   second_order_ ? n : unknowns);
  configured_size_ = unknowns;
  // TS counts steps in 32 bits; its number matters for monitors only.
  const bool countable = state.step < std::numeric_limits<PetscInt>::max() / 2;
  const auto step_number = static_cast<PetscInt>(countable ? state.step : 0);
  petsc_check(TSSetStepNumber(ts_, step_number));
  petsc_check(TSSetTime(ts_, state.t));
  petsc_check(TSSetTimeStep(ts_, std::ldexp(dt_, -2 * shortened_)));
  petsc_check(TSSetMaxTime(ts_, t_end));
  petsc_check(TSRestartStep(ts_));

  Run run{*this, system, with_derivatives, state, observer, y, v, t_end, state.t, 0, dt_ >= t_end - state.t, false};
  run.load();
  PetscInt iterations_before = 0, iterations = 0;
  if (step_number != 0) {  // else TSSolve zeroes them
    petsc_check(TSGetStepRejections(ts_, &run.rejected_before));
    petsc_check(TSGetKSPIterations(ts_, &iterations_before));
  }
  set_functions(run);
  if (limits_motion()) {
    std::vector<Real> rates(unknowns);
    if (!system.has_velocities()) system.rate(state.t, state.x().data(), rates.data());
    const Real* const speeds = system.has_velocities() ? state.v().data() : rates.data();
    const Real longest = limit_motion(run, largest_magnitude(system.positions(), speeds), 0, 0);
    if (dt_ > longest) petsc_check(TSSetTimeStep(ts_, longest));
  }
  last_failure_.clear();
  outside_ = false;
  petsc_check(TSSetApplicationContext(ts_, &run));
  reusable_ = false;
  const PetscErrorCode code = TSSolve(ts_, nullptr);
  petsc_check(TSGetKSPIterations(ts_, &iterations));
  statistics_.linear_iterations += iterations - iterations_before;
  if (code == PETSC_ERR_USER) petsc_check(code);  // thrown in a callback: arrives as it was
  try {
    petsc_check(code);
  } catch (const NumericalError& error) {
    throw NumericalError("{} failed in the step after t = {} (step {}): {}", name(), state.t, state.step, error.what());
  }
  TSConvergedReason reason;
  PetscInt rejected = 0;
  PetscReal dt = 0;
  petsc_check(TSGetConvergedReason(ts_, &reason));
  petsc_check(TSGetStepRejections(ts_, &rejected));
  petsc_check(TSGetTimeStep(ts_, &dt));
  statistics_.rejected += rejected - run.rejected_before;
  if (const auto viewer = viewer_option(comm_, "-" + std::string(converged_reason)); viewer != nullptr)
    petsc_check(PetscViewerASCIIPrintf(viewer, "TS %s due to %s, %" PetscInt_FMT " steps in all\n",
                                       reason < 0 ? "did not converge" : "converged", TSConvergedReasons[reason],
                                       static_cast<PetscInt>(statistics_.steps)));
  if (reason == TS_DIVERGED_STEP_REJECTED && contains(stubborn_types, type_) && shortened_ < most_shortened) {
    ++shortened_;
    return true;
  }
  shortened_ = 0;
  if (reason < 0)
    throw NumericalError(
        "{} failed in the step after t = {} (step {}): {}, {} rejections, dt down to {}; loosen the tolerances "
        "(-ts_rtol, -ts_atol), reduce -ts_dt or raise -ts_max_reject{}",
        name(), state.t, state.step, TSConvergedReasons[reason], rejected - run.rejected_before, dt,
        failure_of_trial());
  if (reason == TS_CONVERGED_ITS)
    throw NumericalError("the limit of steps (-ts_max_steps) was reached at t = {} of {}; raise it or leave it out",
                         state.t, t_end);
  reusable_ = true;
  return run.reordered;
}

bool TsIntegrator::needs_jacobian() const { return !contains(explicit_types, type_); }

bool TsIntegrator::explicit_fixed_step() const { return fixed_; }

Real TsIntegrator::shortest_controlled_step() const {
  if (!explicit_ || fixed_) return 0;
  TSAdapt adapt = nullptr;
  PetscReal shortest = 0;
  petsc_check(TSGetAdapt(ts_, &adapt));
  petsc_check(TSAdaptGetStepLimits(adapt, &shortest, nullptr));
  return shortest;
}

Real TsIntegrator::longest_controlled_step() const {
  if (!adaptive_) return std::numeric_limits<Real>::infinity();
  TSAdapt adapt = nullptr;
  PetscReal longest = 0;
  petsc_check(TSGetAdapt(ts_, &adapt));
  petsc_check(TSAdaptGetStepLimits(adapt, nullptr, &longest));
  return longest;
}

namespace {

PetscErrorCode shift(::TS, PetscReal, ::Vec y, ::Vec ydot, void*) {
  PetscInt n;
  const PetscScalar* from;
  PetscScalar* to;
  PetscFunctionBeginUser;
  PetscCall(VecGetLocalSize(y, &n));
  PetscCall(VecGetArrayRead(y, &from));
  PetscCall(VecGetArrayWrite(ydot, &to));
  to[0] = 0;
  std::copy_n(from, n - 1, to + 1);
  PetscCall(VecRestoreArrayWrite(ydot, &to));
  PetscCall(VecRestoreArrayRead(y, &from));
  PetscFunctionReturn(0);
}

/// For a method without a table, from a step of length 1 of ẏ_k = y_(k−1) from y = (1, 0, …): R(N) for the nilpotent
/// matrix N has the coefficients of R in its first column.
StabilityPolynomial step_of_shift(::TS ts, PetscInt stages) {
  PetscVec y;
  petsc_check(VecCreateSeq(PETSC_COMM_SELF, stages + 1, y.out()));
  petsc_check(VecSetValue(y, 0, 1, INSERT_VALUES));
  petsc_check(VecAssemblyBegin(y));
  petsc_check(VecAssemblyEnd(y));
  TSAdapt adapt = nullptr;
  petsc_check(TSGetAdapt(ts, &adapt));
  petsc_check(TSAdaptSetType(adapt, TSADAPTNONE));
  petsc_check(TSSetRHSFunction(ts, nullptr, shift, nullptr));
  petsc_check(TSSetMaxSteps(ts, 1));
  petsc_check(TSSetTimeStep(ts, 1));
  petsc_check(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_STEPOVER));
  petsc_check(TSSetSolution(ts, y));
  petsc_check(TSStep(ts));
  const Read values(y);
  return StabilityPolynomial({+values, +values + stages + 1});
}

StabilityPolynomial polynomial_of(::TS ts, const std::string& type) {
  if (type == TSRK) {
    PetscInt stages = 0;
    const PetscReal *a = nullptr, *b = nullptr;
    petsc_check(TSRKGetTableau(ts, &stages, &a, &b, nullptr, nullptr, nullptr, nullptr, nullptr));
    const auto s = static_cast<std::size_t>(stages);
    return StabilityPolynomial::of_tableau({a, s * s}, {b, s});
  }
  if (type == ts_arkode) {
    ArkodeTable table;
    petsc_check(arkode_explicit_table(ts, &table));
    return StabilityPolynomial::of_tableau(table.a, table.b);
  }
  PetscTs same;
  PetscInt stages = 1;
  petsc_check(TSCreate(PETSC_COMM_SELF, same.out()));
  petsc_check(TSSetType(same, type.c_str()));
  if (type == TSSSP) {
    TSSSPType method = nullptr;
    petsc_check(TSSSPGetType(ts, &method));
    petsc_check(TSSSPGetNumStages(ts, &stages));
    petsc_check(TSSSPSetType(same, method));
    petsc_check(TSSSPSetNumStages(same, stages));
  }
  return step_of_shift(same, stages);
}

}  // namespace

Real TsIntegrator::longest_stable_step(const FastestRates& rates) const {
  if (!explicit_) return std::numeric_limits<Real>::infinity();
  if (type_ == ts_verlet)  // Verlet refuses motion without inertia only when it runs
    return rates.oscillation > 0 ? longest_verlet_step(rates) : std::numeric_limits<Real>::infinity();
  return polynomial_of(ts_, type_).longest_step(rates);
}

std::string TsIntegrator::name() const {
  if (type_ != TSRK)
    return fmt::format("ts:{}{}", type_, options_.implicit == TermGroup::shape ? ", shape implicit" : "");
  TSRKType table = nullptr;
  petsc_check(TSRKGetType(ts_, &table));
  return fmt::format("ts:rk {}", table);
}

}  // namespace pliant
