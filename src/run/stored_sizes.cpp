#include <pliant/run/stored_sizes.h>

#include <cstdint>
#include <limits>
#include <memory>
#include <type_traits>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/model/surface_arrays.h>

namespace pliant {
namespace {

std::string surface_entry(const std::string& prefix, const std::string& name) { return prefix + "surface_" + name; }

SurfaceArrays read_surfaces(const std::string& prefix, const Checkpoint& from) {
  SurfaceArrays arrays;
  SurfaceArrays::for_each(arrays, [&]<class Number>(const std::string& name, std::vector<Number>& values, int) {
    const std::string entry = surface_entry(prefix, name);
    if constexpr (std::is_same_v<Number, Real>) {
      values = from.real_array(entry, from.length(entry));
    } else {
      const auto& stored = from.integer_array(entry, from.length(entry), 0, Checkpoint::any_count);
      values.assign(stored.begin(), stored.end());
    }
  });
  return arrays;
}

}  // namespace

void save_sizes(const std::string& prefix, const Topology& all, SharedCheckpoint& to) {
  std::vector<std::int64_t> points;
  std::vector<Real> width, mass;
  for (Index m = 0; m < all.particles(); ++m) {
    points.push_back(all.points_of(m));
    width.push_back(all.diameter[static_cast<std::size_t>(all.offset[m])]);
    mass.push_back(all.point_mass[m] * all.points_of(m));
  }
  to.add(prefix + "points", points);
  to.add(prefix + "diameter", width);
  to.add(prefix + "mass", mass);
  to.add(prefix + "inverse_point_mass", all.inverse_point_mass);
  to.add(prefix + "a0", all.a0);
  to.add(prefix + "l0", all.l0);
  if (!all.surfaces) return;
  const SurfaceArrays arrays(*all.surfaces);
  SurfaceArrays::for_each(arrays, [&]<class Number>(const std::string& name, const std::vector<Number>& values, int) {
    using Stored = std::conditional_t<std::is_same_v<Number, Real>, Real, std::int64_t>;
    to.add(surface_entry(prefix, name), std::vector<Stored>(values.begin(), values.end()));
  });
}

Topology read_sizes(const std::string& prefix, int dim, const Checkpoint& from) {
  constexpr Real smallest = std::numeric_limits<Real>::min();
  const std::size_t n = from.length(prefix + "points");
  const auto& points = from.integer_array(prefix + "points", n, 1, 1 << 24);
  const auto positive = [&](const char* name) -> const std::vector<Real>& {
    return from.real_array(prefix + name, n, smallest);
  };
  const std::vector<Real>&width = positive("diameter"), &mass = positive("mass"), &a0 = positive("a0"),
        &l0 = from.real_array(prefix + "l0", n, 0);
  Topology all;
  all.dim = dim;
  const auto surfaces = std::make_shared<Surfaces>();
  SurfaceArrays arrays;
  if (from.integers.contains(surface_entry(prefix, "kind"))) {
    arrays = read_surfaces(prefix, from);
    try {
      surfaces->kinds = arrays.kinds();
    } catch (const InputError& error) {
      from.refuse("{}: {}", surface_entry(prefix, "kind"), error.what());
    }
    all.surfaces = surfaces;
  }
  for (std::size_t m = 0; m < n; ++m)
    if (all.surfaces)
      surfaces->add_particle(all, arrays.kind[m], a0[m], width[m], mass[m]);
    else if (points[m] == 1)
      all.add_soft(width[m], mass[m]);
    else
      all.add_polygon(static_cast<Index>(points[m]), a0[m], l0[m], width[m], mass[m]);
  // The mass of a polygon is rounded when it is shared out over the points, and its inverse does not follow from that.
  if (const std::string name = prefix + "inverse_point_mass"; from.reals.contains(name))  // older versions lack it
    all.inverse_point_mass = from.real_array(name, n, smallest);
  return all;
}

}  // namespace pliant
