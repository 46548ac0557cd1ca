// What terms keep of contacts from step to step: tangential springs and the like.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <pliant/model/neighbours.h>
#include <pliant/model/topology.h>

namespace pliant {

/// What a term keeps: `width` numbers for every contact of its kind of elements, which are pairs of points or points
/// with parts of walls.
struct HistoryNeeds {
  std::string name;
  Elements elements;
  int width;
};

/// Two particles by id, the lower one first; or a particle and the number of a surface of the walls.
struct ContactKey {
  Index first, second;
  auto operator<=>(const ContactKey&) const = default;  // NOLINT(modernize-use-nullptr): there is no pointer
};

/// Contacts, each once, sorted by key. values [keys · width]
struct StoredContacts {
  std::vector<ContactKey> keys;
  std::vector<Real> values;

  std::span<const Real> row(std::size_t k, int width) const {
    return std::span(values).subspan(k * static_cast<std::size_t>(width), static_cast<std::size_t>(width));
  }
  void add(const ContactKey& key, std::span<const Real> numbers) {
    keys.push_back(key);
    values.insert(values.end(), numbers.begin(), numbers.end());
  }
};

/// The history of one term. An entry of the list of its elements has the numbers of its contact: evaluations read them,
/// and nothing but an accepted step changes them. A pair that is listed twice, on both sides of the border of a chunk
/// or of a rank, has them twice; a term that looks at a pair in the order of the ids advances both alike, bit for bit.
class ContactTable {
 public:
  explicit ContactTable(HistoryNeeds needs) : needs_(std::move(needs)) {}

  const HistoryNeeds& needs() const { return needs_; }
  /// Whether contacts are between particles, rather than with walls.
  bool pairs() const { return needs_.elements == Elements::point_pairs; }

  /// What was known of element e at the end of the last accepted step: `width` numbers; none if it was no contact then.
  std::span<const Real> past(Index e) const {
    if (touched_[e] == 0) return {};
    return {values_.data() + static_cast<std::size_t>(e) * needs_.width, static_cast<std::size_t>(needs_.width)};
  }

  /// Moves element e to the end of an accepted step: advance(known, numbers) changes its numbers, zeros where `known`
  /// is false as the contact is new, and returns whether it touches; if not it must leave them alone. Different
  /// elements may be advanced at the same time.
  template <class Advance>
  void advance(Index e, Advance&& advance) {
    const std::span numbers(values_.data() + static_cast<std::size_t>(e) * needs_.width,
                            static_cast<std::size_t>(needs_.width));
    const bool known = touched_[e] != 0, touches = advance(known, numbers);
    if (known && !touches) std::ranges::fill(numbers, 0);
    touched_[e] = touches ? 1 : 0;
  }
  /// All elements have been advanced: what is not listed does not touch.
  void advanced() { unlisted_ = {}; }

  /// All contacts that this rank knows: every one with a particle of its own.
  StoredContacts contacts() const;
  /// These instead, in any order; a contact may be there twice, with the same numbers. They take their places in the
  /// list with the next assign().
  void set(const StoredContacts& contacts);
  /// The list has other entries, with these keys. Contacts that are not in it, as positions are those of a trial state,
  /// are kept until the next accepted step.
  void assign(std::vector<ContactKey> keys);

 private:
  HistoryNeeds needs_;
  std::vector<ContactKey> keys_;       ///< [list]
  std::vector<std::uint8_t> touched_;  ///< [list]
  std::vector<Real> values_;           ///< [list · width]; zeros where nothing touched
  StoredContacts unlisted_;
};

/// The histories of all terms of a model that have one. It follows the lists: contacts are known by ids, so that
/// rebuilding, sorting and moving between ranks changes nothing. Particles have one point each.
class ContactHistory {
 public:
  /// Errors: std::logic_error for two terms of one name, and for elements that are no such pairs.
  explicit ContactHistory(std::vector<HistoryNeeds> needs);

  bool empty() const { return tables_.empty(); }
  /// The history of the term called so.
  const ContactTable& of(std::string_view term) const;
  ContactTable& of(std::string_view term) { return const_cast<ContactTable&>(std::as_const(*this).of(term)); }
  const std::vector<ContactTable>& tables() const { return tables_; }

  /// Makes every entry of the lists find its contact. Costs nothing while the lists are the same.
  template <int D>
  void follow(const Topology& topology, const Walls<D>& walls, const Neighbours<D>& neighbours);
  /// After an accepted step, when all tables were advanced.
  void advanced();
  /// See ContactTable::set.
  void set(std::string_view term, const StoredContacts& contacts);
  /// Nothing touches anything.
  void clear();

 private:
  std::vector<ContactTable> tables_;
  std::int64_t version_ = -1;  ///< of the lists
};

}  // namespace pliant
