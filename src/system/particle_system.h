// Particles, walls, neighbour lists and forces as one equation of motion, on one rank or on several.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <pliant/domain/halo.h>
#include <pliant/domain/migration.h>
#include <pliant/domain/skin.h>
#include <pliant/model/force_field.h>
#include <pliant/system/implicit_system.h>
#include <pliant/system/motion_bound.h>

namespace pliant {

/// M r̈ = F(r, ṙ) for the points of a topology [H 7, 13]. Inactive particles keep their positions: their inverse mass is
/// zero. On several ranks each rank has a share of the particles, and copies (ghosts) of nearby particles of other
/// ranks; all functions that take positions are collective then. In a periodic box images of particles are ghosts too,
/// so that no other code depends on the box. Positions may lie anywhere; sort() wraps them into the box.
template <int D>
class ParticleSystem final : public ImplicitSystem {
 public:
  /// topology: the rank's own particles. All particles of all ranks together have different ids. Errors: InputError for
  /// walls that the box cannot have or the model is not defined for.
  ParticleSystem(Topology topology, Walls<D> walls, std::unique_ptr<ForceField<D>> field, Real skin,
                 Ranks ranks = Ranks(), const Box<D>& box = {});

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
  std::size_t positions() const override { return static_cast<std::size_t>(topology_.owned_points()) * D; }
  Real outside_speed(Real t, const Real* x) const override;

  void acceleration(Real t, const Real* x, const Real* v, Real* a) override;
  void moved_by(Real change) override { motion_.report(change); }
  /// For polygons, whose shapes are half of the work, and with ghosts, where it takes one message less. Spheres have
  /// long lists, which more arrays push out of the caches.
  bool fuses_step() const override;
  bool fused_step(Real t, std::vector<Real>& x, std::vector<Real>& v, const Advance& advance) override;
  void group_acceleration(TermGroup group, Real t, const Real* x, const Real* v, Real* a) override;
  void accepted(Real t, const Real* x, const Real* v, Real h, bool evaluated = false) override;

  /// Errors: InputError where particles rotate or contacts have a history.
  void check_derivatives() const;
  /// Errors: as check_derivatives().
  std::unique_ptr<Jacobian> jacobian(JacobianForm form, JacobianKind kind, TermGroup group) override;

  /// Contact history: changes with accepted steps; take() clears it.
  const ContactHistory& history() const { return history_; }
  ContactHistory& history() { return history_; }

  /// The last accepted step ended at x [size()]: to be called where contact history is set.
  void set_accepted(std::span<const Real> x);

  /// Whether the model has more than positions and velocities: spins or contact history.
  bool rotates_or_remembers() const { return field_->rotates() || !history_.empty(); }

  /// The configuration with neighbour lists that are valid for it, ghosts included. x, v [size()]; v may be null if
  /// only energies are needed. t matters for walls and boxes that move.
  StateView<D> view(const Real* x, const Real* v, Real t);
  /// The same with the box as it is; walls at time 0 unless the box flows.
  StateView<D> view(const Real* x, const Real* v) { return view(x, v, shear_time_); }
  /// The same where the last accelerations were found, which saves looking whether the lists hold.
  StateView<D> last_view(const Real* x, const Real* v, Real t) { return make_view(x, v, t); }

  /// Upper bound of the motion up to the last acceleration or fused step; a view loses it. The same on every rank.
  const MotionBound& motion() const { return motion_; }
  /// Outlines were checked at positions from which no point is farther than `distance` now.
  void outlines_checked(Real distance = 0) { motion_.restart(MotionSince::outline_check, distance); }
  /// The same for points with walls and each other; the motion of walls does not count.
  void passages_checked(Real distance = 0) { motion_.restart(MotionSince::passage_check, distance); }

  /// Whether there may be ghosts: on several ranks, and in a periodic box.
  bool has_ghosts() const { return ranks_.several() || !box_.open(); }
  /// Values of the owned points [owned points · D], extended to all points [points · D]; `storage` holds it where
  /// there are ghosts. Not for positions, because positions of images are shifted. The lists must be valid. Collective.
  const Real* with_ghosts(const Real* own, std::vector<Real>& storage) const;

  /// Builds ghosts and lists from x, which becomes their reference.
  void rebuild(const Real* x, Real t);
  void rebuild(const Real* x) { rebuild(x, shear_time_); }

  /// Other walls, or walls that move otherwise from now on. The same on every rank. Errors: InputError for walls that
  /// the box cannot have or the model is not defined for.
  void set_walls(Walls<D> walls);

  /// Another periodic box, for particles at other places: a compression or a shear. The same on every rank. Errors:
  /// InputError for an open box, walls that the box cannot have, and a box that is sheared at a rate.
  void set_box(const Box<D>& box);
  /// The box follows r → origin + F (r − origin). The lists remain valid if the caller's particles follow it too, up to
  /// small displacements. The same on every rank. Errors: InputError as of Box::deformed, and for a system with walls.
  void deform(const Mat<D>& f);

  /// From now on the box is sheared at this rate: at time t it is the present box after simple shear by rate · t, in
  /// which edge 1 is shortened by a number of edges 0 (Box::sheared). Images and the fluid of the drag follow the flow
  /// (Box::flow), and so must the velocities of the particles. The same on every rank. Errors: InputError for a box
  /// that is open in a direction, one that is sheared at a rate already, a system with walls, and particles that rotate
  /// or contacts with history.
  void shear_at(Real rate, std::int64_t shortened_by = 0);
  /// Describes the lattice at the time of the state by the edge 1 with the smallest tilt; the images in the state are
  /// counted by it. Nothing else changes, except that the lists will be rebuilt. Returns by how many edges 0 the edge
  /// is shortened in all. The same on every rank.
  std::int64_t shift_lattice(State& state);

  /// Coefficients of the force field have changed, but neither its lists nor what its contacts remember: numbers that
  /// terms have stored of elements of the lists are forgotten. The same on every rank.
  void coefficients_changed();

  /// Makes these the rank's own particles, which touch nothing yet. On every rank, without messages. Errors: InputError
  /// for particles of several points where they rotate or contacts have a history.
  void take(Topology own);

  /// Whether particles should be sorted again, after a number of list rebuilds. The same on every rank.
  bool sort_due() const { return use().rebuilds >= rebuilds_to_sort; }
  /// Whether many particles are far from the region of their rank, which causes many ghosts. The same on every rank.
  bool migration_due() const { return migration_due_; }

  /// Sorts particles in space, moves them to the ranks where they belong and builds the lists; in a periodic box, wraps
  /// particles that have left it first, `predicted` as in wrap(). The caller applies the returned migration to its data
  /// per particle.
  Migration sort(State& state, std::span<Real> predicted = {});

  /// Wraps owned particles whose centres have left the periodic box, and counts the box lengths. In a box that flows
  /// their velocities change, and so do other velocities of them, `predicted` [size() or 0].
  void wrap(State& state, std::span<Real> predicted = {}) const;

  /// Lets sort() choose the skin from the use of the lists.
  void tune_skin() { tune_skin_ = true; }

  /// Since the last sort(): needed by a restart.
  ListUse use() const { return {use_.evaluations, neighbours_.rebuilds() - sorted_at_}; }
  void set_use(const ListUse& use);

  /// Owned particle m was moved to another place in x. Saves a rebuild of the lists if there are no ghosts. Not
  /// collective.
  void relist(const Real* x, Index m);

  /// Takes own particle m out of the run. Not collective; the bound of the motion must be lost afterwards on every
  /// rank, by a view() or an infinite moved_by().
  void deactivate(Index m);

  /// Own particles, then ghosts.
  const Topology& topology() const { return topology_; }
  const Box<D>& box() const { return box_; }
  const Walls<D>& walls() const { return walls_; }
  const ForceField<D>& field() const { return *field_; }
  Neighbours<D>& neighbours() { return neighbours_; }
  const Neighbours<D>& neighbours() const { return neighbours_; }

 private:
  void check(const Walls<D>& walls) const;
  void replace_box(const Box<D>& box);
  /// Brings a box that is sheared at a rate to time t.
  void follow_shear(Real t);
  void check_no_shear() const;
  void check_points() const;
  /// A place on the substrate would have to jump with the particle.
  void check_places() const;
  /// Histories identify contacts by ids: no two particles may be listed at two images of each other, and no particle at
  /// its own image.
  void check_lengths() const;

  /// Contacts migrate with their particles. To be called before the topology migrates.
  void move_history(const Migration& migration);

  /// Whether the lists hold at x. Positions are compared with the reference positions of the lists only if the bound of
  /// the motion exceeds the limit. The same on every rank.
  bool hold(const Real* x, Real t);
  /// After a change of the particles or the walls: the next view rebuilds the lists.
  void invalidate_lists();
  /// Narrows the list of vertices and edges, of which few touch, again and again at x [points · D].
  void narrow(const Real* x);

  /// The configuration at x, at the distance from the last evaluation given by motion_.
  StateView<D> make_view(const Real* x, const Real* v, Real t);
  /// Angles and spins from x and v [size()]; and the history and its workspace, which follow the lists.
  void add_rotations_and_history(StateView<D>& s, const Real* x, const Real* v);
  /// StateView::turns. relisted: the lists, and with them the ghosts, may be others than at the last call.
  void add_turns(StateView<D>& s, bool relisted);

  void find_ghosts(const Real* x);
  Real best_skin() const;

  static constexpr std::int64_t rebuilds_to_sort = 16;

  Ranks ranks_;
  Box<D> box_;
  Box<D> unsheared_;  ///< of a box that is sheared at a rate, at time 0
  Real shear_rate_ = 0, shear_time_ = 0;
  std::int64_t shortened_by_ = 0;
  Topology topology_;
  Walls<D> walls_;
  std::unique_ptr<ForceField<D>> field_;
  Neighbours<D> neighbours_;
  Halo<D> halo_;
  std::vector<Real> x_, v_, angles_, spins_;  ///< with ghosts; unused where there are none
  ContactHistory history_;
  HistoryWorkspace workspace_;         ///< the next history
  std::vector<Real> accepted_angles_;  ///< at the last accepted step, of all points; empty: undefined
  std::vector<Real> turns_;
  /// Whether the workspace holds the next history at the positions of the last acceleration: no view has been made
  /// since.
  bool has_found_ = false;
  bool home_is_set_ = false, migration_due_ = false, tune_skin_ = false;
  MotionBound motion_{D};
  std::vector<Real> scratch_;  ///< for the accelerations of a fused step
  ListUse use_;                ///< its evaluations count
  std::int64_t sorted_at_ = 0;
};

extern template class ParticleSystem<2>;
extern template class ParticleSystem<3>;

}  // namespace pliant
