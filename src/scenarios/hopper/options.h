// Options of the scenario `hopper`.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/catalogue/own_model.h>
#include <pliant/geometry/container.h>
#include <pliant/run/options.h>
#include <pliant/scenarios/disks/friction_options.h>
#include <pliant/setup/packing.h>
#include <pliant/setup/particles.h>
#include <pliant/setup/reinsertion.h>
#include <pliant/system/jacobian.h>

namespace pliant {

/// Newton's equations, or their limit of strong drag.
enum class Dynamics { inertial, overdamped };
enum class IntegratorKind { verlet, ts };
enum class FlowKind { continuous, discharge };
/// When a particle counts for the flow rate: as its centre crosses the orifice line, or as it is put back.
enum class Counting { crossing, removal };
/// Whether a particle whose outline crosses itself ends the run, or is counted.
enum class OnSelfCrossing { stop, count };
/// What vertices and lips touch: edges as well, or vertices only, as [H] prints it.
enum class ContactRule { edge, literal };

/// As given by the user; `resolve` fills in what is automatic. Units: σ_avg = g = ρ = 1, times in t0.
struct HopperOptions : RunOptions {
  /// own: what -model can name beside sp, rough and smooth.
  explicit HopperOptions(std::vector<OwnModel> own = {}) : own_models_(std::move(own)) {}

  std::string model = "sp";
  Index dim = 2;
  Index particles = 0;  ///< 0: automatic
  SizeDistribution sizes;
  PolygonShape shape;

  Real wall_diameter = 0;
  Real e_sp = 100, e_w = 1e4, e_c = 1e4, k_a = 2e4, k_l = 10, k_b = 0.1;
  AreaEnergy area_energy = AreaEnergy::absolute;
  EdgeVectors bending_edges = EdgeVectors::unit;
  EdgeForce edge_force = EdgeForce::single;
  ContactLaw contact_law = ContactLaw::harmonic;
  Real mu = 0;
  std::optional<Real> zeta;
  FrictionPoint friction_point = FrictionPoint::contact;
  Friction friction = Friction::whole;
  DragLaw drag = DragLaw::per_particle;
  ContactRule lip_contact = ContactRule::edge, rough_contact = ContactRule::edge;
  OnSelfCrossing self_crossing = OnSelfCrossing::stop;
  bool self_contact = false;

  // Frictional disks
  Real e_disk = 1e4;
  FrictionOptions disk{0.4}, wall{0.4};
  Real restitution = 0.5, tangential_stiffness = 2.0 / 7, tangential_damping = 0.5;

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
  /// Fills in automatic values and checks what options have to do with each other. Errors: InputError.
  void resolve();
  /// Errors: InputError for an option that the user has given, though the model, or whatever else the run uses, does
  /// not read it.
  void refuse_unread(const Options& options) const;

  /// Of which model the particles are: sp, rough, smooth or disk.
  ModelKind particle_kind() const;
  /// Whether they are polygons.
  bool deformable() const { return particle_kind() == ModelKind::rough || particle_kind() == ModelKind::smooth; }
  ModelParameters model_parameters() const;
  /// The option that sets the stiffness of contacts.
  const char* contact_energy() const {
    return deformable() ? "-e_c" : particle_kind() == ModelKind::disk ? "-e_disk" : "-e_sp";
  }
  /// The forces of the model.
  template <int D>
  std::unique_ptr<ForceField<D>> force_field(const Vec<D>& gravity) const;
  /// Speed at which the weight of the lightest particle equals drag and friction, σ_avg/t0; infinite without them. A
  /// slow flow is about as fast, and comes to rest where it is much slower.
  Real creep_speed() const;
  /// For a -clog_speed that a slow flow may not reach.
  void warn_of_clog_speed() const;
  /// Standard step over `elastic`, the limit that elastic forces set: as long as flow rates, energies and contacts are
  /// those of shorter ones, and what a discharge leaves comes to rest (docs/steps.md). Without dissipation nothing
  /// carries off the heat of longer steps. lightest: mass of a particle.
  Real elastic_fraction(Real elastic, Real lightest) const;
  /// Margin of the neighbour lists at first; tuned from then on where the user gave none.
  Real first_skin() const;

 private:
  void bind_own_models(Options& options);
  void resolve_dissipation();
  void resolve_clog_speed();
  /// The place of `model` in own_models_; their number for a model of the catalogue.
  std::size_t own_model() const;

  std::vector<OwnModel> own_models_;
  std::vector<std::shared_ptr<const ForceFieldMaker>> makers_;  ///< of each, since bind
};

}  // namespace pliant
