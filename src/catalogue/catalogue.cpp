#include <pliant/catalogue/catalogue.h>

#include <array>
#include <type_traits>

#include <pliant/base/cure.h>
#include <pliant/catalogue/surface_models.h>
#include <pliant/model/base_friction.h>
#include <pliant/model/contact_laws.h>
#include <pliant/model/depletion.h>
#include <pliant/model/disk_contact.h>
#include <pliant/model/disk_wall_contact.h>
#include <pliant/model/fused_terms.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/self_contact.h>
#include <pliant/model/sphere_contact.h>
#include <pliant/model/sphere_wall_contact.h>
#include <pliant/model/vertex_base_friction.h>
#include <pliant/model/wall_depletion.h>
#include <pliant/model/wall_repulsion.h>

namespace pliant {
namespace {

template <int D>
using Forces = std::unique_ptr<ForceField<D>>;

template <int D, class... Terms>
Forces<D> model(Terms... terms) {
  return std::make_unique<Model<D, Terms...>>(std::move(terms)...);
}

/// Terms whose forces the kernel computes in one pass.
template <class Kernel, class... Terms>
Fused<Kernel, Terms...> fused(Terms... terms) {
  return Fused<Kernel, Terms...>(std::move(terms)...);
}

template <int D>
void check_no_substrate(const Surroundings<D>& s, ModelKind kind) {
  if (s.substrate)
    throw InputError("the particles lie on a substrate, but the model {} has no friction with one in {}D; leave it out",
                     to_string(kind), D);
}

template <int D>
auto outer(ParameterReader& p, const Surroundings<D>& s) {
  return fused<PointKernel>(Gravity<D>{s.gravity}, configured(p, Drag<D>{}));
}

template <int D>
Forces<D> soft(ParameterReader& p, const Surroundings<D>& s) {
  check_no_substrate(s, ModelKind::sp);
  const ContactLaw law = read_contact_law(p, ContactLaw::harmonic, ContactLaw::hertz, ContactLaw::linear);
  const auto pair = configured(p, PairContact<D>{0, "pair", law}, contact_energy::soft);
  const auto friction = configured(p, PairFriction<D>{});
  const auto wall = configured(p, WallContact<D>{.law = law});
  return model<D>(fused<PairKernel>(pair, friction), fused<WallKernel>(wall), outer(p, s));
}

/// Of disks, or of spheres.
template <int D>
Forces<D> frictional(ParameterReader& p, const Surroundings<D>& s) {
  if (D == 3) check_no_substrate(s, ModelKind::disk);
  const ContactLaw law = read_contact_law(p, ContactLaw::harmonic, ContactLaw::hertz, ContactLaw::spring);
  const auto pair = configured(p, PairContact<D>{0, "pair", law}, contact_energy::disk);
  const auto friction = configured(p, std::conditional_t<D == 2, DiskContact, SphereContact>{.law = law});
  const auto wall_friction = configured(p, std::conditional_t<D == 2, DiskWallContact, SphereWallContact>{.law = law});
  const WallContact<D> wall{.epsilon = wall_friction.epsilon, .law = law};
  const auto pairs = fused<DiskKernel>(pair, friction);
  const auto walls = fused<DiskWallKernel>(wall, wall_friction);
  if constexpr (D == 2) {
    BaseFriction base{.all_alike = law == ContactLaw::spring};
    if (s.substrate) base = configured(p, base, reference_stiffness(Overlap{law, pair.epsilon, 1}));
    return model<2>(pairs, walls, base, outer(p, s));
  } else {
    return model<3>(pairs, walls, outer(p, s));
  }
}

template <int D>
Forces<D> droplets(ParameterReader& p, const Surroundings<D>& s) {
  check_no_substrate(s, ModelKind::bubble);
  const auto contact = configured(p, BubbleContact<D>{});
  const auto depletion = configured(p, Depletion<D>{});
  const auto repulsion = configured(p, WallRepulsion<D>{});
  const auto wall_depletion = configured(p, WallDepletion<D>{});
  return model<D>(contact, depletion, repulsion, wall_depletion, Gravity<D>{s.gravity});
}

auto shape_energy(ParameterReader& p) {
  const Area area = configured(p, Area{});
  const Perimeter perimeter = configured(p, Perimeter{});
  return fused<ShapeKernel>(area, perimeter, configured(p, Bending{}));
}

Forces<2> rough(ParameterReader& p, const Surroundings<2>& s) {
  read_contact_law(p, ContactLaw::harmonic);
  const auto contact = configured(p, PairContact<2>{0, "contact"}, contact_energy::deformable);
  const auto friction = configured(p, PairFriction<2>{});
  const auto pairs = fused<PairKernel>(contact, friction);
  const auto edges = fused<EdgeKernel>(configured(p, EdgeContact{0, Edges::bare}), EdgeFriction{0});
  const auto self = configured(p, SelfContact{0, Edges::bare});
  const auto wall = fused<WallKernel>(configured(p, WallContact<2>{}));
  const auto lip = configured(p, LipContact{});
  if (!s.substrate && !s.rest_outlines) {
    const auto shape = shape_energy(p);
    return model<2>(shape, pairs, edges, self, wall, lip, outer(p, s));
  }
  const auto shape = s.rest_outlines ? fused<ShapeKernel>(Area{}, Perimeter{}, Bending{}) : shape_energy(p);
  RestShape rest{0, s.rest_outlines};
  if (s.rest_outlines) rest = configured(p, rest, s.rest_stiffness);
  VertexBaseFriction base;
  if (s.substrate) base = configured(p, base, contact.epsilon);
  return model<2>(shape, rest, pairs, edges, self, wall, lip, base, outer(p, s));
}

Forces<2> smooth(ParameterReader& p, const Surroundings<2>& s) {
  check_no_substrate(s, ModelKind::smooth);
  const ContactLaw law = read_contact_law(p, ContactLaw::harmonic, ContactLaw::hertz, ContactLaw::barrier);
  const auto contact = configured(p, EdgeContact{.law = law});
  const auto edges = fused<EdgeKernel>(contact, configured(p, EdgeFriction{}));
  const auto self = configured(p, SelfContact{.law = law});
  const auto wall = fused<WallKernel>(configured(p, WallContact<2>{.law = law}));
  const auto lip = configured(p, LipContact{{}, law});
  const auto shape = shape_energy(p);
  return model<2>(shape, edges, self, wall, lip, outer(p, s));
}

Forces<2> shape_alone(ParameterReader& p, const Surroundings<2>& s) {
  check_no_substrate(s, ModelKind::shape);
  const auto shape = shape_energy(p);
  return model<2>(shape, outer(p, s));
}

const std::array<ModelDefinition, 6>& models() {
  static const std::array<ModelDefinition, 6> all{{
      {"sp", "soft", ModelKind::sp, soft<2>, soft<3>},
      {"rough", "rough polygons", ModelKind::rough, rough, rough_surfaces},
      {"smooth", "smooth polygons", ModelKind::smooth, smooth, smooth_surfaces},
      {"shape", "polygons without contacts", ModelKind::shape, shape_alone, surfaces_without_contacts},
      {"bubble", "droplets", ModelKind::bubble, droplets<2>, droplets<3>},
      {"disk", "frictional", ModelKind::disk, frictional<2>, frictional<3>},
  }};
  return all;
}

}  // namespace

std::string_view to_string(ModelKind kind) { return catalogue_model(kind).name; }

const ModelDefinition& catalogue_model(ModelKind kind) { return models()[static_cast<std::size_t>(kind)]; }

template <int D>
std::unique_ptr<ForceField<D>> make_force_field(ModelKind kind, ParameterReader& p, const Surroundings<D>& s) {
  return catalogue_model(kind).make<D>(p, s);
}

template std::unique_ptr<ForceField<2>> make_force_field<2>(ModelKind, ParameterReader&, const Surroundings<2>&);
template std::unique_ptr<ForceField<3>> make_force_field<3>(ModelKind, ParameterReader&, const Surroundings<3>&);

}  // namespace pliant
