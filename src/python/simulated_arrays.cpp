// Arrays that Python and the engine share, and other data of the particles.
#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

#include <pliant/model/surface.h>
#include <pliant/python/simulated.h>

namespace pliant::python {

template <int D>
Array Simulated<D>::array(const std::string& name) {
  const EngineUse use(EngineUse::Kind::access);
  check_open();
  for (std::size_t k = 0; k < names.size(); ++k)
    if (names[k] == name) {
      if (columns(k) == 0) throw UsageError("particles of this model do not rotate, and have no {}", name);
      SharedArray& shared = arrays_[k];
      const bool derived = k == 1 && overdamped();
      if (derived) {
        check_usable();  // velocities need forces
        take_changes();
      }
      if (stale_) fetch_all();
      const bool first = !shared.array;
      if (first) shared.array = new_array(rows(k), columns(k));
      if (first || derived) fetch(k);
      shared.shown = true;
      return py::reinterpret_borrow<Array>(shared.array);
    }
  throw std::logic_error("no array " + name);
}

template <int D>
py::dict Simulated<D>::counters() const {
  const IntegratorStatistics& s = simulation().integrator().statistics();
  py::dict d;
  d["integrator"] = simulation().integrator().name();
  d["dt_critical"] = critical_;
  d["force_evaluations"] = before_.force_evaluations + s.force_evaluations;
  d["list_rebuilds"] = rebuilds_before_ + simulation().particles().neighbours().rebuilds();
  d["skin"] = simulation().particles().neighbours().skin();
  return d;
}

template <int D>
py::dict Simulated<D>::topology() const {
  const EngineUse use(EngineUse::Kind::access);
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
  if (!all.surfaces) return d;
  std::vector<Index> faces;
  for (std::size_t id = 0; id < n; ++id)
    for (const Face& face : all.surfaces->kinds[static_cast<std::size_t>(all.surfaces->kind[id])].faces)
      for (const Index i : face) faces.push_back(offset_[id] + i);
  IndexArray triangles(std::vector<py::ssize_t>{static_cast<py::ssize_t>(faces.size() / 3), 3});
  std::ranges::copy(faces, triangles.mutable_data());
  d["faces"] = triangles;
  return d;
}

template <int D>
std::optional<std::pair<std::vector<Real>, std::vector<Real>>> Simulated<D>::box() const {
  check_open();
  if (box_.open()) return {};
  return std::pair(std::vector<Real>(box_.origin().begin(), box_.origin().end()),
                   std::vector<Real>(box_.length().begin(), box_.length().end()));
}

template <int D>
py::array Simulated<D>::images() const {
  const EngineUse use(EngineUse::Kind::access);
  py::array_t<std::int64_t> all(std::vector<py::ssize_t>{static_cast<py::ssize_t>(ids_.size()), D});
  std::fill_n(all.mutable_data(), all.size(), 0);
  const State& s = simulation().state();
  for (std::size_t m = 0; m < s.images.size(); ++m)
    for (int k = 0; k < D; ++k) all.mutable_at(simulation().topology().id[m], k) = s.images[m][k];
  return all;
}

template <int D>
void Simulated<D>::gather(const Topology& topology, const Real* from, std::size_t width, Real* to) const {
  for (Index m = 0; m < topology.owned(); ++m)
    std::copy_n(from + static_cast<std::size_t>(topology.offset[m]) * width,
                static_cast<std::size_t>(topology.points_of(m)) * width,
                to + static_cast<std::size_t>(offset_[static_cast<std::size_t>(topology.id[m])]) * width);
}

template <int D>
void Simulated<D>::scatter(const Topology& topology, const Real* from, std::size_t width, Real* to) const {
  for (Index m = 0; m < topology.owned(); ++m)
    std::copy_n(from + static_cast<std::size_t>(offset_[static_cast<std::size_t>(topology.id[m])]) * width,
                static_cast<std::size_t>(topology.points_of(m)) * width,
                to + static_cast<std::size_t>(topology.offset[m]) * width);
}

template <int D>
Array Simulated<D>::by_id(const std::vector<Real>& values, int width) const {
  Array array = new_array(rows(0), static_cast<std::size_t>(width));
  gather(simulation_->topology(), values.data(), static_cast<std::size_t>(width), array.mutable_data());
  return array;
}

template <int D>
void Simulated<D>::fetch(std::size_t k) {
  if (k == 1 && overdamped()) {
    if (running_ == nullptr) settings_->restore();  // PETSc's options may belong to another simulation
    try {
      simulation_->find_velocities();
    } catch (const NumericalError&) {  // the state has no forces: a run that came there has ended with this error
      std::ranges::fill(simulation_->state().v(), std::numeric_limits<Real>::quiet_NaN());
    }
  }
  gather(simulation_->topology(), numbers(k), columns(k),
         py::reinterpret_borrow<Array>(arrays_[k].array).mutable_data());
}

template <int D>
void Simulated<D>::fetch_all() {
  for (std::size_t k = 0; k < arrays_.size(); ++k)
    if (arrays_[k].array) fetch(k);
  stale_ = false;
}

template <int D>
void Simulated<D>::show_state() {
  stale_ = true;
  bool in_use = false;
  for (SharedArray& shared : arrays_) {
    shared.shown = shared.in_use();
    in_use = in_use || shared.shown;
  }
  if (in_use) fetch_all();
}

template <int D>
void Simulated<D>::take_changes() {
  const Topology& topology = simulation_->topology();
  std::vector<Real> now;
  for (std::size_t k = 0; k < arrays_.size(); ++k) {
    SharedArray& shared = arrays_[k];
    if (!shared.shown || (k == 1 && overdamped())) continue;
    const auto array = py::reinterpret_borrow<Array>(shared.array);
    const std::span<const Real> given = numbers_of(array);
    if (given.size() != rows(k) * columns(k))
      throw InputError("{} has {} numbers, but {} belong to it; do not resize arrays of a simulation", names[k],
                       given.size(), rows(k) * columns(k));
    now.resize(given.size());
    gather(topology, numbers(k), columns(k), now.data());
    if (std::ranges::equal(now, given)) continue;
    check_finite(given, columns(k), names[k]);
    audit_->disturb(k % 2 == 0 ? EnergyAudit<D>::Change::all : EnergyAudit<D>::Change::velocities);
    scatter(topology, given.data(), columns(k), numbers(k));
    note_change();
  }
}

template Array Simulated<2>::array(const std::string&);
template py::dict Simulated<2>::counters() const;
template py::dict Simulated<2>::topology() const;
template std::optional<std::pair<std::vector<Real>, std::vector<Real>>> Simulated<2>::box() const;
template py::array Simulated<2>::images() const;
template void Simulated<2>::gather(const Topology&, const Real*, std::size_t, Real*) const;
template void Simulated<2>::scatter(const Topology&, const Real*, std::size_t, Real*) const;
template Array Simulated<2>::by_id(const std::vector<Real>&, int) const;
template void Simulated<2>::show_state();
template void Simulated<2>::take_changes();
template Array Simulated<3>::array(const std::string&);
template py::dict Simulated<3>::counters() const;
template py::dict Simulated<3>::topology() const;
template std::optional<std::pair<std::vector<Real>, std::vector<Real>>> Simulated<3>::box() const;
template py::array Simulated<3>::images() const;
template void Simulated<3>::gather(const Topology&, const Real*, std::size_t, Real*) const;
template void Simulated<3>::scatter(const Topology&, const Real*, std::size_t, Real*) const;
template Array Simulated<3>::by_id(const std::vector<Real>&, int) const;
template void Simulated<3>::show_state();
template void Simulated<3>::take_changes();

}  // namespace pliant::python
