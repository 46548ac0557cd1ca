// Forces, energies and derivatives of a configuration, for any model.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/model/term.h>

namespace pliant {

/// The longest steps of velocity Verlet, in t0.
struct CriticalStep {
  Real elastic = std::numeric_limits<Real>::infinity();  ///< 2/ω of the stiffest single contact, or other element
  Real damping = std::numeric_limits<Real>::infinity();  ///< 1/γ of the fastest damping of a single term
  MotionRates crowded = {};  ///< rates of all terms together, with as many contacts as fit around a point

  /// Limit for a single contact: standard steps are fractions of this limit.
  Real one_contact() const { return std::min(elastic, damping); }
  /// Part of limit() above which opening and closing contacts heat a flow (docs/reference/steps.md).
  static constexpr Real safe_part = 0.7;
  /// A standard step, shortened to the safe part of limit().
  Real standard(Real dt) const { return std::min(dt, safe_part * limit()); }

  /// The step above which a dense packing is unstable.
  Real limit() const { return std::min(limit(crowded.translation), limit(crowded.rotation)); }
  /// With predicted velocities (FixedStepVerlet) a mode of frequency ω and damping γ is stable while ω² h² + 4 γ h ≤ 4:
  /// there its factor of growth per step is −1, and so for symmetric matrices of stiffness and damping.
  static Real limit(const Rates& r) {
    const Real sum = r.damping + std::sqrt(r.damping * r.damping + r.stiffness);
    return sum > 0 ? 2 / sum : std::numeric_limits<Real>::infinity();
  }
};

/// A choice of terms: all; shape: the terms whose elements belong to one particle each, as the shape energy of
/// deformable particles; rest: all other terms.
enum class TermGroup { all, shape, rest };

/// Energy and forces of one term for one configuration.
struct TermReport {
  std::string name;
  bool is_energy;           ///< false: a dissipation
  bool has_energy;          ///< energies, and dissipations with the energy of springs (contact history)
  Real energy = 0;          ///< sum over all elements
  std::vector<Real> force;  ///< [points · D]
  std::vector<Real> particle_energy =
      {};  ///< [particles] of a term whose elements belong to one particle each, else empty
};

/// The virial of one energy term: see ForceField::virials.
template <int D>
struct TermVirial {
  std::string name;
  Mat<D> virial;
};

/// All walls, or the moving walls.
enum class WallGroup { all, moving };

/// The points that derivatives couple, in addition to each point with itself.
struct ElementCoupling {
  bool particles = false;                      ///< all points of a particle
  std::array<bool, element_kinds> stencils{};  ///< for each kind: the points of an element

  template <Elements E>
  void add(ElementKind<E>) {
    particles |= ElementKind<E>::couples == Couples::particle;
    stencils[static_cast<std::size_t>(E)] |= ElementKind<E>::couples == Couples::stencil;
  }
  template <Elements E>
  bool has(ElementKind<E>) const {
    return stencils[static_cast<std::size_t>(E)];
  }
};
/// Couplings of ∂F/∂x and of ∂F/∂v.
struct Couplings {
  ElementCoupling x, v;
};

/// Energies and forces of a configuration. One virtual call per evaluation, none per element. Arrays of forces have the
/// length of all points; only the owned points are written, and with StateView::ghosts_feel forces are added on ghosts.
/// If particles rotate, torques on the owned points follow the forces on the owned points [points · (D + rotations)].
/// Sums are over the rank's share: elements inside its chunks, and elements across borders that count for an owned
/// particle (Topology::counts_for); over all ranks every element counts once. Energies, powers, contacts and forces on
/// walls count active particles only.
template <int D>
class ForceField {
 public:
  virtual ~ForceField() = default;

  /// The lists that the terms read. Errors: std::logic_error if terms need different edges.
  virtual NeighbourNeeds needs() const = 0;
  /// Errors: InputError for walls that a term is not defined for.
  virtual void check_walls(const Walls<D>& walls) const = 0;

  /// Total force, written to f [points · D].
  virtual void forces(const StateView<D>& s, Real* f) const = 0;
  /// Forces divided by the masses: 0 for inactive particles. Returns whether all are finite. workspace: gets the next
  /// contact history, for accept(); without it history is only read, as by all functions without this argument.
  virtual bool accelerations(const StateView<D>& s, Real* a, HistoryWorkspace* workspace = nullptr) const = 0;
  /// Accelerations that are not stored: done(chunk, a) gets the accelerations of the points of a chunk, numbered as in
  /// an array of all points, and is called by several threads at a time. `scratch` holds them and grows as needed.
  virtual bool accelerations(const StateView<D>& s, std::vector<Real>& scratch,
                             const std::function<void(Index, const Real*)>& done) const = 0;
  /// The accelerations by a part of the terms, written to a [points · D].
  virtual void group_accelerations(const StateView<D>& s, TermGroup group, Real* a) const = 0;
  /// ∂F/∂x and ∂F/∂v of a part of the terms: the rows of the rank's own points. Threads divide the rows: they call the
  /// sinks for different rows at the same time.
  virtual void derivatives(const StateView<D>& s, TermGroup group, BlockSink<D>& df_dx, BlockSink<D>& df_dv) const = 0;
  /// Places of the blocks of derivatives(): all elements of the terms, touching or not.
  virtual Couplings couplings(const StateView<D>& s, TermGroup group) const = 0;
  /// Total energy; if f is given, the forces of the energy terms alone are written to f.
  virtual Real energy(const StateView<D>& s, Real* f = nullptr) const = 0;
  /// Σ_elements Σ_i ∂U/∂r_i ⊗ r_i of each active energy term, in the order of the model's list, r_i the positions in
  /// the element (of images, where they belong to it). In a box that is periodic in all directions, without walls and
  /// gravity, the sum of the terms over the volume is the stress σ_ab = (1/V) ∂U/∂e_ab under r → (1 + e) r of all
  /// particles and the box: tension positive, pressure −tr σ/D. Errors: InputError for terms with contact history.
  virtual std::vector<TermVirial<D>> virials(const StateView<D>& s) const = 0;
  /// The same sum shared out to the own particles [own particles]: the elements of a particle belong to it, and each
  /// element between two particles belongs to either by half. Errors: as of virials().
  virtual std::vector<Mat<D>> particle_virials(const StateView<D>& s) const = 0;
  /// The energy of the elements that have a point of one of these particles, given by id.
  virtual Real energy_of(const StateView<D>& s, std::span<const Index> ids) const = 0;
  /// Dissipated power, ≥ 0.
  virtual Real power(const StateView<D>& s) const = 0;
  /// The forces of the dissipation terms alone, without contact history, written to f [points · D].
  virtual void dissipative_forces(const StateView<D>& s, Real* f) const = 0;
  /// Each active term by itself, in the order of the model's list; forces by the terms' plain element loops.
  virtual std::vector<TermReport> report(const StateView<D>& s) const = 0;
  /// Sum of the forces of the terms with these names, written to f [points · D]; the model may lack any of them.
  virtual void force_of(std::initializer_list<std::string_view> names, const StateView<D>& s, Real* f) const = 0;
  /// ∂²U/∂x² of all energy terms. Errors: InputError for a term whose pre-stress cannot be dropped.
  virtual void hessian(const StateView<D>& s, BlockSink<D>& h, PreStress pre_stress = PreStress::kept) const = 0;
  /// ∂F/∂v of all dissipations.
  virtual void damping(const StateView<D>& s, BlockSink<D>& h) const = 0;
  /// The contacts that terms show (ContactTerm), with their elastic forces.
  virtual void for_each_contact(const StateView<D>& s, const std::function<void(const Contact<D>&)>& visit) const = 0;
  /// The forces between particles, element by element, except zeros: elastic forces, friction and damping. Without
  /// elastic forces between two points, which for_each_contact() has. Contact history is only read.
  virtual void for_each_pair_force(const StateView<D>& s,
                                   const std::function<void(const PairForce<D>&)>& visit) const = 0;
  /// Force on each wall by the points, added to f [walls · D]; with torques [walls · rotations], also the torque on it
  /// about the pivot of its motion, which is the origin for walls without one. `which`: walls at rest may be left out.
  virtual void add_wall_forces(const StateView<D>& s, Real* f, Real* torques = nullptr,
                               WallGroup which = WallGroup::all) const = 0;
  /// Limits of stability of velocity Verlet, of the points that are stiffest for their mass. walls: whether there are
  /// any; without them, forces of walls limit no step.
  virtual CriticalStep critical_step(const Topology& topology, bool walls = true) const = 0;

  /// Whether a term has torques, so that particles have angles and spins.
  virtual bool rotates() const = 0;
  /// Contact histories of the terms.
  virtual std::vector<HistoryNeeds> history_needs() const = 0;
  /// A step of length h has been accepted, which ends at s: the next contact history becomes current. found: the last
  /// accelerations with this workspace were those at the same time, positions and angles, so that the next history need
  /// not be computed again.
  virtual void accept(const StateView<D>& s, Real h, ContactHistory& history, HistoryWorkspace& workspace,
                      bool found = false) const = 0;
};

/// Power of the moving walls on the points, as far as their forces belong to
/// the force field. For the rank's share; 0 at once if no wall moves.
template <int D>
Real wall_power(const ForceField<D>& field, const StateView<D>& s) {
  if (!s.walls.move()) return 0;
  const auto walls = static_cast<std::size_t>(s.walls.size());
  std::vector<Real> force(walls * D), torque(walls * rotations<D>);
  field.add_wall_forces(s, force.data(), torque.data(), WallGroup::moving);
  Real power = 0;
  for (Index k = 0; k < s.walls.size(); ++k) {
    const Motion<D>& motion = s.walls.motion(s.walls.body_of_wall(k));
    power -= point<D>(force.data(), k).dot(motion.drift(s.t));
    if (!motion.turns()) continue;
    if constexpr (D == 2)
      power -= torque[k] * motion.spin;
    else
      power -= point<3>(torque.data(), k).dot(motion.spin);
  }
  return power;
}

}  // namespace pliant
