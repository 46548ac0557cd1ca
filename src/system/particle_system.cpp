#include <pliant/system/particle_system.h>

#include <algorithm>
#include <array>
#include <limits>
#include <unordered_map>
#include <utility>

#include <pliant/base/cure.h>
#include <pliant/base/log.h>
#include <pliant/geometry/walls_in_box.h>
#include <pliant/kernels/arrays.h>
#include <pliant/model/polygon.h>

namespace pliant {
namespace {

constexpr Index many_strays = 32;
constexpr std::size_t beyond_caches = 1 << 20;  // coordinates, several arrays of which no cache holds

}  // namespace

template <int D>
ParticleSystem<D>::ParticleSystem(Topology topology, Walls<D> walls, std::unique_ptr<ForceField<D>> field, Real skin,
                                  Ranks ranks, const Box<D>& box)
    : ranks_(ranks),
      box_(box),
      topology_(std::move(topology)),
      walls_(std::move(walls)),
      field_(std::move(field)),
      neighbours_(field_->needs(), skin),
      halo_(ranks, box),
      history_(field_->history_needs()),
      workspace_(history_) {
  check(walls_);
  check_points();
  check_places();
}

template <int D>
void ParticleSystem<D>::acceleration(Real t, const Real* x, const Real* v, Real* a) {
  ++use_.evaluations;
  motion_.evaluate();
  const StateView<D> s = make_view(x, v, t);
  const LogScope log(LogEvent::forces);
  field_->accelerations(s, a, history_.empty() ? nullptr : &workspace_);
  has_found_ = true;
}

template <int D>
bool ParticleSystem<D>::fuses_step() const {
  return !rotates_or_remembers() && (has_ghosts() || topology_.points() != topology_.particles());
}

template <int D>
bool ParticleSystem<D>::fused_step(Real t, std::vector<Real>& x, std::vector<Real>& v, const Advance& advance) {
  if (rotates_or_remembers()) return ImplicitSystem::fused_step(t, x, v, advance);
  ++use_.evaluations;
  motion_.evaluate();
  follow_shear(t);
  if (!hold(x.data(), t)) rebuild(x.data(), t);
  if (has_ghosts()) {
    const LogScope log(LogEvent::halo);
    halo_.update(x, v);
  }
  narrow(x.data());
  Prefetch prefetch;
  if (size() >= beyond_caches) {
    prefetch = advance.arrays;
    prefetch.add(v.data());
  }
  StateView<D> s{x.data(), v.data(), topology_, neighbours_, walls_, t, prefetch};
  s.flow = box_.flow();
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
  const Real next = ranks_.max(finite ? largest : not_finite);
  moved_by(next);
  return next != not_finite;
}

template <int D>
void ParticleSystem<D>::group_acceleration(TermGroup group, Real t, const Real* x, const Real* v, Real* a) {
  ++use_.evaluations;
  const StateView<D> s = view(x, v, t);
  const LogScope log(LogEvent::forces);
  field_->group_accelerations(s, group, a);
}

template <int D>
void ParticleSystem<D>::accepted(Real t, const Real* x, const Real* v, Real h, bool evaluated) {
  if (history_.empty()) return;
  const bool found = evaluated && has_found_;
  const StateView<D> s = found ? last_view(x, v, t) : view(x, v, t);
  field_->accept(s, h, history_, workspace_, found);
  if (s.turns != nullptr) accepted_angles_.assign(s.angles, s.angles + turns_.size());
}

template <int D>
Real ParticleSystem<D>::outside_speed(Real t, const Real* x) const {
  return walls_.fastest(t, [&](const Vec<D>& from) {
    Real most = 0;
    for (Index i = 0; i < topology_.owned_points(); ++i) most = std::max(most, (point<D>(x, i) - from).norm());
    return most;
  });
}

template <int D>
void ParticleSystem<D>::set_accepted(std::span<const Real> x) {
  const std::span<const Real> angles = rotations_in(x);
  accepted_angles_.assign(angles.begin(), angles.end());
}

template <int D>
void ParticleSystem<D>::check_derivatives() const {
  if (rotates_or_remembers())
    throw InputError(
        "particles that rotate and contacts with history have no Jacobian, which this integrator needs; use {}, or "
        "-ts_type rk",
        cures({Cure::verlet}));
}

template <int D>
std::unique_ptr<Jacobian> ParticleSystem<D>::jacobian(JacobianForm form, JacobianKind kind, TermGroup group) {
  check_derivatives();
  return make_jacobian(*this, form, kind, group);
}

template <int D>
StateView<D> ParticleSystem<D>::view(const Real* x, const Real* v, Real t) {
  motion_.lose();
  return make_view(x, v, t);
}

template <int D>
const Real* ParticleSystem<D>::with_ghosts(const Real* own, std::vector<Real>& storage) const {
  if (!has_ghosts()) return own;
  halo_.update(own, storage);
  return storage.data();
}

template <int D>
void ParticleSystem<D>::rebuild(const Real* x, Real t) {
  motion_.restart(MotionSince::list_rebuild);
  follow_shear(t);
  if (has_ghosts()) find_ghosts(x);
  const LogScope log(LogEvent::lists);
  ranks_.together([&] { neighbours_.rebuild(topology_, walls_, has_ghosts() ? x_.data() : x, t); });
}

template <int D>
void ParticleSystem<D>::set_walls(Walls<D> walls) {
  check(walls);
  walls_ = std::move(walls);
  invalidate_lists();
}

template <int D>
void ParticleSystem<D>::set_box(const Box<D>& box) {
  for (int k = 0; k < D; ++k)
    if (box.periodic(k) != box_.periodic(k))
      throw InputError("a box stays periodic, or open, in each direction: direction {} of the new box differs", k);
  check_no_shear();
  check_walls(box, walls_);
  replace_box(box);
  invalidate_lists();
}

template <int D>
void ParticleSystem<D>::deform(const Mat<D>& f) {
  if (walls_.size() > 0) throw InputError("walls do not follow a box that deforms; leave them out");
  check_no_shear();
  replace_box(box_.deformed(f));
  neighbours_.deform(box_.origin(), f, halo_.widest());
  motion_.lose();
}

template <int D>
void ParticleSystem<D>::replace_box(const Box<D>& box) {
  box_ = box;
  halo_.set_box(box);
  home_is_set_ = false;
}

template <int D>
void ParticleSystem<D>::shear_at(Real rate, std::int64_t shortened_by) {
  if (!std::isfinite(rate)) throw InputError("the shear rate is {}; it must be finite", rate);
  check_no_shear();
  if (walls_.size() > 0) throw InputError("walls do not follow a box that is sheared; leave them out");
  if (rotates_or_remembers())
    throw InputError(
        "particles that rotate and contacts with history do not follow a box that is sheared; use a model without "
        "friction");
  unsheared_ = box_;
  shear_rate_ = rate;
  shortened_by_ = shortened_by;
  shear_time_ = 0;
  replace_box(unsheared_.sheared(0, rate, shortened_by));
  invalidate_lists();
}

template <int D>
void ParticleSystem<D>::follow_shear(Real t) {
  if (shear_rate_ == 0 || t == shear_time_) return;
  shear_time_ = t;
  box_ = unsheared_.sheared(shear_rate_ * t, shear_rate_, shortened_by_);
  motion_.carry(halo_.set_box(box_));
  // A function of the time alone, so that a restart decides alike.
  Mat<D> f = Mat<D>::Identity();
  f(0, 1) = shear_rate_ * t - shear_rate_ * neighbours_.time_of_rebuild();
  neighbours_.set_deformation(box_.origin(), f, halo_.widest());
  motion_.lose(MotionSince::list_rebuild);  // counts from the deformed reference
}

template <int D>
std::int64_t ParticleSystem<D>::shift_lattice(State& state) {
  follow_shear(state.t);
  const auto edges = static_cast<std::int64_t>(std::nearbyint(box_.tilt()[0] / box_.length()[0]));
  if (edges == 0) return shortened_by_;
  shortened_by_ += edges;
  for (Image& image : state.images) image[0] += edges * image[1];
  box_ = unsheared_.sheared(shear_rate_ * state.t, shear_rate_, shortened_by_);
  halo_.set_box(box_);
  invalidate_lists();
  return shortened_by_;
}

template <int D>
void ParticleSystem<D>::take(Topology own) {
  topology_ = std::move(own);
  invalidate_lists();
  history_.clear();
  accepted_angles_.clear();
  check_points();
}

template <int D>
Migration ParticleSystem<D>::sort(State& state, std::span<Real> predicted) {
  const LogScope log(LogEvent::sort);
  if (tune_skin_ && sort_due()) neighbours_.set_skin(best_skin());
  follow_shear(state.t);
  if (!box_.open()) wrap(state, predicted);
  Migration migration = plan_migration<D>(ranks_, topology_, state.x().data());
  move_history(migration);
  migration.move(topology_);
  migration.move(state, coordinates());
  set_accepted(state.x());
  if (!box_.open()) migration.move(state.images);
  home_is_set_ = migration_due_ = false;
  rebuild(state.x().data(), state.t);
  set_use({});
  return migration;
}

template <int D>
void ParticleSystem<D>::wrap(State& state, std::span<Real> predicted) const {
  state.images.resize(static_cast<std::size_t>(topology_.owned()));
  for (Index m = 0; m < topology_.owned(); ++m) {
    const Image image = box_.image_of(mean_of_points<D>(state.x().data(), topology_, m));
    if (image == Image{}) continue;
    const Vec<D> shift = box_.shift(image), velocity = box_.shift_velocity(image);
    for (Index i = topology_.offset[m]; i < topology_.offset[m + 1]; ++i) {
      point<D>(state.x().data(), i) -= shift;
      if (!box_.flow().flows()) continue;
      point<D>(state.v().data(), i) -= velocity;
      if (!predicted.empty()) point<D>(predicted.data(), i) -= velocity;
    }
    for (int k = 0; k < D; ++k) state.images[m][k] += image[k];
  }
}

template <int D>
void ParticleSystem<D>::set_use(const ListUse& use) {
  use_ = use;
  sorted_at_ = neighbours_.rebuilds() - use.rebuilds;
}

template <int D>
void ParticleSystem<D>::relist(const Real* x, Index m) {
  if (!has_ghosts() && !neighbours_.reference().empty()) neighbours_.relist(topology_, walls_, x, m);
}

template <int D>
void ParticleSystem<D>::deactivate(Index m) {
  topology_.deactivate(m);
  neighbours_.invalidate();  // motion_ stays the same on every rank
}

template <int D>
void ParticleSystem<D>::check(const Walls<D>& walls) const {
  check_walls(box_, walls);
  field_->check_walls(walls);
}

template <int D>
void ParticleSystem<D>::check_no_shear() const {
  if (shear_rate_ != 0)
    throw InputError("the box is sheared at the rate {}, which determines it at all times; it cannot be set",
                     shear_rate_);
}

template <int D>
void ParticleSystem<D>::check_points() const {
  const bool touches = std::ranges::any_of(
      history_.tables(), [](const ContactTable& table) { return table.needs().elements != Elements::points; });
  if ((field_->rotates() || touches) && topology_.deformable())
    throw InputError(
        "angles and contact history need particles of one point; polygons rotate by their vertices, and have contact "
        "history with a substrate only");
}

template <int D>
void ParticleSystem<D>::check_places() const {
  if (box_.open()) return;
  for (const ContactTable& table : history_.tables())
    if (table.needs().elements == Elements::points)
      throw InputError("the term {} stores positions of particles, which a periodic box shifts; use an open box",
                       table.needs().name);
}

template <int D>
void ParticleSystem<D>::check_lengths() const {
  Real widest = 0;
  for (Index m = 0; m < topology_.owned_points(); ++m) widest = std::max(widest, topology_.diameter[m]);
  const Real least = 2 * (ranks_.max(widest) + neighbours_.margin());
  for (int k = 0; k < D; ++k)
    if (box_.length()[k] < least)
      throw InputError(
          "the periodic box has the length {:g} in direction {}, but contacts with a history need at least {:.3g}: "
          "twice the largest diameter and the skin of the neighbour lists",
          box_.length()[k], k, least);
}

template <int D>
void ParticleSystem<D>::move_history(const Migration& migration) {
  if (!ranks_.several()) return;  // ids do not change
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
    history_.set(table.needs().name, {migration.send(leaving.keys, 1, of), migration.send(leaving.values, width, of)});
  }
}

template <int D>
bool ParticleSystem<D>::hold(const Real* x, Real t) {
  const Real limit = neighbours_.limit(), bound = motion_.since(MotionSince::list_rebuild),
             surely = limit * (1 - 1e-12);
  if (bound <= surely && !walls_.turn_without_end() && neighbours_.farthest_wall(walls_, t) <= surely) return true;
  const Real moved = ranks_.max(neighbours_.farthest(walls_, x, t));
  motion_.restart(MotionSince::list_rebuild, moved);
  return moved <= limit;
}

template <int D>
void ParticleSystem<D>::coefficients_changed() {
  if (!history_.empty()) workspace_.follow(history_);
  has_found_ = false;
}

template <int D>
void ParticleSystem<D>::invalidate_lists() {
  neighbours_.invalidate();
  motion_.lose(MotionSince::list_rebuild);
}

template <int D>
void ParticleSystem<D>::narrow(const Real* x) {
  if (neighbours_.vertex_edges.empty() && neighbours_.vertex_faces.empty() && neighbours_.edge_pairs.empty()) return;
  // An element of surfaces costs much more than an entry in the lists.
  const Real range = neighbours_.skin() / (D == 2 ? 2 : 4);
  if (neighbours_.narrowed() && 2 * motion_.since(MotionSince::narrowing) < range * (1 - 1e-9)) return;
  neighbours_.narrow(topology_, x, range);
  motion_.restart(MotionSince::narrowing);
}

template <int D>
StateView<D> ParticleSystem<D>::make_view(const Real* x, const Real* v, Real t) {
  has_found_ = false;
  walls_.prepare(t);
  follow_shear(t);
  const bool valid = hold(x, t);
  if (!valid) rebuild(x, t);
  neighbours_.widen();
  StateView<D> s{x, v, topology_, neighbours_, walls_, t};
  s.flow = box_.flow();
  if (has_ghosts()) {
    const LogScope log(LogEvent::halo);
    if (valid) halo_.update_positions(x, x_);
    if (v != nullptr) halo_.update_velocities(v, v_);
    s.x = x_.data();
    if (v != nullptr) s.v = v_.data();
  }
  if (rotates_or_remembers()) add_rotations_and_history(s, x, v);
  return s;
}

template <int D>
void ParticleSystem<D>::add_rotations_and_history(StateView<D>& s, const Real* x, const Real* v) {
  const std::size_t positions = static_cast<std::size_t>(topology_.owned_points()) * D;
  const auto with_images = [&](const Real* own, std::vector<Real>& storage) {
    if (!has_ghosts()) return own;
    halo_.update_rotations(own, storage);
    return static_cast<const Real*>(storage.data());
  };
  if (field_->rotates()) {
    s.angles = with_images(x + positions, angles_);
    if (v != nullptr) s.spins = with_images(v + positions, spins_);
  }
  if (history_.empty()) return;
  const bool relisted = history_.follow(topology_, walls_, neighbours_);
  if (relisted) workspace_.follow(history_);
  s.history = &history_;
  if (D == 3 && field_->rotates()) add_turns(s, relisted);
}

template <int D>
void ParticleSystem<D>::add_turns(StateView<D>& s, bool relisted) {
  const std::size_t own = static_cast<std::size_t>(topology_.owned_points()) * rotations<D>,
                    all = static_cast<std::size_t>(topology_.points()) * rotations<D>;
  if (accepted_angles_.size() < own) accepted_angles_.assign(s.angles, s.angles + own);
  if (relisted && has_ghosts()) {
    accepted_angles_.resize(own);
    halo_.update_rotations(std::vector<Real>(accepted_angles_).data(), accepted_angles_);
  }
  turns_.resize(all);
  subtract(s.angles, accepted_angles_.data(), all, turns_.data());
  s.turns = turns_.data();
}

template <int D>
void ParticleSystem<D>::find_ghosts(const Real* x) {
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

template <int D>
Real ParticleSystem<D>::best_skin() const {
  Real width = 0;
  for (Index i = 0; i < topology_.owned_points(); ++i) width += topology_.diameter[i];
  std::array sums{width, static_cast<Real>(topology_.owned_points()), static_cast<Real>(neighbours_.pairs())};
  ranks_.sum(sums);
  return pliant::best_skin(neighbours_.skin(), use(), D, sums[2] / sums[1], sums[0] / sums[1]);
}

template class ParticleSystem<2>;
template class ParticleSystem<3>;

}  // namespace pliant
