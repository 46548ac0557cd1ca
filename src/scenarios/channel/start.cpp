#include <pliant/scenarios/channel/start.h>

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include <pliant/base/errors.h>
#include <pliant/base/rng.h>
#include <pliant/catalogue/catalogue.h>
#include <pliant/catalogue/parameter_values.h>
#include <pliant/model/polygon.h>
#include <pliant/setup/rest_outlines.h>
#include <pliant/setup/streams.h>
#include <pliant/system/fire.h>
#include <pliant/system/particle_system.h>

namespace pliant {
namespace {

/// Uniform in the channel.
Vec<2> random_place(const Channel& channel, Index m, std::uint64_t seed) {
  constexpr std::uint64_t most_attempts = 1 << 20;
  Vec<2> low = channel.corners()[0], high = low;
  for (const Vec<2>& r : channel.corners()) {
    low = low.cwiseMin(r);
    high = high.cwiseMax(r);
  }
  for (std::uint64_t attempt = 0; attempt < most_attempts; ++attempt) {
    const auto [u, v] = rng::uniform2(seed, stream::placement, static_cast<std::uint64_t>(m) * most_attempts + attempt);
    const Vec<2> r = low + (high - low).cwiseProduct(Vec<2>(u, v));
    if (channel.inside(r)) return r;
  }
  throw NumericalError(
      "no place for particle {} in {} attempts: the channel fills too little of its bounding rectangle", m,
      most_attempts);
}

/// Polygons of another size, with points of mass 1.
Topology scaled(const Topology& polygons, Real scale) {
  Topology all;
  for (Index m = 0; m < polygons.particles(); ++m) {
    const Index n = polygons.points_of(m);
    all.add_polygon(n, square(scale) * polygons.a0[m], scale * polygons.l0[m],
                    scale * polygons.diameter[polygons.offset[m]], n);
  }
  return all;
}

/// Two polygons of which one reaches into the other.
std::optional<std::pair<Index, Index>> find_tangle(const StateView<2>& s) {
  const Topology& t = s.topology;
  std::vector<Vec<2>> centre;
  std::vector<Real> reach;
  for (Index m = 0; m < t.particles(); ++m) {
    centre.push_back(mean_of_points<2>(s.x, t, m));
    Real most = 0;
    for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i) most = std::max(most, (s.position(i) - centre[m]).norm());
    reach.push_back(most);
  }
  for (Index m = 0; m < t.particles(); ++m)
    for (Index n = m + 1; n < t.particles(); ++n) {
      if ((centre[n] - centre[m]).norm() > reach[m] + reach[n]) continue;
      if (inside_polygon(s.x, t, m, s.position(t.offset[n])) || inside_polygon(s.x, t, n, s.position(t.offset[m])))
        return std::pair(m, n);
      for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i)
        for (Index j = t.offset[n]; j < t.offset[n + 1]; ++j)
          if (segments_meet(s.position(i), s.position(t.next[i]), s.position(j), s.position(t.next[j])))
            return std::pair(m, n);
    }
  return std::nullopt;
}

/// Pushes polygons apart by their contacts, `scale` being how large they are.
void relax_polygons(Topology polygons, const std::shared_ptr<const RestOutlines>& outlines, const Channel& channel,
                    const Walls<2>& walls, Real tolerance, Real scale, ChannelStart& start) {
  const Real smallest = *std::min_element(polygons.diameter.begin(), polygons.diameter.end());
  const Real epsilon = square(smallest);  // so that all stiffnesses are 1
  ParticleSystem<2> system(
      std::move(polygons), walls,
      make_force_field<2>(ModelKind::rough,
                          ParameterValues{{Role::contact_energy, epsilon}, {Role::wall_energy, epsilon / 4}},
                          {.rest_outlines = outlines}),
      smallest);
  FireOptions options;
  options.dt = 0.1;
  options.dt_max = 0.4;
  options.max_move = smallest / 10;
  options.force_tolerance = 1e-2 * tolerance * smallest;
  options.max_iterations = 20000;
  const auto inside = [&](const Real* r) {
    for (Index i = 0; i < system.topology().points(); ++i)
      if (!channel.inside(point<2>(r, i))) return false;
    return true;
  };
  const Relaxed relaxed = push_apart<2>(system, options, tolerance, inside, start.x);
  start.iterations += relaxed.iterations;
  start.max_overlap = relaxed.max_overlap;
  const auto fail = [&](const std::string& what) {
    throw NumericalError(
        "the start: {} polygons do not fit: at {:.3g} of their size {}; lower -area_fraction or use another -seed",
        system.topology().particles(), scale, what);
  };
  if (!relaxed.done)
    fail(inside(start.x.data())
             ? fmt::format("they still overlap by {:.2g} of the contact distance ({}), with {:.2g} allowed",
                           start.max_overlap, relaxed.reason, tolerance)
             : "a polygon was pushed out of the channel");
  if (const auto tangle = find_tangle(system.view(start.x.data(), nullptr)))
    fail(fmt::format("polygon {} reaches into polygon {}", tangle->first, tangle->second));
}

}  // namespace

ChannelStart random_start(const Topology& disks, const Channel& channel, const Walls<2>& walls, Real tolerance,
                          std::uint64_t seed) {
  constexpr std::int64_t most_iterations = 50000;
  const Index n = disks.particles();
  ChannelStart start;
  for (Index m = 0; m < n; ++m) {
    const Vec<2> r = random_place(channel, m, seed);
    start.x.insert(start.x.end(), {r[0], r[1]});
  }
  const Relaxed relaxed = relax_disks<2>(
      disks, walls, {.tolerance = tolerance, .iterations = most_iterations},
      [&](Index m, const Real* r) { return channel.inside(point<2>(r, m)); }, start.x);
  start.iterations = relaxed.iterations;
  start.max_overlap = relaxed.max_overlap;
  if (relaxed.done) return start;
  if (relaxed.max_overlap <= tolerance)
    throw NumericalError("the start: a disk was pushed out of the channel; use another -seed, or smaller disks");
  throw NumericalError(
      "the start: {} disks still overlap by {:.2g} of the contact distance ({}), with {:.2g} allowed; lower "
      "-area_fraction, raise -start_overlap or use another -seed",
      n, relaxed.max_overlap, relaxed.reason, tolerance);
}

ChannelStart random_polygon_start(const Topology& polygons, const std::shared_ptr<const RestOutlines>& outlines,
                                  const Channel& channel, const Walls<2>& walls, Real tolerance, std::uint64_t seed) {
  constexpr Real first_fraction = 0.6, first_tolerance = 1e-2, growth = 0.15;  // of an edge, by which any place moves
  const Index n = polygons.particles();
  const auto outline = [&](Index m) -> const std::vector<Vec<2>>& { return (*outlines)[polygons.points_of(m)]; };
  const auto around = [&](Index m) { return polygons.l0[m] * outline_radius(outline(m)); };
  Real covered = 0, widest = 0;  // by the disks around them; the radius of one over an edge
  for (Index m = 0; m < n; ++m) {
    covered += pi * square(around(m));
    widest = std::max(widest, outline_radius(outline(m)));
  }
  Real scale = std::min(1.0, std::sqrt(first_fraction * channel.area() / covered));
  Topology disks;
  for (Index m = 0; m < n; ++m) disks.add_soft(2 * scale * around(m), 1);
  const ChannelStart centres = random_start(disks, channel, walls, first_tolerance, seed);
  ChannelStart start;
  start.iterations = centres.iterations;
  for (Index m = 0; m < n; ++m) {
    const Eigen::Rotation2D<Real> turn(2 * pi * rng::uniform(seed, stream::orientation, m));
    for (const Vec<2>& r : outline(m)) {
      const Vec<2> place = point<2>(centres.x.data(), m) + scale * polygons.l0[m] * (turn * r);
      start.x.insert(start.x.end(), {place[0], place[1]});
    }
  }
  while (true) {
    relax_polygons(scaled(polygons, scale), outlines, channel, walls, scale < 1 ? first_tolerance : tolerance, scale,
                   start);
    if (scale >= 1) return start;
    const Real larger = std::min(1.0, scale * (1 + growth / widest));
    for (Index m = 0; m < n; ++m) {
      const Vec<2> mean = mean_of_points<2>(start.x.data(), polygons, m);
      for (Index i = polygons.offset[m]; i < polygons.offset[m + 1]; ++i)
        point<2>(start.x.data(), i) = mean + larger / scale * (point<2>(start.x.data(), i) - mean);
    }
    scale = larger;
  }
}

}  // namespace pliant
