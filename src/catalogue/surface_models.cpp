#include <pliant/catalogue/surface_models.h>

#include <utility>

#include <pliant/model/drag.h>
#include <pliant/model/gravity.h>
#include <pliant/model/model.h>
#include <pliant/model/pair_contact.h>
#include <pliant/model/pair_friction.h>
#include <pliant/model/surface_terms.h>

namespace pliant {
namespace {

using ForcesInSpace = std::unique_ptr<ForceField<3>>;

/// The model of the terms of the shape, the terms in `more`, gravity and drag. surfaces = null: without the shape.
template <class... More>
ForcesInSpace with_shape(ParameterReader& p, const Surroundings<3>& s, const std::shared_ptr<const Surfaces>& surfaces,
                         More... more) {
  const auto volume = configured(p, Volume{{surfaces}});
  const auto area = configured(p, FaceArea{{{surfaces}}});
  const auto tension = configured(p, SurfaceTension{{{surfaces}}});
  const auto edges = configured(p, EdgeLength{{surfaces}});
  const auto bending = configured(p, HingeBending{{surfaces}});
  const auto drag = configured(p, Drag<3>{});
  const Gravity<3> gravity{s.gravity};
  using All = Model<3, Volume, FaceArea, EdgeLength, HingeBending, SurfaceTension, More..., Gravity<3>, Drag<3>>;
  return std::make_unique<All>(volume, area, edges, bending, tension, std::move(more)..., gravity, drag);
}

}  // namespace

ModelDefinition surface_model(ModelKind kind, std::shared_ptr<const Surfaces> surfaces, bool shape_terms) {
  const ModelDefinition& plane = catalogue_model(kind);
  ModelDefinition model{.name = plane.name, .help = "closed surfaces", .particles = kind};
  const std::shared_ptr<const Surfaces> active = shape_terms ? std::move(surfaces) : nullptr;
  if (kind == ModelKind::shape)
    model.space = [=](ParameterReader& p, const Surroundings<3>& s) { return with_shape(p, s, active); };
  else if (kind == ModelKind::rough)
    model.space = [=](ParameterReader& p, const Surroundings<3>& s) {
      const auto contact = configured(p, PairContact<3>{0, "rough"}, contact_energy::deformable);
      const auto friction = configured(p, PairFriction<3>{});
      return with_shape(p, s, active, contact, friction);
    };
  else
    throw InputError("model {} has no deformable particles in 3D; use shape or rough", plane.name);
  return model;
}

}  // namespace pliant
