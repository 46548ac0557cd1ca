#include <pliant/python/simulation.h>

#include <pybind11/stl.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <set>

#include <pliant/base/text.h>
#include <pliant/python/simulated.h>
#include <pliant/run/folder.h>

namespace pliant::python {
namespace {

/// With the GIL held.
std::set<AnySimulation*>& open_simulations() {
  static std::set<AnySimulation*> all;
  return all;
}

std::unique_ptr<AnySimulation> make_simulation(int dim, const ParticleArrays& particles, const AnyWalls& walls,
                                               const std::vector<Real>& origin, const std::vector<Real>& lengths,
                                               const std::vector<Real>& weight,
                                               const std::vector<std::string>& arguments) {
  const EngineUse use(EngineUse::Kind::access);
  const auto make = [&]<int D>() -> std::unique_ptr<AnySimulation> {
    const Box<D> box = lengths.empty() ? Box<D>() : box_of<D>(origin, lengths);
    return std::make_unique<Simulated<D>>(particles, walls, box, vector_of<D>(weight, "gravity"), arguments);
  };
  if (dim == 2) return make.template operator()<2>();
  if (dim == 3) return make.template operator()<3>();
  throw InputError("particles have {} coordinates; give 2 or 3", dim);
}

OutputIntervals intervals_of(std::optional<Real> frames, std::optional<Real> samples, std::optional<Real> checkpoints) {
  OutputIntervals intervals{frames, samples};
  if (checkpoints) intervals.checkpoints = *checkpoints;
  return intervals;
}

/// The simulation of a folder, from its newest checkpoint that can be used. Intervals that are not given are those of
/// the folder. Errors: InputError, FolderInUse.
std::unique_ptr<AnySimulation> restart_simulation(const std::string& folder, const OutputIntervals& given) {
  const EngineUse use(EngineUse::Kind::access);
  given.check();
  if (!std::filesystem::is_directory(folder)) throw InputError("{}: there is no such folder", printable(folder));
  const StoredCheckpoints stored = find_checkpoints(folder);
  std::vector<std::string> problems = stored.problems;
  for (const std::filesystem::path& file : stored.files) {
    try {
      const Checkpoint c = read_checkpoint(file);
      if (const std::string& own = c.text("scenario"); own != python_scenario)
        throw InputError("{0} holds a run of the scenario {1}; continue it with pliant.{1}(restart=\"{0}\")", folder,
                         own);
      FolderLock lock(folder);
      check_counts(
          folder,
          {static_cast<std::uint64_t>(c.integer("samples")), static_cast<std::uint64_t>(c.integer("frames")), 0},
          file.string());
      OutputIntervals intervals = given;
      const auto stored_interval = [&](const char* name) -> std::optional<Real> {
        return c.reals.contains(name) ? std::optional(c.real(name, std::numeric_limits<Real>::min())) : std::nullopt;
      };
      if (!intervals.frames) intervals.frames = stored_interval("last_frame_at_interval");
      if (!intervals.samples) intervals.samples = stored_interval("last_sample_at_interval");
      const auto description = nlohmann::json::parse(c.text("simulation"));
      if (description.at("dim") == 2) return std::make_unique<Simulated<2>>(c, description, intervals, std::move(lock));
      return std::make_unique<Simulated<3>>(c, description, intervals, std::move(lock));
    } catch (const FolderInUse&) {
      throw;
    } catch (const Error& error) {
      problems.emplace_back(error.what());
    } catch (const nlohmann::json::exception& error) {
      problems.push_back(fmt::format("{} cannot be used: {}", file.string(), error.what()));
    }
    if (std::ranges::count(problems, problems.back()) > 1) problems.pop_back();
  }
  throw InputError("{}", fmt::join(problems, "; "));
}

ParticleArrays arrays_of(const IndexArray& points_of, const Array& positions, const Array& velocities,
                         const Array& mass, const Array& diameter, const Array& a0, const Array& l0,
                         const std::vector<Mesh>& meshes, Real shape_parameter) {
  return {points_of, positions, velocities, mass, diameter, a0, l0, meshes, shape_parameter};
}

}  // namespace

void remember(AnySimulation& simulation) { open_simulations().insert(&simulation); }
void forget(AnySimulation& simulation) { open_simulations().erase(&simulation); }

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
      .def_property_readonly("called_functions", &AnySimulation::called_functions)
      .def("array", &AnySimulation::array)
      .def_property_readonly("failure", &AnySimulation::failure)
      .def("counters", &AnySimulation::counters)
      .def("take_warning", &AnySimulation::take_warning)
      .def("topology", &AnySimulation::topology)
      .def("images", &AnySimulation::images)
      .def("stop", &AnySimulation::stop)
      .def("minimize", &AnySimulation::minimize)
      .def("moduli", &AnySimulation::moduli)
      .def("box", &AnySimulation::box)
      .def("configure", &AnySimulation::configure)
      .def("add", &AnySimulation::add)
      .def("remove", &AnySimulation::remove)
      .def("move_wall", &AnySimulation::move_wall)
      .def_property_readonly("inertial", &AnySimulation::inertial)
      .def("work_and_heat", &AnySimulation::work_and_heat)
      .def("energies", &AnySimulation::energies)
      .def("forces", &AnySimulation::forces)
      .def("contacts", &AnySimulation::contacts)
      .def("wall_forces", &AnySimulation::wall_forces)
      .def("walls", &AnySimulation::walls)
      .def("hessian", &AnySimulation::hessian)
      .def("open_output", &AnySimulation::open_output)
      .def("save", &AnySimulation::save)
      .def("description", &AnySimulation::description)
      .def("write_frame", &AnySimulation::write_frame)
      .def("write_sample", &AnySimulation::write_sample)
      .def_property_readonly("output", &AnySimulation::output)
      .def("interrupt", &AnySimulation::interrupt)
      .def("close", &AnySimulation::close);
  const py::object loads = py::module_::import("json").attr("loads");
  py::class_<OutputIntervals>(m, "OutputIntervals").def(py::init(&intervals_of));
  m.def("restart_simulation", restart_simulation);
  m.def("simulation_options", [loads] { return loads(Settings().table().dump()); });
}

}  // namespace pliant::python
