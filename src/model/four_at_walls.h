// Contacts of particles with walls, placed one by one and settled four at a time.
#pragma once

#include <algorithm>
#include <array>

#include <pliant/model/term.h>

namespace pliant {

/// Up to four contacts of a term that have been placed, to be settled together.
template <int D, class Term>
struct FourAtWalls {
  using Current = ContactTable::Current<Term::history>;
  using Next = ContactWorkspace::Next<Term::history, true>;

  std::array<typename Term::Touch, 4> touch;
  std::array<Index, 4> element;
  std::array<const Real*, 4> current;  ///< null without a history
  Index count = 0;
  std::array<Real, losses_of<Term>()> lost{};  ///< losses of all settled contacts
};

/// The forces of a range of elements: RangeTerm::add_forces. The term has place(s, e, touch), the first part of its
/// find(), and settle_four(four, s, next, force, total) adds the forces of the contacts that were placed and
/// writes their contact history. total: with the elastic forces. untouched(e): called for elements that do not touch,
/// except some that are too far apart.
/// A term may also have find_near(s, range, near), which writes the elements that may touch and returns their number;
/// and settle_at_rest(s, elements, count, current, next, force, total, lost), which does the work of place()
/// and settle_four() for up to four elements, or returns false.
template <int D, class Term, class Untouched>
PLIANT_INLINE void add_wall_forces(const Term& term, const StateView<D>& s, Range range, const ContactTable& table,
                                   ContactWorkspace& workspace, const Scatter<D, 1>& force, bool total,
                                   Untouched&& untouched) {
  const typename FourAtWalls<D, Term>::Current current(table);
  const typename FourAtWalls<D, Term>::Next next(table, workspace);
  next.clear(range);
  FourAtWalls<D, Term> four;
  const auto take = [&](Index e) {
    if (!term.place(s, e, four.touch[four.count])) return untouched(e);
    four.element[four.count] = e;
    four.current[four.count] = current(e);
    if (++four.count == 4) term.settle_four(four, s, next, force, total);
  };
  if constexpr (requires { term.find_near(s, range, workspace.indices(range)); }) {
    Index* const elements = workspace.indices(range);
    const Index near = term.find_near(s, range, elements);
    for (Index k = 0; k < near; k += 4) {
      const Index count = std::min(near - k, Index(4));
      if (!term.settle_at_rest(s, elements + k, count, current, next, force, total, four.lost))
        for (Index l = 0; l < count; ++l) take(elements[k + l]);
    }
  } else {
    for (Index e = range.first; e < range.last; ++e) take(e);
  }
  if (four.count > 0) term.settle_four(four, s, next, force, total);
  if (range.size() > 0) std::ranges::copy(four.lost, workspace.losses(range));
}

}  // namespace pliant
