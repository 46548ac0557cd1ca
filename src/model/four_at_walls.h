// Contacts of particles with walls, placed one by one and settled four at a time.
#pragma once

#include <algorithm>
#include <array>

#include <pliant/model/term.h>

namespace pliant {

/// Up to four contacts of a term that have been placed, to be settled together.
template <int D, class Term>
struct FourAtWalls {
  using Next = ContactWorkspace::Next<Term::history, true>;

  std::array<typename Term::Touch, 4> touch;
  std::array<Index, 4> element;
  std::array<const Real*, 4> current;  ///< null without a history
  Index count = 0;
  std::array<Real, losses_of<Term>()> lost{};  ///< losses of all settled contacts
};

/// The forces of a range of elements: RangeTerm::add_forces. The term has place(s, e, touch), the first part of its
/// find(), and settle_four(four, term, s, next, force, total) adds the forces of the contacts that were placed and
/// writes their contact history. total: with the elastic forces. untouched(e): called for elements that do not touch,
/// except some that are too far apart.
template <int D, class Term, class Untouched>
PLIANT_INLINE void add_wall_forces(const Term& term, const StateView<D>& s, Range range, const ContactTable& table,
                                   ContactWorkspace& workspace, const Scatter<D, 1>& force, bool total,
                                   Untouched&& untouched) {
  const ContactTable::Current<Term::history> current(table);
  const typename FourAtWalls<D, Term>::Next next(table, workspace);
  next.clear(range);
  FourAtWalls<D, Term> four;
  const auto take = [&](Index e) {
    if (!term.place(s, e, four.touch[four.count])) return untouched(e);
    four.element[four.count] = e;
    four.current[four.count] = current(e);
    if (++four.count == 4) settle_four(four, term, s, next, force, total);
  };
  if constexpr (requires { term.near(s, Index()); }) {
    // First which elements, without a branch that depends on them: most of a list does not touch.
    Index* const which = workspace.indices(range);
    Index count = 0;
    for (Index e = range.first; e < range.last; ++e) {
      which[count] = e;
      count += term.near(s, e) ? 1 : 0;
    }
    for (Index k = 0; k < count; ++k) take(which[k]);
  } else {
    for (Index e = range.first; e < range.last; ++e) take(e);
  }
  if (four.count > 0) settle_four(four, term, s, next, force, total);
  if (range.size() > 0) std::ranges::copy(four.lost, workspace.losses(range));
}

}  // namespace pliant
