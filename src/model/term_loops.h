// The loops over the elements of one term. They are functions of their own, not inlined, so that the compiler makes
// them once for a term and not once for every model that has the term; loops that need no term it makes once for a kind
// of elements.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/model/force_field.h>
#include <pliant/model/term.h>

namespace pliant {

template <class T>
using KindOf = ElementKind<T::elements>;

/// Receives gradients: Σ ∂U/∂r_i ⊗ r_i.
template <int D>
struct VirialSum {
  const Real* x;
  Mat<D> sum = Mat<D>::Zero();
  void add(Index i, const Vec<D>& gradient) { sum += gradient * point<D>(x, i).transpose(); }
};

/// Receives forces on points, or gradients: their sum over the points of one particle.
template <int D>
struct SumOnParticle {
  const Topology& topology;
  Index particle;
  Vec<D> sum = Vec<D>::Zero();
  void add(Index i, const Vec<D>& force) {
    if (topology.particle[i] == particle) sum += force;
  }
  void add_torque(Index, const Rotation<D>&) {}
};

/// Whether a term has second derivatives.
template <class T, int D>
inline constexpr bool has_derivatives = !has_torque<T> && !HistoryTerm<T, D>;

/// Whether a dissipation has ∂F/∂x.
template <class T, int D>
inline constexpr bool depends_on_x = requires(const T term, const StateView<D>& s, BlockSink<D>& h) {
  term.add_dforce_dx(s, Index(), h);
};

/// Whether an energy has second derivatives without pre-stress.
template <class T, int D>
inline constexpr bool drops_pre_stress = requires(const T term, const StateView<D>& s, BlockSink<D>& h) {
  term.add_hessian(s, Index(), h, PreStress::dropped);
};

/// The elements of a kind, of any term.
template <int D, Elements E>
class ElementLoops {
  using View = StateView<D>;
  using Kind = ElementKind<E>;

 public:
  /// The elements in a chunk, and those across the border of the chunk.
  static Range inside(const View& s, Index chunk) { return Kind::inside(s.neighbours, chunk); }
  static Range across(const View& s, Index chunk) {
    if constexpr (Kind::paired)
      return (s.neighbours.*Kind::list).across(chunk);
    else
      return {};
  }

  /// Whether an element of a chunk, or across its border, counts there: elements of inactive particles do not, and an
  /// element across a border counts in one chunk. Lists contain active particles only.
  static bool counts(const View& s, Index chunk, Index e) {
    if constexpr (!Kind::listed) return s.topology.active[Kind::particle(s.topology, e)] != 0;
    if constexpr (Kind::paired)
      return inside(s, chunk).contains(e) || s.neighbours.points(chunk).contains(counts_at<E>(s, e));
    return true;
  }

  /// The elements that have a point in one of these ranges, which are few.
  [[gnu::noinline]] static void for_each_at(const View& s, std::span<const Range> points,
                                            const std::function<void(Index)>& visit) {
    for (Index c = 0; c < s.neighbours.chunks(); ++c)
      for (const Range part : {inside(s, c), across(s, c)})
        for (Range some{part.first, part.first}; some.last < part.last; some.first = some.last) {
          some.last = std::min(part.last, some.first + 64);
          if (!touches(s, some, points)) continue;
          for (Index e = some.first; e < some.last; ++e)
            if (touches(s, {e, e + 1}, points) && counts(s, c, e)) visit(e);
        }
  }

  /// Whether the wall of an element moves.
  [[gnu::noinline]] static bool wall_moves(const View& s, Index e) {
    Index wall;
    if constexpr (E == Elements::lips)
      wall = s.walls.lips()[s.neighbours.lips[e].first].wall;
    else
      wall = s.walls.wall_of_part(s.neighbours.walls[e].second);
    return !s.walls.motion(s.walls.body_of_wall(wall)).rests();
  }
  /// Adds the opposite of the force on an element to its wall: see ForceField::add_wall_forces.
  [[gnu::noinline]] static void push_wall(const View& s, Index e, const Vec<D>& force, Real* f, Real* on_pivots) {
    const auto [wall, place] = touched_wall(s, e);
    point<D>(f, wall) -= force;
    if (on_pivots == nullptr) return;
    const Motion<D>& motion = s.walls.motion(s.walls.body_of_wall(wall));
    add_rotation<D>(on_pivots, wall, torque(Vec<D>(place - motion.pivot - motion.shift(s.t)), Vec<D>(-force)));
  }

 private:
  /// Whether one of these elements has a point in one of the ranges. Without branches, for the sake of speed.
  static bool touches(const View& s, Range elements, std::span<const Range> points) {
    unsigned found = 0;
    for (const Range own : points) {
      const auto first = static_cast<unsigned>(own.first), count = static_cast<unsigned>(own.size());
      for (Index e = elements.first; e < elements.last; ++e)
        for (const Index i : points_of(s, e)) found |= static_cast<unsigned>(i) - first < count ? 1U : 0U;
    }
    return found != 0;
  }
  /// One point of an element that is a particle.
  static auto points_of(const View& s, Index e) {
    if constexpr (Kind::listed)
      return Kind::stencil(s.topology, (s.neighbours.*Kind::list)[e]);
    else
      return std::array{E == Elements::particles ? s.topology.offset[e] : e};
  }
  /// The wall of an element and where it is touched.
  static std::pair<Index, Vec<D>> touched_wall(const View& s, Index e) {
    if constexpr (E == Elements::lips) {
      const auto [lip, edge] = s.neighbours.lips[e];
      const Index wall = s.walls.lips()[lip].wall;
      if constexpr (D == 2) {
        return {wall, s.walls.lip(lip, s.t)};
      } else {
        const auto [a, b] = points_of_edge(s.topology, edge);
        return {wall, s.walls.lip(lip, s.position(a), s.position(b), s.t)};
      }
    } else {
      const auto [i, part] = s.neighbours.walls[e];
      Real d;
      Vec<D> n;
      s.walls.nearest(s.position(i), part, s.t, d, n);
      return {s.walls.wall_of_part(part), s.position(i) - d * n};
    }
  }
};

/// Torques in an array of forces, which they follow.
template <int D>
Real* torques_in(const StateView<D>& s, Real* f) {
  return f + static_cast<std::size_t>(s.topology.owned_points()) * D;
}

/// Blocks in the rows of own points, times a sign.
template <int D>
struct OwnRows final : BlockSink<D> {
  BlockSink<D>& to;
  Range own;
  Real sign;
  OwnRows(BlockSink<D>& sink, Range rows, Real factor) : to(sink), own(rows), sign(factor) {}
  void add(Index i, Index j, const Mat<D>& block) override {
    if (own.contains(i)) to.add(i, j, sign * block);
  }
};

/// The loops of a term. Sums continue from `sum`, element by element, so that they are the same in whatever order the
/// terms of a model are compiled.
template <int D, class T>
class TermLoops {
  using View = StateView<D>;
  using Of = ElementLoops<D, T::elements>;
  static constexpr bool has_history = HistoryTerm<T, D>, is_energy = EnergyTerm<T, D>;
  static_assert(!(has_history && is_energy));

 public:
  /// The forces of a chunk are added to f.
  [[gnu::noinline]] static void add_forces(const T& term, const View& s, HistoryWorkspace* workspace, Index chunk,
                                           Real* f) {
    constexpr int sign = is_energy ? -1 : 1;
    const auto add = [&](Range range, auto scatter) {
      if constexpr (RangeTerm<T, D>)
        if (workspace != nullptr)
          return term.add_forces(s, range, s.history->of(term.name()), workspace->of(term.name()), scatter);
      if constexpr (has_history) {
        for_each_touch(term, s, workspace, range, scatter,
                       [&](const auto& c) PLIANT_INLINE_LAMBDA { term.add_force(s, c, scatter); });
      } else {
        for (Index e = range.first; e < range.last; ++e)
          if constexpr (is_energy)
            term.add_gradient(s, e, scatter);
          else
            term.add_force(s, e, scatter);
      }
    };
    Real* const turn = has_torque<T> ? torques_in(s, f) : nullptr;
    add(Of::inside(s, chunk), Scatter<D, sign>{f, {}, turn});
    if constexpr (KindOf<T>::paired) add(Of::across(s, chunk), Scatter<D, sign, true>{f, s.pushed(chunk), turn});
  }

  /// sum + the energy of a chunk.
  [[gnu::noinline]] static Real add_energy(const T& term, const View& s, Index chunk, Real sum) {
    with_energies(term, s, [&](auto&& energy) { for_each_element(s, chunk, [&](Index e) { sum += energy(e); }); });
    return sum;
  }
  /// The virial of a chunk, which minimisations at a pressure need as often as the forces. Errors: InputError for a
  /// term whose forces depend on contact history.
  [[gnu::noinline]] static Mat<D> virial(const T& term, const View& s, Index chunk) {
    VirialSum<D> gradients{s.x};
    if constexpr (is_energy && !has_torque<T>)
      for_each_element(s, chunk, [&](Index e) { term.add_gradient(s, e, gradients); });
    else
      throw InputError("the term {} has no virial: its forces depend on more than positions", term.name());
    return gradients.sum;
  }
  /// The virials of the elements of a chunk, added to sums [own particles]: of one particle, or a half for each of two
  /// particles. A particle of another chunk gets its half there. Errors: as above.
  [[gnu::noinline]] static void add_particle_virials(const T& term, const View& s, Index chunk, Mat<D>* sums) {
    if constexpr (!is_energy || has_torque<T>) {
      throw InputError("the term {} has no virial: its forces depend on more than positions", term.name());
    } else if constexpr (!KindOf<T>::paired) {
      const Range range = Of::inside(s, chunk);
      for (Index e = range.first; e < range.last; ++e) {
        VirialSum<D> gradients{s.x};
        add_virial(term, s, e, gradients);
        if constexpr (KindOf<T>::listed)
          sums[s.topology.particle[(s.neighbours.*KindOf<T>::list)[e].first]] += gradients.sum;
        else
          sums[KindOf<T>::particle(s.topology, e)] += gradients.sum;
      }
    } else {
      const Range own = s.neighbours.particles(chunk);
      for (const Range range : {Of::inside(s, chunk), Of::across(s, chunk)})
        for (Index e = range.first; e < range.last; ++e) {
          VirialSum<D> gradients{s.x};
          add_virial(term, s, e, gradients);
          const Pair points = points_of_both(s, e);
          for (const Index i : {points.first, points.second})
            if (const Index m = s.topology.particle[i]; own.contains(m)) sums[m] += gradients.sum / 2;
        }
    }
  }
  /// sum + the energy of the elements that have a point in one of these ranges, which are few.
  [[gnu::noinline]] static Real add_energy_of(const T& term, const View& s, std::span<const Range> points, Real sum) {
    with_energies(term, s, [&](auto&& energy) {
      const auto add = [&](Index e) { sum += energy(e); };
      Of::for_each_at(s, points, std::ref(add));  // a reference, which allocates no memory
    });
    return sum;
  }
  /// sum + the dissipated power of a chunk.
  [[gnu::noinline]] static Real add_power(const T& term, const View& s, Index chunk, Real sum) {
    if constexpr (has_history) {
      const CurrentHistory current(s, term);
      for_each_element(s, chunk, [&](Index e) {
        typename T::Touch c;
        sum += find_touch(term, s, e, current(e), c) ? term.power(s, c) : 0;
      });
    } else {
      for_each_element(s, chunk, [&](Index e) { sum += term.power(s, e); });
    }
    return sum;
  }

  /// numbers: length of an array of forces, with torques.
  [[gnu::noinline]] static TermReport report(const T& term, const View& s, std::size_t numbers) {
    TermReport r{std::string(term.name()), is_energy, is_energy || has_history, 0, std::vector<Real>(numbers)};
    for (Index c = 0; c < s.neighbours.chunks(); ++c) {
      if constexpr (is_energy || has_history) r.energy = add_energy(term, s, c, r.energy);
      add_forces(term, s, nullptr, c, r.force.data());
    }
    if constexpr (requires { term.particle(s, Index()); }) {
      r.particle_energy.resize(s.topology.particles());
      for_each_element(s, [&](Index e) { r.particle_energy[term.particle(s, e)] += term.energy(s, e); });
    }
    return r;
  }

  /// Errors: InputError for a term without second derivatives.
  static void require_derivatives(const T& term) {
    if constexpr (!has_derivatives<T, D>)
      throw InputError("the term {} has no second derivatives; use an explicit integrator", term.name());
  }
  /// ∂F/∂x and ∂F/∂v of a chunk in the rows of its points. Errors: as above.
  [[gnu::noinline]] static void derivatives(const T& term, const View& s, Index chunk, BlockSink<D>& df_dx,
                                            BlockSink<D>& df_dv) {
    require_derivatives(term);
    if constexpr (has_derivatives<T, D>) {
      const Range own = s.neighbours.points(chunk);
      OwnRows<D> elastic(df_dx, own, -1), moved(df_dx, own, 1), damping(df_dv, own, 1);
      for (const Range range : {Of::inside(s, chunk), Of::across(s, chunk)})
        for (Index e = range.first; e < range.last; ++e)
          if constexpr (is_energy) {
            add_hessian(term, s, e, elastic, PreStress::kept);
          } else {
            add_dforce_dv(term, s, e, damping);
            if constexpr (depends_on_x<T, D>) term.add_dforce_dx(s, e, moved);
          }
    }
  }
  /// ∂²U/∂x² of an energy, ∂F/∂v of a dissipation. Errors: as above, and InputError for an energy whose pre-stress
  /// cannot be dropped.
  [[gnu::noinline]] static void add_blocks(const T& term, const View& s, BlockSink<D>& h, PreStress pre_stress) {
    require_derivatives(term);
    if (is_energy && !drops_pre_stress<T, D> && pre_stress == PreStress::dropped)
      throw InputError("the pre-stress of the term {} cannot be dropped; keep it", term.name());
    if constexpr (has_derivatives<T, D>)
      for_each_element(s, [&](Index e) {
        if constexpr (is_energy)
          add_hessian(term, s, e, h, pre_stress);
        else
          add_dforce_dv(term, s, e, h);
      });
  }

  [[gnu::noinline]] static void for_each_contact(const T& term, const View& s,
                                                 const std::function<void(const Contact<D>&)>& visit) {
    if constexpr (ContactTerm<T, D>) {
      Contact<D> contact;
      for_each_element(s, [&](Index e) {
        if (!term.contact(s, e, contact)) return;
        contact.elements = T::elements;
        contact.element = e;
        contact.point = points_of_both(s, e).first;
        visit(contact);
      });
    }
  }

  /// Nothing for a term whose elements do not join two particles, and for an energy of pairs of points.
  [[gnu::noinline]] static void for_each_pair_force(const T& term, const View& s,
                                                    const std::function<void(const PairForce<D>&)>& visit) {
    if constexpr (KindOf<T>::paired && !(is_energy && T::elements == Elements::point_pairs))
      with_forces(term, s, [&](auto&& add_force) {
        for_each_element(s, [&](Index e) {
          const Pair points = points_of_both(s, e);
          SumOnParticle<D> on{s.topology, s.topology.particle[points.first]};
          add_force(e, on);
          if (on.sum != Vec<D>::Zero())
            visit({T::elements, e, is_energy, points, is_energy ? Vec<D>(-on.sum) : on.sum});
        });
      });
  }

  /// See ForceField::add_wall_forces. Nothing for a term without walls.
  [[gnu::noinline]] static void add_wall_forces(const T& term, const View& s, Real* f, Real* on_pivots,
                                                WallGroup which) {
    if constexpr (T::elements == Elements::walls || T::elements == Elements::lips) {
      const auto add = [&](auto&& value) {
        for_each_element(s, [&](Index e) {
          if (which == WallGroup::all || Of::wall_moves(s, e)) Of::push_wall(s, e, value(e), f, on_pivots);
        });
      };
      if constexpr (requires { term.force(s, Index()); }) {
        add([&](Index e) { return term.force(s, e); });
      } else if constexpr (requires(const typename T::Touch& c) { term.force(s, c); }) {
        const CurrentHistory current(s, term);
        add([&](Index e) -> Vec<D> {
          typename T::Touch c;
          return find_touch(term, s, e, current(e), c) ? term.force(s, c) : Vec<D>(Vec<D>::Zero());
        });
      }
    }
  }

 private:
  /// A point of each of the two particles of an element.
  static Pair points_of_both(const View& s, Index e) {
    return KindOf<T>::points_of_both((s.neighbours.*KindOf<T>::list)[e]);
  }

  // Compiled once for all loops that call them: loops that no step needs.

  [[gnu::noinline]] static void add_virial(const T& term, const View& s, Index e, VirialSum<D>& sum) {
    term.add_gradient(s, e, sum);
  }
  [[gnu::noinline]] static void add_dforce_dv(const T& term, const View& s, Index e, BlockSink<D>& h) {
    term.add_dforce_dv(s, e, h);
  }
  [[gnu::noinline]] static void add_hessian(const T& term, const View& s, Index e, BlockSink<D>& h,
                                            PreStress pre_stress) {
    if constexpr (drops_pre_stress<T, D>)
      term.add_hessian(s, e, h, pre_stress);
    else
      term.add_hessian(s, e, h);
  }

  /// visit(energy), where energy(e) is the energy of an element.
  template <class Visit>
  static void with_energies(const T& term, const View& s, Visit&& visit) {
    if constexpr (has_history) {
      const CurrentHistory current(s, term);
      visit([&](Index e) {
        typename T::Touch c;
        return find_touch(term, s, e, current(e), c) ? term.energy(s, c) : 0;
      });
    } else {
      visit([&](Index e) { return term.energy(s, e); });
    }
  }

  /// visit(add), where add(e, sink) adds the forces of an element, or the gradients of an energy, to a sink.
  template <class Visit>
  static void with_forces(const T& term, const View& s, Visit&& visit) {
    if constexpr (has_history) {
      const CurrentHistory current(s, term);
      visit([&](Index e, auto& sink) {
        typename T::Touch c;
        if (find_touch(term, s, e, current(e), c)) term.add_force(s, c, sink);
      });
    } else {
      visit([&](Index e, auto& sink) {
        if constexpr (is_energy)
          term.add_gradient(s, e, sink);
        else
          term.add_force(s, e, sink);
      });
    }
  }

  template <class Visit>
  static void for_each_element(const View& s, Index chunk, Visit&& visit) {
    for (const Range part : {Of::inside(s, chunk), Of::across(s, chunk)})
      for (Index e = part.first; e < part.last; ++e)
        if (Of::counts(s, chunk, e)) visit(e);
  }
  template <class Visit>
  static void for_each_element(const View& s, Visit&& visit) {
    for (Index c = 0; c < s.neighbours.chunks(); ++c) for_each_element(s, c, visit);
  }
};

}  // namespace pliant
