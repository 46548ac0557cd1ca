#include <pliant/python/walls.h>

#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include <pliant/python/engine.h>
#include <pliant/python/wall_record.h>
#include <pliant/scenarios/hopper/shapes.h>
#include <pliant/setup/packing.h>
#include <pliant/setup/particles.h>
#include <pliant/setup/polylines.h>

namespace pliant::python {
namespace {

std::vector<Vec<2>> corners_of(const Array& points, std::string_view name) {
  if (points.ndim() != 2 || points.shape(1) != 2) throw InputError("{} must be an array [n, 2] of coordinates", name);
  std::vector<Vec<2>> corners;
  for (py::ssize_t k = 0; k < points.shape(0); ++k) {
    corners.emplace_back(points.at(k, 0), points.at(k, 1));
    if (!corners.back().allFinite()) throw InputError("{}[{}] is not finite", name, k);
  }
  return corners;
}

/// Particles may be on both sides of these walls, and a corner is concave on one of them, where a particle touches both
/// segments. Therefore a surface, which has one friction history for each particle, ends at each corner.
WallParts two_sided(WallParts walls) {
  for (Joint& joint : walls.joints) {
    const Vec<2>&u = walls.segments[joint.before].direction, &v = walls.segments[joint.wall].direction;
    joint.convex = std::abs(u[0] * v[1] - u[1] * v[0]) < flat_turn && u.dot(v) > 0;
  }
  return walls;
}

/// Two sides, with a lip at each end and at each sharp corner.
WallParts open_polyline(const std::vector<Vec<2>>& points) {
  if (points.size() < 2) throw InputError("a wall has {} points; give at least 2", points.size());
  WallParts walls;
  for (std::size_t k = 0; k + 1 < points.size(); ++k) {
    if (points[k] == points[k + 1])
      throw InputError("points {} and {} of a wall are the same, ({:g}, {:g}); a segment must have a length", k, k + 1,
                       points[k][0], points[k][1]);
    for (std::size_t n = 0; n + 1 < k; ++n)
      if (cross_each_other(points[k], points[k + 1], points[n], points[n + 1]))
        throw InputError("segments {} and {} of a wall cross; divide it into walls that do not", n, k);
    const Real by = k == 0 ? pi : turn(points[k - 1], points[k], points[k + 1], true);
    if (k > 0) walls.joints.push_back({points[k], walls.next(), walls.next() - 1, false});
    if (std::abs(by) > sharp_turn) walls.lips.push_back({points[k], walls.next()});
    walls.segments.push_back(WallSegment::between(points[k], points[k + 1]));
  }
  walls.lips.push_back({points.back(), walls.next() - 1});
  return two_sided(std::move(walls));
}

Real positive(Real value, std::string_view name) {
  if (!(value > 0 && std::isfinite(value))) throw InputError("{} is {}, but must be positive and finite", name, value);
  return value;
}

Obstacle polygon_of(const Array& corners, std::string_view name) {
  try {
    return {make_polygon(corners_of(corners, name))};
  } catch (const InputError& error) {
    throw InputError("{}: {}", name, error.what());
  }
}

Obstacle obstacle_of(const py::handle& entry) {
  const auto tuple = py::cast<py::tuple>(entry);
  const auto kind = !tuple.empty() ? py::cast<std::string>(tuple[0]) : std::string();
  if (kind == "disk" && tuple.size() == 3)
    return {{vector_of<2>(py::cast<std::vector<Real>>(tuple[1]), "the centre of an obstacle")},
            positive(py::cast<Real>(tuple[2]), "the radius of an obstacle")};
  if (kind == "polygon" && tuple.size() == 2)
    return polygon_of(py::cast<Array>(tuple[1]), "the corners of an obstacle");
  throw InputError("an obstacle is (\"disk\", centre, radius) or (\"polygon\", corners)");
}

std::vector<Obstacle> obstacles_of(const py::iterable& entries) {
  std::vector<Obstacle> obstacles;
  for (const py::handle& entry : entries) obstacles.push_back(obstacle_of(entry));
  return obstacles;
}

/// The container with obstacles that hoppers of the program may have, too.
template <class Shape>
Container container_of(const Shape& shape, const py::iterable& entries) {
  std::vector<Obstacle> obstacles = obstacles_of(entries);
  check_obstacles(Container(shape), obstacles, 2);
  return {shape, std::move(obstacles)};
}

Container hopper_container(Real wall_distance, Real orifice, Real angle, const py::iterable& obstacles) {
  const Hopper hopper{positive(wall_distance, "wall_distance"), positive(orifice, "width"), angle};
  hopper.check();
  return container_of(hopper, obstacles);
}

Container outline_container(const Array& left, const Array& right, const py::iterable& obstacles) {
  return container_of(Vessel(corners_of(left, "left"), corners_of(right, "right")), obstacles);
}

/// Positions [points, D] in a Container, or a Box<D>.
template <int D, class Space>
Array pack_into(const Space& space, const Topology& particles, PackingParameters parameters) {
  parameters.check = [] {
    const py::gil_scoped_acquire held;
    check_signals();
  };
  Array x(std::vector<py::ssize_t>{particles.points(), D});
  Real* const to = x.mutable_data();
  const py::gil_scoped_release released;
  pack<D>(particles, space, parameters, to);
  return x;
}

/// vertices: 0 for disks (spheres), and for surfaces of a mesh.
Topology particles_to_pack(int dim, const std::vector<Real>& diameters, Index vertices, Real shape_parameter,
                           const Mesh& mesh) {
  if (dim != 2 && dim != 3) throw InputError("dim is {}, but must be 2 or 3", dim);
  if (diameters.empty()) throw InputError("there are no diameters; give at least one");
  for (const Real d : diameters) positive(d, "a diameter");
  if (mesh && (dim != 3 || vertices != 0))
    throw InputError("a mesh is the shape of particles in 3D; give it without n_vertices, and dim=3");
  if (mesh)  // at the distance of rough particles
    return make_particles(ModelKind::smooth, dim, diameters,
                          {.shape_parameter = shape_parameter, .edge_width = 1, .mesh = mesh});
  if (vertices != 0 && dim == 2 && vertices < 3)
    throw InputError("polygons have at least 3 vertices, not {}", vertices);
  return make_particles(vertices > 0 ? ModelKind::rough : ModelKind::sp, dim, diameters,
                        {.vertices = vertices, .shape_parameter = shape_parameter});
}

Array pack_container(const Container& container, int dim, const std::vector<Real>& diameters, Index vertices,
                     Real shape_parameter, const Mesh& mesh, Real fraction, std::uint64_t seed) {
  const EngineUse use(EngineUse::Kind::access);
  if (!(fraction > 0 && fraction <= 1)) throw InputError("fraction is {}, but must be above 0 and at most 1", fraction);
  const Topology particles = particles_to_pack(dim, diameters, vertices, shape_parameter, mesh);
  const PackingParameters parameters{.fraction = fraction, .seed = seed};
  return dim == 2 ? pack_into<2>(container, particles, parameters) : pack_into<3>(container, particles, parameters);
}

Array pack_box(const std::vector<Real>& origin, const std::vector<Real>& lengths, const std::vector<Real>& diameters,
               Index vertices, Real shape_parameter, const Mesh& mesh, std::uint64_t seed) {
  const EngineUse use(EngineUse::Kind::access);
  const auto dim = static_cast<int>(lengths.size());
  const Topology particles = particles_to_pack(dim, diameters, vertices, shape_parameter, mesh);
  const PackingParameters parameters{.seed = seed};
  return dim == 2 ? pack_into<2>(box_of<2>(origin, lengths), particles, parameters)
                  : pack_into<3>(box_of<3>(origin, lengths), particles, parameters);
}

std::vector<Real> diameters(Index n, const std::string& kind, Real ratio, Real fraction, Real deviation,
                            std::uint64_t seed) {
  const std::vector<std::string> kinds{"bidisperse", "normal", "mono"};
  if (n < 1) throw InputError("n is {}, but must be at least 1", n);
  if (std::ranges::find(kinds, kind) == kinds.end())
    throw InputError("the distribution '{}' is none of bidisperse, normal, mono", kind);
  if (!(ratio >= 1 && ratio <= 10)) throw InputError("ratio is {}, but must be at least 1 and at most 10", ratio);
  if (!(fraction >= 0 && fraction <= 1)) throw InputError("fraction is {}, but must be between 0 and 1", fraction);
  if (!(deviation >= 0 && deviation <= 0.3))
    throw InputError("deviation is {}, but must be at least 0 and at most 0.3", deviation);
  return draw_diameters({kind, ratio, fraction, deviation}, n, seed);
}

/// Whether two parts lie on each other along a line, or are the same disk.
bool coincide(const WallSegment& a, const WallSegment& b) {
  constexpr Real tolerance = 1e-9;
  if (a.length == 0 || b.length == 0)
    return a.length == b.length && a.radius > 0 && a.radius == b.radius && a.origin == b.origin;
  const Vec<2> to = b.origin - a.origin, normal(-a.direction[1], a.direction[0]);
  if (std::abs(normal.dot(b.direction)) > tolerance || std::abs(normal.dot(to)) > tolerance) return false;
  const Real first = a.direction.dot(to), last = first + a.direction.dot(b.direction) * b.length;
  return std::min(a.length, std::max(first, last)) - std::max<Real>(0, std::min(first, last)) > tolerance;
}

/// Vertices [Σ n, 2] of regular polygons with the areas of disks of these diameters.
Array regular_polygons(const Array& centres, const std::vector<Real>& sizes, Index vertices,
                       const std::vector<Real>& angles) {
  const std::vector<Vec<2>> places = corners_of(centres, "centres");
  if (vertices < 3) throw InputError("a polygon has at least 3 vertices, not {}", vertices);
  if (places.size() != sizes.size() || angles.size() != sizes.size())
    throw InputError("there are {} centres, {} diameters and {} angles; give equally many", places.size(), sizes.size(),
                     angles.size());
  for (const Real d : sizes) positive(d, "a diameter");
  const Topology particles = make_particles(ModelKind::rough, 2, sizes, {.vertices = vertices});
  Array x(std::vector<py::ssize_t>{particles.points(), 2});
  for (std::size_t m = 0; m < sizes.size(); ++m)
    place_particle(particles, static_cast<Index>(m), places[m].data(), angles[m], x.mutable_data());
  return x;
}

}  // namespace

template <int D>
Motion<D> motion_of(const MotionArguments& arguments, Real since) {
  const auto& [velocity, amplitude, frequency, phase, spin, pivot] = arguments;
  Motion<D> motion;
  motion.since = since;
  const auto set = [](Vec<D>& to, const std::vector<Real>& numbers, const char* name) {
    if (!numbers.empty()) to = vector_of<D>(numbers, name);
  };
  set(motion.velocity, velocity, "velocity");
  set(motion.amplitude, amplitude, "amplitude");
  set(motion.pivot, pivot, "pivot");
  if (!std::isfinite(frequency) || !std::isfinite(phase)) throw InputError("frequency and phase must be finite");
  motion.frequency = frequency;
  motion.phase = phase;
  if (!spin.empty()) {
    if constexpr (D == 2)
      motion.spin = vector_of<1>(spin, "spin")[0];
    else
      motion.spin = vector_of<3>(spin, "spin");
  }
  return motion;
}
template Motion<2> motion_of<2>(const MotionArguments&, Real);
template Motion<3> motion_of<3>(const MotionArguments&, Real);

AnyWalls::AnyWalls(int dim) {
  if (dim != 2 && dim != 3) throw InputError("dim is {}, but must be 2 or 3", dim);
  if (dim == 3) walls_.emplace<1>();
}

Index AnyWalls::add(const WallParts& parts, const MotionArguments& motion) {
  for (const WallSegment& s : parts.segments)
    if (dim() == 3 && (s.origin[0] < 0 || s.end()[0] < 0))
      throw InputError("a wall in 3D is the meridian (rho, z) of a surface of revolution: rho must not be negative");
  Body next{parts, to_json(parts), motion};
  check_coincidence(next);
  const Index body =
      std::visit([&]<int D>(Walls<D>& walls) { return walls.add(parts, motion_of<D>(motion, 0)); }, walls_);
  bodies_.push_back(std::move(next));
  return body;
}

void AnyWalls::check_coincidence(const Body& next) const {
  const auto on_each_other = [&](const Body& body) {
    if (body.motion != next.motion) return false;
    for (const WallSegment& one : body.parts.segments)
      for (const WallSegment& other : next.parts.segments)
        if (one.weight > 0 && other.weight > 0 && coincide(one, other)) return true;
    return body.record == next.record;
  };
  if (const auto found = std::ranges::find_if(bodies_, on_each_other); found != bodies_.end())
    throw InputError("the body would lie on body {} of the walls, and particles would feel both; leave one out",
                     found - bodies_.begin());
}

nlohmann::json AnyWalls::parts() const {
  nlohmann::json all = nlohmann::json::array();
  for (const Body& body : bodies_) all.push_back(body.record);
  return all;
}

Index AnyWalls::polyline(const Array& points, const MotionArguments& motion) {
  return add(open_polyline(corners_of(points, "points")), motion);
}

Index AnyWalls::polygon(const Array& corners, const MotionArguments& motion) {
  WallParts parts;
  polygon_of(corners, "the corners of a polygon").add_to(parts);
  return add(two_sided(std::move(parts)), motion);
}

Index AnyWalls::disk(const std::vector<Real>& centre, Real radius, const MotionArguments& motion) {
  WallParts parts;
  Obstacle{{vector_of<2>(centre, "centre")}, positive(radius, "radius")}.add_to(parts);
  return add(parts, motion);
}

Index AnyWalls::half_space(const std::vector<Real>& point, const std::vector<Real>& normal,
                           const MotionArguments& motion) {
  return std::visit(
      [&]<int D>(Walls<D>& walls) {
        const Vec<D> n = vector_of<D>(normal, "normal");
        if (n.norm() == 0) throw InputError("the normal of a half-space is zero, and has no direction");
        const auto solid = Solid<D>::half_space(vector_of<D>(point, "point"), n);
        Body next{{}, to_json(solid), motion};
        check_coincidence(next);
        const Index body = walls.add(solid, motion_of<D>(motion, 0));
        bodies_.push_back(std::move(next));
        return body;
      },
      walls_);
}

Index AnyWalls::container(const Container& container) { return add(container.parts(dim()), {}); }

Index AnyWalls::bodies() const {
  return std::visit([](const auto& walls) { return walls.bodies(); }, walls_);
}

void bind_walls(py::module_& m) {
  py::class_<AnyWalls>(m, "Walls")
      .def(py::init<int>())
      .def_property_readonly("dim", &AnyWalls::dim)
      .def_property_readonly("bodies", &AnyWalls::bodies)
      .def("polyline", &AnyWalls::polyline)
      .def("polygon", &AnyWalls::polygon)
      .def("disk", &AnyWalls::disk)
      .def("half_space", &AnyWalls::half_space)
      .def("container", &AnyWalls::container);
  py::class_<Container>(m, "Container")
      .def_static("hopper", hopper_container)
      .def_static("outline", outline_container)
      .def("inside", [](const Container& c, int dim, Real a, Real b) { return c.inside(dim, Vec<2>(a, b)); })
      .def_property_readonly("orifice", &Container::orifice)
      .def_property_readonly("inflow", [](const Container& c) { return std::pair(c.inflow()[0], c.inflow()[1]); })
      .def_property_readonly("upright_from", &Container::upright_from);
  m.def("pack_container", pack_container);
  m.def("pack_box", pack_box);
  m.def("diameters", diameters);
  m.def("regular_polygons", regular_polygons);
}

}  // namespace pliant::python
