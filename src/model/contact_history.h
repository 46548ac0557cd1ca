// Contact history: numbers that terms store per contact from step to step, such as tangential springs.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <pliant/base/multiversion.h>
#include <pliant/model/neighbours.h>
#include <pliant/model/topology.h>

namespace pliant {

/// Size of a term's contact history: `width` numbers for every contact of its kind of elements, which are pairs of
/// points, points with walls, or points with the substrate.
struct HistoryNeeds {
  std::string name;
  Elements elements;
  int width;
  std::vector<std::string> losses = {};  ///< names of losses of energy into heat, whose sums are stored
  int constants = 0;                     ///< numbers of an element that stay the same as long as the list does
};

/// Two particles by id, the lower one first; or a particle and the number of a surface of the walls, or the number of
/// one of its points, for contacts with the substrate.
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

/// Numbers of contacts, and whether each of them touches.
struct ContactNumbers {
  std::vector<std::uint8_t> touches;  ///< [contacts]
  std::vector<Real> values;           ///< [contacts · width]; zeros where nothing touches

  void resize(std::size_t contacts, int width) {
    touches.assign(contacts, 0);
    values.assign(contacts * static_cast<std::size_t>(width), 0);
  }
};

class ContactWorkspace;

/// The current history of one term. Each entry of the list of the term's elements has the numbers of its contact, which
/// are valid at the last accepted step. Force evaluations read them and write the next history into a ContactWorkspace;
/// an accepted step makes the next history the current one. Parts of walls that belong to one surface have one contact
/// with a point.
/// A pair that is listed twice, on both sides of the border of a chunk or of a rank, has its numbers twice; a term that
/// computes each pair in the order of its ids gets the same numbers on both sides, bit for bit.
class ContactTable {
 public:
  explicit ContactTable(HistoryNeeds needs) : needs_(std::move(needs)), heat_(needs_.losses.size()) {}

  const HistoryNeeds& needs() const { return needs_; }
  /// Whether contacts are between particles, rather than with walls.
  bool pairs() const { return needs_.elements == Elements::point_pairs; }
  /// Entries of the list, and contacts in them: fewer where several elements are one contact.
  std::size_t elements() const { return contact_of_.empty() ? keys_.size() : contact_of_.size(); }
  std::size_t listed_contacts() const { return keys_.size(); }

  /// The rank's share of the heat of each of the losses in all accepted steps.
  std::span<const Real> heat() const { return heat_; }
  void add_heat(std::span<const Real> heat) {
    for (std::size_t k = 0; k < heat_.size(); ++k) heat_[k] += heat[k];
  }
  void set_heat(std::span<const Real> heat) { heat_.assign(heat.begin(), heat.end()); }

  /// Current history of element e: `width` numbers; none if there was no contact at the last accepted step.
  PLIANT_INLINE std::span<const Real> current(Index e) const {
    const std::size_t k = contact_of(e);
    if (current_.touches[k] == 0) return {};
    return {current_.values.data() + k * needs_.width, static_cast<std::size_t>(needs_.width)};
  }

  /// Current history for loops over elements: null where there was no contact.
  template <int Width>
  class Current {
   public:
    explicit Current(const ContactTable& table)
        : contact_of_(table.contact_of_.empty() ? nullptr : table.contact_of_.data()),
          touches_(table.current_.touches.data()),
          values_(table.current_.values.data()) {}
    PLIANT_INLINE const Real* operator()(Index e) const {
      return touches(e) ? values_ + contact_of(e) * Width : nullptr;
    }
    /// Whether there was a contact.
    PLIANT_INLINE bool touches(Index e) const { return touches_[contact_of(e)] != 0; }

   private:
    PLIANT_INLINE std::size_t contact_of(Index e) const {
      return static_cast<std::size_t>(contact_of_ == nullptr ? e : contact_of_[e]);
    }
    const Index* contact_of_;
    const std::uint8_t* touches_;
    const Real* values_;
  };

  /// Current history of elements that are contacts of their own, for loops over several elements at a time.
  template <int Width>
  class CurrentRows {
   public:
    explicit CurrentRows(const ContactTable& table)
        : touches_(table.current_.touches.data()), values_(table.current_.values.data()) {}
    /// Zeros where there was no contact.
    PLIANT_INLINE const Real* operator()(Index e) const { return values_ + static_cast<std::ptrdiff_t>(e) * Width; }
    PLIANT_INLINE bool touches(Index e) const { return touches_[e] != 0; }
    /// All numbers of a range; null if one of its elements was not a contact.
    PLIANT_INLINE const Real* all(Range range) const {
      for (Index e = range.first; e < range.last; ++e)
        if (!touches(e)) return nullptr;
      return (*this)(range.first);
    }

   private:
    const std::uint8_t* touches_;
    const Real* values_;
  };

  /// The step has ended where the forces of all elements were evaluated last: swaps the current and the next history.
  /// Elements that are not listed do not touch.
  void accept(ContactWorkspace& workspace);

  /// All contacts of this rank, that is, all contacts with an owned particle.
  StoredContacts contacts() const;
  /// These instead, in any order; a contact may be there twice, with the same numbers. They take their places in the
  /// list with the next assign().
  void set(const StoredContacts& contacts);
  /// Ends all contacts of this particle.
  void forget(Index id);
  /// The list has other entries, with these keys. Contacts that are not in the list, which may belong to a trial state,
  /// are kept until the next accepted step.
  void assign(const std::vector<ContactKey>& list);

 private:
  friend class ContactWorkspace;
  /// The contact has ended.
  void end(std::size_t contact);
  /// Contacts of this rank in any order, pairs of two chunks twice.
  void append_to(StoredContacts& all) const;
  /// Whether several elements may be one contact.
  bool shared() const { return needs_.elements == Elements::walls; }
  std::size_t contact_of(Index e) const {
    return static_cast<std::size_t>(contact_of_.empty() ? e : contact_of_[static_cast<std::size_t>(e)]);
  }

  HistoryNeeds needs_;
  std::vector<Index> contact_of_;  ///< [list]; empty: each element is one
  std::vector<ContactKey> keys_;   ///< [contacts]
  ContactNumbers current_;
  std::vector<Real> heat_;  ///< [losses]
  StoredContacts unlisted_;
  /// Memory of assign(), which is called often.
  struct Scratch {
    StoredContacts known;
    std::vector<std::size_t> start;  ///< first row of each id in `rows`
    std::vector<std::size_t> rows;   ///< of `known`, by the first id of their keys
    std::vector<std::uint8_t> listed;
  } scratch_;
};

/// The arrays that force evaluations write for one term with contact history: the next history, which is valid if the
/// step ends at the evaluated state, and scratch. Different elements may be written at the same time; elements of
/// walls, if they are of different points.
class ContactWorkspace {
 public:
  explicit ContactWorkspace(HistoryNeeds needs) : needs_(std::move(needs)) {}

  const HistoryNeeds& needs() const { return needs_; }
  /// Allocates memory for the list of a table, after its assign(). No element touches and no constant is set.
  void follow(const ContactTable& table) {
    next_.resize(table.listed_contacts(), needs_.width);
    scratch_.indices.resize(table.elements());
    scratch_.losses.resize(table.elements() * needs_.losses.size());
    constants_.assign(table.elements() * static_cast<std::size_t>(needs_.constants), 0);
  }

  /// Next history of elements; undefined before the force evaluation. `Shared`: of walls.
  template <int Width, bool Shared = false>
  class Next {
   public:
    Next(const ContactTable& table, ContactWorkspace& workspace)
        : contact_of_(table.contact_of_.data()),
          touches_(workspace.next_.touches.data()),
          values_(workspace.next_.values.data()) {}
    /// Whether there is a contact, as was written last.
    PLIANT_INLINE bool touches(Index e) const { return touches_[contact_of(e)] != 0; }
    /// Bit k: whether element e + k touches, of 64 elements.
    PLIANT_INLINE std::uint64_t touch_bits(Index e) const {
      static_assert(!Shared);
      std::uint64_t all = 0;
      for (int k = 0; k < 64; k += 8) {
        std::uint64_t eight;  // bytes of 0 or 1, the first of which is to be the lowest
        std::memcpy(&eight, touches_ + e + k, sizeof eight);
        if constexpr (std::endian::native == std::endian::big) eight = __builtin_bswap64(eight);
        all |= (eight * 0x0102040810204080) >> 56 << k;  // the product gathers the eight bits in its highest byte
      }
      return all;
    }
    /// Element e touches: its numbers, to be written.
    PLIANT_INLINE Real* set(Index e) const {
      touches_[contact_of(e)] = 1;
      return values_ + contact_of(e) * Width;
    }
    /// All elements of a range touch, which are contacts of their own.
    PLIANT_INLINE Real* set(Range range) const {
      static_assert(!Shared);
      std::fill_n(touches_ + range.first, range.size(), std::uint8_t{1});
      return values_ + contact_of(range.first) * Width;
    }
    /// Element e does not touch.
    PLIANT_INLINE void clear(Index e) const {
      touches_[contact_of(e)] = 0;
      std::fill_n(values_ + contact_of(e) * Width, Width, 0.0);
    }
    /// No element of a range touches. Elements of walls are cleared before any of them is set, because several elements
    /// may be one contact.
    PLIANT_INLINE void clear(Range range) const {
      for (Index e = range.first; e < range.last; ++e)
        if (touches(e)) clear(e);
    }

   private:
    PLIANT_INLINE std::ptrdiff_t contact_of(Index e) const { return Shared ? contact_of_[e] : e; }
    const Index* contact_of_;
    std::uint8_t* touches_;
    Real* values_;
  };

  /// Scratch: an index for each element of a range.
  Index* indices(Range range) { return scratch_.indices.data() + range.first; }
  /// Losses of the elements of a range, per time or in the step; the range is not empty. [losses]
  Real* losses(Range range) {
    return scratch_.losses.data() + static_cast<std::size_t>(range.first) * needs_.losses.size();
  }
  /// Constants of element e and of the elements after it, zeros until the term has set them for the present list.
  Real* constants(Index e) { return constants_.data() + static_cast<std::ptrdiff_t>(e) * needs_.constants; }

 private:
  friend class ContactTable;
  struct Scratch {
    std::vector<Index> indices;  ///< [list]
    std::vector<Real> losses;    ///< [list · losses], at the first element of each range
  };

  HistoryNeeds needs_;
  ContactNumbers next_;
  Scratch scratch_;
  std::vector<Real> constants_;  ///< [list · constants]
};

/// The current histories of all terms of a model that have one. They follow the lists: contacts are known by ids, so
/// that rebuilding, sorting and moving between ranks changes nothing. Particles have one point each where pairs or
/// walls have a history.
class ContactHistory {
 public:
  /// Errors: std::logic_error for two terms of one name, and for other elements.
  explicit ContactHistory(std::vector<HistoryNeeds> needs);

  bool empty() const { return tables_.empty(); }
  /// The history of the term called so.
  const ContactTable& of(std::string_view term) const;
  ContactTable& of(std::string_view term) { return const_cast<ContactTable&>(std::as_const(*this).of(term)); }
  const std::vector<ContactTable>& tables() const { return tables_; }

  /// Makes every entry of the lists find its contact, and returns whether the lists have changed since the last call.
  template <int D>
  bool follow(const Topology& topology, const Walls<D>& walls, const Neighbours<D>& neighbours);
  /// See ContactTable::set.
  void set(std::string_view term, const StoredContacts& contacts);
  /// The particle was moved to another place: its contacts end.
  void forget(Index id);
  /// Ends all contacts.
  void clear();

 private:
  std::vector<ContactTable> tables_;
  std::vector<ContactKey> keys_;  ///< memory of follow()
  std::int64_t version_ = -1;     ///< of the lists
};

/// The workspaces of all terms of a model that have a contact history. A force evaluation gets them next to its
/// StateView, which only reads.
class HistoryWorkspace {
 public:
  explicit HistoryWorkspace(const ContactHistory& history);

  /// The workspace of the term called so.
  ContactWorkspace& of(std::string_view term);
  /// After ContactHistory::follow has returned true for `history`.
  void follow(const ContactHistory& history);

 private:
  std::vector<ContactWorkspace> workspaces_;  ///< in the order of the tables
};

}  // namespace pliant
