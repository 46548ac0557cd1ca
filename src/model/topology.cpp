#include <pliant/model/topology.h>

#include <cmath>

namespace pliant {

void Topology::reserve(Index particles, Index points) {
  const auto n = static_cast<std::size_t>(particles), all = static_cast<std::size_t>(points);
  offset.reserve(n + 1);
  for (auto* a : {&particle, &next, &previous}) a->reserve(all);
  diameter.reserve(all);
  for (auto* a : {&point_mass, &inverse_point_mass, &inertia, &inverse_inertia, &sigma, &a0, &l0}) a->reserve(n);
  active.reserve(n);
  id.reserve(n);
}

void Topology::connect_points(Index n) {
  const Index first = points(), m = particles();
  for (Index k = 0; k < n; ++k) {
    particle.push_back(m);
    next.push_back(first + (k + 1) % n);
    previous.push_back(first + (k + n - 1) % n);
  }
  offset.push_back(first + n);
}

void Topology::add_points(Index n, Real diameter_m, Real mass_m) {
  const Index m = particles();
  connect_points(n);
  diameter.insert(diameter.end(), n, diameter_m);
  point_mass.push_back(mass_m / n);
  inverse_point_mass.push_back(n / mass_m);
  inertia.push_back(0);
  inverse_inertia.push_back(0);
  active.push_back(1);
  id.push_back(m);
}

void Topology::add_soft(Real sigma_m, Real mass_m) {
  add_points(1, sigma_m, mass_m);
  sigma.push_back(sigma_m);
  a0.push_back(dim == 2 ? pi * square(sigma_m) / 4 : pi * sigma_m * square(sigma_m) / 6);
  l0.push_back(0);
  set_inertia(particles() - 1, mass_m * square(sigma_m) / (dim == 2 ? 8 : 10));
}

void Topology::add_polygon(Index n, Real a0_m, Real l0_m, Real delta_m, Real mass_m) {
  add_points(n, delta_m, mass_m);
  sigma.push_back(std::sqrt(4 * a0_m / pi));
  a0.push_back(a0_m);
  l0.push_back(l0_m);
}

void Topology::set_inertia(Index m, Real value) {
  inertia[m] = value;
  inverse_inertia[m] = active[m] != 0 ? 1 / value : 0;
}

void Topology::deactivate(Index m) {
  active[m] = 0;
  inverse_point_mass[m] = 0;
  inverse_inertia[m] = 0;
}

Topology Topology::select(std::span<const Index> which) const {
  Topology t;
  t.dim = dim;
  t.surfaces = surfaces;
  Index all = 0;
  for (const Index m : which) all += points_of(m);
  t.reserve(static_cast<Index>(which.size()), all);
  for (const Index m : which) {
    t.connect_points(points_of(m));
    t.diameter.insert(t.diameter.end(), diameter.begin() + offset[m], diameter.begin() + offset[m + 1]);
    t.point_mass.push_back(point_mass[m]);
    t.inverse_point_mass.push_back(inverse_point_mass[m]);
    t.inertia.push_back(inertia[m]);
    t.inverse_inertia.push_back(inverse_inertia[m]);
    t.sigma.push_back(sigma[m]);
    t.a0.push_back(a0[m]);
    t.l0.push_back(l0[m]);
    t.active.push_back(active[m]);
    t.id.push_back(id[m]);
  }
  return t;
}

void Topology::add_ghost(Index id_m, Index n, Real delta_m, Real sigma_m, Real a0_m, Real l0_m, Real mass_m,
                         Real inertia_m, int side) {
  add_points(n, delta_m, mass_m);
  if (inertia_m > 0) set_inertia(particles() - 1, inertia_m);
  id.back() = id_m;
  sigma.push_back(sigma_m);
  a0.push_back(a0_m);
  l0.push_back(l0_m);
  ghost_side.push_back(static_cast<std::int8_t>(side));
  ++ghosts;
}

void Topology::drop_ghosts() {
  const std::size_t kept_points = owned_points(), kept = owned();
  for (auto* a : {&particle, &next, &previous}) a->resize(kept_points);
  diameter.resize(kept_points);
  for (auto* a : {&point_mass, &inverse_point_mass, &inertia, &inverse_inertia, &sigma, &a0, &l0}) a->resize(kept);
  offset.resize(kept + 1);
  active.resize(kept);
  id.resize(kept);
  ghost_side.clear();
  ghosts = 0;
}

void Topology::connect(const std::vector<Index>& points_of_each) {
  offset.assign(1, 0);
  particle.clear();
  next.clear();
  previous.clear();
  for (const Index n : points_of_each) connect_points(n);
}

}  // namespace pliant
