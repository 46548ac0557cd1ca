#include <pliant/python/simulation.h>

#include <omp.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <tuple>

#include <pliant/base/cure.h>
#include <pliant/python/changeable_field.h>
#include <pliant/python/run_output.h>
#include <pliant/python/settings.h>
#include <pliant/python/walls.h>
#include <pliant/run/crossing_watch.h>
#include <pliant/run/frame_data.h>
#include <pliant/run/overlap_check.h>
#include <pliant/run/run_control.h>
#include <pliant/run/schedule.h>
#include <pliant/run/simulation.h>
#include <pliant/run/start_particles.h>
#include <pliant/setup/particles.h>
#include <pliant/system/fire.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

namespace pliant::python {
namespace {

/// With the GIL held.
std::set<AnySimulation*>& open_simulations() {
  static std::set<AnySimulation*> all;
  return all;
}

Array new_array(std::size_t rows, std::size_t columns) {
  Array array(std::vector<py::ssize_t>{static_cast<py::ssize_t>(rows), static_cast<py::ssize_t>(columns)});
  std::fill_n(array.mutable_data(), array.size(), 0.0);
  return array;
}

std::span<const Real> numbers_of(const Array& array) { return {array.data(), static_cast<std::size_t>(array.size())}; }

/// One of the arrays of an AnySimulation: created when it is first asked for.
struct SharedArray {
  py::object array;    ///< Array, or null
  bool shown = false;  ///< Python may have changed it since the engine wrote it
  bool in_use() const { return array && array.ref_count() > 1; }
};

/// The data of particles, in the order of the ids.
struct Particles {
  Topology topology;
  std::vector<Real> x, v, angles, spins;
  std::vector<Image> images;
  struct Contacts {
    std::string term;
    bool pairs;  ///< of particles, or of particles with walls
    int width;
    StoredContacts stored;
  };
  std::vector<Contacts> history;
};

void append(std::vector<Real>& to, std::span<const Real> from) { to.insert(to.end(), from.begin(), from.end()); }

void check_shape(const Array& array, std::size_t rows, std::size_t columns, const char* name) {
  const bool fits = columns == 0 ? array.ndim() == 1 && static_cast<std::size_t>(array.shape(0)) == rows
                                 : array.ndim() == 2 && static_cast<std::size_t>(array.shape(0)) == rows &&
                                       static_cast<std::size_t>(array.shape(1)) == columns;
  if (!fits) throw InputError("{} has not the shape of {} rows for the given particles", name, rows);
}

void check_finite(std::span<const Real> values, std::size_t columns, const char* name) {
  for (std::size_t k = 0; k < values.size(); ++k)
    if (!std::isfinite(values[k])) throw InputError("{}[{}] is {}; give finite numbers", name, k / columns, values[k]);
}

void check_positive(const Array& values, const char* name) {
  for (py::ssize_t k = 0; k < values.size(); ++k)
    if (!(values.data()[k] > 0 && std::isfinite(values.data()[k])))
      throw InputError("{}[{}] is {}, but must be positive and finite", name, k, values.data()[k]);
}

/// Appends the particles of arrays, with ids that continue the present ids.
template <int D>
void append_particles(Particles& to, const ParticleArrays& arrays) {
  const auto n = static_cast<std::size_t>(arrays.points_of.size());
  std::size_t points = 0;
  bool polygons = false;
  for (std::size_t m = 0; m < n; ++m) {
    const Index count = arrays.points_of.data()[m];
    polygons = polygons || count != 1;
    if (count != 1 && (D != 2 || count < 3))
      throw InputError("particle {} has {} points; a polygon has at least 3, in 2D, a disk or sphere has 1", m, count);
    points += static_cast<std::size_t>(count);
  }
  if (n == 0) throw InputError("there are no particles; give at least one");
  check_shape(arrays.positions, points, D, "positions");
  check_shape(arrays.velocities, points, D, "velocities");
  check_finite(numbers_of(arrays.positions), D, "positions");
  check_finite(numbers_of(arrays.velocities), D, "velocities");
  for (const auto& [array, name] : {std::pair(&arrays.mass, "mass"), std::pair(&arrays.diameter, "diameter")}) {
    check_shape(*array, n, 0, name);
    check_positive(*array, name);
  }
  if (polygons)
    for (const auto& [array, name] : {std::pair(&arrays.a0, "a0"), std::pair(&arrays.l0, "l0")}) {
      check_shape(*array, n, 0, name);
      check_positive(*array, name);
    }
  Topology& topology = to.topology;
  topology.dim = D;
  const auto first = static_cast<std::size_t>(topology.points());
  for (std::size_t m = 0; m < n; ++m) {
    if (const Index count = arrays.points_of.data()[m]; count == 1)
      topology.add_soft(arrays.diameter.data()[m], arrays.mass.data()[m]);
    else
      topology.add_polygon(count, arrays.a0.data()[m], arrays.l0.data()[m], arrays.diameter.data()[m],
                           arrays.mass.data()[m]);
  }
  append(to.x, numbers_of(arrays.positions));
  append(to.v, numbers_of(arrays.velocities));
  to.angles.resize(static_cast<std::size_t>(topology.points()) * rotations<D>, 0);
  to.spins.resize(to.angles.size(), 0);
  to.images.resize(static_cast<std::size_t>(topology.particles()));
  if constexpr (D == 2)
    for (Index m = topology.particle[first]; polygons && m < topology.particles(); ++m) {
      if (topology.points_of(m) == 1) continue;
      if (const auto fault = outline_fault(topology, m, to.x.data())) throw InputError("particle {}: {}", m, *fault);
    }
}

template <int D>
class Simulated final : public AnySimulation {
 public:
  Simulated(const ParticleArrays& particles, const AnyWalls& walls, const Box<D>& box, const Vec<D>& weight,
            const std::vector<std::string>& arguments)
      : box_(box), weight_(weight), settings_(std::make_unique<Settings>(arguments)) {
    if (walls.dim() != D) throw InputError("the walls are {}D, but the particles are {}D", walls.dim(), D);
    Particles all;
    append_particles<D>(all, particles);
    build(std::move(all), walls.get<D>(), 0, 0);
    check_start();
    open_simulations().insert(this);
  }
  ~Simulated() override {
    try {
      end_output();
    } catch (const std::exception& error) {
      PySys_WriteStderr("pliant: warning: %.900s\n", error.what());
    }
    open_simulations().erase(this);
  }
  Simulated(const Simulated&) = delete;
  Simulated& operator=(const Simulated&) = delete;

  int dim() const override { return D; }

  Array array(const std::string& name) override {
    const EngineUse use(EngineUse::Kind::access);
    check_open();
    for (std::size_t k = 0; k < names.size(); ++k)
      if (names[k] == name) {
        if (columns(k) == 0) throw UsageError("particles of this model do not rotate, and have no {}", name);
        SharedArray& shared = arrays_[k];
        if (stale_) fetch_all();
        if (!shared.array) {
          shared.array = new_array(rows(k), columns(k));
          fetch(k);
        }
        shared.shown = true;
        return py::reinterpret_borrow<Array>(shared.array);
      }
    throw std::logic_error("no array " + name);
  }

  Real t() const override { return simulation().state().t; }
  std::int64_t steps() const override { return simulation().state().step; }
  Real dt() const override { return simulation().integrator().next_dt(); }

  py::dict counters() const override {
    const IntegratorStatistics& s = simulation().integrator().statistics();
    py::dict d;
    d["integrator"] = simulation().integrator().name();
    d["dt_critical"] = critical_;
    d["force_evaluations"] = force_evaluations_ + s.force_evaluations;
    d["list_rebuilds"] = simulation().particles().neighbours().rebuilds();
    d["skin"] = simulation().particles().neighbours().skin();
    return d;
  }

  py::dict topology() const override {
    const Topology& all = simulation().topology();
    const std::size_t n = ids_.size();
    IndexArray offset(static_cast<py::ssize_t>(n + 1)), ids(static_cast<py::ssize_t>(n));
    std::ranges::copy(offset_, offset.mutable_data());
    std::ranges::copy(ids_, ids.mutable_data());
    py::dict d;
    d["offset"] = offset;
    d["ids"] = ids;
    for (const auto& [name, values] :
         {std::pair("sigma", &all.sigma), std::pair("a0", &all.a0), std::pair("l0", &all.l0)}) {
      Array column(static_cast<py::ssize_t>(n));
      for (std::size_t m = 0; m < n; ++m) column.mutable_data()[all.id[m]] = (*values)[m];
      d[name] = column;
    }
    Array mass(static_cast<py::ssize_t>(n)), diameter(static_cast<py::ssize_t>(n));
    for (std::size_t m = 0; m < n; ++m) {
      mass.mutable_data()[all.id[m]] = all.point_mass[m] * all.points_of(static_cast<Index>(m));
      diameter.mutable_data()[all.id[m]] = all.diameter[static_cast<std::size_t>(all.offset[m])];
    }
    d["mass"] = mass;
    d["diameter"] = diameter;
    return d;
  }

  py::array images() const override {
    py::array_t<std::int64_t> all(std::vector<py::ssize_t>{static_cast<py::ssize_t>(ids_.size()), D});
    std::fill_n(all.mutable_data(), all.size(), 0);
    const State& s = simulation().state();
    for (std::size_t m = 0; m < s.images.size(); ++m)
      for (int k = 0; k < D; ++k) all.mutable_at(simulation().topology().id[m], k) = s.images[m][k];
    return all;
  }

  void run(std::optional<Real> duration, std::int64_t count, const std::vector<Callback>& callbacks,
           py::object force) override {
    const EngineUse use(EngineUse::Kind::run);
    check_open();
    take_changes();
    Running running(*this, callbacks, count);
    const Real end = end_of(duration, count);
    prepare();
    const CureOptions cures([this](Cure cure) { return settings_->options.curing(cure); });
    std::unique_ptr<ForceFunction> function;
    if (!force.is_none()) {
      function = std::make_unique<ForceFunction>(*this, std::move(force), running.error);
      field_->set_function([&](const StateView<D>& s, Real* f) { (*function)(s, f); });
      simulation_->changed();
    }
    std::exception_ptr failure;
    {
      const py::gil_scoped_release released;
      omp_set_num_threads(static_cast<int>(settings_->threads));
      try {
        for (bool more = true; more;) {
          if (function) function->keep(simulation_->state());
          simulation_->advance(end, [&](State&) { return running.after_step(function.get()); });
          more = running.apply_deferred();
        }
        if (!running.error) check_walls(running.step);
      } catch (...) {
        failure = std::current_exception();
      }
      if (failure) simulation_->changed();  // the integrator may have stopped in the middle of a step
      if (function && function->failed()) function->restore(*simulation_);
    }
    if (function) {
      field_->set_function({});
      simulation_->changed();
    }
    deferred_.clear();
    show_state();
    try {
      running.error.rethrow();
      if (failure) std::rethrow_exception(failure);
    } catch (const NumericalError& error) {
      failed_ = error.what();
      throw;
    }
    check_signals();
  }

  void stop() override {
    if (running_ == nullptr) throw UsageError("stop() ends a run from its callback; this simulation is not running");
    stop_ = true;
  }

  py::dict minimize(Real force_tolerance, std::int64_t most_iterations) override {
    const EngineUse use(EngineUse::Kind::run);
    check_open();
    take_changes();
    if (!(force_tolerance > 0 && std::isfinite(force_tolerance)))
      throw InputError("force_tolerance is {}, but must be positive and finite", force_tolerance);
    if (most_iterations < 1) throw InputError("max_iterations is {}, but must be at least 1", most_iterations);
    ParticleSystem<D>& system = simulation_->particles();
    State& state = simulation_->state();
    const std::size_t n = system.positions_in(state.x()).size();
    std::vector<Real> x(state.x().begin(), state.x().end()), f;
    const Topology& topology = system.topology();
    std::vector<Real> masses;
    for (Index m = 0; m < topology.owned(); ++m)
      masses.insert(masses.end(), topology.points_of(m), topology.point_mass[m]);
    FireOptions options;
    const Real stable = field_->critical_step(topology).elastic;
    if (!std::isfinite(stable)) throw InputError("this model has no energies of contact or shape to minimise");
    options.dt = 0.1 * stable;
    options.dt_max = 0.5 * stable;
    options.force_tolerance = force_tolerance;
    options.max_iterations = most_iterations;
    PendingError error;
    RunControl control(0, 0);
    options.done = [&](const Real*) {
      if (control.due()) error.guard(check_signals);
      return static_cast<bool>(error);
    };
    FireResult result;
    {
      const py::gil_scoped_release released;
      omp_set_num_threads(static_cast<int>(settings_->threads));
      result = fire(
          std::span(x).first(n), masses,
          [&](const Real* r, Real* gradient) {
            std::copy_n(r, n, x.data());
            const StateView<D> s = system.view(x.data(), state.v().data(), state.t);
            f.assign(static_cast<std::size_t>(s.topology.points()) * (D + rotations<D>), 0);
            const Real energy = field_->energy(s, f.data());
            std::copy_n(f.data(), n, gradient);
            return energy;
          },
          options);
      std::copy_n(x.data(), n, state.x().begin());
      std::ranges::fill(state.v(), 0.0);
      system.history().clear();
      simulation_->changed();
    }
    show_state();
    error.rethrow();
    py::dict d;
    d["converged"] = result.converged;
    d["reason"] = result.reason;
    d["iterations"] = result.iterations;
    d["evaluations"] = result.evaluations;
    d["max_force"] = result.max_force;
    d["energy"] = result.energy;
    return d;
  }

  void configure(const std::vector<std::string>& arguments) override {
    const EngineUse use(EngineUse::Kind::access);
    check_open();
    auto settings = std::make_unique<Settings>(arguments);
    if (settings->model.name != settings_->model.name)
      throw InputError("the model of a simulation is {} and cannot become {}; make another simulation",
                       settings_->model.name, settings->model.name);
    auto field = make_field(*settings);
    const CriticalStep critical = field->critical_step(simulation().topology());
    check_step(*settings, critical);
    if (field_->fits(*field)) {
      field_->replace(std::move(field));
      simulation_->particles().coefficients_changed();
      settings_ = std::move(settings);
      if (settings_->dt || settings_->method == Method::ts ||
          !(standard_step(critical) > 0.8 * dt() && standard_step(critical) < 1.25 * dt()))
        defer([this] { set_integrator(); });
    } else {
      settings_ = std::move(settings);
      defer([this] { rebuild([](Particles&) {}); });
    }
    changed_ = true;
    if (running_ == nullptr) simulation_->changed();
  }

  void add(const ParticleArrays& arrays) override {
    const EngineUse use(EngineUse::Kind::access);
    check_open();
    keep_particles();
    take_changes();
    Particles trial;
    append_particles<D>(trial, arrays);
    const auto count = trial.topology.particles();
    for (Index k = 0; k < count; ++k) new_ids_.push_back(next_id_++);
    defer([this, arrays] { rebuild([&](Particles& all) { append_particles<D>(all, arrays); }); });
  }

  void remove(const std::vector<Index>& ids) override {
    const EngineUse use(EngineUse::Kind::access);
    check_open();
    keep_particles();
    take_changes();
    const std::set<Index> gone(ids.begin(), ids.end());
    for (const Index id : gone)
      if (std::ranges::find(ids_, id) == ids_.end() && std::ranges::find(new_ids_, id) == new_ids_.end())
        throw InputError("there is no particle with the id {}; see ids", id);
    if (gone.size() >= ids_.size() + new_ids_.size())
      throw InputError("remove() of all {} particles; keep at least one", gone.size());
    defer([this, gone] {
      std::vector<Index> kept;
      for (std::size_t k = 0; k < ids_.size(); ++k)
        if (!gone.contains(ids_[k])) kept.push_back(static_cast<Index>(k));
      if (kept.size() < ids_.size()) rebuild([&](Particles& all) { all = selected(all, kept); }, kept);
    });
  }

  void move_wall(Index body, const MotionArguments& arguments) override {
    const EngineUse use(EngineUse::Kind::access);
    check_open();
    Walls<D> walls = simulation().particles().walls();
    if (body < 0 || body >= walls.bodies())
      throw InputError("there is no wall {}; this simulation has {}, from 0 on", body, walls.bodies());
    walls.set_motion(body, motion_of<D>(arguments, t()));
    simulation_->particles().set_walls(std::move(walls));
    changed_ = true;
    if (running_ == nullptr) simulation_->changed();
  }

  py::dict energies() override {
    const EngineUse use(EngineUse::Kind::access);
    const StateView<D> s = present();
    py::dict d;
    for (const TermReport& term : field_->report(s))
      if (term.is_energy) d[py::str(term.name)] = term.energy;
    Real kinetic = 0;
    for (Index i = 0; i < s.topology.owned_points(); ++i) kinetic += s.kinetic_energy(i);
    d["kinetic"] = kinetic;
    return d;
  }

  py::dict forces() override {
    const EngineUse use(EngineUse::Kind::access);
    const StateView<D> s = present();
    py::dict d;
    for (const TermReport& term : field_->report(s)) d[py::str(term.name)] = by_id(term.force, D);
    std::vector<Real> f(static_cast<std::size_t>(s.topology.points()) * (D + rotations<D>));
    field_->forces(s, f.data());
    d["total"] = by_id(f, D);
    return d;
  }

  py::dict contacts() override {
    const EngineUse use(EngineUse::Kind::access);
    check_open();
    take_changes();
    FrameData<D> data(simulation_->particles(), simulation_->state());
    py::dict d;
    d["particles"] = contact_columns(data.frame.contacts);
    d["walls"] = contact_columns(data.frame.wall_contacts);
    return d;
  }

  Array wall_forces() override {
    const EngineUse use(EngineUse::Kind::access);
    const StateView<D> s = present();
    Array f = new_array(static_cast<std::size_t>(s.walls.size()), D);
    field_->add_wall_forces(s, f.mutable_data());
    return f;
  }

  py::dict walls() override {
    check_open();
    py::list segments, radius, bodies;
    const Walls<D>& walls = simulation().particles().walls();
    for (Index k = 0; k < static_cast<Index>(walls.segments().size()); ++k) {
      WallSegment wall = walls.segments()[static_cast<std::size_t>(k)];
      if constexpr (D == 2) wall = walls.segment(k, t());
      Vec<2> end = wall.end();
      for (int c = 0; c < 2; ++c)
        if (wall.direction[c] == 0) end[c] = wall.origin[c];  // the fixed coordinate of an infinite wall
      segments.append(py::make_tuple(wall.origin[0], wall.origin[1], end[0], end[1]));
      radius.append(wall.radius);
      bodies.append(walls.body_of_wall(k));
    }
    py::dict d;
    d["segments"] = segments;
    d["radius"] = radius;
    d["body"] = bodies;
    d["bodies"] = walls.bodies();
    d["walls"] = walls.size();
    return d;
  }

  py::tuple hessian() override {
    const EngineUse use(EngineUse::Kind::access);
    const StateView<D> s = present();
    if (rotates())
      throw InputError("particles of the model {} rotate, and their contacts have no second derivatives; use model sp",
                       settings_->model.name);
    struct Triplets final : BlockSink<D> {
      std::vector<Index> place;  ///< of each point, ghosts too, in the order of the ids
      std::vector<Index> rows, columns;
      std::vector<Real> values;
      void add(Index i, Index j, const Mat<D>& block) override {
        for (int a = 0; a < D; ++a)
          for (int b = 0; b < D; ++b) {
            rows.push_back(place[static_cast<std::size_t>(i)] * D + a);
            columns.push_back(place[static_cast<std::size_t>(j)] * D + b);
            values.push_back(block(a, b));
          }
      }
    } sink;
    const Topology& topology = s.topology;
    for (Index m = 0; m < topology.particles(); ++m)
      for (Index k = 0; k < topology.points_of(m); ++k) sink.place.push_back(offset_[topology.id[m]] + k);
    field_->hessian(s, sink);
    const auto size = static_cast<py::ssize_t>(sink.values.size());
    return py::make_tuple(py::array_t<Index>(size, sink.rows.data()), py::array_t<Index>(size, sink.columns.data()),
                          py::array_t<Real>(size, sink.values.data()), offset_.back() * D);
  }

  void open_output(const std::string& folder, std::optional<Real> frame_interval,
                   std::optional<Real> sample_interval) override {
    const EngineUse use(EngineUse::Kind::access);
    check_open();
    take_changes();
    output_ = std::make_unique<RunOutput<D>>(folder, frame_interval, sample_interval, collect().topology,
                                             settings_->model.name, settings_->options, *simulation_);
  }
  void write_frame() override {
    write([&] { output_->write_frame(*simulation_); });
  }
  void write_sample() override {
    write([&] { output_->write_sample(*simulation_); });
  }
  std::optional<std::string> output() const override {
    return output_ ? std::optional(output_->folder().string()) : std::nullopt;
  }

  void close() override {
    if (running_ != nullptr) throw UsageError("a callback cannot close the simulation that runs; call stop()");
    if (simulation_ && output_) {
      const EngineUse use(EngineUse::Kind::access);
      take_changes();
      end_output();
    }
    simulation_.reset();
    field_ = nullptr;
    for (SharedArray& shared : arrays_) shared = {};
    open_simulations().erase(this);
  }
  bool closed() const override { return simulation_ == nullptr; }

 private:
  static constexpr std::array<const char*, 4> names{"positions", "velocities", "angles", "spins"};

  /// A function of Python as a force, and the state before the step that it may fail in.
  class ForceFunction {
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
        const auto result = Array::ensure(function_(x_, v_, s.t));
        if (!result) {
          PyErr_Clear();
          throw InputError("the force function returned no array of numbers; return one [points, {}]", D);
        }
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
    Simulated& of_;
    py::object function_;
    PendingError& error_;
    Array x_, v_;
    State kept_;
    bool failed_ = false;
  };

  /// A run: its callbacks, errors and end.
  struct Running {
    struct Call {
      const Callback* callback;
      std::optional<Schedule> schedule;
    };

    Running(Simulated& simulated, const std::vector<Callback>& callbacks, std::int64_t count)
        : of(simulated), left(count), last_t(simulated.t()) {
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
    ~Running() { of.running_ = nullptr; }
    Running(const Running&) = delete;
    Running& operator=(const Running&) = delete;

    AfterStep after_step(ForceFunction* function) {
      if (error) return AfterStep::stop;  // exception of the force function
      Simulation<D>& simulation = *of.simulation_;
      of.stale_ = true;
      if constexpr (D == 2)
        if (of.deformable()) of.outlines_.after_step(simulation.particles(), simulation.state());
      for (Call& call : calls) {
        const Real t = simulation.state().t;
        if (call.schedule && !call.schedule->due(t)) continue;
        if (call.schedule) call.schedule->done(t);
        error.guard([&] {
          of.show_state();
          call.callback->first();
          of.take_changes();
        });
        if (error) break;
      }
      if (control.due()) error.guard(check_signals);
      step = simulation.state().t - std::exchange(last_t, simulation.state().t);
      if (left > 0) --left;
      const bool changed = std::exchange(of.changed_, false), ends = error || of.stop_ || left == 0,
                 stops = ends || !of.deferred_.empty();
      if constexpr (D == 2)
        if (changed && of.deformable()) of.outlines_.after_change(simulation.particles(), simulation.state());
      if (function != nullptr) function->keep(simulation.state());
      if (!error && steps++ % 128 == 0) error.guard([&] { of.check_walls(step); });
      ended = ends || error;
      if (of.output_ && !error && (stops || changed)) of.output_->follow(simulation);
      if (stops || error) {
        if (changed) simulation.changed();
        return AfterStep::stop;
      }
      if (changed) return AfterStep::changed;
      if (!simulation.wants_sorting()) {
        if (of.output_) of.output_->follow(simulation);
        return AfterStep::proceed;
      }
      simulation.sort();
      if (of.output_) of.output_->follow(simulation);
      if constexpr (D == 2)
        if (of.deformable()) of.outlines_.after_change(simulation.particles(), simulation.state());
      return AfterStep::reordered;
    }

    /// Changes that callbacks asked for and that the integrator must not see. Returns whether the run continues.
    bool apply_deferred() {
      if (of.deferred_.empty()) return false;
      error.guard([&] { of.apply(); });
      return !error && !ended;
    }

    Simulated& of;
    std::vector<Call> calls;
    std::int64_t left;  ///< steps; −1: no limit
    std::int64_t steps = 0;
    Real last_t, step = 0;
    bool ended = false;
    PendingError error;
    RunControl control{0, 0};
  };

  Simulation<D>& simulation() const {
    check_open();
    return *simulation_;
  }
  void check_open() const {
    if (!simulation_) throw UsageError("this simulation is closed; make another one");
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
    check_open();
    if (!output_) throw UsageError("this simulation has no output folder; give output when it is made");
    take_changes();
    write_it();
  }
  void end_output() {
    if (!simulation_) return;
    if (output_ && !output_->owned()) (void)output_.release();  // its destructor would remove the lock of the parent
    if (const std::unique_ptr<RunOutput<D>> output = std::move(output_))
      output->finish(settings_->options, force_evaluations_ + simulation_->integrator().statistics().force_evaluations,
                     failed_, *simulation_);
  }
  bool deformable() const { return simulation_->topology().deformable(); }
  bool rotates() const { return field_->rotates(); }

  // --- Construction

  std::unique_ptr<ForceField<D>> make_field(Settings& settings) const {
    const Surroundings<D> surroundings{.gravity = weight_};
    settings.model.template resolve<D>(surroundings);
    return settings.model.template force_field<D>(surroundings);
  }

  /// A simulation of these particles at a time, in place of the present one.
  void build(Particles all, const Walls<D>& walls, Real t, std::int64_t step) {
    const auto n = static_cast<std::size_t>(all.topology.particles());
    auto field = std::make_unique<ChangeableField<D>>(make_field(*settings_));
    ChangeableField<D>* const changeable = field.get();
    Real width = 0;
    for (const Real sigma : all.topology.sigma) width += sigma / static_cast<Real>(n);
    const ModelKind kind = settings_->model.particles();
    if (all.topology.deformable() != settings_->model.deformable())
      throw InputError("model {} is for {}, but the particles are {}", settings_->model.name,
                       settings_->model.deformable() ? "polygons" : "disks and spheres",
                       all.topology.deformable() ? "polygons" : "disks or spheres");
    ParticleSystem<D> system({}, walls, std::move(field), settings_->skin.value_or(usual_skin(kind, D) * width),
                             Ranks(), box_);
    if (!settings_->skin) system.tune_skin();
    const std::vector<Index> offset = all.topology.offset;
    auto next =
        std::make_unique<Simulation<D>>(std::move(all.topology), std::move(system),
                                        settings_->method == Method::verlet ? Sorting::regularly : Sorting::at_start);
    next->state().t = t;
    next->place(all.x);
    // place() makes a state at rest, at time 0.
    State& state = next->state();
    state.t = t;
    state.step = step;
    offset_ = offset;
    simulation_ = std::move(next);
    field_ = changeable;
    const Topology& topology = simulation_->topology();
    ParticleSystem<D>& particles = simulation_->particles();
    scatter(topology, all.v.data(), D, state.v().data());
    if (rotates()) {
      scatter(topology, all.angles.data(), rotations<D>, particles.rotations_in(state.x()).data());
      scatter(topology, all.spins.data(), rotations<D>, particles.rotations_in(state.v()).data());
    }
    for (std::size_t m = 0; m < state.images.size(); ++m)
      for (int k = 0; k < D; ++k) state.images[m][k] += all.images[static_cast<std::size_t>(topology.id[m])][k];
    for (const Particles::Contacts& contacts : all.history)
      if (std::ranges::any_of(particles.history().tables(),
                              [&](const ContactTable& table) { return table.needs().name == contacts.term; }))
        particles.history().set(contacts.term, contacts.stored);
    simulation_->forget_all();
    const auto start = static_cast<Index>(ids_.size());
    for (auto k = start; k < static_cast<Index>(n); ++k) {
      if (new_ids_.empty()) new_ids_.push_back(next_id_++);
      ids_.push_back(new_ids_.front());
      new_ids_.erase(new_ids_.begin());
    }
    for (SharedArray& shared : arrays_) shared = {};
    stale_ = true;
    set_integrator();
  }

  /// Errors: InputError where a force has no direction, or particles are inside each other.
  void check_start() {
    const StateView<D> s = present();
    const auto id = [&](Index i) { return ids_[static_cast<std::size_t>(s.topology.id[s.topology.particle[i]])]; };
    for (const auto& [i, j] : s.neighbours.point_pairs)
      if (s.position(i) == s.position(j))
        throw InputError("particles {} and {} are at the same place, where the force has no direction; move one", id(i),
                         id(j));
    for (const auto& [i, part] : s.neighbours.walls) {
      const Real d = s.walls.distance(s.position(i), part, s.t);
      if (!s.walls.solid(part, s.t) && d == 0)
        throw InputError("particle {} is on a wall, where the force has no direction; move it", id(i));
      if (d < 0) throw InputError("particle {} is inside wall {}; move it", id(i), s.walls.wall_of_part(part));
    }
    if constexpr (D == 2)
      if (deformable()) outlines_.start(simulation_->particles(), simulation_->state());
  }

  /// All data by id, of the present particles.
  Particles collect() {
    Particles all;
    const Topology& topology = simulation_->topology();
    State& state = simulation_->state();
    const std::size_t n = ids_.size(), points = rows(0);
    std::vector<Index> order(n);
    for (std::size_t m = 0; m < n; ++m) order[static_cast<std::size_t>(topology.id[m])] = static_cast<Index>(m);
    all.topology = topology.select(order);
    all.x.resize(points * D), all.v.resize(points * D);
    all.angles.resize(points * rotations<D>), all.spins.resize(points * rotations<D>);
    gather(topology, state.x().data(), D, all.x.data());
    gather(topology, state.v().data(), D, all.v.data());
    if (rotates()) {
      gather(topology, simulation_->angles().data(), rotations<D>, all.angles.data());
      gather(topology, simulation_->spins().data(), rotations<D>, all.spins.data());
    }
    all.images.resize(n);
    for (std::size_t m = 0; m < state.images.size(); ++m)
      all.images[static_cast<std::size_t>(topology.id[m])] = state.images[m];
    for (const ContactTable& table : simulation_->particles().history().tables())
      all.history.push_back({table.needs().name, table.pairs(), table.needs().width, table.contacts()});
    return all;
  }

  /// The particles `kept`, in increasing order, with new ids.
  static Particles selected(const Particles& all, const std::vector<Index>& kept) {
    Particles some;
    some.topology = all.topology.select(kept);
    std::map<Index, Index> now;
    for (std::size_t k = 0; k < kept.size(); ++k) {
      const Index m = kept[k];
      some.topology.id[k] = static_cast<Index>(k);
      now[m] = static_cast<Index>(k);
      const auto first = static_cast<std::size_t>(all.topology.offset[m]),
                 count = static_cast<std::size_t>(all.topology.points_of(m));
      for (const auto& [to, from, width] :
           {std::tuple(&some.x, &all.x, D), std::tuple(&some.v, &all.v, D),
            std::tuple(&some.angles, &all.angles, rotations<D>), std::tuple(&some.spins, &all.spins, rotations<D>)}) {
        const auto w = static_cast<std::size_t>(width);
        append(*to, std::span(*from).subspan(first * w, count * w));
      }
      some.images.push_back(all.images[static_cast<std::size_t>(m)]);
    }
    for (const Particles::Contacts& contacts : all.history) {
      StoredContacts stored;
      for (std::size_t k = 0; k < contacts.stored.keys.size(); ++k) {
        const ContactKey& key = contacts.stored.keys[k];
        const auto first = now.find(key.first), second = now.find(key.second);
        if (first == now.end() || (contacts.pairs && second == now.end())) continue;
        stored.add({first->second, contacts.pairs ? second->second : key.second},
                   contacts.stored.row(k, contacts.width));
      }
      some.history.push_back({contacts.term, contacts.pairs, contacts.width, std::move(stored)});
    }
    return some;
  }

  template <class Change>
  void rebuild(Change&& change, const std::vector<Index>& kept = {}) {
    Particles all = collect();
    change(all);
    const Walls<D> walls = simulation_->particles().walls();
    const Real now = t();
    const std::int64_t taken = steps(), evaluations = simulation_->integrator().statistics().force_evaluations;
    const auto before = std::tuple(field_, offset_, ids_, arrays_, critical_);
    std::unique_ptr<Simulation<D>> old = std::move(simulation_);
    if (!kept.empty()) {
      std::vector<Index> ids;
      for (const Index k : kept) ids.push_back(ids_[static_cast<std::size_t>(k)]);
      ids_ = std::move(ids);
    }
    try {
      build(std::move(all), walls, now, taken);
      check_start();
    } catch (...) {
      simulation_ = std::move(old);
      std::tie(field_, offset_, ids_, arrays_, critical_) = before;
      new_ids_.clear();
      throw;
    }
    force_evaluations_ += evaluations;
  }

  /// change() at once, or after the step if the simulation runs.
  void defer(std::function<void()> change) {
    deferred_.push_back(std::move(change));
    if (running_ == nullptr) apply();
  }
  void apply() {
    const std::vector<std::function<void()>> changes = std::exchange(deferred_, {});
    for (const auto& change : changes) change();
  }

  // --- Integration

  static Real standard_step(const CriticalStep& critical) {
    return critical.standard(std::min(0.2 * critical.elastic, 0.5 * critical.damping));
  }

  /// Errors: InputError for a fixed step that is unstable, and without any by which to choose it.
  static Real check_step(const Settings& settings, const CriticalStep& critical) {
    const Real dt = settings.dt.value_or(standard_step(critical));
    if (!std::isfinite(dt)) throw InputError("nothing sets the time scale of this simulation; give -dt");
    if (settings.method == Method::verlet && dt > critical.limit() * (1 + 1e-9) && !settings.allow_unstable_dt)
      throw InputError(
          "-dt {:g} is {:.3g} times the limit of stability, {:.3g}: a dense packing would gain energy; shorten the "
          "step, leave it out, or override with -allow_unstable_dt",
          dt, dt / critical.limit(), critical.limit());
    return dt;
  }

  void set_integrator() {
    const CriticalStep critical = field_->critical_step(simulation_->topology());
    const Real dt = check_step(*settings_, critical);
    critical_ = critical.limit();
    if (settings_->method == Method::verlet) {
      settings_->options.check_consumed("-integrator verlet does not read it; name a method of PETSc");
      simulation_->set_integrator(std::make_unique<FixedStepVerlet>(dt));
    } else {
      settings_->restore();
      auto ts = std::make_unique<TsIntegrator>(
          TsOptions{.dt = dt, .implicit = settings_->implicit, .jacobian = settings_->jacobian});
      if (ts->needs_jacobian()) simulation_->particles().check_derivatives();
      settings_->options.check_consumed();
      FastestRates rates{.oscillation = 0, .drag = 0, .decay = 0};
      for (const Rates& r : {critical.crowded.translation, critical.crowded.rotation}) {
        rates.oscillation = std::max(rates.oscillation, std::sqrt(r.stiffness));
        rates.decay = std::max(rates.decay, r.damping);
      }
      critical_ = ts->longest_stable_step(rates);
      if (ts->explicit_fixed_step() && ts->next_dt() > critical_ && !settings_->allow_unstable_dt)
        throw InputError("-dt {:g} is above the limit of stability, {:.3g}; shorten the step, or use another method",
                         ts->next_dt(), critical_);
      simulation_->set_integrator(std::move(ts));
    }
    simulation_->changed();
  }

  /// PETSc's options may belong to another simulation.
  void prepare() {
    if (settings_->method == Method::ts) settings_->restore();
    if constexpr (D == 2)
      if (deformable()) outlines_.start(simulation_->particles(), simulation_->state());
  }

  /// Errors: NumericalError for a particle within a wall, and where steps are fixed for one that goes so far in a step
  /// that it may meet nothing.
  void check_walls(Real step) {
    const StateView<D> s = simulation_->view();
    const bool judged = simulation_->integrator().explicit_fixed_step() && !settings_->allow_unstable_dt;
    if (s.walls.size() > 0 || s.topology.particles() > 1)
      check_walls_hold(s, judged ? step : 0, Ranks(), cures({Cure::stiffer_walls, Cure::shorter_step}));
  }

  Real end_of(std::optional<Real> duration, std::int64_t count) const {
    if (!duration) {
      if (count < 1) throw InputError("step({}): give a positive number of steps", count);
      return t() + 1e3 * static_cast<Real>(count) * dt();
    }
    if (!(*duration > 0 && std::isfinite(*duration)))
      throw InputError("run({}): the time must be positive and finite", *duration);
    if (settings_->method == Method::verlet && *duration < dt() / 2)
      throw InputError("run({:g}): the step, {:g}, is longer; call step(), or give a shorter dt", *duration, dt());
    return t() + *duration;
  }

  // --- Arrays

  std::size_t rows(std::size_t k) const { return k < 2 ? static_cast<std::size_t>(offset_.back()) : ids_.size(); }
  std::size_t columns(std::size_t k) const { return k < 2 ? D : rotates() ? rotations<D> : 0; }
  Real* numbers(std::size_t k) {
    State& s = simulation_->state();
    if (k < 2) return k == 0 ? s.x().data() : s.v().data();
    return k == 2 ? simulation_->angles().data() : simulation_->spins().data();
  }

  /// From the order in memory to the order of the ids [points · width], or back; owned points only.
  void gather(const Topology& topology, const Real* from, std::size_t width, Real* to) const {
    for (Index m = 0; m < topology.owned(); ++m)
      std::copy_n(from + static_cast<std::size_t>(topology.offset[m]) * width,
                  static_cast<std::size_t>(topology.points_of(m)) * width,
                  to + static_cast<std::size_t>(offset_[static_cast<std::size_t>(topology.id[m])]) * width);
  }
  void scatter(const Topology& topology, const Real* from, std::size_t width, Real* to) const {
    for (Index m = 0; m < topology.owned(); ++m)
      std::copy_n(from + static_cast<std::size_t>(offset_[static_cast<std::size_t>(topology.id[m])]) * width,
                  static_cast<std::size_t>(topology.points_of(m)) * width,
                  to + static_cast<std::size_t>(topology.offset[m]) * width);
  }
  Array by_id(const std::vector<Real>& values, int width) const {
    Array array = new_array(rows(0), static_cast<std::size_t>(width));
    gather(simulation_->topology(), values.data(), static_cast<std::size_t>(width), array.mutable_data());
    return array;
  }

  void fetch(std::size_t k) {
    gather(simulation_->topology(), numbers(k), columns(k),
           py::reinterpret_borrow<Array>(arrays_[k].array).mutable_data());
  }
  /// The arrays that exist have the present state.
  void fetch_all() {
    for (std::size_t k = 0; k < arrays_.size(); ++k)
      if (arrays_[k].array) fetch(k);
    stale_ = false;
  }
  /// The engine returns to Python: arrays in use change at once, others when they are asked for.
  void show_state() {
    stale_ = true;
    bool in_use = false;
    for (SharedArray& shared : arrays_) {
      shared.shown = shared.in_use();
      in_use = in_use || shared.shown;
    }
    if (in_use) fetch_all();
  }
  /// The engine continues, or answers a question: with the numbers that Python has written. Errors: InputError for
  /// numbers that are not finite; the state is then as it was.
  void take_changes() {
    const Topology& topology = simulation_->topology();
    std::vector<Real> now;
    for (std::size_t k = 0; k < arrays_.size(); ++k) {
      SharedArray& shared = arrays_[k];
      if (!shared.shown) continue;
      const auto array = py::reinterpret_borrow<Array>(shared.array);
      const std::span<const Real> given = numbers_of(array);
      now.resize(given.size());
      gather(topology, numbers(k), columns(k), now.data());
      if (std::ranges::equal(now, given)) continue;
      check_finite(given, columns(k), names[k]);
      scatter(topology, given.data(), columns(k), numbers(k));
      changed_ = true;
      if (running_ == nullptr) simulation_->changed();
    }
  }
  StateView<D> present() {
    check_open();
    take_changes();
    return simulation_->view();
  }

  static py::dict contact_columns(const FrameContacts& contacts) {
    const auto n = static_cast<std::size_t>(contacts.count);
    IndexArray particles(std::vector<py::ssize_t>{static_cast<py::ssize_t>(n), 2});
    Array position = new_array(n, D), normal = new_array(n, D), force = new_array(n, D), overlap = new_array(n, 1);
    for (std::size_t c = 0; c < n; ++c) {
      std::copy_n(contacts.particles[c], 2, particles.mutable_data() + 2 * c);
      std::copy_n(contacts.position[c], D, position.mutable_data() + D * c);
      std::copy_n(contacts.normal[c], D, normal.mutable_data() + D * c);
      std::copy_n(contacts.force[c], D, force.mutable_data() + D * c);
      overlap.mutable_data()[c] = *contacts.overlap[c];
    }
    py::dict d;
    d["particles"] = particles;
    d["position"] = position;
    d["normal"] = normal;
    d["force"] = force;
    d["overlap"] = overlap;
    return d;
  }

  Box<D> box_;
  Vec<D> weight_;
  std::unique_ptr<Settings> settings_;
  std::unique_ptr<Simulation<D>> simulation_;
  ChangeableField<D>* field_ = nullptr;
  std::unique_ptr<RunOutput<D>> output_;
  std::string failed_;  ///< message of a run that failed
  CrossingWatch outlines_;
  Real critical_ = 0;                   ///< longest stable step
  std::int64_t force_evaluations_ = 0;  ///< of earlier integrators

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

std::unique_ptr<AnySimulation> make_simulation(int dim, const ParticleArrays& particles, const AnyWalls& walls,
                                               const std::vector<Real>& origin, const std::vector<Real>& lengths,
                                               const std::vector<Real>& weight,
                                               const std::vector<std::string>& arguments) {
  const EngineUse use(EngineUse::Kind::access);
  const auto make = [&]<int D>() -> std::unique_ptr<AnySimulation> {
    Box<D> box;
    if (!lengths.empty()) {
      Vec<D> length;
      if (lengths.size() != D) throw InputError("the box has {} lengths; give {}", lengths.size(), D);
      std::ranges::copy(lengths, length.begin());
      box = Box<D>(vector_of<D>(origin, "the origin of the box"), length);
    }
    return std::make_unique<Simulated<D>>(particles, walls, box, vector_of<D>(weight, "gravity"), arguments);
  };
  if (dim == 2) return make.template operator()<2>();
  if (dim == 3) return make.template operator()<3>();
  throw InputError("particles have {} coordinates; give 2 or 3", dim);
}

ParticleArrays arrays_of(const IndexArray& points_of, const Array& positions, const Array& velocities,
                         const Array& mass, const Array& diameter, const Array& a0, const Array& l0) {
  return {points_of, positions, velocities, mass, diameter, a0, l0};
}

}  // namespace

void close_all_simulations() {
  const std::set<AnySimulation*> all = open_simulations();
  for (AnySimulation* simulation : all) {
    try {
      simulation->close();
    } catch (const std::exception& error) {
      PySys_WriteStderr("pliant: warning: %.900s\n", error.what());
    }
  }
}

void bind_simulation(py::module_& m) {
  py::class_<ParticleArrays>(m, "ParticleArrays").def(py::init(&arrays_of));
  py::class_<AnySimulation>(m, "Simulation")
      .def(py::init(&make_simulation))
      .def_property_readonly("dim", &AnySimulation::dim)
      .def_property_readonly("t", &AnySimulation::t)
      .def_property_readonly("steps", &AnySimulation::steps)
      .def_property_readonly("dt", &AnySimulation::dt)
      .def_property_readonly("closed", &AnySimulation::closed)
      .def("array", &AnySimulation::array)
      .def("counters", &AnySimulation::counters)
      .def("topology", &AnySimulation::topology)
      .def("images", &AnySimulation::images)
      .def("run", &AnySimulation::run)
      .def("stop", &AnySimulation::stop)
      .def("minimize", &AnySimulation::minimize)
      .def("configure", &AnySimulation::configure)
      .def("add", &AnySimulation::add)
      .def("remove", &AnySimulation::remove)
      .def("move_wall", &AnySimulation::move_wall)
      .def("energies", &AnySimulation::energies)
      .def("forces", &AnySimulation::forces)
      .def("contacts", &AnySimulation::contacts)
      .def("wall_forces", &AnySimulation::wall_forces)
      .def("walls", &AnySimulation::walls)
      .def("hessian", &AnySimulation::hessian)
      .def("open_output", &AnySimulation::open_output)
      .def("write_frame", &AnySimulation::write_frame)
      .def("write_sample", &AnySimulation::write_sample)
      .def_property_readonly("output", &AnySimulation::output)
      .def("close", &AnySimulation::close);
  const py::object loads = py::module_::import("json").attr("loads");
  m.def("simulation_options", [loads] { return loads(Settings().table().dump()); });
}

}  // namespace pliant::python
