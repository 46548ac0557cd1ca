#include <pliant/scenarios/channel/start.h>

#include <pliant/base/errors.h>
#include <pliant/base/rng.h>
#include <pliant/setup/streams.h>

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
  throw NumericalError("no place for disk {} in {} attempts: the channel is a sliver of the rectangle around it", m,
                       most_attempts);
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
  const RelaxedDisks relaxed = relax_disks<2>(
      disks, walls, tolerance, most_iterations, [&](Index m, const Real* r) { return channel.inside(point<2>(r, m)); },
      start.x);
  start.iterations = relaxed.iterations;
  start.max_overlap = relaxed.max_overlap;
  if (relaxed.done) return start;
  if (relaxed.max_overlap <= tolerance)
    throw NumericalError("the start: a disk was pushed out of the channel; use another -seed, or smaller disks");
  throw NumericalError(
      "the start: {} disks still overlap by {:.2g} of the distance of contact ({}), with {:.2g} allowed; lower "
      "-area_fraction, raise -start_overlap or use another -seed",
      n, relaxed.max_overlap, relaxed.reason, tolerance);
}

}  // namespace pliant
