#include <pliant/python/particle_table.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <tuple>
#include <utility>

#include <pliant/model/surface.h>
#include <pliant/run/start_particles.h>

namespace pliant::python {
namespace {

void append(std::vector<Real>& to, std::span<const Real> from) { to.insert(to.end(), from.begin(), from.end()); }

void check_shape(const Array& array, std::size_t rows, std::size_t columns, const char* name) {
  const bool fits = columns == 0 ? array.ndim() == 1 && static_cast<std::size_t>(array.shape(0)) == rows
                                 : array.ndim() == 2 && static_cast<std::size_t>(array.shape(0)) == rows &&
                                       static_cast<std::size_t>(array.shape(1)) == columns;
  if (!fits) throw InputError("{} has not the shape of {} rows for the given particles", name, rows);
}

void check_positive(const Array& values, const char* name) {
  for (py::ssize_t k = 0; k < values.size(); ++k)
    if (!(values.data()[k] > 0 && std::isfinite(values.data()[k])))
      throw InputError("{}[{}] is {}, but must be positive and finite", name, k, values.data()[k]);
}

/// The number of a surface among the kinds, where it is new or as before.
Index kind_of(Surface surface, std::vector<Surface>& kinds) {
  const auto same = std::ranges::find_if(kinds, [&](const Surface& k) {
    return k.faces == surface.faces && k.vertices == surface.vertices && k.rest_length == surface.rest_length;
  });
  const auto number = static_cast<Index>(same - kinds.begin());
  if (same == kinds.end()) kinds.push_back(std::move(surface));
  return number;
}

void append_surfaces(Topology& topology, const ParticleArrays& arrays) {
  const auto surfaces =
      topology.surfaces ? std::make_shared<Surfaces>(*topology.surfaces) : std::make_shared<Surfaces>();
  std::map<const TriangleMesh*, Index> kinds;
  for (std::size_t m = 0; m < arrays.meshes.size(); ++m) {
    const TriangleMesh& mesh = *arrays.meshes[m];
    if (!kinds.contains(&mesh))
      kinds[&mesh] =
          kind_of(arrays.shape_parameter > 0 ? surface_with_shape(mesh, arrays.shape_parameter) : relaxed_surface(mesh),
                  surfaces->kinds);
    surfaces->add_particle(topology, kinds[&mesh], arrays.a0.data()[m], arrays.diameter.data()[m],
                           arrays.mass.data()[m]);
  }
  topology.surfaces = surfaces;
}

}  // namespace

Array new_array(std::size_t rows, std::size_t columns) {
  Array array(std::vector<py::ssize_t>{static_cast<py::ssize_t>(rows), static_cast<py::ssize_t>(columns)});
  std::fill_n(array.mutable_data(), array.size(), 0.0);
  return array;
}

void check_finite(std::span<const Real> values, std::size_t columns, const char* name) {
  constexpr Real largest = 1e150;
  for (std::size_t k = 0; k < values.size(); ++k)
    if (!(std::abs(values[k]) <= largest))
      throw InputError("{}[{}] is {}; give finite numbers of at most {:g}, whose squares are finite", name, k / columns,
                       values[k], largest);
}

template <int D>
void append_particles(ParticleTable& to, const ParticleArrays& arrays) {
  const auto n = static_cast<std::size_t>(arrays.points_of.size());
  std::size_t points = 0;
  bool polygons = false;
  for (std::size_t m = 0; m < n; ++m) {
    const Index count = arrays.points_of.data()[m];
    polygons = polygons || count != 1;
    if (count != 1 && D == 2 && count < 3)
      throw InputError("particle {} has {} points; a polygon has at least 3, a disk has 1", m, count);
    if (count != 1 && D == 3 && arrays.meshes.size() != n)
      throw InputError("particle {} has {} points, but no mesh; a sphere has 1", m, count);
    if (D == 3 && !arrays.meshes.empty() && static_cast<Index>(arrays.meshes[m]->vertices.size()) != count)
      throw InputError("surface {} has {} vertices, but its mesh has {}; give the mesh with the faces of this surface",
                       m, count, arrays.meshes[m]->vertices.size());
    points += static_cast<std::size_t>(count);
  }
  if (n == 0) throw InputError("there are no particles; give at least one");
  check_shape(arrays.positions, points, D, "positions");
  check_shape(arrays.velocities, points, D, "velocities");
  check_finite(numbers_of(arrays.positions), D, "positions");
  check_finite(numbers_of(arrays.velocities), D, "velocities");
  for (const auto& [array, name] : {std::pair(&arrays.a0, "a0"), std::pair(&arrays.l0, "l0"),
                                    std::pair(&arrays.diameter, "diameter"), std::pair(&arrays.mass, "mass")})
    check_shape(*array, n, 0, name);
  Topology& topology = to.topology;
  topology.dim = D;
  const auto first = static_cast<std::size_t>(topology.points());
  if (!arrays.meshes.empty()) {
    check_positive(arrays.a0, "a0");
    append_surfaces(topology, arrays);
  } else {
    for (std::size_t m = 0; m < n; ++m)
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
  if constexpr (D == 3)
    for (Index m = topology.particles() - static_cast<Index>(arrays.meshes.size()); m < topology.particles(); ++m)
      if (const Real volume = surface_volume(to.x.data(), topology, topology.surfaces->of(topology, m), m);
          !(volume > 0))
        throw InputError("surface {} has the signed volume {:g}; is it inverted?", m, volume);
  // By default sizes follow from outlines, diameters from l0, and masses from a0 and diameters.
  if (polygons) check_positive(arrays.a0, "a0"), check_positive(arrays.l0, "l0");
  check_positive(arrays.diameter, "diameter");
  check_positive(arrays.mass, "mass");
}

template <int D>
ParticleTable select_particles(const ParticleTable& all, const std::vector<Index>& kept) {
  ParticleTable some;
  some.topology = all.topology.select(kept);
  if (all.topology.surfaces) {
    const auto surfaces = std::make_shared<Surfaces>(*all.topology.surfaces);
    surfaces->kind.clear();
    for (const Index m : kept) surfaces->kind.push_back(all.topology.surfaces->kind[static_cast<std::size_t>(m)]);
    some.topology.surfaces = surfaces;
  }
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
  for (const ParticleTable::Contacts& contacts : all.history) {
    StoredContacts stored;
    for (std::size_t k = 0; k < contacts.stored.keys.size(); ++k) {
      const ContactKey& key = contacts.stored.keys[k];
      const auto first = now.find(key.first), second = now.find(key.second);
      if (first == now.end() || (contacts.pairs && second == now.end())) continue;
      stored.add({first->second, contacts.pairs ? second->second : key.second}, contacts.stored.row(k, contacts.width));
    }
    some.history.push_back({contacts.term, contacts.pairs, contacts.width, std::move(stored), contacts.heat});
  }
  return some;
}

template void append_particles<2>(ParticleTable&, const ParticleArrays&);
template void append_particles<3>(ParticleTable&, const ParticleArrays&);
template ParticleTable select_particles<2>(const ParticleTable&, const std::vector<Index>&);
template ParticleTable select_particles<3>(const ParticleTable&, const std::vector<Index>&);

}  // namespace pliant::python
