// A simulation that Python drives.
#pragma once

#include <pybind11/numpy.h>

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <pliant/base/types.h>
#include <pliant/geometry/mesh.h>
#include <pliant/python/engine.h>
#include <pliant/python/run_output.h>

namespace pliant::python {

using Array = py::array_t<Real, py::array::c_style | py::array::forcecast>;
using IndexArray = py::array_t<Index, py::array::c_style | py::array::forcecast>;

/// The faces and the shape of a closed surface.
using Mesh = std::shared_ptr<TriangleMesh>;

/// Particles as arrays: points of each particle [N], positions and velocities [points, D], and sizes [N]. Polygons and
/// closed surfaces have more than one point.
struct ParticleArrays {
  IndexArray points_of;
  Array positions, velocities;
  Array mass, diameter;      ///< diameters of points: δ of polygons and surfaces
  Array a0, l0;              ///< of polygons; a0 of surfaces, too
  std::vector<Mesh> meshes;  ///< [N] of surfaces: faces and shape at rest
  Real shape_parameter = 0;  ///< surfaces: 𝒜0; 0: 𝒜 of the mesh
};

/// How a body of walls moves from the present time on: velocity, amplitude, frequency, phase, spin, pivot.
using MotionArguments =
    std::tuple<std::vector<Real>, std::vector<Real>, Real, Real, std::vector<Real>, std::vector<Real>>;

/// A function, and the interval between its calls; none: after every step.
using Callback = std::pair<py::object, std::optional<Real>>;

/// A run that has begun, while the engine is in use (EngineUse). Until the run has ended, only the run and its
/// callbacks change the simulation.
class Run {
 public:
  virtual ~Run() = default;
  /// Integrates, without the GIL; end() throws the errors. stop: once it is true the run ends after its step. Null: in
  /// the thread that began the run, which checks signals itself.
  virtual void compute(const std::atomic<bool>* stop) noexcept = 0;
  /// After compute(), in the thread that began the run.
  virtual void end() = 0;
};

/// Any dimension. The Python class Simulation wraps it, converts arguments and documents it. Arrays are in the order of
/// the particles, which is that in which they were added; the engine's own order in memory is another.
///
/// `positions`, `velocities`, `angles` and `spins` are numpy arrays that keep their addresses while particles are
/// neither added nor removed, and outlive the simulation. The engine copies its state there when it returns to Python,
/// if the arrays are in use, and takes changes from there when it continues.
class AnySimulation {
 public:
  virtual ~AnySimulation() = default;
  virtual int dim() const = 0;
  virtual Array array(const std::string& name) = 0;

  virtual Real t() const = 0;
  virtual std::int64_t steps() const = 0;
  virtual Real dt() const = 0;
  virtual py::dict counters() const = 0;
  /// The first warning of the energy audit, once; empty without one.
  virtual std::string take_warning() = 0;
  virtual py::dict topology() const = 0;
  virtual py::array images() const = 0;

  /// For a duration, or a number of steps. callbacks: outlive the run. Errors: InputError, UsageError, NumericalError.
  virtual std::unique_ptr<Run> begin_run(std::optional<Real> duration, std::int64_t count,
                                         const std::vector<Callback>& callbacks, py::object force) = 0;
  /// Whether runs call PETSc, which serves one thread.
  virtual bool needs_petsc() const = 0;
  /// The message of the last run, if it has failed; else empty.
  virtual std::string failure() const = 0;
  virtual void stop() = 0;
  /// pressure: of the periodic box, whose size may change; none: the box is fixed.
  /// Elastic moduli at rest, without rattlers. Errors: InputError, NumericalError.
  virtual py::dict moduli(Real contact_threshold) = 0;
  virtual py::dict minimize(Real force_tolerance, std::int64_t most_iterations, std::optional<Real> pressure) = 0;
  /// Origin and lengths of the periodic box; nothing without one.
  virtual std::optional<std::pair<std::vector<Real>, std::vector<Real>>> box() const = 0;

  virtual void configure(const std::vector<std::string>& arguments) = 0;
  virtual void add(const ParticleArrays& particles) = 0;
  virtual void remove(const std::vector<Index>& indices) = 0;
  virtual void move_wall(Index body, const MotionArguments& motion) = 0;

  virtual bool inertial() const = 0;
  /// Work of the outside, and energy dissipated, since the start.
  virtual std::pair<Real, Real> work_and_heat() = 0;
  virtual py::dict energies() = 0;
  virtual py::dict forces() = 0;
  virtual py::dict contacts() = 0;
  virtual Array wall_forces() = 0;
  virtual py::dict walls() = 0;
  virtual py::tuple hessian() = 0;

  /// A run folder, from now on.
  virtual void open_output(const std::string& folder, const OutputIntervals& intervals) = 0;
  virtual void write_frame() = 0;
  virtual void write_sample() = 0;
  /// A checkpoint now; in a callback after the step.
  virtual void save() = 0;
  /// How it was made, as JSON: "dim", "arguments", "box", "gravity", "walls".
  virtual std::string description() const = 0;
  /// Whether the run so far has called functions of Python: callbacks, or a force.
  virtual bool called_functions() const = 0;
  /// The folder, or nothing.
  virtual std::optional<std::string> output() const = 0;

  /// summary.json is to name the exception that has ended the run so far; empty: none has.
  virtual void interrupt(const std::string& by) = 0;
  /// Ends the output, too.
  virtual void close() = 0;
  virtual bool closed() const = 0;
};

void bind_simulation(py::module_& m);
void bind_runs(py::module_& m);
void bind_meshes(py::module_& m);
void bind_walls(py::module_& m);
void bind_statistics(py::module_& m);
/// Closes all open simulations at the end of the interpreter, before PETSc ends.
void close_all_simulations();

}  // namespace pliant::python
