// The models of `-model`, each as a list of terms.
#pragma once

#include <concepts>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>
#include <pliant/model/model.h>
#include <pliant/model/parameter.h>
#include <pliant/model/rest_shape.h>

namespace pliant {

enum class ModelKind {
  sp,      ///< soft particles, 2D and 3D [H 2.2]
  rough,   ///< deformable particles, every vertex a disk, in 3D a sphere [H 2.3]
  smooth,  ///< deformable particles, every edge a circulo-line [H App. A]
  shape,   ///< deformable particles without contacts
  bubble,  ///< droplets with depletion attraction, 2D and 3D [T 2.2, 4.2]
  disk     ///< frictional disks and spheres that rotate, 2D and 3D
};

std::string_view to_string(ModelKind kind);

/// The surroundings of the particles, which a model needs in addition to its parameters.
template <int D>
struct Surroundings {
  Vec<D> gravity = Vec<D>::Zero();
  bool substrate = false;   ///< particles lie on a plane that exerts friction (2D, disks and rough particles)
  bool shape_terms = true;  ///< closed surfaces have energies of their shape
  std::shared_ptr<const RestOutlines> rest_outlines =
      nullptr;              ///< rest shapes of rough particles, instead of the terms of deformable shapes
  Real rest_stiffness = 1;  ///< unit of the stiffness of rest shapes
};

/// Makes the forces of a model. A call also lists the parameters, because the terms read them.
template <int D>
using MakeForceField = std::function<std::unique_ptr<ForceField<D>>(ParameterReader& p, const Surroundings<D>& s)>;

/// A model: a named list of terms.
struct ModelDefinition {
  std::string name, help;
  ModelKind particles;  ///< the catalogue model with the same shapes and sizes of particles
  MakeForceField<2> plane = {};
  MakeForceField<3> space = {};  ///< empty, as `plane`, where the model does not exist in so many dimensions

  template <int D>
  const MakeForceField<D>& maker() const {
    if constexpr (D == 2)
      return plane;
    else
      return space;
  }
  /// Errors: InputError where the model does not exist in D dimensions, or parameters contradict each other.
  template <int D>
  std::unique_ptr<ForceField<D>> make(ParameterReader& p, const Surroundings<D>& s) const {
    if (!maker<D>())
      throw InputError("-model {} does not exist in {}D; use {}", name, D,
                       cures({D == 2 ? Cure::three_dimensions : Cure::two_dimensions}));
    return maker<D>()(p, s);
  }
};

const ModelDefinition& catalogue_model(ModelKind kind);

/// A model that a program adds to the catalogue. M has, for D = 2, for 3 or for both, std::unique_ptr<ForceField<D>>
/// force_field(ParameterReader&, const Surroundings<D>&) const.
template <class M>
ModelDefinition own_model(std::string name, std::string help, ModelKind particles) {
  ModelDefinition own{.name = std::move(name), .help = std::move(help), .particles = particles};
  if constexpr (requires(const M m, ParameterReader& p, const Surroundings<2>& s) {
                  { m.force_field(p, s) } -> std::same_as<std::unique_ptr<ForceField<2>>>;
                })
    own.plane = [](ParameterReader& p, const Surroundings<2>& s) { return M().force_field(p, s); };
  if constexpr (requires(const M m, ParameterReader& p, const Surroundings<3>& s) {
                  { m.force_field(p, s) } -> std::same_as<std::unique_ptr<ForceField<3>>>;
                })
    own.space = [](ParameterReader& p, const Surroundings<3>& s) { return M().force_field(p, s); };
  return own;
}

/// The weight of a droplet is ρ g R³ [T 4.6]: give the droplet the mass ρ R³. Errors: InputError for a model that does
/// not exist in D dimensions, for a substrate in 3D or under particles other than disks and rough particles, for a
/// contact law that the model does not have, or for friction whose dynamic coefficient exceeds the static one.
template <int D>
std::unique_ptr<ForceField<D>> make_force_field(ModelKind kind, ParameterReader& p, const Surroundings<D>& s = {});
template <int D>
std::unique_ptr<ForceField<D>> make_force_field(ModelKind kind, ParameterReader&& p, const Surroundings<D>& s = {}) {
  return make_force_field<D>(kind, p, s);
}

}  // namespace pliant
