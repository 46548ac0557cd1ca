#include <pliant/model/topology.h>

#include <cmath>

namespace pliant {

void Topology::add_points(Index n, Real diameter_m, Real mass_m) {
  const Index first = points(), m = particles();
  for (Index k = 0; k < n; ++k) {
    particle.push_back(m);
    next.push_back(first + (k + 1) % n);
    previous.push_back(first + (k + n - 1) % n);
    diameter.push_back(diameter_m);
    mass.push_back(mass_m / n);
    inverse_mass.push_back(n / mass_m);
  }
  offset.push_back(first + n);
  active.push_back(1);
}

void Topology::add_soft(Real sigma_m, Real mass_m) {
  add_points(1, sigma_m, mass_m);
  sigma.push_back(sigma_m);
  a0.push_back(dim == 2 ? pi * square(sigma_m) / 4 : pi * sigma_m * square(sigma_m) / 6);
  l0.push_back(0);
}

void Topology::add_polygon(Index n, Real a0_m, Real l0_m, Real delta_m, Real mass_m) {
  add_points(n, delta_m, mass_m);
  sigma.push_back(std::sqrt(4 * a0_m / pi));
  a0.push_back(a0_m);
  l0.push_back(l0_m);
}

void Topology::deactivate(Index m) {
  active[m] = 0;
  for (Index i = offset[m]; i < offset[m + 1]; ++i) inverse_mass[i] = 0;
}

}  // namespace pliant
