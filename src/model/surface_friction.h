// Friction and damping between surfaces that touch at one place, for pairs of disks and disks at walls.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/base/lanes.h>
#include <pliant/base/vector3.h>
#include <pliant/kernels/contact_law.h>
#include <pliant/model/parameter.h>
#include <pliant/model/term.h>

namespace pliant {

/// Coulomb friction with a tangential spring [P. A. Cundall, O. D. L. Strack, Géotechnique 29, 47 (1979)] and linear
/// damping. The stiffness k_n of a contact is V'' of its law at an overlap of one per cent: ε/δ² with the harmonic law.
struct SurfaceFriction {
  Real mu_static = 0, mu_dynamic = 0;  ///< μ_d ≤ μ_s
  Real stiffness = 2.0 / 7;            ///< k_t/k_n [L. E. Silbert et al., Phys. Rev. E 64, 051302 (2001)]
  Real damping = 0;                    ///< ζ: γ_n = 2 ζ √(m V''), m the reduced mass
  Real tangential_damping = 0.5;       ///< γ_t/γ_n

  bool rubs() const { return mu_static > 0; }

  /// The tangential spring, its force, and whether the surfaces slide; across the normal these are
  /// numbers in the plane (or vectors of several of them), vectors in space.
  template <class Tangent, class Mask = bool>
  struct Hold {
    Tangent spring, pull;
    Mask slides;
  };
  /// k, gamma: coefficients of spring and dashpot. A sticking contact begins to slide when the force of the spring
  /// exceeds static_limit, and slides at dynamic_limit until the force of the spring falls below it. The dashpot may
  /// use the rest of the limit.
  template <class R>
  PLIANT_INLINE static Hold<R, MaskOf<R>> hold(R k, R gamma, R spring, R rate, R static_limit, R dynamic_limit,
                                               MaskOf<R> was_sliding) {
    const R limit = was_sliding ? dynamic_limit : static_limit;
    const MaskOf<R> slides = k * magnitude(spring) > limit;
    if constexpr (std::is_arithmetic_v<R>) {
      if (slides) spring = std::copysign(dynamic_limit / k, spring);
    } else {
      const R longest = dynamic_limit / k;
      spring = slides ? times_sign_of(spring, longest) : spring;
    }
    const R most = slides ? dynamic_limit : limit, pull = k * spring + gamma * rate;
    return {spring, pull < -most ? -most : (most < pull ? most : pull), slides};
  }
  /// As above, for vectors across the normal, which are cut to the limit by their lengths. Roots and quotients are
  /// computed independently: kernels wait for this chain.
  template <class R>
  PLIANT_INLINE static Hold<Vector3<R>, MaskOf<R>> hold(R k, R gamma, Vector3<R> spring, const Vector3<R>& rate,
                                                        R static_limit, R dynamic_limit, MaskOf<R> was_sliding) {
    const R limit = was_sliding ? dynamic_limit : static_limit, length2 = dot(spring, spring);
    const MaskOf<R> slides = k * k * length2 > limit * limit;
    spring = select<R>(slides, R(square_root(length2) * (dynamic_limit / (k * length2))) * spring, spring);
    const R most = slides ? dynamic_limit : limit;
    const Vector3<R> pull = k * spring + gamma * rate;
    const R size2 = dot(pull, pull);
    return {spring, select<R>(size2 > most * most, R(square_root(size2) * (most / size2)) * pull, pull), slides};
  }
};

/// A pair of coefficients of friction, μ_d ≤ μ_s.
struct Coulomb {
  Real mu_static, mu_dynamic;
};

/// The coefficient of dynamic friction that belongs to the static coefficient `name`; default `usual`. Errors:
/// InputError if it exceeds mu_static, or is 0 while mu_static is not.
Coulomb read_dynamic_friction(ParameterReader& p, std::string_view name, Real mu_static, Real usual);
/// Static and dynamic friction; `mu` declares the static coefficient. Errors: as above.
Coulomb read_coulomb(ParameterReader& p, const Parameter& mu);
Coulomb read_pair_friction(ParameterReader& p);
Coulomb read_wall_friction(ParameterReader& p);

/// The coefficients of walls of the materials 1, 2, … (Walls::material); all other parameters are equal to material 0.
class OtherMaterials {
 public:
  OtherMaterials() = default;
  explicit OtherMaterials(std::vector<Coulomb> mu) : mu_(std::move(mu)) {}

  /// The coefficients of a material; material 0 has the coefficients of `first`.
  PLIANT_INLINE Coulomb of(Index material, const SurfaceFriction& first) const {
    return material > 0 ? mu_[static_cast<std::size_t>(material - 1)] : Coulomb{first.mu_static, first.mu_dynamic};
  }
  /// The friction of the material with the largest μ_s.
  SurfaceFriction roughest(const SurfaceFriction& first) const {
    SurfaceFriction most = first;
    for (const Coulomb& mu : mu_)
      if (mu.mu_static > most.mu_static) most.mu_static = mu.mu_static, most.mu_dynamic = mu.mu_dynamic;
    return most;
  }
  /// Errors: InputError for walls of a material that has no coefficients.
  template <int D>
  void check(std::string_view term, const Walls<D>& walls) const {
    for (Index body = 0; body < walls.bodies(); ++body)
      if (const Index material = walls.material(body); material < 0 || material > static_cast<Index>(mu_.size()))
        throw InputError(
            "{}: body {} of the walls is of the material {}, for which there are no coefficients of friction", term,
            body, material);
  }

 private:
  std::vector<Coulomb> mu_;
};

/// V'' of a law at an overlap of one per cent.
template <class Law>
Real reference_stiffness(const Law& law) {
  return law.curvature(0.99 * law.delta);
}

/// A contact at the distance d < δ, or several: −V', V'' and the reference stiffness.
template <class R>
struct Press {
  R force, stiffness, reference;
};
/// visit(law) for one of the laws of surfaces with friction.
template <class Visit>
decltype(auto) with_surface_law(ContactLaw law, Visit&& visit) {
  return with_law<HertzOverlap, SpringOverlap, HarmonicOverlap>(law, visit);
}
/// Whether V'' is the same at all distances.
constexpr bool constant_stiffness(ContactLaw law) { return law == ContactLaw::harmonic || law == ContactLaw::spring; }
/// Of one of these laws: vectors need one that is known at compile time.
template <class R>
PLIANT_INLINE Press<R> press_of(ContactLaw law, Real epsilon, R delta, R d) {
  if (constant_stiffness(law)) {  // with one division
    const R k = law == ContactLaw::harmonic ? R(epsilon / (delta * delta)) : R(epsilon + R());
    return {k * (delta - d), k, k};
  }
  if constexpr (std::is_arithmetic_v<R>) {
    const HertzOverlap hertz{epsilon, delta};
    return {-hertz.slope(d), hertz.curvature(d), reference_stiffness(hertz)};
  } else {
    Press<R> all;
    for (std::size_t k = 0; k < sizeof(R) / sizeof(Real); ++k) {
      const Press<Real> one = press_of<Real>(law, epsilon, delta[k], d[k]);
      all.force[k] = one.force, all.stiffness[k] = one.stiffness, all.reference[k] = one.reference;
    }
    return all;
  }
}

/// The rate ω of the stiffest tangential spring, ω² = share k_t/m. reach: distance at touch over the diameter, 1 with a
/// like point, 1/2 at a wall.
Real spring_rate(ContactLaw law, const SurfaceFriction& f, const Topology& topology, Real epsilon, Real reach,
                 Real share);

/// The rate share ζ √(V''/(partners m)) of the dashpots of a point, with V'' and m of the stiffest contact. `share` is
/// for γ_t/γ_n up to 1/2; beyond, the tangential dashpot is faster.
Real dashpot_rate(ContactLaw law, const SurfaceFriction& f, const Topology& topology, Real epsilon, Real reach,
                  Real share, Real partners);

/// How many times the stiffness of one spring over the mass of a point, and so with dashpots, all contacts around it
/// have: for its motion along the normals and across them, and for its rotation.
struct SurfaceContacts {
  Real normal, across, rotation;
  Real bodies;  ///< that a contact moves: 2, or 1 at a wall
};

/// Rates of springs across the normals and of dashpots, without the elastic stiffness. reach: as above.
MotionRates surface_rates(ContactLaw law, const SurfaceFriction& f, const Topology& topology, Real epsilon, Real reach,
                          const SurfaceContacts& contacts);

/// Forces between two touching surfaces, and the heat of them. This part follows from positions. Also of
/// several contacts at a time, where R is a vector of numbers.
template <int D, class R = Real>
struct SurfaceTouch {
  static constexpr std::array<Loss, 3> losses{
      {{"normal_damping", true}, {"tangential_damping", true}, {"sliding", false}}};
  using Tangent = std::conditional_t<D == 2, R, Vector3<R>>;

  R elastic;   ///< N_e
  R k, gamma;  ///< k_t, γ_n
  R lever;     ///< the limit of P is μN over it; in space `per_lever` is its inverse, which is set as well
  R per_lever;
  Tangent stretched;  ///< ξ if it did not slide
  MaskOf<R> slid;     ///< in the last step

  /// And from how fast they move.
  struct Rub {
    R normal, parting;  ///< N, u_n
    Tangent rate;       ///< q̇
    SurfaceFriction::Hold<Tangent, MaskOf<R>> hold;
  };

  /// Finds k_t and γ_n. press_times_mass: V'' times the reduced mass.
  PLIANT_INLINE void stiffen(const SurfaceFriction& f, R press_times_mass, R reference) {
    gamma = 2 * f.damping * square_root(press_times_mass);
    k = f.stiffness * reference;
  }
  PLIANT_INLINE Rub rub(const SurfaceFriction& f, R parting, const Tangent& rate) const {
    return rub(f.tangential_damping, f.mu_static, f.mu_dynamic, parting, rate);
  }
  /// For contacts with separate coefficients: numbers, or vectors of them.
  template <class Mu>
  PLIANT_INLINE Rub rub(Real tangential_damping, Mu mu_static, Mu mu_dynamic, R parting, const Tangent& rate) const {
    const R pressed = elastic - gamma * parting, normal = pressed < 0 ? R() : pressed,
            limit = D == 2 ? R(normal / lever) : R(normal * per_lever);
    return {normal, parting, rate,
            SurfaceFriction::hold(k, R(tangential_damping * gamma), stretched, rate, R(mu_static * limit),
                                  R(mu_dynamic * limit), slid)};
  }

  /// Energy of the spring.
  Real energy(const Rub& c) const { return k / 2 * product(c.hold.spring, c.hold.spring); }
  PLIANT_INLINE R normal_power(const Rub& c) const { return (elastic - c.normal) * c.parting; }
  PLIANT_INLINE R tangential_power(const Rub& c) const { return product(c.hold.pull - k * c.hold.spring, c.rate); }
  /// Energy lost by sliding in a step that began with the spring `before`.
  PLIANT_INLINE R slid_heat(const Rub& c, const Tangent& before) const {
    return product(R(k / 2) * (before + c.hold.spring), stretched - c.hold.spring);
  }
  Real power(const Rub& c) const {
    const Real sliding = c.hold.slides ? std::max(product(k * c.hold.spring, c.rate), 0.0) : 0;
    return normal_power(c) + tangential_power(c) + sliding;
  }
  /// Counts all three; the spring was `before` at the begin of the step if the contact is not new.
  PLIANT_INLINE void count_losses(const Rub& c, bool known, const Tangent& before, Real* lost) const {
    lost[0] += normal_power(c);
    lost[1] += tangential_power(c);
    if (known) lost[2] += slid_heat(c, before);
  }

 private:
  PLIANT_INLINE static R product(const Tangent& a, const Tangent& b) {
    if constexpr (D == 2)
      return a * b;
    else
      return dot(a, b);
  }
};

/// The coefficient of restitution of two bodies that collide with the damping ζ, with a force that never attracts: they
/// part where it vanishes. With the harmonic law e = exp(−2ζ arccos(ζ)/√(1−ζ²)) [T. Schwager, T. Pöschel, Granular
/// Matter 9, 465 (2007)]; with Hertz' law, whose damping follows the stiffness, the equation of motion is solved.
Real restitution(ContactLaw law, Real zeta);

/// The damping ζ that gives a coefficient of restitution. Errors: InputError for a coefficient outside (0, 1].
Real damping_for(ContactLaw law, Real e);

/// The parameters of SurfaceFriction, except the coefficients of friction, which are given.
SurfaceFriction read_surface(ParameterReader& p, ContactLaw law, const Coulomb& mu);

/// The friction of walls of the reader's materials; default: the friction of other walls, `first`.
OtherMaterials read_materials(ParameterReader& p, const Coulomb& first);

}  // namespace pliant
