// The models that `-model` can name: which terms each is made of.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include <pliant/kernels/contact_law.h>
#include <pliant/model/area.h>
#include <pliant/model/bending.h>
#include <pliant/model/drag.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/edge_friction.h>
#include <pliant/model/model.h>
#include <pliant/model/rest_shape.h>
#include <pliant/model/surface_friction.h>

namespace pliant {

enum class ModelKind {
  sp,      ///< soft particles, 2D and 3D [H 2.2]
  rough,   ///< deformable particles, every vertex a disk [H 2.3]
  smooth,  ///< deformable particles, every edge a circulo-line [H App. A]
  shape,   ///< deformable particles without contacts
  bubble,  ///< droplets with depletion attraction, 2D and 3D [T 2.2, 4.2]
  disk     ///< frictional disks and spheres that rotate, 2D and 3D
};

std::string_view to_string(ModelKind kind);

/// Friction with the table on which particles lie: BaseFriction of disks, VertexBaseFriction of rough ones.
struct BaseParameters {
  Real gravity = 0;  ///< g normal to it; 0: there is none
  Real mu = 0.3, mu_dynamic = 0.3;
  Real stiffness = 0.1;  ///< k_b/k_n
  Real damping = 0.1;    ///< of critical, of what sticks
  bool coupled = true;   ///< disks: sliding and spinning as uniform pressure couples them
};

/// Friction and damping of disks and spheres: SurfaceFriction. Coefficients of friction are static and
/// dynamic ones, the latter not larger.
struct DiskParameters {
  Real mu_disk = 0.4, mu_disk_dynamic = 0.4;
  Real mu_wall = 0.4, mu_wall_dynamic = 0.4;
  std::vector<Coulomb> mu_others = {};  ///< with walls of the materials 1, 2, …
  Real restitution = 0.5;               ///< of disks with each other and with walls
  Real tangential_stiffness = 2.0 / 7;  ///< k_t/k_n
  Real tangential_damping = 0.5;        ///< γ_t/γ_n
};

/// Coefficients of the terms, in units of σ_avg = g = ρ = 1, those of droplets in units of ⟨R⟩ = b = 1. A zero switches
/// its term off.
struct ModelParameters {
  Real epsilon = 100;                     ///< contact energy: E_sp or E_c
  Real epsilon_wall = 1e4;                ///< E_w
  Real wall_diameter = 0;                 ///< thickness of walls, whose ends are round
  ContactLaw law = ContactLaw::harmonic;  ///< of contacts with each other, walls and lips
  Real k_a = 0, k_l = 0, k_b = 0;
  AreaEnergy area_energy = AreaEnergy::absolute;
  EdgeVectors bending_edges = EdgeVectors::unit;
  EdgeForce edge_force = EdgeForce::single;  ///< of smooth particles
  Real mu = 0, zeta = 0;
  FrictionPoint friction_point = FrictionPoint::contact;
  Friction friction = Friction::whole;
  DragLaw drag = DragLaw::per_particle;
  bool lip_edges = true;      ///< lips feel edges too
  bool rough_edges = true;    ///< vertices of rough particles feel edges too
  bool self_contact = false;  ///< vertices of deformable particles feel edges of their own outline
  // Droplets
  Real f0 = 10;          ///< contact force
  Real phi_c = 1e-4;     ///< depletion energy
  Real a_s = 0.05;       ///< radius of the depletant
  Real mean_radius = 1;  ///< ⟨R⟩ in the repulsion of walls
  DiskParameters disk = {};
  BaseParameters base = {};   ///< of disks and rough particles
  RestShape rest_shape = {};  ///< of rough particles, beside the shape energy
};

std::string_view to_string(ContactLaw law);
/// Whether a model's contacts can follow a law.
bool has_law(ModelKind kind, ContactLaw law);

/// The weight of a droplet is ρ g R³ [T 4.6]: give it the mass ρ R³.
/// Errors: InputError for a deformable model or a base in 3D, for a base under other particles than disks and rough
/// ones, for a contact law that the model does not have, where a_s is not positive for droplets, or for disks with a
/// dynamic friction that exceeds the static one.
template <int D>
std::unique_ptr<ForceField<D>> make_force_field(ModelKind kind, const ModelParameters& p, const Vec<D>& gravity);

}  // namespace pliant
