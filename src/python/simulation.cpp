#include <pliant/python/simulation.h>

#include <pybind11/stl.h>

#include <algorithm>
#include <set>

#include <pliant/python/simulated.h>

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
