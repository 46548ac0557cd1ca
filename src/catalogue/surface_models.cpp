#include <pliant/catalogue/surface_models.h>

#include <utility>

#include <pliant/base/errors.h>
#include <pliant/model/contact_laws.h>
#include <pliant/model/fused_surfaces.h>
#include <pliant/model/fused_terms.h>
#include <pliant/model/rim_contact.h>
#include <pliant/model/simplex_contact.h>
#include <pliant/model/simplex_friction.h>

namespace pliant {
namespace {

using VertexFaces =
    Fused<SimplexKernel<Elements::vertex_faces>, VertexFaceContact, SimplexFriction<Elements::vertex_faces>>;
using Shape = Fused<SurfaceKernel, Volume, FaceArea, EdgeLength, HingeBending, SurfaceTension>;

/// The model of the terms of the shape, the parts in `more`, gravity and drag.
template <class... More>
std::unique_ptr<ForceField<3>> with_shape(ParameterReader& p, const Surroundings<3>& s, More... more) {
  if (s.substrate) throw InputError("the particles lie on a substrate, which exists in 2D only; leave it out");
  const auto term = [&](auto off) { return s.shape_terms ? configured(p, off) : off; };
  const auto volume = term(Volume{});
  const auto area = term(FaceArea{});
  const auto edges = term(EdgeLength{});
  const auto bending = term(HingeBending{});
  const Shape shape(volume, area, edges, bending, term(SurfaceTension{}));
  Fused<PointKernel, Gravity<3>, Drag<3>> outer(Gravity<3>{s.gravity}, configured(p, Drag<3>{}));
  return std::make_unique<Model<3, Shape, More..., decltype(outer)>>(shape, std::move(more)..., outer);
}

}  // namespace

std::unique_ptr<ForceField<3>> surfaces_without_contacts(ParameterReader& p, const Surroundings<3>& s) {
  return with_shape(p, s);
}

std::unique_ptr<ForceField<3>> rough_surfaces(ParameterReader& p, const Surroundings<3>& s) {
  read_contact_law(p, ContactLaw::harmonic);
  const auto contact = configured(p, PairContact<3>{0, "rough"}, contact_energy::deformable);
  const Fused<PairKernel, PairContact<3>, PairFriction<3>> pairs(contact, configured(p, PairFriction<3>{}));
  const VertexFaces faces(configured(p, VertexFaceContact{0, Edges::bare}), SimplexFriction<Elements::vertex_faces>{0});
  const Fused<WallKernel, WallContact<3>> walls(configured(p, WallContact<3>{}));
  RimContact rim{};
  rim.s1 = 1.0 / 16;  // edges are as wide as they are long, so that the width gives no angle below 90°
  return with_shape(p, s, pairs, faces, walls, configured(p, rim));
}

std::unique_ptr<ForceField<3>> smooth_surfaces(ParameterReader& p, const Surroundings<3>& s) {
  read_contact_law(p, ContactLaw::harmonic);
  const auto vertices = configured(p, VertexFaceContact{});
  const auto edges = configured(p, EdgePairContact{});
  const VertexFaces faces(vertices, configured(p, SimplexFriction<Elements::vertex_faces>{}));
  const Fused<SimplexKernel<Elements::edge_pairs>, EdgePairContact, SimplexFriction<Elements::edge_pairs>> pairs(
      edges, configured(p, SimplexFriction<Elements::edge_pairs>{}));
  const Fused<WallKernel, WallContact<3>> walls(configured(p, WallContact<3>{}));
  return with_shape(p, s, faces, pairs, walls, configured(p, RimContact{}));
}

}  // namespace pliant
