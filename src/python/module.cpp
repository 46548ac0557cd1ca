// pliant._core: the engine for the Python package `pliant`, which wraps and documents it.
#include <pliant/python/simulation.h>

PYBIND11_MODULE(_core, m) {
  m.doc() = "The compiled part of pliant. Use the functions and classes of the package instead.";
  pliant::python::bind_engine(m);
  pliant::python::bind_scenarios(m);
  pliant::python::bind_meshes(m);
  pliant::python::bind_walls(m);
  pliant::python::bind_simulation(m);
  pliant::python::bind_runs(m);
  pliant::python::bind_statistics(m);
}
