#include <pliant/model/surface_friction.h>

#include <algorithm>
#include <cmath>

namespace pliant {
namespace {

/// The largest stiffness(i)/m of a point i.
template <class Stiffness>
Real stiffest(const Topology& topology, Stiffness&& stiffness) {
  return 1 / smallest_over_points(topology, [&](Index i) { return topology.mass(i) / stiffness(i); });
}

/// √(V''/(partners m)) of the stiffest point.
Real contact_frequency(ContactLaw law, const Topology& topology, Real epsilon, Real reach, Real partners) {
  return std::sqrt(stiffest(topology,
                            [&](Index i) {
                              return Overlap::stiffness(law) * epsilon /
                                     Overlap::scale(law, reach * topology.diameter[i]);
                            }) /
                   partners);
}

}  // namespace

Coulomb read_dynamic_friction(ParameterReader& p, std::string_view name, Real mu_static, Real usual) {
  const std::string own = fmt::format("{}_dynamic", name),
                    help = fmt::format("dynamic friction coefficient that belongs to {}", name);
  const Coulomb mu{
      mu_static,
      p.automatic(
          {.name = own, .help = help, .max = 10, .automatic = "the static coefficient", .role = Role::dynamic_friction},
          usual)};
  if (mu.mu_dynamic > mu.mu_static)
    throw InputError("{} {:g} is more than {} {:g}; lower it", p.spelled(own), mu.mu_dynamic, p.spelled(name),
                     mu.mu_static);
  if (mu.mu_dynamic == 0 && mu.mu_static > 0)
    throw InputError(
        "{0} 0 with {1} {2:g}: dynamic friction must be positive if static friction is; raise {0}, or give {1} 0",
        p.spelled(own), p.spelled(name), mu.mu_static);
  return mu;
}

Coulomb read_coulomb(ParameterReader& p, const Parameter& mu) {
  const Real mu_static = p.number(mu);
  return read_dynamic_friction(p, mu.name, mu_static, std::min(mu_static, p.usual_dynamic_friction));
}

Coulomb read_pair_friction(ParameterReader& p) {
  return read_coulomb(p, {.name = "mu_disk",
                          .symbol = "\\mu_{disk}",
                          .help = "static friction coefficient of frictional disks and spheres with each other",
                          .value = 0.4,
                          .max = 10,
                          .role = Role::friction});
}

Coulomb read_wall_friction(ParameterReader& p) {
  return read_coulomb(p, {.name = "mu_wall",
                          .symbol = "\\mu_{wall}",
                          .help = "static friction coefficient of frictional disks and spheres with walls",
                          .value = 0.4,
                          .max = 10,
                          .role = Role::friction});
}

Real spring_rate(ContactLaw law, const SurfaceFriction& f, const Topology& topology, Real epsilon, Real reach,
                 Real share) {
  return std::sqrt((f.rubs() ? share * f.stiffness : 0) * stiffest(topology, [&](Index i) {
                     return reference_stiffness(Overlap{law, epsilon, reach * topology.diameter[i]});
                   }));
}

Real dashpot_rate(ContactLaw law, const SurfaceFriction& f, const Topology& topology, Real epsilon, Real reach,
                  Real share, Real partners) {
  return share * std::max(1.0, 2 * f.tangential_damping) * f.damping *
         contact_frequency(law, topology, epsilon, reach, partners);
}

MotionRates surface_rates(ContactLaw law, const SurfaceFriction& f, const Topology& topology, Real epsilon, Real reach,
                          const SurfaceContacts& contacts) {
  const Real normal = 2 * f.damping * contact_frequency(law, topology, epsilon, reach, contacts.bodies),
             across = f.rubs() ? f.tangential_damping * normal : 0,
             spring = square(spring_rate(law, f, topology, epsilon, reach, 1));
  return {{contacts.across * spring, contacts.normal * normal + contacts.across * across},
          {contacts.rotation * spring, contacts.rotation * across}};
}

Real restitution(ContactLaw law, Real zeta) {
  if (law != ContactLaw::hertz) {
    const Real root = std::sqrt(std::abs(1 - square(zeta)));
    if (root < 1e-8) return std::exp(-2 * zeta);
    return std::exp(-2 * zeta * (zeta < 1 ? std::acos(zeta) : std::acosh(zeta)) / root);
  }
  // ẍ = −x^(3/2) − 2ζ √(3/2) x^(1/4) ẋ from x = 0, ẋ = 1; as an equation for ẋ(x) it would be singular at the turn.
  Real x = 0, v = 1;
  const auto force = [&](Real at, Real speed) {
    const Real depth = std::max(at, 0.0), root = std::sqrt(depth);
    return -depth * root - 2 * zeta * std::sqrt(1.5 * root) * speed;
  };
  const Real h = 1e-3 / std::max(1.0, zeta);
  for (Real a = force(x, v); v > 0 || a < 0;) {  // the midpoint rule
    const Real middle_x = x + h / 2 * v, middle_v = v + h / 2 * a;
    v += h * force(middle_x, middle_v);
    x += h * middle_v;
    a = force(x, v);
    if (x <= 0) break;
  }
  return -v;
}

Real damping_for(ContactLaw law, Real e) {
  if (!(e > 0 && e <= 1)) throw InputError("the coefficient of restitution is {}, but it must be in (0, 1]", e);
  if (e == 1) return 0;
  Real low = 0, high = 1;
  while (restitution(law, high) > e) high *= 2;
  for (int k = 0; k < 60; ++k) {
    const Real middle = (low + high) / 2;
    (restitution(law, middle) > e ? low : high) = middle;
  }
  return (low + high) / 2;
}

SurfaceFriction read_surface(ParameterReader& p, ContactLaw law, const Coulomb& mu) {
  const Real e = p.number({.name = "restitution",
                           .symbol = "e",
                           .help = "coefficient of restitution of head-on collisions with particles and walls",
                           .value = 0.5,
                           .max = 1,
                           .min_open = true,
                           .role = Role::restitution});
  SurfaceFriction surface{.mu_static = mu.mu_static, .mu_dynamic = mu.mu_dynamic, .damping = damping_for(law, e)};
  surface.stiffness = p.number({.name = "tangential_stiffness",
                                .symbol = "k_t/k_n",
                                .help = "stiffness of tangential springs, divided by the normal stiffness",
                                .value = surface.stiffness,
                                .max = 10,
                                .min_open = true});
  surface.tangential_damping = p.number({.name = "tangential_damping",
                                         .symbol = "\\gamma_t/\\gamma_n",
                                         .help = "tangential damping divided by normal damping",
                                         .value = surface.tangential_damping,
                                         .max = 10});
  return surface;
}

OtherMaterials read_materials(ParameterReader& p, const Coulomb& first) {
  std::vector<Coulomb> all;
  for (const std::string& material : p.materials) {
    const std::string name = fmt::format("mu_{}", material),
                      help = fmt::format("static friction coefficient of disks with the {}", material);
    const Real mu_static = p.automatic(
        {.name = name, .help = help, .max = 10, .automatic = "the coefficient of other walls", .role = Role::friction},
        first.mu_static);
    const Real usual = p.is_set(name) ? std::min(mu_static, p.usual_dynamic_friction) : first.mu_dynamic;
    all.push_back(read_dynamic_friction(p, name, mu_static, usual));
  }
  return OtherMaterials(std::move(all));
}

}  // namespace pliant
