// Particles, walls, neighbour lists and forces as one equation of motion, on one rank or on several.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include <pliant/base/log.h>
#include <pliant/domain/halo.h>
#include <pliant/domain/migration.h>
#include <pliant/domain/skin.h>
#include <pliant/geometry/walls_in_box.h>
#include <pliant/model/model.h>
#include <pliant/model/polygon.h>
#include <pliant/system/implicit_system.h>

namespace pliant {

/// M r̈ = F(r, ṙ) for the points of a topology [H 7, 13]. Inactive particles keep their positions: their inverse mass is
/// zero. On several ranks each has a share of the particles, and copies (ghosts) of others' near them; all functions
/// that take positions are collective then. In a periodic box images of particles are ghosts too, so that nothing else
/// knows of the box. Positions may lie anywhere; sort() puts them back into the box.
template <int D>
class ParticleSystem final : public ImplicitSystem {
 public:
  /// topology: the rank's own particles. All particles of all ranks together have different ids. Errors: InputError for
  /// walls that the box cannot have or the model is not defined for.
  ParticleSystem(Topology topology, Walls<D> walls, std::unique_ptr<ForceField<D>> field, Real skin,
                 Ranks ranks = Ranks(), const Box<D>& box = {})
      : ranks_(ranks),
        box_(box),
        topology_(std::move(topology)),
        walls_(std::move(walls)),
        field_(std::move(field)),
        neighbours_(field_->needs(), skin),
        halo_(ranks, box),
        history_(field_->history_needs()) {
    check(walls_);
    check_points();
    check_places();
  }

  std::size_t size() const override { return static_cast<std::size_t>(topology_.owned_points()) * coordinates().all(); }
  /// Per point: with angles if the model has torques.
  Coordinates coordinates() const { return {D, field_->rotates() ? rotations<D> : 0}; }
  /// The positions or velocities [own points · D] of coordinates or velocities [size()].
  template <class T>
  std::span<T> positions_in(std::span<T> values) const {
    return values.first(static_cast<std::size_t>(topology_.owned_points()) * D);
  }
  /// The angles or spins [own points · rotations] of coordinates or velocities [size()]; none if nothing rotates.
  template <class T>
  std::span<T> rotations_in(std::span<T> values) const {
    return values.subspan(static_cast<std::size_t>(topology_.owned_points()) * D);
  }
  const Ranks& ranks() const override { return ranks_; }

  void acceleration(Real t, const Real* x, const Real* v, Real* a) override {
    ++use_.evaluations;
    const StateView<D> s = view_after(next_change(), x, v, t);
    const LogScope log(LogEvent::forces);
    field_->accelerations(s, a);
    has_found_ = true;
  }

  void moved_by(Real change) override { change_ = change_.value_or(0) + change; }

  /// For polygons, whose shapes are half of the work, and with ghosts, where it takes one message less. Spheres have
  /// long lists, which more arrays push out of the caches.
  bool fuses_step() const override {
    return !rotates_or_remembers() && (has_ghosts() || topology_.points() != topology_.particles());
  }

  bool fused_step(Real t, std::vector<Real>& x, std::vector<Real>& v, const Advance& advance) override {
    if (rotates_or_remembers()) return ImplicitSystem::fused_step(t, x, v, advance);
    ++use_.evaluations;
    const std::optional<Real> since = next_change();
    if (!hold(since, x.data(), t)) rebuild(x.data(), t);
    if (has_ghosts()) {
      const LogScope log(LogEvent::halo);
      halo_.update(x, v);
    }
    narrow(since, x.data());
    Prefetch prefetch;
    if (size() >= beyond_caches) {
      prefetch = advance.arrays;
      prefetch.add(v.data());
    }
    const StateView<D> s{x.data(), v.data(), topology_, neighbours_, walls_, t, prefetch};
    const LogScope log(LogEvent::forces);
    std::array<Real, Neighbours<D>::max_chunks> change;
    const bool finite = field_->accelerations(s, scratch_, [&](Index chunk, const Real* a) {
      const Range points = neighbours_.points(chunk);
      change[chunk] =
          advance.step(static_cast<std::size_t>(points.first) * D, static_cast<std::size_t>(points.last) * D, a);
    });
    // Both in one message.
    const Real largest = *std::max_element(change.begin(), change.begin() + neighbours_.chunks());
    constexpr Real not_finite = std::numeric_limits<Real>::infinity();
    change_ = ranks_.max(finite ? largest : not_finite);
    return change_ != not_finite;
  }

  void group_acceleration(TermGroup group, Real t, const Real* x, const Real* v, Real* a) override {
    ++use_.evaluations;
    const StateView<D> s = view(x, v, t);
    const LogScope log(LogEvent::forces);
    field_->group_accelerations(s, group, a);
  }

  /// Errors: InputError where particles rotate or contacts have a history.
  void check_derivatives() const {
    if (rotates_or_remembers())
      throw InputError(
          "particles that rotate and contacts with history have no Jacobian, which this integrator needs; use "
          "-integrator verlet, or -ts_type rk");
  }
  /// Errors: as check_derivatives().
  std::unique_ptr<Jacobian> jacobian(JacobianForm form, JacobianKind kind, TermGroup group) override {
    check_derivatives();
    return make_jacobian(*this, form, kind, group);
  }

  void accepted(Real t, const Real* x, const Real* v, Real h, bool evaluated = false) override {
    if (history_.empty()) return;
    const bool found = evaluated && has_found_;
    const StateView<D> s = view_after(found ? std::optional<Real>(0) : std::nullopt, x, v, t);
    field_->accept(s, h, history_, found);
  }

  /// Contact history: changes with accepted steps; take() clears it.
  const ContactHistory& history() const { return history_; }
  ContactHistory& history() { return history_; }

  /// Whether the model has more than positions and velocities: spins or contact history.
  bool rotates_or_remembers() const { return field_->rotates() || !history_.empty(); }

  /// The configuration with neighbour lists that are valid for it, ghosts included. x, v [size()]; v may be
  /// null where only energies are asked for. t matters where walls move.
  StateView<D> view(const Real* x, const Real* v, Real t = 0) {
    change_.reset();  // wherever x is
    path_ = std::numeric_limits<Real>::infinity();
    return view_after({}, x, v, t);
  }

  /// The same where the last accelerations were found, which saves looking whether the lists hold.
  StateView<D> last_view(const Real* x, const Real* v, Real t) { return view_after(Real(0), x, v, t); }

  /// An upper bound of how far any point has gone since start_path(), up to the last acceleration or fused step;
  /// infinite after a view, and where the integrator does not say how far points move. The same on every rank.
  Real path() const { return path_; }
  /// Counts from here on, where no point is farther than `gone` from where its path begins.
  void start_path(Real gone = 0) { path_ = gone; }

  /// Whether there may be ghosts: on several ranks, and in a periodic box.
  bool has_ghosts() const { return ranks_.several() || !box_.open(); }
  /// Values of the owned points [owned points · D], extended to all points [points · D]; `storage` holds it where
  /// there are ghosts. Not for positions, because those of images are shifted. The lists must be valid. Collective.
  const Real* with_ghosts(const Real* own, std::vector<Real>& storage) const {
    if (!has_ghosts()) return own;
    halo_.update(own, storage);
    return storage.data();
  }

  /// Builds ghosts and lists from x, which becomes their reference.
  void rebuild(const Real* x, Real t = 0) {
    travel_ = 0;
    if (has_ghosts()) find_ghosts(x);
    const LogScope log(LogEvent::lists);
    ranks_.together([&] { neighbours_.rebuild(topology_, walls_, has_ghosts() ? x_.data() : x, t); });
  }

  /// Other walls, or walls that move otherwise from now on. The same on every rank. Errors: InputError for walls that
  /// the box cannot have or the model is not defined for.
  void set_walls(Walls<D> walls) {
    check(walls);
    walls_ = std::move(walls);
    neighbours_.invalidate();
    travel_ = std::numeric_limits<Real>::infinity();
  }

  /// Makes these the rank's own particles, which touch nothing yet. Not collective. Errors: InputError for particles of
  /// several points where they rotate or contacts have a history.
  void take(Topology own) {
    topology_ = std::move(own);
    neighbours_.invalidate();
    history_.clear();
    check_points();
  }

  /// Whether particles should be sorted again: it has been a number of list rebuilds. The same on every rank.
  bool sort_due() const { return use().rebuilds >= rebuilds_to_sort; }
  /// Whether many particles have gone far from their rank's place, which makes many ghosts. The same on every rank.
  bool migration_due() const { return migration_due_; }

  /// Sorts particles in space, moves them to the ranks where they belong and builds the lists; in a periodic box, puts
  /// those that have left it back first. The caller applies the migration that is returned to whatever else it keeps
  /// per particle.
  Migration sort(State& state) {
    const LogScope log(LogEvent::sort);
    if (tune_skin_ && sort_due()) neighbours_.set_skin(best_skin());
    if (!box_.open()) wrap(state);
    Migration migration = plan_migration<D>(ranks_, topology_, state.x().data());
    move_history(migration);
    migration.move(topology_);
    migration.move(state, coordinates());
    if (!box_.open()) migration.move(state.images);
    home_is_set_ = migration_due_ = false;
    rebuild(state.x().data(), state.t);
    set_use({});
    return migration;
  }

  /// Puts own particles whose centres have left the periodic box back into it, and counts the box lengths.
  void wrap(State& state) const {
    state.images.resize(static_cast<std::size_t>(topology_.owned()));
    for (Index m = 0; m < topology_.owned(); ++m) {
      const Image image = box_.image_of(mean_of_points<D>(state.x().data(), topology_, m));
      if (image == Image{}) continue;
      const Vec<D> shift = box_.shift(image);
      for (Index i = topology_.offset[m]; i < topology_.offset[m + 1]; ++i) point<D>(state.x().data(), i) -= shift;
      for (int k = 0; k < D; ++k) state.images[m][k] += image[k];
    }
  }

  /// Lets sort() choose the skin from how the lists were used.
  void tune_skin() { tune_skin_ = true; }

  /// Since the last sort(): needed by a restart.
  ListUse use() const { return {use_.evaluations, neighbours_.rebuilds() - sorted_at_}; }
  void set_use(const ListUse& use) {
    use_ = use;
    sorted_at_ = neighbours_.rebuilds() - use.rebuilds;
  }

  /// Own particle m was put somewhere else in x. Saves a rebuild of the lists where there are no ghosts. Not
  /// collective.
  void relist(const Real* x, Index m) {
    if (!has_ghosts() && !neighbours_.reference().empty()) neighbours_.relist(topology_, walls_, x, m);
  }

  /// Takes own particle m out of the run. Not collective.
  void deactivate(Index m) {
    topology_.deactivate(m);
    neighbours_.invalidate();
  }

  /// Own particles, then ghosts.
  const Topology& topology() const { return topology_; }
  const Box<D>& box() const { return box_; }
  const Walls<D>& walls() const { return walls_; }
  const ForceField<D>& field() const { return *field_; }
  Neighbours<D>& neighbours() { return neighbours_; }
  const Neighbours<D>& neighbours() const { return neighbours_; }

 private:
  void check(const Walls<D>& walls) const {
    check_walls(box_, walls);
    field_->check_walls(walls);
  }

  void check_points() const {
    const bool touches = std::ranges::any_of(
        history_.tables(), [](const ContactTable& table) { return table.needs().elements != Elements::points; });
    if ((field_->rotates() || touches) && topology_.deformable())
      throw InputError(
          "a model with angles or with contact history is for particles of one point; polygons turn by their vertices, "
          "and keep places on a base alone");
  }

  /// A place on a base would have to jump with the particle.
  void check_places() const {
    if (box_.open()) return;
    for (const ContactTable& table : history_.tables())
      if (table.needs().elements == Elements::points)
        throw InputError("the term {} keeps places of particles, which a periodic box shifts; use an open box",
                         table.needs().name);
  }

  /// Contacts go where their particles go. Before the topology does.
  void move_history(const Migration& migration) {
    if (!ranks_.several()) return;  // ids stay
    std::unordered_map<Index, Index> own;
    for (Index m = 0; m < topology_.owned(); ++m) own[topology_.id[m]] = m;
    for (const ContactTable& table : history_.tables()) {
      const int width = table.needs().width;
      const StoredContacts here = table.contacts();
      StoredContacts leaving;
      std::vector<Index> of;
      for (std::size_t k = 0; k < here.keys.size(); ++k) {
        const auto follow = [&](Index id) {
          const auto found = own.find(id);
          if (found == own.end()) return;
          of.push_back(found->second);
          leaving.add(here.keys[k], here.row(k, width));
        };
        follow(here.keys[k].first);
        if (table.pairs()) follow(here.keys[k].second);
      }
      history_.set(table.needs().name,
                   {migration.send(leaving.keys, 1, of), migration.send(leaving.values, width, of)});
    }
  }

  /// By how much coordinates have changed at most since the last evaluation, as far as is known.
  std::optional<Real> next_change() {
    const std::optional<Real> change = std::exchange(change_, {});
    path_ += std::sqrt(Real(D)) * change.value_or(std::numeric_limits<Real>::infinity());
    return change;
  }

  /// Whether the lists hold at x, where coordinates have changed by at most `change`, if that is known. The positions
  /// are looked at only when enough such changes have come together. The same on every rank.
  bool hold(std::optional<Real> change, const Real* x, Real t) {
    const Real limit = neighbours_.limit();
    if (change && !walls_.turn_without_end()) {
      travel_ += std::sqrt(Real(D)) * *change;
      if (std::max(travel_, neighbours_.farthest_wall(walls_, t)) <= limit * (1 - 1e-12)) return true;
    }
    travel_ = ranks_.max(neighbours_.farthest(walls_, x, t));
    return travel_ <= limit;
  }

  /// Narrows the list of vertices and edges, of which few touch, again and again at x [points · D], where coordinates
  /// have changed by at most `change`, if that is known.
  void narrow(std::optional<Real> change, const Real* x) {
    if constexpr (D == 2) {
      if (neighbours_.vertex_edges.empty()) return;
      const Real range = neighbours_.skin() / 2;
      gone_ += std::sqrt(Real(D)) * change.value_or(std::numeric_limits<Real>::infinity());
      if (neighbours_.narrowed() && 2 * gone_ < range * (1 - 1e-9)) return;
      neighbours_.narrow(topology_, x, range);
      gone_ = 0;
    }
  }

  StateView<D> view_after(std::optional<Real> change, const Real* x, const Real* v, Real t) {
    has_found_ = false;
    walls_.prepare(t);
    const bool valid = hold(change, x, t);
    if (!valid) rebuild(x, t);
    neighbours_.widen();
    StateView<D> s{x, v, topology_, neighbours_, walls_, t};
    if (has_ghosts()) {
      const LogScope log(LogEvent::halo);
      if (valid) halo_.update_positions(x, x_);
      if (v != nullptr) halo_.update(v, v_);
      s.x = x_.data();
      if (v != nullptr) s.v = v_.data();
    }
    if (rotates_or_remembers()) add_rotations_and_history(s, x, v);
    return s;
  }

  /// Angles and spins from x and v [size()]; and the history, which follows the lists.
  void add_rotations_and_history(StateView<D>& s, const Real* x, const Real* v) {
    const std::size_t positions = static_cast<std::size_t>(topology_.owned_points()) * D;
    const auto with_ghosts = [&](const Real* own, std::vector<Real>& storage) {
      if (!has_ghosts()) return own;
      halo_.update_rotations(own, storage);
      return static_cast<const Real*>(storage.data());
    };
    if (field_->rotates()) {
      s.angles = with_ghosts(x + positions, angles_);
      if (v != nullptr) s.spins = with_ghosts(v + positions, spins_);
    }
    if (history_.empty()) return;
    history_.follow(topology_, walls_, neighbours_);
    s.history = &history_;
  }

  /// Histories know contacts by ids: no two particles may be listed at two images of each other, and none at its own.
  void check_lengths() const {
    Real widest = 0;
    for (Index m = 0; m < topology_.owned_points(); ++m) widest = std::max(widest, topology_.diameter[m]);
    const Real least = 2 * (ranks_.max(widest) + neighbours_.margin());
    for (int k = 0; k < D; ++k)
      if (box_.length()[k] < least)
        throw InputError(
            "the periodic box has the length {:g} in direction {}, but contacts with a history need at least {:.3g}: "
            "twice "
            "the largest diameter and the margin of the neighbour lists",
            box_.length()[k], k, least);
  }

  void find_ghosts(const Real* x) {
    const LogScope log(LogEvent::ghosts);
    if (!home_is_set_) {
      halo_.set_home(topology_, x);
      home_is_set_ = true;
    }
    if (!history_.empty()) check_lengths();
    halo_.build(topology_, x, neighbours_.margin());
    halo_.update_positions(x, x_);
    migration_due_ = ranks_.sum(static_cast<std::int64_t>(halo_.strays())) > many_strays;
  }

  Real best_skin() const {
    Real width = 0;
    for (Index i = 0; i < topology_.owned_points(); ++i) width += topology_.diameter[i];
    std::array sums{width, static_cast<Real>(topology_.owned_points()), static_cast<Real>(neighbours_.pairs())};
    ranks_.sum(sums);
    return pliant::best_skin(neighbours_.skin(), use(), D, sums[2] / sums[1], sums[0] / sums[1]);
  }

  static constexpr std::int64_t rebuilds_to_sort = 16;
  static constexpr Index many_strays = 32;
  static constexpr std::size_t beyond_caches = 1 << 20;  ///< coordinates, several arrays of which no cache holds

  Ranks ranks_;
  Box<D> box_;
  Topology topology_;
  Walls<D> walls_;
  std::unique_ptr<ForceField<D>> field_;
  Neighbours<D> neighbours_;
  Halo<D> halo_;
  std::vector<Real> x_, v_, angles_, spins_;  ///< with ghosts; unused where there are none
  ContactHistory history_;
  bool has_found_ = false;  ///< contacts, at the positions of the last acceleration, and nobody has looked since
  bool home_is_set_ = false, migration_due_ = false, tune_skin_ = false;
  /// The farthest that a point can have gone since the lists were built. Not known if others built them.
  Real travel_ = std::numeric_limits<Real>::infinity();
  Real path_ = std::numeric_limits<Real>::infinity();
  std::optional<Real>
      change_;     ///< by how much coordinates have changed at most since the last evaluation, as far as is known
  Real gone_ = 0;  ///< the farthest that a point can have gone since the list was narrowed
  std::vector<Real> scratch_;  ///< for the accelerations of a fused step
  ListUse use_;                ///< its evaluations count
  std::int64_t sorted_at_ = 0;
};

}  // namespace pliant
