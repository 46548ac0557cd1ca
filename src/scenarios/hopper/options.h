// Options of the scenario `hopper`.
#pragma once

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/catalogue/model_choice.h>
#include <pliant/geometry/container.h>
#include <pliant/model/contact_laws.h>
#include <pliant/run/options.h>
#include <pliant/run/start_particles.h>
#include <pliant/setup/packing.h>
#include <pliant/setup/particles.h>
#include <pliant/setup/reinsertion.h>
#include <pliant/system/jacobian.h>

namespace pliant {

/// Newton's equations, or their limit of strong drag.
enum class Dynamics { inertial, overdamped };
enum class IntegratorKind { verlet, ts };
enum class FlowKind { continuous, discharge };
/// When a particle counts for the flow rate: when its centre crosses the orifice line, or when it is reinserted.
enum class Counting { crossing, removal };
/// Whether a particle whose outline crosses itself ends the run, or is counted.
enum class OnSelfCrossing { stop, count };

/// As given by the user; `resolve` fills in automatic values. Units: σ_avg = g = ρ = 1, times in t0.
struct HopperOptions : RunOptions {
  /// own: models that -model offers in addition to sp, rough, smooth and disk.
  explicit HopperOptions(const std::vector<ModelDefinition>& own = {});

  ModelChoice model;
  Index dim = 2;
  StartOption start;
  Index particles = 0;  ///< 0: automatic
  SizeDistribution sizes;
  PolygonShape shape;
  std::string mesh;  ///< text of an OFF file, of which shape.mesh is made; empty: none

  OnSelfCrossing self_crossing = OnSelfCrossing::stop;

  Hopper hopper;
  std::optional<Real> wall_distance, left_angle;
  CornerRule corner_contact = CornerRule::once;
  std::string outline, obstacle;       ///< empty: none; see shapes.h
  std::optional<Container> container;  ///< made of these by `resolve`
  FlowKind flow = FlowKind::continuous;
  Counting counting = Counting::crossing;
  std::optional<Real> removal_depth;
  Reinsertion reinsertion;
  std::optional<Real> pack_fraction;
  Real pack_tolerance = 1e-4;

  Dynamics dynamics = Dynamics::inertial;
  IntegratorKind integrator = IntegratorKind::verlet;
  TermGroup implicit = TermGroup::all;
  JacobianKind jacobian = JacobianKind::assembled;
  std::optional<Real> dt, skin;
  std::optional<Real> t_end;
  Real q_rtol = 0;

  Real clog_time = 10;
  std::optional<Real> clog_speed;

  void bind(Options& options);
  /// Takes the particles of -start, in place of particles, sizes and shapes.
  void take_start(const std::optional<Checkpoint>& checkpoint);
  /// Fills in automatic values and checks that options are consistent. Errors: InputError.
  void resolve();
  /// Errors: InputError for an option of the user that neither the model nor another part of the run reads.
  void refuse_unread(const Options& options) const;

  bool deformable() const { return model.deformable(); }
  /// The forces of the model.
  template <int D>
  std::unique_ptr<ForceField<D>> force_field(const Vec<D>& gravity) const {
    return model.force_field<D>({.gravity = gravity});
  }
  /// Coefficients of drag and of viscous friction.
  Real drag() const { return model.table().with(Role::drag)[0]->value(); }
  Real kinetic_friction() const { return model.value(Role::kinetic_friction); }
  std::string drag_option() const { return fmt::format("-{}", model.table().with(Role::drag)[0]->name); }
  /// Whether heavier particles have more drag.
  bool drag_per_mass() const;
  /// Whether contact energies have no bound.
  bool has_barrier() const { return model.choice(Role::contact_law) == to_string(ContactLaw::barrier); }
  /// Speed at which the weight of the lightest particle equals drag and friction, σ_avg/t0; infinite without them. A
  /// slow flow has about this speed, and rests at much lower speeds.
  Real creep_speed() const;
  /// For a -clog_speed that a slow flow may not reach.
  void warn_of_clog_speed() const;
  /// Standard step over `elastic`, the limit of elastic forces: chosen so that flow rates, energies and contacts agree
  /// with shorter steps, and particles that stay in a discharged hopper stop moving (docs/reference/steps.md). Without
  /// dissipation the heat of longer steps would accumulate. lightest: mass of a particle.
  Real elastic_fraction(Real elastic, Real lightest) const;
  /// Margin of the neighbour lists at first; tuned from then on where the user gave none.
  Real first_skin() const;

  /// Bounds of the diameters.
  Real smallest_diameter() const;
  Real largest_diameter() const;

 private:
  void resolve_dissipation();
  void resolve_clog_speed();
};

}  // namespace pliant
