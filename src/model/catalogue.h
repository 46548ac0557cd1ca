// The models that `-model` can name: which terms each is made of.
#pragma once

#include <memory>
#include <string_view>

#include <pliant/kernels/contact_law.h>
#include <pliant/model/edge_friction.h>
#include <pliant/model/model.h>

namespace pliant {

enum class ModelKind {
  sp,      ///< soft particles, 2D and 3D [H 2.2]
  rough,   ///< deformable particles, every vertex a disk [H 2.3]
  smooth,  ///< deformable particles, every edge a circulo-line [H App. A]
  shape,   ///< deformable particles without contacts
  bubble   ///< droplets with depletion attraction, 2D and 3D [T 2.2, 4.2]
};

std::string_view to_string(ModelKind kind);

/// Coefficients of the terms, in units of σ_avg = g = ρ = 1, those of droplets in units of ⟨R⟩ = b = 1. A zero switches
/// its term off.
struct ModelParameters {
  Real epsilon = 100;                     ///< contact energy: E_sp or E_c
  Real epsilon_wall = 1e4;                ///< E_w
  ContactLaw law = ContactLaw::harmonic;  ///< of contacts with each other, walls and lips
  Real k_a = 0, k_l = 0, k_b = 0;
  Real mu = 0, zeta = 0;
  FrictionPoint friction_point = FrictionPoint::contact;
  bool lip_edges = true;    ///< lips feel edges too
  bool rough_edges = true;  ///< vertices of rough particles feel edges too
  // Droplets
  Real f0 = 10;          ///< contact force
  Real phi_c = 1e-4;     ///< depletion energy
  Real a_s = 0.05;       ///< radius of the depletant
  Real mean_radius = 1;  ///< ⟨R⟩ in the repulsion of walls
};

std::string_view to_string(ContactLaw law);
/// Whether a model's contacts can follow a law.
bool has_law(ModelKind kind, ContactLaw law);

/// The weight of a droplet is ρ g R³ [T 4.6]: give it the mass ρ R³.
/// Errors: InputError for a deformable model in 3D, for a contact law that the model does not have, or where a_s is not
/// positive for droplets.
template <int D>
std::unique_ptr<ForceField<D>> make_force_field(ModelKind kind, const ModelParameters& p, const Vec<D>& gravity);

}  // namespace pliant
