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

void ContactTable::accept(ContactWorkspace& workspace) {
  std::swap(current_, workspace.next_);
  unlisted_ = {};
}

void ContactTable::append_to(StoredContacts& all) const {
  all.keys.insert(all.keys.end(), unlisted_.keys.begin(), unlisted_.keys.end());
  all.values.insert(all.values.end(), unlisted_.values.begin(), unlisted_.values.end());
  for (std::size_t k = 0; k < keys_.size(); ++k)
    if (current_.touches[k] != 0)
      all.add(keys_[k], std::span(current_.values).subspan(k * needs_.width, static_cast<std::size_t>(needs_.width)));
}

StoredContacts ContactTable::contacts() const {
  StoredContacts all;
  append_to(all);
  return sorted(all, needs_.width);
}

void ContactTable::set(const StoredContacts& contacts) {
  contact_of_.clear();
  keys_.clear();
  current_.resize(0, needs_.width);
  unlisted_ = sorted(contacts, needs_.width);
}

void ContactTable::forget(Index id) {
  const auto is_of_it = [&](const ContactKey& key) { return key.first == id || (pairs() && key.second == id); };
  for (std::size_t k = 0; k < keys_.size(); ++k)
    if (current_.touches[k] != 0 && is_of_it(keys_[k])) end(k);
  const StoredContacts before = std::exchange(unlisted_, {});
  for (std::size_t k = 0; k < before.keys.size(); ++k)
    if (!is_of_it(before.keys[k])) unlisted_.add(before.keys[k], before.row(k, needs_.width));
}

void ContactTable::end(std::size_t contact) {
  std::fill_n(current_.values.begin() + static_cast<std::ptrdiff_t>(contact * needs_.width), needs_.width, 0.0);
  current_.touches[contact] = 0;
}

void ContactTable::assign(const std::vector<ContactKey>& list) {
  auto& [known, start, rows, listed] = scratch_;
  known.keys.clear();
  known.values.clear();
  append_to(known);
  // Counting sort by the first id: a particle has few contacts.
  Index ids = 0;
  for (const ContactKey& key : known.keys) ids = std::max(ids, key.first + 1);
  start.assign(static_cast<std::size_t>(ids) + 1, 0);
  for (const ContactKey& key : known.keys) ++start[key.first];
  std::partial_sum(start.begin(), start.end(), start.begin());
  rows.resize(known.keys.size());
  for (std::size_t k = known.keys.size(); k-- > 0;) rows[--start[known.keys[k].first]] = k;

  keys_ = list;
  contact_of_.clear();
  if (shared()) {
    std::sort(keys_.begin(), keys_.end());
    keys_.erase(std::unique(keys_.begin(), keys_.end()), keys_.end());
    for (const ContactKey& key : list)
      contact_of_.push_back(static_cast<Index>(std::lower_bound(keys_.begin(), keys_.end(), key) - keys_.begin()));
  }
  current_.resize(keys_.size(), needs_.width);
  listed.assign(known.keys.size(), 0);
  for (std::size_t e = 0; e < keys_.size(); ++e) {
    const ContactKey& key = keys_[e];
    if (key.first >= ids) continue;
    for (std::size_t at = start[key.first]; at < start[key.first + 1]; ++at) {
      const std::size_t k = rows[at];
      if (known.keys[k] != key) continue;
      listed[k] = 1;
      if (std::exchange(current_.touches[e], std::uint8_t{1}) != 0) continue;
      std::ranges::copy(known.row(k, needs_.width),
                        current_.values.begin() + static_cast<std::ptrdiff_t>(e * needs_.width));
    }
  }
  unlisted_ = {};
  for (std::size_t k = 0; k < known.keys.size(); ++k)
    if (listed[k] == 0) unlisted_.add(known.keys[k], known.row(k, needs_.width));
}

ContactHistory::ContactHistory(std::vector<HistoryNeeds> needs) {
  for (HistoryNeeds& term : needs) {
    if (term.elements != Elements::point_pairs && term.elements != Elements::walls && term.elements != Elements::points)
      throw std::logic_error(term.name + " keeps a history of elements that are no points, pairs of points or walls");
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
bool ContactHistory::follow(const Topology& topology, const Walls<D>& walls, const Neighbours<D>& neighbours) {
  if (empty() || neighbours.version() == version_) return false;
  version_ = neighbours.version();
  const auto id = [&](Index i) { return topology.id[topology.particle[i]]; };
  for (ContactTable& table : tables_) {
    std::vector<ContactKey>& keys = keys_;
    keys.clear();
    if (table.needs().elements == Elements::points)
      for (Index i = 0; i < topology.owned_points(); ++i)
        keys.push_back({id(i), i - topology.offset[topology.particle[i]]});
    else
      for (const auto& [i, j] : list_of(neighbours, table.needs().elements))
        keys.push_back(table.pairs() ? ContactKey{std::min(id(i), id(j)), std::max(id(i), id(j))}
                                     : ContactKey{id(i), walls.surface_of_part(j)});
    table.assign(keys);
  }
  return true;
}

void ContactHistory::set(std::string_view term, const StoredContacts& contacts) {
  of(term).set(contacts);
  version_ = -1;
}

void ContactHistory::forget(Index id) {
  for (ContactTable& table : tables_) table.forget(id);
}

void ContactHistory::clear() {
  for (ContactTable& table : tables_) table.set({});
  version_ = -1;
}

HistoryWorkspace::HistoryWorkspace(const ContactHistory& history) {
  for (const ContactTable& table : history.tables()) workspaces_.emplace_back(table.needs());
}

ContactWorkspace& HistoryWorkspace::of(std::string_view term) {
  for (ContactWorkspace& workspace : workspaces_)
    if (workspace.needs().name == term) return workspace;
  throw std::logic_error("there is no workspace for the history of " + std::string(term));
}

void HistoryWorkspace::follow(const ContactHistory& history) {
  for (std::size_t k = 0; k < workspaces_.size(); ++k) workspaces_[k].follow(history.tables()[k]);
}

template bool ContactHistory::follow(const Topology&, const Walls<2>&, const Neighbours<2>&);
template bool ContactHistory::follow(const Topology&, const Walls<3>&, const Neighbours<3>&);

}  // namespace pliant
