#include <pliant/catalogue/catalogue.h>

#include <fmt/format.h>

#include <pliant/base/errors.h>
#include <pliant/model/base_friction.h>
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

template <int D, class... Terms>
std::unique_ptr<ForceField<D>> model(Terms... terms) {
  return std::make_unique<Model<D, Terms...>>(std::move(terms)...);
}

/// Terms whose forces the kernel computes in one pass.
template <class Kernel, class... Terms>
Fused<Kernel, Terms...> fused(Terms... terms) {
  return Fused<Kernel, Terms...>(std::move(terms)...);
}

template <int D, class Law = HarmonicOverlap>
std::unique_ptr<ForceField<D>> soft(const ModelParameters& p, const Vec<D>& gravity) {
  return model<D>(fused<PairKernel>(PairContact<D, Law>{p.epsilon, "pair"}, PairFriction<D>{p.mu, p.friction}),
                  fused<WallKernel>(WallContact<D, Law>{p.epsilon_wall, p.wall_diameter}),
                  fused<PointKernel>(Gravity<D>{gravity}, Drag<D>{p.zeta, p.drag}));
}

void check(const std::string& what, Real mu_static, Real mu_dynamic) {
  if (!(mu_static >= 0 && mu_dynamic >= 0 && mu_dynamic <= mu_static && std::isfinite(mu_static)) ||
      (mu_static > 0 && mu_dynamic == 0))
    throw InputError(
        "the friction of particles with {} is {} (static) and {} (dynamic); the dynamic one must be positive and not "
        "exceed the static one, or both 0",
        what, mu_static, mu_dynamic);
}

/// Of disks, or of balls.
template <int D, class Law>
std::unique_ptr<ForceField<D>> frictional(const ModelParameters& p, const Vec<D>& gravity) {
  const DiskParameters& q = p.disk;
  check("each other", q.mu_disk, q.mu_disk_dynamic);
  check("walls", q.mu_wall, q.mu_wall_dynamic);
  for (std::size_t k = 0; k < q.mu_others.size(); ++k)
    check(fmt::format("walls of material {}", k + 1), q.mu_others[k].mu_static, q.mu_others[k].mu_dynamic);
  check("the base", p.base.mu, p.base.mu_dynamic);
  SurfaceFriction disk{q.mu_disk, q.mu_disk_dynamic, q.tangential_stiffness, damping_for<Law>(q.restitution),
                       q.tangential_damping};
  SurfaceFriction wall = disk;
  wall.mu_static = q.mu_wall, wall.mu_dynamic = q.mu_wall_dynamic;
  const PairContact<D, Law> pair{p.epsilon, "pair"};
  const OtherMaterials others(q.mu_others);
  const WallContact<D, Law> wall_contact{p.epsilon_wall};
  const auto outer = fused<PointKernel>(Gravity<D>{gravity}, Drag<D>{p.zeta, p.drag});
  if constexpr (D == 2) {
    const BaseFriction base{.gravity = p.base.gravity,
                            .mu_static = p.base.mu,
                            .mu_dynamic = p.base.mu_dynamic,
                            .epsilon = p.base.stiffness * reference_stiffness(Law{p.epsilon, 1}),
                            .damping = p.base.damping,
                            .coupled = p.base.coupled,
                            .all_alike = Law::kind == ContactLaw::spring};
    return model<2>(fused<DiskKernel>(pair, DiskContact<Law>{p.epsilon, disk}),
                    fused<DiskWallKernel>(wall_contact, DiskWallContact<Law>{p.epsilon_wall, wall, others}), base,
                    outer);
  } else {
    if (p.base.gravity > 0)
      throw InputError("the gravity of a base is {}, but balls in space lie on none; leave it out", p.base.gravity);
    return model<3>(fused<DiskKernel>(pair, SphereContact<Law>{p.epsilon, disk}),
                    fused<DiskWallKernel>(wall_contact, SphereWallContact<Law>{p.epsilon_wall, wall, others}), outer);
  }
}

}  // namespace

std::string_view to_string(ContactLaw law) {
  switch (law) {
    case ContactLaw::harmonic:
      return "harmonic";
    case ContactLaw::hertz:
      return "hertz";
    case ContactLaw::barrier:
      return "barrier";
    case ContactLaw::spring:
      return "spring";
    case ContactLaw::linear:
      return "linear";
  }
  return "";
}

bool has_law(ModelKind kind, ContactLaw law) {
  switch (law) {
    case ContactLaw::harmonic:
      return true;
    case ContactLaw::hertz:
      return kind == ModelKind::sp || kind == ModelKind::smooth || kind == ModelKind::disk;
    case ContactLaw::barrier:
      return kind == ModelKind::smooth;
    case ContactLaw::spring:
      return kind == ModelKind::disk;
    case ContactLaw::linear:
      return kind == ModelKind::sp;
  }
  return false;
}

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
    case ModelKind::bubble:
      return "bubble";
    case ModelKind::disk:
      return "disk";
  }
  return "";
}

template <int D>
std::unique_ptr<ForceField<D>> make_force_field(ModelKind kind, const ModelParameters& p, const Vec<D>& gravity) {
  if (!has_law(kind, p.law))
    throw InputError("the model {} does not have the contact law {}; leave it out or use harmonic", to_string(kind),
                     to_string(p.law));
  if (kind != ModelKind::rough && kind != ModelKind::disk && p.base.gravity > 0)
    throw InputError("the gravity of a base is {}, but the model {} has none; leave it out", p.base.gravity,
                     to_string(kind));
  if (kind == ModelKind::sp)
    return p.law == ContactLaw::hertz    ? soft<D, HertzOverlap>(p, gravity)
           : p.law == ContactLaw::linear ? soft<D, LinearOverlap>(p, gravity)
                                         : soft<D>(p, gravity);
  if (kind == ModelKind::disk)
    return p.law == ContactLaw::hertz    ? frictional<D, HertzOverlap>(p, gravity)
           : p.law == ContactLaw::spring ? frictional<D, SpringOverlap>(p, gravity)
                                         : frictional<D, HarmonicOverlap>(p, gravity);
  if (kind == ModelKind::bubble) {
    if (!(p.a_s > 0)) throw InputError("the radius a_s of the depletant is {}, but it must be positive", p.a_s);
    return model<D>(BubbleContact<D>{{p.f0}}, Depletion<D>{{{p.phi_c, p.a_s}}, {p.f0}},
                    WallRepulsion<D>{{p.f0 * p.mean_radius}}, WallDepletion<D>{{p.phi_c, p.a_s}}, Gravity<D>{gravity});
  }
  if constexpr (D == 2) {
    const auto shape =
        fused<ShapeKernel>(Area{p.k_a, p.area_energy}, Perimeter{p.k_l}, Bending{p.k_b, p.bending_edges});
    const auto wall = fused<WallKernel>(WallContact<2>{p.epsilon_wall, p.wall_diameter});
    const LipContact lip{p.epsilon_wall, p.lip_edges, p.wall_diameter};
    const auto outer = fused<PointKernel>(Gravity<2>{gravity}, Drag<2>{p.zeta, p.drag});
    switch (kind) {
      case ModelKind::rough: {
        const auto pairs = fused<PairKernel>(PairContact<2>{p.epsilon, "contact"}, PairFriction<2>{p.mu, p.friction});
        // The edges are as stiff as two disks that touch: ε/4 over half the distance.
        const auto edges = fused<EdgeKernel>(EdgeContact{p.epsilon / 4, Edges::bare, p.rough_edges}, EdgeFriction{0});
        const SelfContact self{p.epsilon / 4, Edges::bare, p.self_contact};
        if (!(p.base.gravity > 0) && !(p.rest_shape.k > 0))
          return model<2>(shape, pairs, edges, self, wall, lip, outer);
        check("the base", p.base.mu, p.base.mu_dynamic);
        const VertexBaseFriction base{.gravity = p.base.gravity,
                                      .mu_static = p.base.mu,
                                      .mu_dynamic = p.base.mu_dynamic,
                                      .epsilon = p.base.stiffness * p.epsilon,
                                      .damping = p.base.damping};
        return model<2>(shape, p.rest_shape, pairs, edges, self, wall, lip, base, outer);
      }
      case ModelKind::smooth:
        return with_law(p.law, [&]<class Law>(Law) {
          return model<2>(shape,
                          fused<EdgeKernel>(EdgeContact<Law>{p.epsilon, Edges::wide, true, p.edge_force},
                                            EdgeFriction{p.mu, p.friction_point, p.friction}),
                          SelfContact<Law>{p.epsilon, Edges::wide, p.self_contact},
                          fused<WallKernel>(WallContact<2, Law>{p.epsilon_wall, p.wall_diameter}),
                          LipContact<Law>{p.epsilon_wall, p.lip_edges, p.wall_diameter}, outer);
        });
      default:
        return model<2>(shape, outer);
    }
  }
  throw InputError("model {} exists in 2D only; use -dim 2 or -model sp", to_string(kind));
}

template std::unique_ptr<ForceField<2>> make_force_field<2>(ModelKind, const ModelParameters&, const Vec<2>&);
template std::unique_ptr<ForceField<3>> make_force_field<3>(ModelKind, const ModelParameters&, const Vec<3>&);

}  // namespace pliant
