// A simulation that Python drives, in 2D or 3D. Each of the files simulated_*.cpp has the functions of one subject.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pliant/python/changeable_field.h>
#include <pliant/python/particle_table.h>
#include <pliant/python/run_output.h>
#include <pliant/python/settings.h>
#include <pliant/python/simulation.h>
#include <pliant/python/wall_record.h>
#include <pliant/python/walls.h>
#include <pliant/run/crossing_watch.h>
#include <pliant/run/energy_audit.h>
#include <pliant/run/motion_archive.h>
#include <pliant/run/passage_watch.h>
#include <pliant/run/simulation.h>
#include <pliant/ts/ts_integrator.h>

namespace pliant::python {

/// One of the arrays of an AnySimulation: created when it is first asked for.
struct SharedArray {
  py::object array;    ///< Array, or null
  bool shown = false;  ///< Python may have changed it since the engine wrote it
  bool in_use() const { return array && array.ref_count() > 1; }
};

/// The open simulations, which close at the end of the interpreter. With the GIL held.
void remember(AnySimulation& simulation);
void forget(AnySimulation& simulation);

template <int D>
class Simulated final : public AnySimulation {
 public:
  Simulated(const ParticleArrays& particles, const AnyWalls& walls, const Box<D>& box, const Vec<D>& weight,
            const std::vector<std::string>& arguments);
  /// The simulation at a checkpoint. description: JSON of description() at that time. lock: locks the folder with the
  /// checkpoint. Errors: InputError.
  Simulated(const Checkpoint& checkpoint, const nlohmann::json& description, const OutputIntervals& intervals,
            FolderLock lock);
  ~Simulated() override;
  Simulated(const Simulated&) = delete;
  Simulated& operator=(const Simulated&) = delete;

  int dim() const override { return D; }
  Array array(const std::string& name) override;

  Real t() const override { return simulation().state().t; }
  std::int64_t steps() const override { return simulation().state().step; }
  Real dt() const override { return simulation().integrator().next_dt(); }
  py::dict counters() const override;
  std::string take_warning() override { return std::exchange(warning_, {}); }
  py::dict topology() const override;
  py::array images() const override;

  std::unique_ptr<Run> begin_run(std::optional<Real> duration, std::int64_t count,
                                 const std::vector<Callback>& callbacks, py::object force) override;
  bool needs_petsc() const override { return settings_->method == Method::ts; }
  std::string failure() const override { return failed_; }
  void stop() override {
    const EngineUse use(EngineUse::Kind::access);
    if (running_ == nullptr) throw UsageError("stop() ends a run from its callback; this simulation is not running");
    stop_ = true;
  }
  py::dict moduli(Real contact_threshold) override;
  py::dict minimize(Real force_tolerance, std::int64_t most_iterations, std::optional<Real> pressure) override;
  std::optional<std::pair<std::vector<Real>, std::vector<Real>>> box() const override;

  void configure(const std::vector<std::string>& arguments) override;
  void add(const ParticleArrays& arrays) override;
  void remove(const std::vector<Index>& ids) override;
  void move_wall(Index body, const MotionArguments& arguments) override;

  bool inertial() const override { return simulation().overdamped() == nullptr; }
  std::pair<Real, Real> work_and_heat() override;
  py::dict energies() override;
  py::dict forces() override;
  py::dict contacts() override;
  Array wall_forces() override;
  py::dict walls() override;
  py::tuple hessian() override;

  void open_output(const std::string& folder, const OutputIntervals& intervals) override;
  void write_frame() override;
  void write_sample() override;
  void save() override;
  std::string description() const override;
  bool called_functions() const override { return called_functions_; }
  std::optional<std::string> output() const override {
    return output_ ? std::optional(output_->folder().string()) : std::nullopt;
  }

  void interrupt(const std::string& by) override {
    if (output_) output_->interrupt(by);
  }
  void close() override;
  bool closed() const override { return simulation_ == nullptr; }

 private:
  static constexpr std::array<const char*, 4> names{"positions", "velocities", "angles", "spins"};

  class ForceFunction;
  class Running;

  Simulation<D>& simulation() const {
    check_open();
    return *simulation_;
  }
  void check_open() const {
    if (!simulation_) throw UsageError("this simulation is closed; make another one");
  }
  /// Errors: UsageError after close, and in a force function, which the engine calls in the middle of a step.
  void check_usable() const {
    check_open();
    if (in_function_)
      throw UsageError(
          "a force function cannot change or measure its simulation, which is in the middle of a step; use its "
          "arguments, or a callback, which is called after steps");
  }
  /// Errors: InputError with an output folder: run.h5 has one list of particles.
  void keep_particles() const {
    if (output_)
      throw InputError("the particles of a simulation with an output folder ({}) are fixed; leave out output",
                       output_->folder().string());
  }
  template <class Write>
  void write(Write&& write_it) {
    const EngineUse use(EngineUse::Kind::access);
    check_usable();
    if (!output_) throw UsageError("this simulation has no output folder; give output when it is made");
    take_changes();
    write_it();
  }

  void end_output();
  /// changed: the state, by a callback after the step.
  void write_checkpoint(bool changed);
  void visit(Archive& archive, MotionNumbers& numbers);
  /// The integrator starts afresh.
  void mark_changed() {
    simulation_->changed();
    fresh_ = true;
    looked_at_.reset();
    watches_ = false;
    function_power_.reset();
    field_->start_power();
  }
  /// Changes up to now, of state, particles, parameters and walls, count as work.
  void settle();
  /// How often the audit evaluates the heat. Few particles may collide between two evaluations, and controlled steps
  /// are as long as the motion allows. Of 16 points and fewer every step counts, as their heat may change its cause.
  void follow_heat();
  /// After a step with inertia: its work and heat. function: of the run, or null.
  void follow_energy(ForceFunction* function);
  /// Errors: NumericalError if energy is not conserved.
  void judge_energy();
  /// After a change of positions, parameters or walls.
  void note_change() {
    changed_ = true;
    simulation_->forget_velocities();
    if (running_ == nullptr) mark_changed();
  }
  bool deformable() const { return simulation_->topology().deformable(); }
  bool rotates() const { return field_->rotates(); }
  /// Errors: InputError for particles that rotate, whose contacts have no second derivatives.
  void require_derivatives() const;

  // --- Construction

  std::unique_ptr<ChangeableField<D>> make_field(Settings& settings, const Walls<D>& walls) const;
  /// Without particles, which have the sizes of `all`.
  ParticleSystem<D> make_system(const Topology& all, const Walls<D>& walls, std::unique_ptr<ForceField<D>> field) const;
  /// The engine's simulation of these particles, which have no places yet, and its forces.
  std::pair<std::unique_ptr<Simulation<D>>, ChangeableField<D>*> make_engine(Topology all, const Walls<D>& walls) const;
  /// A simulation of these particles at a time, in place of the present one.
  void build(ParticleTable all, const Walls<D>& walls, Real t, std::int64_t step);
  /// Errors: InputError where a force has no direction, or particles are inside each other.
  void check_start();
  /// Errors: InputError for surfaces that pierce each other, enclose each other, or have no meaning.
  void check_surfaces_apart() requires(D == 3);
  /// The same in runs, but for enclosed surfaces. Errors: NumericalError.
  void check_surfaces_hold() requires(D == 3);
  Topology topology_by_id() const;
  /// All data by id, of the present particles.
  ParticleTable collect();
  /// A simulation of the particles that change() leaves, in place of the present one. kept: indices of the particles
  /// that remain; none: all.
  void rebuild(const std::function<void(ParticleTable&)>& change, const std::vector<Index>& kept = {});
  /// change() at once, or after the step if the simulation runs.
  void defer(std::function<void()> change) {
    deferred_.push_back(std::move(change));
    if (running_ == nullptr) apply();
  }
  void apply();

  // --- Integration

  bool has_walls() const { return simulation_->particles().walls().size() > 0; }
  CriticalStep critical_of(const ChangeableField<D>& field) const {
    return field.critical_step(simulation().topology());
  }
  bool overdamped() const { return simulation_->overdamped() != nullptr; }
  FastestRates rates_of(const Settings& settings, const CriticalStep& critical) const;
  Real standard_step(const Settings& settings, const CriticalStep& critical) const;
  void scale(TsOptions& method, const CriticalStep& critical) const;
  /// Errors: InputError for a fixed step that is unstable, and without any by which to choose it.
  Real check_step(const Settings& settings, const CriticalStep& critical) const;
  /// next: length of the next step, where it does not follow from the settings.
  void set_integrator(std::optional<Real> next = {});
  /// PETSc's options may belong to another simulation.
  void prepare();
  /// Checks from the present state on whether outlines cross and particles pass through walls. Errors: NumericalError.
  void start_watches();
  /// Errors: NumericalError for a particle within a wall or crossed by one, and where steps are fixed for one that goes
  /// so far in a step that it may meet nothing.
  void check_walls(Real step);
  /// Whether the last check_walls() was so many steps ago, or before a change.
  bool looks_after(std::int64_t count) const { return !looked_at_ || std::abs(steps() - *looked_at_) >= count; }
  Real end_of(std::optional<Real> duration, std::int64_t count) const;

  // --- Arrays

  std::size_t rows(std::size_t k) const { return k < 2 ? static_cast<std::size_t>(offset_.back()) : ids_.size(); }
  std::size_t columns(std::size_t k) const { return k < 2 ? D : rotates() ? rotations<D> : 0; }
  Real* numbers(std::size_t k) {
    State& s = simulation_->state();
    if (k < 2) return k == 0 ? s.x().data() : s.v().data();
    return k == 2 ? simulation_->angles().data() : simulation_->spins().data();
  }
  /// From the order in memory to the order of the ids [points · width], or back; owned points only.
  void gather(const Topology& topology, const Real* from, std::size_t width, Real* to) const;
  void scatter(const Topology& topology, const Real* from, std::size_t width, Real* to) const;
  Array by_id(const std::vector<Real>& values, int width) const;
  void fetch(std::size_t k);
  /// The arrays that exist have the present state.
  void fetch_all();
  /// The engine returns to Python: arrays in use change at once, others when they are asked for.
  void show_state();
  /// The engine continues, or answers a question: with the numbers that Python has written. Errors: InputError for
  /// numbers that are not finite; the state is then as it was.
  void take_changes();
  StateView<D> present() {
    check_usable();
    take_changes();
    return simulation_->view();
  }

  Box<D> box_;
  Vec<D> weight_;
  WallRecord<D> wall_record_;
  std::unique_ptr<Settings> settings_;
  std::unique_ptr<Simulation<D>> simulation_;
  ChangeableField<D>* field_ = nullptr;
  std::unique_ptr<RunOutput<D>> output_;
  std::string failed_;  ///< message of a run that failed
  std::optional<EnergyAudit<D>> audit_;
  std::int64_t judged_at_ = 0;             ///< step at which the energy was judged last
  bool watches_ = false;                   ///< start_watches() has seen the present state
  std::optional<std::int64_t> looked_at_;  ///< step of the last check_walls(); none after a change
  std::string warning_;                    ///< of the energy audit, until it is taken
  bool warned_ = false;
  CrossingWatch outlines_;
  PassageWatch<D> walls_;
  Real critical_ = 0;                   ///< longest stable step
  IntegratorStatistics before_;         ///< of earlier integrators
  std::int64_t rebuilds_before_ = 0;    ///< of lists, before a restart
  Real last_dt_ = 0;                    ///< before a restart
  bool fresh_ = true;                   ///< nothing that the integrator carries belongs to the state
  bool called_functions_ = false;       ///< callbacks, or a force function
  std::optional<Real> function_power_;  ///< of the force function, at the end of the last step
  bool in_function_ = false;            ///< a force function is being called
  bool function_acts_ = false;          ///< the numbers that the integrator carries include a force function

  std::vector<Index> offset_{0};  ///< [N + 1] first point of each particle in arrays
  std::vector<Index> ids_;        ///< [N] that Python sees
  std::vector<Index> new_ids_;    ///< of particles that are about to be added
  Index next_id_ = 0;

  std::array<SharedArray, names.size()> arrays_;
  bool stale_ = false;  ///< the arrays are older than the state

  Running* running_ = nullptr;
  bool stop_ = false, changed_ = false;
  std::vector<std::function<void()>> deferred_;
};

}  // namespace pliant::python
