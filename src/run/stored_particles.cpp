#include <pliant/run/stored_particles.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

namespace pliant {
namespace {

/// First and last of this rank's part of n particles, where `stored` were on each rank.
std::pair<std::size_t, std::size_t> own_share(const std::vector<std::int64_t>& stored, std::size_t n,
                                              const Ranks& ranks) {
  const auto rank = static_cast<std::size_t>(ranks.rank()), size = static_cast<std::size_t>(ranks.size());
  if (stored.size() == size) {
    const auto first = static_cast<std::size_t>(
        std::accumulate(stored.begin(), stored.begin() + static_cast<std::ptrdiff_t>(rank), std::int64_t{0}));
    return {first, first + static_cast<std::size_t>(stored[rank])};
  }
  return {n * rank / size, n * (rank + 1) / size};
}

}  // namespace

StoredParticles::StoredParticles(const Checkpoint& checkpoint, const Topology& all, int dim, const Ranks& ranks)
    : checkpoint_(checkpoint), all_(all), dim_(static_cast<std::size_t>(dim)) {
  const auto n = static_cast<std::size_t>(all.particles());
  const auto& ids = checkpoint.integer_array("id", n, 0, all.particles() - 1);
  std::vector<bool> there(n);
  for (const std::int64_t id : ids) {
    if (there[static_cast<std::size_t>(id)]) checkpoint.refuse("id: {} is there twice", id);
    there[static_cast<std::size_t>(id)] = true;
  }
  all_ids_.assign(ids.begin(), ids.end());
  const auto& on_each =
      checkpoint.integer_array("rank_particles", checkpoint.length("rank_particles"), 0, all.particles());
  if (const auto sum = std::accumulate(on_each.begin(), on_each.end(), std::int64_t{0}); sum != all.particles())
    checkpoint.refuse("rank_particles: {} in all instead of {}", sum, n);
  const auto [first, last] = own_share(on_each, n, ranks);
  first_ = first;
  count_ = last - first;
  for (std::size_t k = 0; k < last; ++k)
    (k < first ? first_coordinate_ : own_coordinates_) += points_of(static_cast<Index>(k)) * dim_;
}

std::vector<Image> StoredParticles::images(const std::string& name) const {
  const auto& all = checkpoint_.integer_array(name, 3 * all_ids_.size(), -Checkpoint::any_count, Checkpoint::any_count);
  std::vector<Image> own(count_);
  for (std::size_t m = 0; m < count_; ++m)
    std::copy_n(all.begin() + static_cast<std::ptrdiff_t>(3 * (first_ + m)), 3, own[m].begin());
  return own;
}

StoredParticles::Lists StoredParticles::lists(Real reach) const {
  const Checkpoint& c = checkpoint_;
  const std::size_t n = all_ids_.size(), listed = c.length("list_reference") == 0 ? 0 : coordinates(),
                    moved = listed == 0 ? 0 : c.length("list_relisted");
  const auto& relisted = c.integer_array("list_relisted", moved, 0, static_cast<std::int64_t>(n) - 1);
  std::vector<std::size_t> start{0};  // of each particle's coordinates
  for (std::size_t k = 0; k < n; ++k) start.push_back(start[k] + points_of(static_cast<Index>(k)) * dim_);
  const auto count = [&](std::int64_t k) { return start[static_cast<std::size_t>(k) + 1] - start[k]; };
  std::size_t numbers = 0;
  for (const std::int64_t k : relisted) numbers += count(k);
  Lists lists{c.real_array("list_reference", listed, -far, far),
              {relisted.begin(), relisted.end()},
              c.real_array("list_places", numbers, -far, far)};
  std::vector<Real> place = lists.reference;
  std::size_t from = 0;
  for (const std::int64_t k : relisted) {
    std::copy_n(&lists.places[from], count(k), &place[start[k]]);
    from += count(k);
  }
  const auto& x = c.real_array("x", coordinates(), -far, far);
  for (std::size_t i = 0; i < place.size(); ++i)
    if (std::abs(x[i] - place[i]) > reach)
      c.refuse("x[{}] = {} is farther from the place {} where it was listed than lists hold", i, x[i], place[i]);
  return lists;
}

}  // namespace pliant
