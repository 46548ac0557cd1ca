// The models that `-model` can name: which terms each is made of.
#pragma once

#include <memory>
#include <string_view>

#include <pliant/model/edge_friction.h>
#include <pliant/model/model.h>

namespace pliant {

enum class ModelKind {
  sp,      ///< soft particles, 2D and 3D [H 2.2]
  rough,   ///< deformable particles, every vertex a disk [H 2.3]
  smooth,  ///< deformable particles, every edge a circulo-line [H App. A]
  shape    ///< deformable particles without contacts
};

std::string_view to_string(ModelKind kind);

/// Coefficients of the terms, in units of σ_avg = g = ρ = 1. A zero switches its term off.
struct ModelParameters {
  Real epsilon = 100;       ///< contact energy: E_sp or E_c
  Real epsilon_wall = 1e4;  ///< E_w
  Real k_a = 0, k_l = 0, k_b = 0;
  Real mu = 0, zeta = 0;
  FrictionPoint friction_point = FrictionPoint::contact;
  bool lip_edges = true;  ///< lips feel edges too
};

/// Which lists the model reads.
NeighbourNeeds neighbour_needs(ModelKind kind);

/// Errors: InputError for a deformable model in 3D.
template <int D>
std::unique_ptr<ForceField<D>> make_force_field(ModelKind kind, const ModelParameters& p, const Vec<D>& gravity);

}  // namespace pliant
