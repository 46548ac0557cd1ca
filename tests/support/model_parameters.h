// Coefficients of the catalogue's models as plain members.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <pliant/catalogue/catalogue.h>
#include <pliant/catalogue/parameter_values.h>
#include <pliant/model/area.h>
#include <pliant/model/bending.h>
#include <pliant/model/contact_laws.h>
#include <pliant/model/drag.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/edge_friction.h>
#include <pliant/model/surface_friction.h>

namespace pliant {

/// Friction with the substrate.
struct BaseParameters {
  Real gravity = 0;  ///< 0: there is no substrate
  Real mu = 0.3, mu_dynamic = 0.3;
  Real stiffness = 0.1;
  Real damping = 0.1;
  bool coupled = true;
};

struct DiskParameters {
  Real mu_disk = 0.4, mu_disk_dynamic = 0.4;
  Real mu_wall = 0.4, mu_wall_dynamic = 0.4;
  std::vector<Coulomb> mu_others = {};  ///< with walls of the materials 1, 2, …
  Real restitution = 0.5;
  Real tangential_stiffness = 2.0 / 7;
  Real tangential_damping = 0.5;
};

/// A zero switches its term off.
struct ModelParameters {
  Real epsilon = 100;
  Real epsilon_wall = 1e4;
  Real wall_diameter = 0;
  ContactLaw law = ContactLaw::harmonic;
  Real k_a = 0, k_l = 0, k_b = 0;
  AreaEnergy area_energy = AreaEnergy::absolute;
  EdgeVectors bending_edges = EdgeVectors::unit;
  EdgeForce edge_force = EdgeForce::single;
  Real mu = 0, zeta = 0;
  FrictionPoint friction_point = FrictionPoint::contact;
  Friction friction = Friction::whole;
  DragLaw drag = DragLaw::per_particle;
  bool lip_edges = true;
  bool rough_edges = true;
  bool self_contact = false;
  Real f0 = 10;
  Real phi_c = 1e-4;
  Real a_s = 0.05;
  Real mean_radius = 1;
  DiskParameters disk = {};
  BaseParameters base = {};
};

inline ParameterValues values_of(const ModelParameters& p) {
  const auto chosen = [](bool first, const char* one, const char* other) { return std::string(first ? one : other); };
  const DiskParameters& d = p.disk;
  ParameterValues v{{Role::contact_energy, p.epsilon},
                    {Role::wall_energy, p.epsilon_wall},
                    {"wall_diameter", p.wall_diameter},
                    {"contact_law", std::string(to_string(p.law))},
                    {"k_a", p.k_a},
                    {"k_l", p.k_l},
                    {"k_b", p.k_b},
                    {"area_energy", chosen(p.area_energy == AreaEnergy::absolute, "absolute", "relative")},
                    {"bending_edges", chosen(p.bending_edges == EdgeVectors::unit, "unit", "full")},
                    {"edge_force", chosen(p.edge_force == EdgeForce::single, "single", "twofold")},
                    {"mu", p.mu},
                    {"zeta", p.zeta},
                    {"friction_point", chosen(p.friction_point == FrictionPoint::contact, "contact", "vertex")},
                    {"friction", chosen(p.friction == Friction::whole, "whole", "tangential")},
                    {"drag", chosen(p.drag == DragLaw::per_particle, "per_particle", "per_mass")},
                    {"lip_contact", chosen(p.lip_edges, "edge", "literal")},
                    {"rough_contact", chosen(p.rough_edges, "edge", "literal")},
                    {"self_contact", p.self_contact ? 1.0 : 0.0},
                    {"f0", p.f0},
                    {"phi_c", p.phi_c},
                    {"a_s", p.a_s},
                    {"R_mean", p.mean_radius},
                    {"mu_disk", d.mu_disk},
                    {"mu_disk_dynamic", d.mu_disk_dynamic},
                    {"mu_wall", d.mu_wall},
                    {"mu_wall_dynamic", d.mu_wall_dynamic},
                    {"restitution", d.restitution},
                    {"tangential_stiffness", d.tangential_stiffness},
                    {"tangential_damping", d.tangential_damping},
                    {"gravity", p.base.gravity},
                    {"mu_base", p.base.mu},
                    {"mu_base_dynamic", p.base.mu_dynamic},
                    {"base_stiffness", p.base.stiffness},
                    {"base_damping", p.base.damping},
                    {"base_coupled", p.base.coupled ? 1.0 : 0.0}};
  for (const Coulomb& mu : d.mu_others) {
    const std::string material = "material" + std::to_string(v.materials.size() + 1);
    v.materials.push_back(material);
    v.set("mu_" + material, mu.mu_static);
    v.set("mu_" + material + "_dynamic", mu.mu_dynamic);
  }
  return v;
}

template <int D>
std::unique_ptr<ForceField<D>> make_force_field(ModelKind kind, const ModelParameters& p, const Vec<D>& gravity) {
  return make_force_field<D>(kind, values_of(p), {.gravity = gravity, .substrate = p.base.gravity > 0});
}

}  // namespace pliant
