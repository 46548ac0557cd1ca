#include <pliant/setup/packing.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <vector>

#include <pliant/base/cure.h>
#include <pliant/base/rng.h>
#include <pliant/catalogue/catalogue.h>
#include <pliant/catalogue/parameter_values.h>
#include <pliant/model/chunks.h>
#include <pliant/setup/particles.h>
#include <pliant/setup/streams.h>
#include <pliant/system/fire.h>
#include <pliant/system/particle_system.h>

namespace pliant {
namespace {

constexpr std::uint64_t most_attempts_per_particle = 2000;

/// From so many particles on, fluctuations of the density over large distances make random starts slow.
constexpr Index many = 100000;

/// Element k of a sequence of numbers that covers the unit square (cube) evenly: k/g, k/g², …, with g^(D+1) = g + 1,
/// without their integer parts.
template <int D>
Vec<D> even_place(std::uint64_t k) {
  constexpr Real g = D == 2 ? 1.32471795724474603 : 1.22074408460575947;
  Vec<D> place;
  Real step = 1;
  for (int axis = 0; axis < D; ++axis) {
    step /= g;
    const Real at = step * static_cast<Real>(k);
    place[axis] = at - std::floor(at);
  }
  return place;
}

/// A free place in the closed container for particle m. All are equally probable, or, if `evenly` counts the places
/// tried so far, the next free place of an even sequence, moved at random by up to half a diameter. round: each round
/// has different random numbers.
template <int D>
void find_place(const Container& container, const Walls<D>& walls, Real height, Real radius, std::uint64_t seed,
                Index m, std::uint64_t round, std::uint64_t* evenly, Real* r) {
  const Vec<2> across = D == 2 ? container.extent() : Vec<2>(-container.extent()[1], container.extent()[1]);
  const Real middle = (across[0] + across[1]) / 2, half = (across[1] - across[0]) / 2;
  for (std::uint64_t attempt = 0; attempt < most_attempts_per_particle; ++attempt) {
    const auto draw = [&](std::uint64_t k) {
      return rng::uniform(
          seed, stream::placement,
          (static_cast<std::uint64_t>(m) << 24) + 4 * (round * most_attempts_per_particle + attempt) + k);
    };
    Vec<D> place;
    for (int k = 0; k < D; ++k) place[k] = draw(static_cast<std::uint64_t>(k));
    const Vec<D> moved = place - Vec<D>::Constant(0.5);
    if (evenly != nullptr) place = even_place<D>((*evenly)++);
    for (int k = 0; k < D - 1; ++k) r[k] = middle + half * (2 * place[k] - 1);
    r[D - 1] = height * place[D - 1];
    if (evenly != nullptr) point<D>(r, 0) += 2 * radius * moved;
    // If the full move is blocked, a part of it may be possible.
    const Real margin = std::pow(0.99, static_cast<Real>(attempt));
    if (container.has_room<D>(walls, point<D>(r, 0), radius, margin)) return;
  }
  throw NumericalError(
      "packing: no room for particle {} below a height of {:.3g} in {} attempts; make obstacles smaller", m, height,
      most_attempts_per_particle);
}

// All contacts of disks and spheres are in one list, whose parts threads share.
constexpr Index pairs_of_part = 4096;
std::size_t parts_of(const PairList& pairs) {
  return (static_cast<std::size_t>(pairs.size()) + pairs_of_part - 1) / pairs_of_part;
}

/// visit(part, first, last) for the pairs [first, last) of each part.
template <class Visit>
void for_each_part(const PairList& pairs, Visit&& visit) {
  for_each_chunk(static_cast<Index>(parts_of(pairs)), [&](Index part) {
    const Index first = part * pairs_of_part;
    visit(static_cast<std::size_t>(part), first, std::min(first + pairs_of_part, pairs.size()));
  });
}

/// Over the contact distance.
template <int D>
Real overlap_of_pair(const StateView<D>& s, Index e) {
  const auto [i, j] = s.neighbours.point_pairs[e];
  return 1 - (s.position(i) - s.position(j)).norm() / s.neighbours.point_pairs.reach[e];
}

/// Largest overlap over the contact distance, of points among each other and with walls; or any one above `enough`.
template <int D>
Real largest_overlap(ParticleSystem<D>& system, const Real* x, Real enough = std::numeric_limits<Real>::infinity()) {
  const StateView<D> s = system.view(x, nullptr);
  Real largest = 0;
  for (const auto& [i, wall] : s.neighbours.walls)
    largest = std::max(largest, 1 - 2 * s.walls.distance(s.position(i), wall, s.t) / s.topology.diameter[i]);
  if (largest > enough) return largest;
  if (s.topology.deformable()) {
    system.field().for_each_contact(s, [&](const Contact<D>& c) { largest = std::max(largest, c.overlap); });
    return largest;
  }
  const PairList& pairs = s.neighbours.point_pairs;
  std::vector<Real> most(parts_of(pairs), 0);
  std::atomic<bool> found = false;
  for_each_part(pairs, [&](std::size_t part, Index first, Index last) {
    if (found) return;
    Real here = 0;
    for (Index e = first; e < last && !(here > enough); ++e) here = std::max(here, overlap_of_pair(s, e));
    most[part] = here;
    if (here > enough) found = true;
  });
  for (const Real here : most) largest = std::max(largest, here);
  return largest;
}

/// Number of pairs of points that overlap by more than the tolerance.
template <int D>
Index overlapping_pairs(ParticleSystem<D>& system, const Real* x, Real tolerance) {
  const StateView<D> s = system.view(x, nullptr);
  std::vector<Index> number(parts_of(s.neighbours.point_pairs), 0);
  for_each_part(s.neighbours.point_pairs, [&](std::size_t part, Index first, Index last) {
    for (Index e = first; e < last; ++e) number[part] += overlap_of_pair(s, e) > tolerance;
  });
  return std::accumulate(number.begin(), number.end(), Index(0));
}

/// One around each particle.
/// A power of 8 near the mean length: DiskPush is for lengths near 1, and divisions by the power are exact.
Real unit_near(const std::vector<Real>& lengths) {
  const Real mean = std::accumulate(lengths.begin(), lengths.end(), Real{0}) / static_cast<Real>(lengths.size());
  return std::pow(8, std::round(std::log2(mean) / 3));
}

template <int D>
Topology outer_disks(const Topology& topology) {
  constexpr Real mass = 1;
  Topology disks;
  disks.dim = D;
  disks.reserve(topology.particles(), topology.particles());
  for (Index m = 0; m < topology.particles(); ++m) disks.add_soft(2 * outer_radius(topology, m), mass);
  return disks;
}

}  // namespace

template <int D>
Relaxed push_apart(ParticleSystem<D>& system, FireOptions options, Real tolerance,
                   const std::function<bool(const Real*)>& inside, std::span<Real> x,
                   const std::function<void()>& check) {
  constexpr Real mass = 1;
  Relaxed relaxed;
  options.force = [&](const Real* r, Real* f) { system.field().forces(system.view(r, nullptr), f); };
  const auto ended = std::move(options.done);
  options.done = [&](const Real* r) {
    if (check) check();
    return (largest_overlap<D>(system, r, tolerance) <= tolerance && inside(r)) || (ended && ended(r));
  };
  const EnergyAndForce without_energy = [&](const Real* r, Real* f) {
    options.force(r, f);
    return Real(0);  // overlaps, not the energy, end the iterations
  };
  const FireResult result = fire(x, std::span(&mass, 1), without_energy, options);
  relaxed.iterations = result.iterations;
  relaxed.reason = result.reason;
  relaxed.max_overlap = largest_overlap<D>(system, x.data());
  relaxed.done = relaxed.max_overlap <= tolerance && inside(x.data());
  return relaxed;
}

namespace {

/// Disks that are pushed apart, sorted in space at their first push: then searches and sums are fast.
template <int D>
class DiskPusher {
 public:
  DiskPusher(Topology disks, const Walls<D>& walls, const DiskPush& options, const Box<D>& box = {})
      : options_(options),
        system_(widened(std::move(disks), options.margin), walls, field(), options.skin, Ranks(), box) {}

  void set_walls(const Walls<D>& walls) { system_.set_walls(walls); }

  /// Arguments as of relax_disks().
  Relaxed push(const std::function<bool(Index, const Real*)>& inside, std::span<Real> centres,
               const std::function<void()>& check) {
    const Topology& disks = system_.topology();
    const Index n = disks.particles();
    std::vector<Real> x(centres.begin(), centres.end());
    if (sorted_) {
      for (Index k = 0; k < n; ++k) point<D>(x.data(), k) = point<D>(centres.data(), disks.id[k]);
    } else {
      State state(n, D);
      std::ranges::copy(x, state.x().begin());
      system_.sort(state);
      std::ranges::copy(state.x(), x.begin());
      sorted_ = true;
    }
    const Real tolerance = of_widened(options_.tolerance);
    FireOptions fire;
    fire.dt = 0.1;
    fire.dt_max = 0.5;
    fire.force_tolerance = 1e-2 * options_.tolerance;
    fire.max_iterations = options_.iterations;
    bool jammed = false;
    fire.done = [&, looks = std::int64_t(0)](const Real* r) mutable {
      if (options_.looks == 0 || ++looks % options_.looks != 0) return false;
      // Nearly as many pairs as hold all disks: at the edge of jamming few of them open.
      constexpr Real many_pairs = 0.9 * D, half_life = 30;
      const Real most = many_pairs * std::exp2(static_cast<Real>(options_.looks - looks) / half_life);
      jammed = overlapping_pairs(system_, r, options_.tolerance) > most * static_cast<Real>(n);
      return jammed;
    };
    // Disks beyond walls do not keep it from ending: no force brings them back.
    Relaxed relaxed = push_apart<D>(
        system_, fire, tolerance, [](const Real*) { return true; }, x, check);
    for (Index k = 0; k < n; ++k) relaxed.done = relaxed.done && inside(k, x.data());
    if (jammed) relaxed.reason = "they jam";
    relaxed.max_overlap = std::max((1 + options_.margin) * relaxed.max_overlap - options_.margin, Real(0));
    for (Index k = 0; k < n; ++k) point<D>(centres.data(), disks.id[k]) = point<D>(x.data(), k);
    return relaxed;
  }

 private:
  static Topology widened(Topology disks, Real margin) {
    for (Real& d : disks.diameter) d *= 1 + margin;
    return disks;
  }
  static auto field() {
    return make_force_field<D>(ModelKind::sp, ParameterValues{{Role::contact_energy, 1.0}, {Role::wall_energy, 1.0}});
  }
  /// The overlap of widened disks that overlap by this part of their own contact distance.
  Real of_widened(Real overlap) const { return (overlap + options_.margin) / (1 + options_.margin); }

  DiskPush options_;
  ParticleSystem<D> system_;
  bool sorted_ = false;
};

}  // namespace

template <int D>
Relaxed relax_disks(Topology disks, const Walls<D>& walls, const DiskPush& options,
                    const std::function<bool(Index, const Real*)>& inside, std::span<Real> centres, const Box<D>& box,
                    const std::function<void()>& check) {
  return DiskPusher<D>(std::move(disks), walls, options, box).push(inside, centres, check);
}

void check_fit(const Topology& topology, const Container& container) {
  for (Index m = 0; m < topology.particles(); ++m)
    if (const Real width = 2 * outer_radius(topology, m); width >= container.inflow_width())
      throw InputError("particle {} is {:.3g} sigma_avg wide, the container only {:.3g} at its upper end; use {}", m,
                       width, container.inflow_width(), cures({Cure::wider_container, Cure::own_outline}));
}

template <int D>
Packing pack(const Topology& topology, const Container& container, const PackingParameters& p, Real* x) {
  check_fit(topology, container);
  const Index n = topology.particles();
  DiskPush options{.tolerance = p.tolerance, .iterations = 2000, .looks = 30};
  if (n >= many) {
    options.looks = 10;
    options.skin = 0.5;
    // Wider disks lose the last small overlaps sooner.
    options.margin = std::min(10 * p.tolerance, 1e-3);
  }
  Topology disks = outer_disks<D>(topology);
  Real content = 0, largest = 0;
  for (const Index m : disks.id) {
    content += disks.a0[m];
    largest = std::max(largest, disks.diameter[m]);
  }
  Packing packing;
  std::vector<Real> centres(static_cast<std::size_t>(n) * D);
  const auto inside = [&](Index m, const Real* r) { return container.inside(D, in_plane<D>(point<D>(r, m))); };
  std::optional<DiskPusher<D>> pusher;
  std::uint64_t tried = 0;
  bool again = false;
  packing.fraction = p.fraction;
  for (std::uint64_t round = 0;; ++round) {
    const Real before = packing.height;
    // A few particles lie side by side: none may be higher than the lid.
    packing.height = std::max(container.fill_height(D, content / packing.fraction), 1.001 * largest);
    const Walls<D> walls = container.closed<D>(packing.height, p.clearance);
    for (Index m = 0; m < n; ++m) {
      Real* r = &centres[static_cast<std::size_t>(m) * D];
      if (before > 0) r[D - 1] *= packing.height / before;
      if (before == 0 || !inside(m, centres.data()))
        find_place<D>(container, walls, packing.height, outer_radius(topology, m), p.seed, m, round,
                      round == 0 && n >= many ? &tried : nullptr, r);
    }
    if (pusher)
      pusher->set_walls(walls);
    else
      pusher.emplace(std::move(disks), walls, options);
    const Relaxed relaxed = pusher->push(inside, centres, p.check);
    packing.iterations += relaxed.iterations;
    packing.max_overlap = relaxed.max_overlap;
    if (relaxed.done) break;
    // Only disks beyond walls need another place, but perhaps they have none at this fraction.
    again = relaxed.max_overlap <= p.tolerance && !again;
    if (again) continue;
    if (packing.fraction < 0.5 * p.fraction)
      throw NumericalError(
          "packing {} particles: overlaps up to {:.2g}, or particles beyond walls, remain at a fraction of {:.2g} "
          "({}); "
          "is the hopper wide enough for them?",
          n, packing.max_overlap, packing.fraction, relaxed.reason);
    packing.fraction *= 0.98;
  }
  packing.fraction = std::min(packing.fraction, content / container.capacity(D, packing.height));
  place_at_random_angles(topology, centres.data(), p.seed, x);
  return packing;
}

template <int D>
Packing pack(const Topology& topology, const Box<D>& box, const PackingParameters& p, Real* x) {
  for (int k = 0; k < D; ++k)
    if (!box.periodic(k))
      throw InputError("direction {} of the box is open, and particles do not fill it; give a finite length", k);
  Topology disks = outer_disks<D>(topology);
  Packing packing;
  std::vector<Real> centres(static_cast<std::size_t>(disks.particles()) * D);
  for (Index m = 0; m < disks.particles(); ++m) {
    packing.fraction += disks.a0[m] / box.volume();
    if (disks.diameter[m] >= box.length().minCoeff())
      throw InputError("particle {} is {:.3g} wide, and touches itself in a box of {:.3g}; enlarge the box", m,
                       disks.diameter[m], box.length().minCoeff());
    for (int k = 0; k < D; ++k)
      centres[static_cast<std::size_t>(m) * D + static_cast<std::size_t>(k)] =
          box.origin()[k] +
          box.length()[k] * rng::uniform(p.seed, stream::placement,
                                         static_cast<std::uint64_t>(m) * D + static_cast<std::uint64_t>(k));
  }
  const Real unit = unit_near(disks.diameter);
  Tilt<D> tilt = box.tilt();
  for (Real& t : tilt) t /= unit;
  for (Real& d : disks.diameter) d /= unit;
  for (Real& c : centres) c /= unit;
  const Relaxed relaxed = relax_disks<D>(
      std::move(disks), {}, {.tolerance = p.tolerance}, [](Index, const Real*) { return true; }, centres,
      Box<D>(box.origin() / unit, box.length() / unit, tilt), p.check);
  for (Real& c : centres) c *= unit;
  packing.iterations = relaxed.iterations;
  packing.max_overlap = relaxed.max_overlap;
  if (!relaxed.done)
    throw NumericalError(
        "packing {} particles in a periodic box: overlaps up to {:.2g} remain at a fraction of {:.3g} ({}); enlarge "
        "the "
        "box, or use another seed",
        topology.particles(), packing.max_overlap, packing.fraction, relaxed.reason);
  for (Index m = 0; m < topology.particles(); ++m) {
    auto r = point<D>(centres.data(), m);
    r -= box.shift(box.image_of(r));
  }
  place_at_random_angles(topology, centres.data(), p.seed, x);
  return packing;
}

template Relaxed push_apart(ParticleSystem<2>&, FireOptions, Real, const std::function<bool(const Real*)>&,
                            std::span<Real>, const std::function<void()>&);
template Relaxed push_apart(ParticleSystem<3>&, FireOptions, Real, const std::function<bool(const Real*)>&,
                            std::span<Real>, const std::function<void()>&);
template Relaxed relax_disks<2>(Topology, const Walls<2>&, const DiskPush&,
                                const std::function<bool(Index, const Real*)>&, std::span<Real>, const Box<2>&,
                                const std::function<void()>&);
template Relaxed relax_disks<3>(Topology, const Walls<3>&, const DiskPush&,
                                const std::function<bool(Index, const Real*)>&, std::span<Real>, const Box<3>&,
                                const std::function<void()>&);
template Packing pack<2>(const Topology&, const Container&, const PackingParameters&, Real*);
template Packing pack<3>(const Topology&, const Container&, const PackingParameters&, Real*);
template Packing pack<2>(const Topology&, const Box<2>&, const PackingParameters&, Real*);
template Packing pack<3>(const Topology&, const Box<3>&, const PackingParameters&, Real*);

}  // namespace pliant
