// Meshes of closed surfaces in Python.
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include <pliant/model/surface.h>
#include <pliant/model/surface_crossing.h>
#include <pliant/python/particle_table.h>

namespace pliant::python {
namespace {

Mesh checked(TriangleMesh mesh) {
  check_crosses_nothing(relaxed_surface(mesh));
  return std::make_shared<TriangleMesh>(std::move(mesh));
}

Mesh mesh_of(const Array& vertices, const IndexArray& faces) {
  if (vertices.ndim() != 2 || vertices.shape(1) != 3 || faces.ndim() != 2 || faces.shape(1) != 3)
    throw InputError("a mesh has vertices [n, 3] and faces [m, 3]");
  TriangleMesh mesh;
  for (py::ssize_t i = 0; i < vertices.shape(0); ++i) mesh.vertices.emplace_back(vertices.data(i, 0));
  for (py::ssize_t f = 0; f < faces.shape(0); ++f)
    mesh.faces.push_back({faces.at(f, 0), faces.at(f, 1), faces.at(f, 2)});
  return checked(std::move(mesh));
}

Array vertices_of(const TriangleMesh& mesh) {
  Array all = new_array(mesh.vertices.size(), 3);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
    std::copy_n(mesh.vertices[i].data(), 3, all.mutable_data(i, 0));
  return all;
}

IndexArray faces_of(const TriangleMesh& mesh) {
  IndexArray all(std::vector<py::ssize_t>{static_cast<py::ssize_t>(mesh.faces.size()), 3});
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) std::copy_n(mesh.faces[f].data(), 3, all.mutable_data(f, 0));
  return all;
}

/// Mean rest length of an edge over the cubic root of the rest volume.
Real relative_rest_length(const TriangleMesh& mesh, Real shape_parameter) {
  const Surface surface = shape_parameter > 0 ? surface_with_shape(mesh, shape_parameter) : relaxed_surface(mesh);
  return surface.mean_rest_length() / std::cbrt(surface.volume);
}

}  // namespace

void bind_meshes(py::module_& m) {
  py::class_<TriangleMesh, std::shared_ptr<TriangleMesh>>(m, "Mesh")
      .def(py::init(&mesh_of))
      .def_static("icosphere", [](Index vertices) { return std::make_shared<TriangleMesh>(icosphere(vertices)); })
      .def_static("read", [](const std::string& file) { return checked(read_mesh(file)); })
      .def_property_readonly("vertices", &vertices_of)
      .def_property_readonly("faces", &faces_of)
      .def_property_readonly("volume", &volume)
      .def_property_readonly("area", static_cast<Real (*)(const TriangleMesh&)>(&surface_area))
      .def("relative_rest_length", &relative_rest_length);
}

}  // namespace pliant::python
