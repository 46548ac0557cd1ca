// Motion: runs with callbacks and force functions, minimisation.
#include <omp.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <limits>
#include <string_view>
#include <utility>

#include <pliant/base/cure.h>
#include <pliant/jamming/minimise.h>
#include <pliant/python/simulated.h>
#include <pliant/run/overlap_check.h>
#include <pliant/run/run_control.h>
#include <pliant/run/schedule.h>
#include <pliant/run/surface_check.h>
#include <pliant/ts/verlet.h>

namespace pliant::python {
namespace {

template <int D>
Array stress_array(const BoxStress<D>& of) {
  Array stress = new_array(D, D);
  for (int a = 0; a < D; ++a)
    for (int b = 0; b < D; ++b) stress.mutable_at(a, b) = of.stress(a, b);
  return stress;
}

}  // namespace

template <int D>
py::dict Simulated<D>::minimize(Real force_tolerance, std::int64_t most_iterations, std::optional<Real> pressure) {
  const EngineUse use(EngineUse::Kind::run);
  check_open();
  take_changes();
  if (!(force_tolerance > 0 && std::isfinite(force_tolerance)))
    throw InputError("force_tolerance is {}, but must be positive and finite", force_tolerance);
  if (most_iterations < 1) throw InputError("max_iterations is {}, but must be at least 1", most_iterations);
  ParticleSystem<D>& system = simulation_->particles();
  State& state = simulation_->state();
  const CureOptions cures([this](Cure cure) { return settings_->options.curing(cure); });
  audit_->disturb();
  if (!std::isfinite(critical_of(*field_).elastic))
    throw InputError("this model has no energies of contact or shape to minimise");
  PendingError error;
  RunControl control(0, 0);
  MinimiserOptions options;
  options.pressure = pressure;
  options.force_tolerance = force_tolerance;
  options.max_iterations = most_iterations;
  options.energy_per_particle = -std::numeric_limits<Real>::infinity();  // walls and gravity have energies, too
  options.t = state.t;
  options.stop = [&] {
    if (control.due()) error.guard(check_signals);
    return static_cast<bool>(error);
  };
  const std::vector<Real> before(state.x().begin(), state.x().end());
  Minimum<D> found;
  {
    const py::gil_scoped_release released;
    omp_set_num_threads(static_cast<int>(settings_->threads));
    try {
      found = minimise<D>(system, state.x(), options);
      // Checkpoints store lists by positions at their rebuild, which know nothing of a deformation of the box.
      if (pressure) system.rebuild(state.x().data(), state.t);
      start_watches();
      std::ranges::fill(state.v(), 0.0);
      system.history().clear();
    } catch (...) {
      std::ranges::copy(before, state.x().begin());
      if (pressure && !box_.open()) system.set_box(box_);
      mark_changed();
      throw;
    }
    box_ = system.box();
    simulation_->forget_velocities();
    mark_changed();
    settle();
  }
  show_state();
  error.rethrow();
  py::dict d;
  d["converged"] = found.converged;
  d["reason"] = found.reason;
  d["iterations"] = found.iterations;
  d["evaluations"] = found.evaluations;
  d["max_force"] = found.max_force;
  d["energy"] = found.energy;
  d["stress"] = py::none();
  if (box_.volume() < std::numeric_limits<Real>::infinity() && !system.rotates_or_remembers())
    d["stress"] = stress_array(found.stress);
  return d;
}

/// A function of Python as a force, and the state before the step that it may fail in.
template <int D>
class Simulated<D>::ForceFunction {
 public:
  ForceFunction(Simulated& of, py::object function, PendingError& error)
      : of_(of),
        function_(std::move(function)),
        error_(error),
        x_(new_array(of.rows(0), D)),
        v_(new_array(of.rows(0), D)) {}
  ~ForceFunction() = default;
  ForceFunction(const ForceFunction&) = delete;
  ForceFunction& operator=(const ForceFunction&) = delete;

  /// After a failure there is no force: the run ends after the step.
  void operator()(const StateView<D>& s, Real* f) {
    if (error_) return;
    error_.guard([&] {
      const std::size_t rows = of_.rows(0);
      if (static_cast<std::size_t>(x_.shape(0)) != rows) x_ = new_array(rows, D), v_ = new_array(rows, D);
      of_.gather(s.topology, s.x, D, x_.mutable_data());
      of_.gather(s.topology, s.v, D, v_.mutable_data());
      const Array result = real_numbers(call(s.t));
      check_process();
      if (result.ndim() != 2 || static_cast<std::size_t>(result.shape(0)) != rows || result.shape(1) != D)
        throw InputError("the force function returned another shape than [{}, {}], a force for each point", rows, D);
      for (std::size_t k = 0; k < rows * D; ++k)
        if (!std::isfinite(result.data()[k]))
          throw InputError("the force function returned {} for point {}", result.data()[k], k / D);
      of_.scatter(s.topology, result.data(), D, f);
    });
    failed_ = static_cast<bool>(error_);
  }
  bool failed() const { return failed_; }
  void keep(const State& state) {
    if (!failed_) kept_ = state;
  }
  void restore(Simulation<D>& simulation) const {
    if (kept_.size() == simulation.state().size()) simulation.state() = kept_;
  }

 private:
  static Array real_numbers(const py::object& returned) {
    constexpr std::string_view kinds = "biufO";  // numpy's letters for types that become real numbers
    if (py::hasattr(returned, "mask"))
      throw InputError("the force function returned a masked array, whose masked numbers have no meaning; fill them");
    const auto given = py::array::ensure(returned);
    if (given && kinds.find(given.dtype().kind()) != std::string_view::npos)
      if (auto numbers = Array::ensure(given)) return numbers;
    PyErr_Clear();
    throw InputError("the force function returned no array of numbers; return one [points, {}]", D);
  }
  py::object call(Real t) {
    struct Calling {
      bool& flag;
      explicit Calling(bool& f) : flag(f) { flag = true; }
      ~Calling() { flag = false; }
    } const calling(of_.in_function_);
    return function_(x_, v_, t);
  }

  Simulated& of_;
  py::object function_;
  PendingError& error_;
  Array x_, v_;
  State kept_;
  bool failed_ = false;
};

template <int D>
class Simulated<D>::Running final : public Run {
 public:
  struct Call {
    const Callback* callback;
    std::optional<Schedule> schedule;
  };

  Running(Simulated& simulated, const std::vector<Callback>& callbacks, Real end, std::int64_t count)
      : of(simulated), end_t(end), left(count), last_t(simulated.t()) {
    for (const Callback& callback : callbacks) {
      Call call{&callback, {}};
      if (callback.second) {
        if (!(*callback.second > 0 && std::isfinite(*callback.second)))
          throw InputError("the interval of a callback is {}, but must be positive and finite", *callback.second);
        call.schedule.emplace(*callback.second);
        call.schedule->done(of.t());
      }
      calls.push_back(std::move(call));
    }
    of.running_ = this;
    of.stop_ = of.changed_ = false;
  }
  ~Running() override { of.running_ = nullptr; }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  void set_force(py::object force) {
    function = std::make_unique<ForceFunction>(of, std::move(force), error);
    of.field_->set_function([this](const StateView<D>& s, Real* f) { (*function)(s, f); });
  }

  void compute(const std::atomic<bool>* stop) noexcept override {
    stop_all = stop;
    omp_set_num_threads(static_cast<int>(of.settings_->threads));
    try {
      const CureOptions cures([this](Cure cure) { return of.settings_->options.curing(cure); });
      for (bool more = true; more;) {
        if (function) function->keep(of.simulation_->state());
        of.fresh_ = false;
        if (of.simulation_->wants_sorting()) {  // due since the end of the last call
          sort();
          after_change();
        }
        of.simulation_->advance(end_t, [&](State&) { return after_step(); });
        more = apply_deferred();
      }
      if (!error) {
        if (of.looks_after(steps_between_ends)) of.check_walls(step);
        of.judge_energy();
      }
      if (function && !error) of.simulation_->find_velocities();  // with the function, which ends with the run
    } catch (...) {
      failure = std::current_exception();
    }
    if (failure) of.mark_changed();  // the integrator may have stopped in the middle of a step
    if (error) of.watches_ = false;
    if (function && function->failed()) function->restore(*of.simulation_);
  }

  void end() override {
    if (function) {
      of.field_->set_function({});
      of.function_acts_ = false;
      of.mark_changed();
    }
    of.deferred_.clear();
    of.show_state();
    try {
      error.rethrow();
      if (failure) std::rethrow_exception(failure);
    } catch (const NumericalError& numerical) {
      of.failed_ = numerical.what();
      throw;
    }
  }

 private:
  AfterStep after_step() {
    if (error) return AfterStep::stop;  // exception of the force function
    Simulation<D>& simulation = *of.simulation_;
    of.stale_ = true;
    of.follow_energy(function.get());
    if (error) return AfterStep::stop;
    if constexpr (D == 2)
      if (of.deformable()) of.outlines_.after_step(simulation.particles(), simulation.state());
    of.walls_.after_step(simulation.particles(), simulation.state());
    for (Call& call : calls) {
      const Real t = simulation.state().t;
      if (call.schedule && !call.schedule->due(t)) continue;
      if (call.schedule) call.schedule->done(t);
      error.guard([&] {
        of.show_state();
        call.callback->first();
        check_process();
        of.take_changes();
      });
      if (error) break;
    }
    const bool now_and_then = control.due();
    if (stop_all != nullptr)
      of.stop_ = of.stop_ || *stop_all;
    else if (now_and_then)
      error.guard(check_signals);
    step = simulation.state().t - std::exchange(last_t, simulation.state().t);
    if (left > 0) --left;
    const bool changed = std::exchange(of.changed_, false), ends = error || of.stop_ || left == 0,
               stops = ends || !of.deferred_.empty();
    if (changed) {
      of.settle();
      of.function_power_.reset();
      of.field_->start_power();
      after_change();
    }
    if (function) function->keep(simulation.state());
    if (!error && of.looks_after(steps_between_looks)) error.keep([&] { of.check_walls(step); });
    ended = ends || error;
    const bool sorted = !stops && !error && !changed && simulation.wants_sorting();
    if (sorted) sort();
    if (of.output_ && !error) {
      const bool due = of.output_->due(simulation.state().t),
                 saves = of.deferred_.empty() && (of.output_->save_asked() || (now_and_then && of.output_->save_due()));
      // HDF5 serves one thread at a time: the thread with the GIL.
      if (due || saves)
        error.guard([&] {
          if (due) of.output_->follow(simulation, *of.audit_);
          if (saves) of.write_checkpoint(changed || (ends && function));  // the force ends with the run
        });
    }
    if (sorted) after_change();
    of.audit_->prepare(changed);
    if (stops || error) {
      if (changed) of.mark_changed();
      return AfterStep::stop;
    }
    if (changed) return AfterStep::changed;
    return sorted ? AfterStep::reordered : AfterStep::proceed;
  }

  /// A periodic box lifts particles that have fallen through it.
  void sort() {
    bool lifts = false;
    for (int k = 0; k < D; ++k) lifts = lifts || (of.weight_[k] != 0 && of.box_.periodic(k));
    if (lifts) of.audit_->disturb();
    of.simulation_->sort();
    if (lifts) of.settle();
  }

  /// Particles or walls are elsewhere, or particles are in another order.
  void after_change() {
    Simulation<D>& simulation = *of.simulation_;
    if constexpr (D == 2)
      if (of.deformable()) of.outlines_.after_change(simulation.particles(), simulation.state());
    of.walls_.start(simulation.particles(), simulation.state());
  }

  /// Changes that callbacks asked for and that the integrator must not see. Returns whether the run continues.
  bool apply_deferred() {
    if (of.deferred_.empty()) return false;
    error.guard([&] {
      of.apply();
      if (of.output_ && of.output_->save_asked()) of.write_checkpoint(false);
    });
    return !error && !ended;
  }

  Simulated& of;
  std::vector<Call> calls;
  std::unique_ptr<ForceFunction> function;
  const std::atomic<bool>* stop_all = nullptr;
  Real end_t;
  /// Checks of walls and passing particles: within calls, and where calls end, which may be after each step.
  static constexpr std::int64_t steps_between_looks = 128, steps_between_ends = 8;
  std::int64_t left;  ///< steps; −1: no limit
  Real last_t, step = 0;
  bool ended = false;
  PendingError error;
  std::exception_ptr failure;  ///< exception of the integrator
  RunControl control{0, 0};
};

template <int D>
std::unique_ptr<Run> Simulated<D>::begin_run(std::optional<Real> duration, std::int64_t count,
                                             const std::vector<Callback>& callbacks, py::object force) {
  check_open();
  take_changes();
  auto running = std::make_unique<Running>(*this, callbacks, end_of(duration, count), count);
  const CureOptions cures([this](Cure cure) { return settings_->options.curing(cure); });
  prepare();
  settle();
  audit_->prepare(fresh_);
  const bool acts = !force.is_none();
  called_functions_ |= acts || !callbacks.empty();
  if (acts) running->set_force(std::move(force));
  if (std::exchange(function_acts_, acts) != acts) mark_changed();
  return running;
}

template <int D>
void Simulated<D>::prepare() {
  if (settings_->method == Method::ts) settings_->restore();
  if (!watches_) start_watches();
}

template <int D>
void Simulated<D>::start_watches() {
  if constexpr (D == 2)
    if (deformable()) outlines_.start(simulation_->particles(), simulation_->state());
  if constexpr (D == 3)
    if (deformable()) check_surfaces_hold();
  walls_.have_inertia(!overdamped());
  walls_.allow_overlaps(settings_->allow_passing_overlap, ", or accept it with -allow_passing_overlap");
  walls_.start(simulation_->particles(), simulation_->state());
  watches_ = true;
}

template <int D>
void Simulated<D>::check_surfaces_hold() requires(D == 3) {
  const ModelChoice& model = settings_->model;
  const bool touch = !model.parameters(Role::contact_energy).empty();
  check_surfaces(
      simulation_->view(), Ranks(),
      {.contacts = touch ? fmt::format("raise {}", model.option(Role::contact_energy)) : "",
       .shape = fmt::format("raise {}, or use {}", model.options({Role::area, Role::perimeter, Role::bending}),
                            cures({Cure::shorter_step})),
       .self_crossing = "",
       .piercing_stops = touch});
}

template <int D>
void Simulated<D>::check_walls(Real step) {
  looked_at_ = steps();
  simulation_->find_velocities();
  const StateView<D> s = simulation_->view();
  const bool judged = simulation_->integrator().explicit_fixed_step() && !settings_->allow_unstable_dt;
  const std::string cure = "use " + cures({Cure::stiffer_walls, Cure::shorter_step});
  if (s.walls.size() > 0 || s.topology.particles() > 1) check_walls_hold(s, judged ? step : 0, Ranks(), cure);
  if constexpr (D == 2)
    if (deformable()) check_outlines_meet_no_wall(s, Ranks(), cure);
  if constexpr (D == 3)
    if (deformable()) check_surfaces_hold();
}

template <int D>
void Simulated<D>::follow_heat() {
  constexpr std::int64_t always = 16, seldom = 64;  // points up to which every step is sampled; steps
  const bool often = settings_->model.value(Role::kinetic_friction) > 0 || settings_->method == Method::ts;
  const std::int64_t at_first =
      often ? std::clamp<std::int64_t>(simulation_->topology().owned_points() / always, 1, seldom) : seldom;
  audit_->sample_every(at_first, std::min(at_first * at_first, seldom));
}

template <int D>
void Simulated<D>::settle() {
  audit_->settle();
  follow_heat();
}

template <int D>
void Simulated<D>::follow_energy(ForceFunction* function) {
  if (overdamped()) return;  // work and heat are integrated with the positions
  if (function == nullptr) return audit_->follow();
  // Velocity Verlet has called the function at the end of the step, other methods elsewhere.
  if (!simulation_->integrator().carries()) field_->find_function(simulation_->view());
  const Real start = function_power_.value_or(field_->first_power()),
             end = field_->function_power(simulation_->state().v().data());
  function_power_ = end;
  audit_->follow({start, end});
}

template <int D>
void Simulated<D>::judge_energy() {
  // A budget costs as much as a few evaluations of the forces; a controlled step, several.
  const std::int64_t steps_between = settings_->method == Method::ts ? 8 : 64;
  settle();
  if ((overdamped() && !settings_->droplets()) || std::abs(steps() - judged_at_) < steps_between) return;
  judged_at_ = steps();
  const EnergyBudget budget = audit_->budget();
  if (!settings_->allow_energy_error) check_energy(budget);
  if (!warned_) warning_ = energy_warning(budget);
  warned_ |= !warning_.empty();
}

template <int D>
Real Simulated<D>::end_of(std::optional<Real> duration, std::int64_t count) const {
  if (!duration) {
    if (count < 1) throw InputError("step({}): give a positive number of steps", count);
    return t() + 1e3 * static_cast<Real>(count) * dt();
  }
  if (!(*duration > 0 && std::isfinite(*duration)))
    throw InputError("run({}): the time must be positive and finite", *duration);
  if (settings_->method != Method::verlet) return t() + *duration;
  if (*duration < dt() / 2)
    throw InputError("run({:g}): the step, {:g}, is longer; call step(), or give a shorter dt", *duration, dt());
  if (!(*duration / dt() < FixedStepVerlet::most_steps))
    throw InputError("run({:g}): too many steps of {:g} to count; give a longer dt", *duration, dt());
  return t() + *duration;
}

template void Simulated<2>::settle();
template void Simulated<2>::judge_energy();
template void Simulated<2>::start_watches();
template std::unique_ptr<Run> Simulated<2>::begin_run(std::optional<Real>, std::int64_t, const std::vector<Callback>&,
                                                      py::object);
template py::dict Simulated<2>::minimize(Real, std::int64_t, std::optional<Real>);
template void Simulated<3>::settle();
template void Simulated<3>::judge_energy();
template void Simulated<3>::start_watches();
template std::unique_ptr<Run> Simulated<3>::begin_run(std::optional<Real>, std::int64_t, const std::vector<Callback>&,
                                                      py::object);
template py::dict Simulated<3>::minimize(Real, std::int64_t, std::optional<Real>);

}  // namespace pliant::python
