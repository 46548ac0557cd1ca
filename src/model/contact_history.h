// Contact history: numbers that terms store per contact from step to step, such as tangential springs.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
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
/// points, points with walls, or points with the base that all of them lie on.
struct HistoryNeeds {
  std::string name;
  Elements elements;
  int width;
  std::vector<std::string> losses = {};  ///< names of losses of energy into heat, whose sums are stored
  int constants = 0;                     ///< numbers of an element that stay the same as long as the list does
};

/// Two particles by id, the lower one first; or a particle and the number of a surface of the walls, or of which of its
/// points lies on the base.
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
/// and write the next history, valid if the step ends there: an accepted step makes it the current one. Parts of walls
/// that are of one surface have one contact with a point.
/// A pair that is listed twice, on both sides of the border of a chunk or of a rank, has them twice; a term that looks
/// at a pair in the order of the ids keeps the same of both, bit for bit.
class ContactTable {
 public:
  explicit ContactTable(HistoryNeeds needs) : needs_(std::move(needs)), heat_(needs_.losses.size()) {}

  const HistoryNeeds& needs() const { return needs_; }
  /// Whether contacts are between particles, rather than with walls.
  bool pairs() const { return needs_.elements == Elements::point_pairs; }

  /// The rank's share of the heat of each of the losses in all accepted steps.
  std::span<const Real> heat() const { return heat_; }
  void add_heat(std::span<const Real> heat) {
    for (std::size_t k = 0; k < heat_.size(); ++k) heat_[k] += heat[k];
  }
  void set_heat(std::span<const Real> heat) { heat_.assign(heat.begin(), heat.end()); }

  /// Current history of element e, of the last accepted step: `width` numbers; none if there was no contact then.
  PLIANT_INLINE std::span<const Real> past(Index e) const {
    const std::size_t k = contact_of(e);
    if (now_.touched[k] == 0) return {};
    return {now_.values.data() + k * needs_.width, static_cast<std::size_t>(needs_.width)};
  }

  /// The same for loops over elements: null where there was no contact.
  template <int Width>
  class Pasts {
   public:
    explicit Pasts(const ContactTable& table)
        : contact_of_(table.contact_of_.empty() ? nullptr : table.contact_of_.data()),
          touched_(table.now_.touched.data()),
          values_(table.now_.values.data()) {}
    PLIANT_INLINE const Real* operator()(Index e) const { return known(e) ? values_ + contact_of(e) * Width : nullptr; }
    /// Whether there was one.
    PLIANT_INLINE bool known(Index e) const { return touched_[contact_of(e)] != 0; }

   private:
    PLIANT_INLINE std::size_t contact_of(Index e) const {
      return static_cast<std::size_t>(contact_of_ == nullptr ? e : contact_of_[e]);
    }
    const Index* contact_of_;
    const std::uint8_t* touched_;
    const Real* values_;
  };
  template <int Width>
  Pasts<Width> pasts() const {
    return Pasts<Width>(*this);
  }

  /// The same of elements that are contacts of their own, for loops over several at a time.
  template <int Width>
  class Rows {
   public:
    explicit Rows(const ContactTable& table) : touched_(table.now_.touched.data()), values_(table.now_.values.data()) {}
    /// Zeros where there was no contact.
    PLIANT_INLINE const Real* operator()(Index e) const { return values_ + static_cast<std::ptrdiff_t>(e) * Width; }
    PLIANT_INLINE bool known(Index e) const { return touched_[e] != 0; }
    /// All numbers of a range; null where one of it was no contact.
    PLIANT_INLINE const Real* all(Range range) const {
      for (Index e = range.first; e < range.last; ++e)
        if (!known(e)) return nullptr;
      return (*this)(range.first);
    }

   private:
    const std::uint8_t* touched_;
    const Real* values_;
  };
  template <int Width>
  Rows<Width> rows() const {
    return Rows<Width>(*this);
  }

  /// Next history of elements, for a step that ends at the present force evaluation; undefined before it.
  /// `Shared`: of walls. Different elements may be written at the same time, of walls those of different points.
  template <int Width, bool Shared = false>
  class Ahead {
   public:
    explicit Ahead(const ContactTable& table)
        : contact_of_(table.contact_of_.data()),
          touched_(table.next_.touched.data()),
          values_(table.next_.values.data()) {}
    /// Whether there is a contact, as was written last.
    PLIANT_INLINE bool known(Index e) const { return touched_[contact_of(e)] != 0; }
    /// There is one: its numbers, to be set.
    PLIANT_INLINE Real* touches(Index e) const {
      touched_[contact_of(e)] = 1;
      return values_ + contact_of(e) * Width;
    }
    /// The same of a range of elements that are contacts of their own.
    PLIANT_INLINE Real* touches(Range range) const {
      static_assert(!Shared);
      std::fill_n(touched_ + range.first, range.size(), std::uint8_t{1});
      return values_ + contact_of(range.first) * Width;
    }
    /// There is none.
    PLIANT_INLINE void parted(Index e) const {
      touched_[contact_of(e)] = 0;
      std::fill_n(values_ + contact_of(e) * Width, Width, 0.0);
    }
    /// None of a range does; of walls before any of them touches, as several may be one contact.
    PLIANT_INLINE void parted(Range range) const {
      for (Index e = range.first; e < range.last; ++e)
        if (known(e)) parted(e);
    }

   private:
    PLIANT_INLINE std::ptrdiff_t contact_of(Index e) const { return Shared ? contact_of_[e] : e; }
    const Index* contact_of_;
    std::uint8_t* touched_;
    Real* values_;
  };
  /// An index for each element of a range, for such an evaluation to use.
  Index* room(Range range) const { return room_.data() + range.first; }
  /// Losses of the elements of a range, per time or in the step; the range is not empty. [losses]
  Real* lost(Range range) const { return lost_.data() + static_cast<std::size_t>(range.first) * needs_.losses.size(); }
  /// The step has ended where the forces of all elements were evaluated last. Elements that are not listed do not
  /// touch.
  void accept() {
    std::swap(now_, next_);
    unlisted_ = {};
  }

  /// Constants of element e and of the elements after it, zeros until the term has set them. Different elements may be
  /// set at the same time.
  Real* constants(Index e) const { return constants_.data() + static_cast<std::ptrdiff_t>(e) * needs_.constants; }

  /// All contacts that this rank knows: every one with a particle of its own.
  StoredContacts contacts() const;
  /// These instead, in any order; a contact may be there twice, with the same numbers. They take their places in the
  /// list with the next assign().
  void set(const StoredContacts& contacts);
  /// Those of this particle are over, whatever it touches next.
  void forget(Index id);
  /// The list has other entries, with these keys. Contacts that are not in it, as positions are those of a trial state,
  /// are kept until the next accepted step.
  void assign(std::vector<ContactKey> keys);

 private:
  struct Side {
    std::vector<std::uint8_t> touched;  ///< [contacts]
    std::vector<Real> values;           ///< [contacts · width]; zeros where nothing touches

    void resize(std::size_t contacts, int width) {
      touched.assign(contacts, 0);
      values.assign(contacts * static_cast<std::size_t>(width), 0);
    }
  };
  /// It touches no more.
  void end(std::size_t contact);
  /// Whether several elements may be one contact.
  bool shared() const { return needs_.elements == Elements::walls; }
  std::size_t contact_of(Index e) const {
    return static_cast<std::size_t>(contact_of_.empty() ? e : contact_of_[static_cast<std::size_t>(e)]);
  }

  HistoryNeeds needs_;
  std::vector<Index> contact_of_;  ///< [list]; empty: each element is one
  std::vector<ContactKey> keys_;   ///< [contacts]
  Side now_;
  mutable Side next_;       ///< written ahead
  std::vector<Real> heat_;  ///< [losses]
  StoredContacts unlisted_;
  mutable std::vector<Real> constants_;  ///< [list · constants]
  mutable std::vector<Index> room_;      ///< [list]
  mutable std::vector<Real> lost_;       ///< [list · losses], at the first element of each range
};

/// The histories of all terms of a model that have one. It follows the lists: contacts are known by ids, so that
/// rebuilding, sorting and moving between ranks changes nothing. Particles have one point each where pairs or walls
/// have a history.
class ContactHistory {
 public:
  /// Errors: std::logic_error for two terms of one name, and for other elements.
  explicit ContactHistory(std::vector<HistoryNeeds> needs);

  bool empty() const { return tables_.empty(); }
  /// The history of the term called so.
  const ContactTable& of(std::string_view term) const;
  ContactTable& of(std::string_view term) { return const_cast<ContactTable&>(std::as_const(*this).of(term)); }
  const std::vector<ContactTable>& tables() const { return tables_; }

  /// Makes every entry of the lists find its contact. Costs nothing while the lists are the same.
  template <int D>
  void follow(const Topology& topology, const Walls<D>& walls, const Neighbours<D>& neighbours);
  /// See ContactTable::set.
  void set(std::string_view term, const StoredContacts& contacts);
  /// The particle was put somewhere else: its contacts are over.
  void forget(Index id);
  /// Nothing touches anything.
  void clear();

 private:
  std::vector<ContactTable> tables_;
  std::int64_t version_ = -1;  ///< of the lists
};

}  // namespace pliant
