#include <pliant/model/contact_history.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace pliant {
namespace {

/// Sorted by key, each once.
StoredContacts sorted(const StoredContacts& all, int width) {
  std::vector<std::size_t> order(all.keys.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return all.keys[a] < all.keys[b]; });
  StoredContacts once;
  for (const std::size_t k : order)
    if (once.keys.empty() || once.keys.back() != all.keys[k]) once.add(all.keys[k], all.row(k, width));
  return once;
}

template <int D>
const PairList& list_of(const Neighbours<D>& neighbours, Elements elements) {
  return elements == Elements::point_pairs ? neighbours.point_pairs : neighbours.walls;
}

}  // namespace

StoredContacts ContactTable::contacts() const {
  StoredContacts all = unlisted_;
  for (std::size_t e = 0; e < keys_.size(); ++e)
    if (touched_[e] != 0) all.add(keys_[e], past(static_cast<Index>(e)));
  return sorted(all, needs_.width);
}

void ContactTable::set(const StoredContacts& contacts) {
  keys_.clear();
  touched_.clear();
  values_.clear();
  unlisted_ = sorted(contacts, needs_.width);
}

void ContactTable::assign(std::vector<ContactKey> keys) {
  const StoredContacts known = contacts();
  const auto width = static_cast<std::size_t>(needs_.width);
  std::vector<bool> listed(known.keys.size());
  keys_ = std::move(keys);
  touched_.assign(keys_.size(), 0);
  values_.assign(keys_.size() * width, 0);
  for (std::size_t e = 0; e < keys_.size(); ++e) {
    const auto at = std::lower_bound(known.keys.begin(), known.keys.end(), keys_[e]);
    if (at == known.keys.end() || *at != keys_[e]) continue;
    const auto k = static_cast<std::size_t>(at - known.keys.begin());
    listed[k] = true;
    touched_[e] = 1;
    std::ranges::copy(known.row(k, needs_.width), values_.begin() + static_cast<std::ptrdiff_t>(e * width));
  }
  unlisted_ = {};
  for (std::size_t k = 0; k < known.keys.size(); ++k)
    if (!listed[k]) unlisted_.add(known.keys[k], known.row(k, needs_.width));
}

ContactHistory::ContactHistory(std::vector<HistoryNeeds> needs) {
  for (HistoryNeeds& term : needs) {
    if (term.elements != Elements::point_pairs && term.elements != Elements::walls)
      throw std::logic_error(term.name + " keeps a history of elements that are neither pairs of points nor walls");
    for (const ContactTable& other : tables_)
      if (other.needs().name == term.name)
        throw std::logic_error("two terms called " + term.name + " keep a history; names tell them apart");
    tables_.emplace_back(std::move(term));
  }
}

const ContactTable& ContactHistory::of(std::string_view term) const {
  for (const ContactTable& table : tables_)
    if (table.needs().name == term) return table;
  throw std::logic_error("no history is kept for " + std::string(term));
}

template <int D>
void ContactHistory::follow(const Topology& topology, const Walls<D>& walls, const Neighbours<D>& neighbours) {
  if (empty() || neighbours.version() == version_) return;
  version_ = neighbours.version();
  const auto id = [&](Index i) { return topology.id[topology.particle[i]]; };
  for (ContactTable& table : tables_) {
    std::vector<ContactKey> keys;
    for (const auto& [i, j] : list_of(neighbours, table.needs().elements))
      keys.push_back(table.pairs() ? ContactKey{std::min(id(i), id(j)), std::max(id(i), id(j))}
                                   : ContactKey{id(i), walls.surface_of_part(j)});
    table.assign(std::move(keys));
  }
}

void ContactHistory::advanced() {
  for (ContactTable& table : tables_) table.advanced();
}

void ContactHistory::set(std::string_view term, const StoredContacts& contacts) {
  of(term).set(contacts);
  version_ = -1;
}

void ContactHistory::clear() {
  for (ContactTable& table : tables_) table.set({});
  version_ = -1;
}

template void ContactHistory::follow(const Topology&, const Walls<2>&, const Neighbours<2>&);
template void ContactHistory::follow(const Topology&, const Walls<3>&, const Neighbours<3>&);

}  // namespace pliant
