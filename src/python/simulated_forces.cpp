// Energies, forces, contacts and derivatives of the present state.
#include <pybind11/stl.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include <pliant/jamming/moduli.h>
#include <pliant/python/simulated.h>
#include <pliant/run/frame_data.h>

namespace pliant::python {
namespace {

template <int D>
py::dict contact_columns(const FrameContacts& contacts) {
  const auto n = static_cast<std::size_t>(contacts.count);
  IndexArray particles(std::vector<py::ssize_t>{static_cast<py::ssize_t>(n), 2});
  Array position = new_array(n, D), normal = new_array(n, D), force = new_array(n, D), overlap = new_array(n, 1),
        friction = new_array(n, D);
  std::fill_n(friction.mutable_data(), D * n, 0.0);
  for (std::size_t c = 0; c < n; ++c) {
    std::copy_n(contacts.particles[c], 2, particles.mutable_data() + 2 * c);
    std::copy_n(contacts.position[c], D, position.mutable_data() + D * c);
    std::copy_n(contacts.normal[c], D, normal.mutable_data() + D * c);
    std::copy_n(contacts.force[c], D, force.mutable_data() + D * c);
    if (contacts.friction.data != nullptr) std::copy_n(contacts.friction[c], D, friction.mutable_data() + D * c);
    overlap.mutable_data()[c] = *contacts.overlap[c];
  }
  py::dict d;
  d["particles"] = particles;
  d["position"] = position;
  d["normal"] = normal;
  d["force"] = force;
  d["friction"] = friction;
  d["overlap"] = overlap;
  return d;
}

}  // namespace

template <int D>
py::dict Simulated<D>::energies() {
  const EngineUse use(EngineUse::Kind::access);
  const StateView<D> s = present();
  py::dict d;
  for (const TermReport& term : field_->report(s))
    if (term.has_energy) d[py::str(term.name)] = term.energy;
  if (overdamped()) return d;
  d["kinetic"] = kinetic_energy(s);
  return d;
}

template <int D>
std::pair<Real, Real> Simulated<D>::work_and_heat() {
  const EngineUse use(EngineUse::Kind::access);
  check_usable();
  take_changes();
  settle();
  return {audit_->work(), audit_->heat()};
}

template <int D>
py::dict Simulated<D>::forces() {
  const EngineUse use(EngineUse::Kind::access);
  StateView<D> s = present();
  const std::vector<Real> rest(overdamped() ? static_cast<std::size_t>(s.topology.points()) * D : 0);
  if (overdamped()) s.v = rest.data();  // forces that drag balances
  py::dict d;
  for (const TermReport& term : field_->report(s)) d[py::str(term.name)] = by_id(term.force, D);
  std::vector<Real> f(static_cast<std::size_t>(s.topology.points()) * (D + rotations<D>));
  field_->forces(s, f.data());
  d["total"] = by_id(f, D);
  return d;
}

template <int D>
py::dict Simulated<D>::contacts() {
  const EngineUse use(EngineUse::Kind::access);
  check_usable();
  take_changes();
  FrameData<D> data(simulation_->particles(), simulation_->state());
  py::dict d;
  d["particles"] = contact_columns<D>(data.frame.contacts);
  d["walls"] = contact_columns<D>(data.frame.wall_contacts);
  return d;
}

template <int D>
Array Simulated<D>::wall_forces() {
  const EngineUse use(EngineUse::Kind::access);
  const StateView<D> s = present();
  Array f = new_array(static_cast<std::size_t>(s.walls.size()), D);
  field_->add_wall_forces(s, f.mutable_data());
  return f;
}

template <int D>
py::dict Simulated<D>::walls() {
  const EngineUse use(EngineUse::Kind::access);
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
  d["drawn"] = Region<D>(*simulation_).drawn(walls, t());
  d["drawn_radius"] = wall_radii(walls);
  return d;
}

template <int D>
py::tuple Simulated<D>::hessian() {
  const EngineUse use(EngineUse::Kind::access);
  const StateView<D> s = present();
  require_derivatives();
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

template <int D>
void Simulated<D>::require_derivatives() const {
  if (rotates())
    throw InputError("particles of the model {} rotate, and their contacts have no second derivatives; use model sp",
                     settings_->model.name);
}

template <int D>
py::dict Simulated<D>::moduli(Real contact_threshold) {
  const EngineUse use(EngineUse::Kind::access);
  check_usable();
  require_derivatives();
  for (int k = 0; k < D; ++k)
    if (!box_.periodic(k))
      throw InputError("direction {} of the box is open; moduli need a box that is periodic in all directions", k);
  take_changes();
  // A copy: without rattlers the lists would change, and with them the bits of the motion.
  const Topology all = topology_by_id();
  const Walls<D>& walls = simulation_->particles().walls();
  Simulation<D> packing(all, make_system(all, walls, make_field(*settings_, walls)), Sorting::never);
  std::vector<Real> x(rows(0) * D);
  gather(simulation_->topology(), simulation_->state().x().data(), D, x.data());
  packing.place(x);
  ParticleSystem<D>& system = packing.particles();
  const std::span<const Real> at = packing.state().x();
  const ContactNetwork<D> network = contact_network<D>(system, at, contact_threshold);
  if (network.backbone == 0)
    throw NumericalError("all {} particles are rattlers, and the packing has no stiffness; compress it", ids_.size());
  const Moduli<D> m = backbone_moduli<D>(system, at, network);
  constexpr Real most = 1e-6;
  if (m.max_force > most * network.typical_force)
    throw InputError(
        "a force of {:.3g} acts on a particle, {:.3g} of the typical contact force: moduli belong to a packing at "
        "equilibrium; call minimize(force_tolerance={:.1g}) first",
        m.max_force, m.max_force / network.typical_force, 1e-3 * most * network.typical_force);
  const auto square = [](const auto& matrix) {
    const auto n = static_cast<std::size_t>(matrix.rows());
    Array array = new_array(n, n);
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t b = 0; b < n; ++b)
        array.mutable_data()[a * n + b] = matrix(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
    return array;
  };
  py::dict d;
  d["bulk"] = m.bulk();
  d["shear"] = m.shear();
  d["shear_xy"] = m.simple_shear(0, 1);
  d["stiffness"] = square(m.voigt());
  d["stress"] = square(m.stress);
  d["max_force"] = m.max_force;
  d["rattlers"] = network.rattlers;
  d["contacts"] = network.contacts;
  return d;
}

template py::dict Simulated<2>::energies();
template std::pair<Real, Real> Simulated<2>::work_and_heat();
template py::dict Simulated<2>::forces();
template py::dict Simulated<2>::contacts();
template py::dict Simulated<2>::moduli(Real);
template Array Simulated<2>::wall_forces();
template py::dict Simulated<2>::walls();
template py::tuple Simulated<2>::hessian();
template py::dict Simulated<3>::energies();
template std::pair<Real, Real> Simulated<3>::work_and_heat();
template py::dict Simulated<3>::forces();
template py::dict Simulated<3>::contacts();
template py::dict Simulated<3>::moduli(Real);
template Array Simulated<3>::wall_forces();
template py::dict Simulated<3>::walls();
template py::tuple Simulated<3>::hessian();

}  // namespace pliant::python
