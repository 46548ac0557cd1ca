#include <pliant/catalogue/surface_models.h>

#include <utility>

#include <pliant/base/errors.h>
#include <pliant/model/contact_laws.h>
#include <pliant/model/fused_surfaces.h>
#include <pliant/model/fused_terms.h>

namespace pliant {
namespace {

using Shape = Fused<SurfaceKernel, Volume, FaceArea, EdgeLength, HingeBending, SurfaceTension>;

/// The model of the terms of the shape, the parts in `more`, gravity and drag.
template <class... More>
std::unique_ptr<ForceField<3>> with_shape(ParameterReader& p, const Surroundings<3>& s, More... more) {
  if (s.substrate) throw InputError("the particles lie on a substrate, which exists in 2D only; leave it out");
  const auto volume = configured(p, Volume{});
  const auto area = configured(p, FaceArea{});
  const auto edges = configured(p, EdgeLength{});
  const auto bending = configured(p, HingeBending{});
  const Shape shape(volume, area, edges, bending, configured(p, SurfaceTension{}));
  Fused<PointKernel, Gravity<3>, Drag<3>> outer(Gravity<3>{s.gravity}, configured(p, Drag<3>{}));
  return std::make_unique<Model<3, Shape, More..., decltype(outer)>>(shape, std::move(more)..., outer);
}

}  // namespace

std::unique_ptr<ForceField<3>> surfaces_without_contacts(ParameterReader& p, const Surroundings<3>& s) {
  return with_shape(p, s);
}

std::unique_ptr<ForceField<3>> rough_surfaces(ParameterReader& p, const Surroundings<3>& s) {
  read_contact_law<HarmonicOverlap>(p);
  const auto contact = configured(p, PairContact<3>{0, "rough"}, contact_energy::deformable);
  const Fused<PairKernel, PairContact<3>, PairFriction<3>> pairs(contact, configured(p, PairFriction<3>{}));
  const Fused<WallKernel, WallContact<3>> walls(configured(p, WallContact<3>{}));
  return with_shape(p, s, pairs, walls);
}

}  // namespace pliant
