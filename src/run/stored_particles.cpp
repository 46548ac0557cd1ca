#include <pliant/run/stored_particles.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <numeric>
#include <unordered_set>
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

/// Under which names the contacts of a term are stored: pairs of ids, or an id and the number of a wall; their numbers.
std::string contacts_of(const HistoryNeeds& term) { return "contacts_of_" + term.name; }
std::string history_of(const HistoryNeeds& term) { return "history_of_" + term.name; }
std::string heat_of(const HistoryNeeds& term) { return "heat_of_" + term.name; }

constexpr std::int64_t history_format = 1;
constexpr const char *ids_entry = "id", *ranks_entry = "rank_particles", *reference_entry = "list_reference",
                     *relisted_entry = "list_relisted", *places_entry = "list_places";

}  // namespace

StoredParticles::StoredParticles(const Checkpoint& checkpoint, const Topology& all, int dim, const Ranks& ranks)
    : checkpoint_(checkpoint), all_(all), dim_(static_cast<std::size_t>(dim)) {
  const auto n = static_cast<std::size_t>(all.particles());
  const auto& ids = checkpoint.integer_array(ids_entry, n, 0, all.particles() - 1);
  std::vector<bool> there(n);
  for (const std::int64_t m : ids) {
    if (there[static_cast<std::size_t>(m)]) checkpoint.refuse("{}: {} is there twice", ids_entry, m);
    there[static_cast<std::size_t>(m)] = true;
  }
  all_ids_.assign(ids.begin(), ids.end());
  const auto& on_each = checkpoint.integer_array(ranks_entry, checkpoint.length(ranks_entry), 0, all.particles());
  if (const auto sum = std::accumulate(on_each.begin(), on_each.end(), std::int64_t{0}); sum != all.particles())
    checkpoint.refuse("{}: {} in all instead of {}", ranks_entry, sum, n);
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

StoredParticles::Lists StoredParticles::lists(Real reach, Real shear, Real y0) const {
  const Checkpoint& c = checkpoint_;
  const std::size_t n = all_ids_.size(), listed = c.length(reference_entry) == 0 ? 0 : coordinates(),
                    moved = listed == 0 ? 0 : c.length(relisted_entry);
  const auto& relisted = c.integer_array(relisted_entry, moved, 0, static_cast<std::int64_t>(n) - 1);
  std::vector<std::size_t> start{0};  // begin of each particle's coordinates
  for (std::size_t k = 0; k < n; ++k) start.push_back(start[k] + points_of(static_cast<Index>(k)) * dim_);
  const auto count = [&](std::int64_t k) { return start[static_cast<std::size_t>(k) + 1] - start[k]; };
  std::size_t numbers = 0;
  for (const std::int64_t k : relisted) numbers += count(k);
  Lists lists{c.real_array(reference_entry, listed, -far, far),
              {relisted.begin(), relisted.end()},
              c.real_array(places_entry, numbers, -far, far)};
  std::vector<Real> place = lists.reference;
  std::size_t from = 0;
  for (const std::int64_t k : relisted) {
    std::copy_n(&lists.places[from], count(k), &place[start[k]]);
    from += count(k);
  }
  if (shear != 0)
    for (std::size_t i = 0; i < place.size(); i += dim_) place[i] += shear * (place[i + 1] - y0);
  const auto& x = c.real_array("x", coordinates(), -far, far);
  for (std::size_t i = 0; i < place.size(); ++i)
    if (std::abs(x[i] - place[i]) > reach)
      c.refuse("x[{}] = {} is too far from {}, its value at the last list rebuild", i, x[i], place[i]);
  return lists;
}

void save_particles(const Topology& topology, SharedCheckpoint& checkpoint) {
  checkpoint.add_parts(ids_entry, std::span(topology.id).first(topology.owned()));
  checkpoint.add_parts(ranks_entry, std::vector<std::int64_t>{topology.owned()});
}

void save_lists(std::vector<Real> reference, const std::vector<Index>& relisted, const std::vector<Real>& places,
                SharedCheckpoint& checkpoint) {
  checkpoint.add_parts(reference_entry, std::move(reference));
  checkpoint.add_parts(places_entry, places);  // none where there are ghosts
  checkpoint.add_parts(relisted_entry, relisted);
}

void save_history(const ContactHistory& history, const Topology& topology, SharedCheckpoint& checkpoint) {
  if (history.empty()) return;
  checkpoint.add("history_format", history_format);
  const std::unordered_set<Index> own(topology.id.begin(), topology.id.begin() + topology.owned());
  for (const ContactTable& table : history.tables()) {
    const StoredContacts here = table.contacts();
    std::vector<std::int64_t> keys;
    std::vector<Real> values;
    for (std::size_t k = 0; k < here.keys.size(); ++k) {
      if (!own.contains(here.keys[k].first)) continue;  // another rank has it too
      keys.push_back(here.keys[k].first);
      keys.push_back(here.keys[k].second);
      std::ranges::copy(here.row(k, table.needs().width), std::back_inserter(values));
    }
    checkpoint.add_parts(contacts_of(table.needs()), std::move(keys));
    checkpoint.add_parts(history_of(table.needs()), std::move(values));
    if (!table.heat().empty())
      checkpoint.add_parts(heat_of(table.needs()), std::vector<Real>(table.heat().begin(), table.heat().end()));
  }
}

template <int D>
void StoredParticles::load_history(ParticleSystem<D>& system) const {
  if (system.history().empty()) return;
  const Checkpoint& c = checkpoint_;
  (void)c.integer("history_format", history_format, history_format);
  const std::unordered_set<Index> own(ids().begin(), ids().end());
  for (const ContactTable& table : system.history().tables()) {
    const HistoryNeeds& term = table.needs();
    const std::string name = contacts_of(term);
    const auto particles = static_cast<std::int64_t>(all_ids_.size());
    const bool points = term.elements == Elements::points;
    const auto others_of = [&](std::int64_t first) -> std::int64_t {
      return points ? all_.points_of(static_cast<Index>(first)) : table.pairs() ? particles : system.walls().surfaces();
    };
    const std::size_t count = c.length(name) / 2;
    const auto& numbers = c.integer_array(name, 2 * count, 0, Checkpoint::any_count);
    const auto& values = c.real_array(history_of(term), count * static_cast<std::size_t>(term.width));
    const StoredContacts stored{{}, values};
    StoredContacts mine;
    std::vector<ContactKey> keys;
    for (std::size_t k = 0; k < count; ++k) {
      const std::int64_t first = numbers[2 * k], second = numbers[2 * k + 1];
      if (first >= particles || second >= others_of(first) || (table.pairs() && first >= second))
        c.refuse("{}: ({}, {}) is not a contact of {} particles{}", name, first, second, particles,
                 points          ? fmt::format(", a point of each with the substrate")
                 : table.pairs() ? ", the lower id first"
                                 : fmt::format(" and {} surfaces of walls", system.walls().surfaces()));
      keys.push_back({static_cast<Index>(first), static_cast<Index>(second)});
      if (own.contains(keys.back().first) || (table.pairs() && own.contains(keys.back().second)))
        mine.add(keys.back(), stored.row(k, term.width));
    }
    std::sort(keys.begin(), keys.end());
    if (const auto twice = std::adjacent_find(keys.begin(), keys.end()); twice != keys.end())
      c.refuse("{}: ({}, {}) is there twice", name, twice->first, twice->second);
    system.history().set(term.name, std::move(mine));
    if (table.heat().empty()) continue;
    // A share of each rank that there was; only the sum counts.
    const std::size_t losses = term.losses.size(), shares = c.length(heat_of(term)) / losses;
    const auto& stored_heat = c.real_array(heat_of(term), shares * losses);
    std::vector<Real> heat(losses);
    for (std::size_t k = 0; system.ranks().root() && k < stored_heat.size(); ++k) heat[k % losses] += stored_heat[k];
    system.history().of(term.name).set_heat(heat);
  }
}

template void StoredParticles::load_history(ParticleSystem<2>&) const;
template void StoredParticles::load_history(ParticleSystem<3>&) const;

}  // namespace pliant
