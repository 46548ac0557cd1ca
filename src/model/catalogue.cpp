#include <pliant/model/catalogue.h>

#include <pliant/base/errors.h>
#include <pliant/model/area.h>
#include <pliant/model/bending.h>
#include <pliant/model/drag.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/gravity.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/pair_contact.h>
#include <pliant/model/pair_friction.h>
#include <pliant/model/perimeter.h>
#include <pliant/model/wall_contact.h>

namespace pliant {
namespace {

template <int D, class... Terms>
std::unique_ptr<ForceField<D>> model(Terms... terms) {
  return std::make_unique<Model<D, Terms...>>(std::move(terms)...);
}

}  // namespace

std::string_view to_string(ModelKind kind) {
  switch (kind) {
    case ModelKind::sp:
      return "sp";
    case ModelKind::rough:
      return "rough";
    case ModelKind::smooth:
      return "smooth";
    case ModelKind::shape:
      return "shape";
  }
  return "";
}

NeighbourNeeds neighbour_needs(ModelKind kind) {
  switch (kind) {
    case ModelKind::sp:
      return {.point_pairs = true, .walls = true};
    case ModelKind::rough:
      return {.point_pairs = true, .walls = true, .lips = true};
    case ModelKind::smooth:
      return {.vertex_edges = true, .walls = true, .lips = true};
    case ModelKind::shape:
      return {};
  }
  return {};
}

template <int D>
std::unique_ptr<ForceField<D>> make_force_field(ModelKind kind, const ModelParameters& p, const Vec<D>& gravity) {
  if (kind == ModelKind::sp)
    return model<D>(PairContact<D>{p.epsilon, "pair"}, WallContact<D>{p.epsilon_wall}, Gravity<D>{gravity},
                    Drag<D>{p.zeta}, PairFriction<D>{p.mu});
  if constexpr (D == 2) {
    const Area area{p.k_a};
    const Perimeter perimeter{p.k_l};
    const Bending bending{p.k_b};
    const WallContact<2> wall{p.epsilon_wall};
    const LipContact lip{p.epsilon_wall, p.lip_edges};
    const Gravity<2> weight{gravity};
    const Drag<2> drag{p.zeta};
    switch (kind) {
      case ModelKind::rough:
        return model<2>(area, perimeter, bending, PairContact<2>{p.epsilon, "contact"}, wall, lip, weight, drag,
                        PairFriction<2>{p.mu});
      case ModelKind::smooth:
        return model<2>(area, perimeter, bending, EdgeContact{p.epsilon}, wall, lip, weight, drag,
                        EdgeFriction{p.mu, p.friction_point});
      default:
        return model<2>(area, perimeter, bending, weight, drag);
    }
  }
  throw InputError("model {} exists in 2D only; use -dim 2 or -model sp", to_string(kind));
}

template std::unique_ptr<ForceField<2>> make_force_field<2>(ModelKind, const ModelParameters&, const Vec<2>&);
template std::unique_ptr<ForceField<3>> make_force_field<3>(ModelKind, const ModelParameters&, const Vec<3>&);

}  // namespace pliant
