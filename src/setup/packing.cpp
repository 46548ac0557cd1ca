#include <pliant/setup/packing.h>

#include <cmath>
#include <vector>

#include <pliant/base/rng.h>
#include <pliant/model/catalogue.h>
#include <pliant/setup/particles.h>
#include <pliant/setup/streams.h>
#include <pliant/system/fire.h>
#include <pliant/system/particle_system.h>

namespace pliant {
namespace {

/// Area (volume) of the hopper between the orifice and height y.
template <int D>
Real capacity(const Hopper& hopper, Real y) {
  const Real slope = hopper.slope_height(), bottom = hopper.orifice / 2, top = hopper.wall_distance / 2;
  const Real s = std::min(y, slope), at = hopper.half_width(s);
  if constexpr (D == 2)
    return s * (bottom + at) + 2 * top * std::max(y - slope, Real(0));
  else
    return pi / 3 * s * (square(bottom) + bottom * at + square(at)) + pi * square(top) * std::max(y - slope, Real(0));
}

template <int D>
Real fill_height(const Hopper& hopper, Real content) {
  Real low = 0, high = 1;
  while (capacity<D>(hopper, high) < content) high *= 2;
  for (int k = 0; k < 100; ++k) {
    const Real middle = (low + high) / 2;
    (capacity<D>(hopper, middle) < content ? low : high) = middle;
  }
  return high;
}

/// Uniform in the closed hopper, a radius away from its walls.
template <int D>
void random_place(const Hopper& hopper, Real height, Real radius, std::uint64_t seed, Index m, Real* r) {
  for (std::uint64_t attempt = 0;; ++attempt) {
    const auto draw = [&](std::uint64_t k) {
      return rng::uniform(seed, stream::placement, (static_cast<std::uint64_t>(m) << 24) + 4 * attempt + k);
    };
    const Real half = hopper.wall_distance / 2;
    for (int k = 0; k < D - 1; ++k) r[k] = half * (2 * draw(k) - 1);
    r[D - 1] = height * draw(D - 1);
    const Real lateral = D == 2 ? std::abs(r[0]) : std::hypot(r[0], r[1]);
    if (lateral <= std::max(hopper.half_width(r[D - 1]) - radius, hopper.orifice / 4)) return;
  }
}

/// Of disks among each other and with walls, relative to the distance of contact.
template <int D>
Real largest_overlap(ParticleSystem<D>& system, const Real* x) {
  const StateView<D> s = system.view(x, nullptr);
  Real largest = 0;
  system.field().for_each_contact(s, [&](const Contact<D>& c) { largest = std::max(largest, c.overlap); });
  for (const auto& [i, wall] : s.neighbours.walls)
    largest = std::max(largest, 1 - 2 * s.walls.distance(s.position(i), wall) / s.topology.diameter[i]);
  return largest;
}

}  // namespace

void check_fit(const Topology& topology, const Hopper& hopper) {
  for (Index m = 0; m < topology.particles(); ++m)
    if (const Real width = 2 * outer_radius(topology, m); width >= hopper.wall_distance)
      throw InputError("particle {} is {:.3g} sigma_avg wide, the hopper only {:.3g}; raise -hopper_wall_distance", m,
                       width, hopper.wall_distance);
}

template <int D>
Packing pack(const Topology& topology, const Hopper& hopper, const PackingParameters& p, Real* x) {
  constexpr Real mass = 1;
  check_fit(topology, hopper);
  const Index n = topology.particles();
  const auto outer_disks = [&] {
    Topology disks;
    disks.dim = D;
    for (Index m = 0; m < n; ++m) disks.add_soft(2 * outer_radius(topology, m), mass);
    return disks;
  };
  Real content = 0, largest = 0;
  for (const Topology disks = outer_disks(); const Index m : disks.id) {
    content += disks.a0[m];
    largest = std::max(largest, disks.diameter[m]);
  }
  Packing packing;
  std::vector<Real> centres(static_cast<std::size_t>(n) * D);
  FireOptions options;
  options.dt = 0.1;
  options.dt_max = 0.5;
  options.force_tolerance = 1e-2 * p.tolerance;
  options.max_iterations = 2000;  // more are needed only at the edge of jamming, where raising the lid is quicker
  for (packing.fraction = p.fraction;; packing.fraction *= 0.98) {
    const Real before = packing.height;
    // A few particles lie side by side: none may be higher than the lid.
    packing.height = std::max(fill_height<D>(hopper, content / packing.fraction), 1.001 * largest);
    for (Index m = 0; m < n; ++m) {
      Real* r = &centres[static_cast<std::size_t>(m) * D];
      if (before == 0)
        random_place<D>(hopper, packing.height, outer_radius(topology, m), p.seed, m, r);
      else
        r[D - 1] *= packing.height / before;
    }
    ParticleSystem<D> system(outer_disks(), hopper.closed<D>(packing.height),
                             make_force_field<D>(ModelKind::sp, {.epsilon = 1, .epsilon_wall = 1}, Vec<D>::Zero()),
                             0.3);
    {
      State state(n, D);
      std::copy(centres.begin(), centres.end(), state.x().begin());
      system.sort(state);  // sorted in space, searches and sums are fast
      std::copy(state.x().begin(), state.x().end(), centres.begin());
    }
    options.force = [&](const Real* r, Real* f) { system.field().forces(system.view(r, nullptr), f); };
    options.done = [&](const Real* r) {
      packing.max_overlap = largest_overlap<D>(system, r);
      return packing.max_overlap <= p.tolerance;
    };
    const FireResult result = fire(
        centres, std::span(&mass, 1),
        [&](const Real* r, Real* f) { return system.field().energy(system.view(r, nullptr), f); }, options);
    packing.iterations += result.iterations;
    const bool done = options.done(centres.data());
    const std::vector<Real> sorted = centres;
    for (Index k = 0; k < n; ++k) point<D>(centres.data(), system.topology().id[k]) = point<D>(sorted.data(), k);
    if (done) break;
    if (packing.fraction < 0.5 * p.fraction)
      throw NumericalError(
          "packing {} particles: overlaps up to {:.2g} remain at a fraction of {:.2g} ({}); is the hopper wide enough "
          "for them?",
          n, packing.max_overlap, packing.fraction, result.reason);
  }
  packing.fraction = std::min(packing.fraction, content / capacity<D>(hopper, packing.height));
  for (Index m = 0; m < n; ++m)
    place_particle(topology, m, &centres[static_cast<std::size_t>(m) * D],
                   2 * pi * rng::uniform(p.seed, stream::orientation, m), x);
  return packing;
}

template Packing pack<2>(const Topology&, const Hopper&, const PackingParameters&, Real*);
template Packing pack<3>(const Topology&, const Hopper&, const PackingParameters&, Real*);

}  // namespace pliant
