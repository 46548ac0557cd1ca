#include <pliant/scenarios/stored_particles.h>

#include <cstdint>
#include <numeric>
#include <utility>

namespace pliant {
namespace {

/// First and last of this rank's part of n particles, where `stored` were on each rank.
std::pair<Index, Index> own_share(const std::vector<std::int64_t>& stored, Index n, const Ranks& ranks) {
  const auto rank = static_cast<std::size_t>(ranks.rank());
  if (stored.size() == static_cast<std::size_t>(ranks.size())) {
    const std::int64_t first = std::accumulate(stored.begin(), stored.begin() + static_cast<std::ptrdiff_t>(rank), 0);
    return {static_cast<Index>(first), static_cast<Index>(first + stored[rank])};
  }
  const auto share = [&](std::size_t r) {
    return static_cast<Index>(static_cast<std::int64_t>(n) * static_cast<std::int64_t>(r) / ranks.size());
  };
  return {share(rank), share(rank + 1)};
}

}  // namespace

StoredParticles::StoredParticles(const Checkpoint& checkpoint, const Topology& all, int dim, const Ranks& ranks) {
  const auto& ids = checkpoint.integers.at("id");
  const auto [first, last] = own_share(checkpoint.integers.at("rank_particles"), static_cast<Index>(ids.size()), ranks);
  first_ = static_cast<std::size_t>(first);
  for (Index k = 0; k < last; ++k) {
    const Index m = static_cast<Index>(ids[k]);
    (k < first ? first_coordinate_ : coordinates_) += static_cast<std::size_t>(all.points_of(m)) * dim;
    if (k >= first) ids_.push_back(m);
  }
}

}  // namespace pliant
