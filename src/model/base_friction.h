// Friction of disks with the table that they lie on.
#pragma once

#include <algorithm>
#include <array>
#include <span>

#include <pliant/base/multiversion.h>
#include <pliant/model/limit_surface.h>
#include <pliant/model/term.h>

namespace pliant {

/// A disk presses on the plane in which it moves with N = m g, evenly spread over its area, and sticks to it by a
/// spring at its place r₀ and angle θ₀: the force −k (r − r₀) and the torque −k R² (θ − θ₀), k = ε/σ². Where force and
/// torque are beyond what Coulomb friction can hold they are the nearest that it can, in the metric of the spring, and
/// r₀ and θ₀ follow: an implicit step of sliding, in the direction in which it takes the most energy. So a disk that
/// sticks does not creep, and one that slides resists as every piece of its area would, with μ p against its own
/// velocity: sliding and spinning are coupled, and a sliding disk spins almost freely (LimitSurface). Uncoupled, force
/// and torque have limits of their own, μN and 2/3 μNR. A disk that sticks begins to slide beyond the limit of
/// μ_static, and slides with that of μ_dynamic, uncoupled both, until its spring is shorter than that. While it sticks,
/// −2ζ √(k m) (v, R² ω) is added as far as the limit allows, so that it comes to rest. Kept: r₀, θ₀ and which way it
/// slides. The energy of the spring is k/2 (|r − r₀|² + R² (θ − θ₀)²). Elements: points.
struct BaseFriction {
  Real gravity = 0;  ///< g, normal to the plane
  Real mu_static = 0, mu_dynamic = 0;
  Real epsilon = 0;
  Real damping = 0.1;  ///< ζ
  bool coupled = true;
  bool all_alike = false;  ///< k = ε for all sizes
  const LimitSurface* surface = &limit_surface();

  static constexpr Elements elements = Elements::points;
  static constexpr bool rotates = true;
  static constexpr int history = 4;
  static constexpr std::array<std::string_view, 2> losses{"damping", "sliding"};
  static std::string_view name() { return "base_friction"; }
  bool enabled(const StateView<2>&) const { return !off(); }
  bool off() const { return !(mu_static > 0 && gravity > 0); }

  Real energy(const StateView<2>& s, Index i, std::span<const Real> past) const {
    if (past.empty()) return 0;
    const Hold c = look(s, i, past);
    return c.k / 2 * (c.spring.squaredNorm() + square(c.wound));
  }
  Real power(const StateView<2>& s, Index i, std::span<const Real> past) const {
    if (past.empty()) return 0;
    const Hold c = look(s, i, past);
    return damping_power(s, i, c) + (c.slides ? std::max(-work_of_spring(s, i, c), 0.0) : 0);
  }
  template <class F>
  void add_force(const StateView<2>& s, Index i, std::span<const Real> past, F& force) const {
    if (past.empty()) return;
    const Hold c = look(s, i, past);
    force.add(i, c.force);
    force.add_torque(i, c.radius * c.push);
  }
  bool advance(const StateView<2>& s, Index i, Real h, bool known, std::span<Real> numbers,
               std::span<Real> heat) const {
    const Vec<2> r = s.position(i);
    if (!known) {
      numbers[0] = r[0], numbers[1] = r[1], numbers[2] = s.angle(i), numbers[3] = sticks;
      return true;
    }
    const Hold c = look(s, i, numbers);
    heat[0] += h * damping_power(s, i, c);
    if (c.slides) {
      const Vec<2> before(numbers[0], numbers[1]), slid = r - before - c.spring;
      const Real turned = c.radius * (s.angle(i) - numbers[2]) - c.wound;
      heat[1] += c.k * (c.spring.dot(slid) + c.wound * turned);
      // Where it comes from the limit of μ_static, the spring has lost what it held beyond that of μ_dynamic.
      if (numbers[3] == sticks)
        heat[1] += c.k / 2 * square(mu_static / mu_dynamic - 1) * (c.spring.squaredNorm() + square(c.wound));
      numbers[0] = r[0] - c.spring[0];
      numbers[1] = r[1] - c.spring[1];
      numbers[2] = s.angle(i) - c.wound / c.radius;
    }
    numbers[3] = c.way;
    return true;
  }
  /// Of the rotation: ω² = k R²/I = 2k/m.
  Real max_rate(const Topology& topology) const { return off() ? 0 : std::sqrt(2 * stiffest(topology)); }
  Real max_damping(const Topology& topology) const { return off() ? 0 : 4 * damping * std::sqrt(stiffest(topology)); }

 private:
  Real stiffness(Real sigma) const { return all_alike ? epsilon : epsilon / square(sigma); }

  static constexpr Real sticks =
      -1;  ///< else the slip of the limit surface; uncoupled 1, 2 or 3: force, torque or both
  struct Hold {
    Real k, radius, gamma;
    Vec<2> spring;  ///< r − r₀
    Real wound;     ///< R (θ − θ₀)
    Vec<2> force;
    Real push;  ///< torque over R
    bool slides;
    Real way;  ///< to keep
  };

  PLIANT_INLINE Hold look(const StateView<2>& s, Index i, std::span<const Real> past) const {
    Hold c;
    const Real m = s.topology.mass(i), sigma = s.topology.diameter[i], weight = m * gravity;
    c.radius = sigma / 2;
    c.k = stiffness(sigma);
    c.gamma = 0;
    c.spring = s.position(i) - Vec<2>(past[0], past[1]);
    c.wound = c.radius * (s.angle(i) - past[2]);
    const bool slid = past[3] != sticks;
    Vec<2> held = c.k * c.spring;
    Real twist = c.k * c.wound;
    c.way = limit(held, twist, slid ? mu_dynamic * weight : mu_static * weight, mu_dynamic * weight, past[3]);
    c.slides = c.way != sticks;
    if (c.slides) {
      const Real per = 1 / c.k;
      c.spring = per * held;
      c.wound = per * twist;
    } else if (damping > 0) {
      c.gamma = 2 * damping * std::sqrt(c.k * m);
      held += c.gamma * s.velocity(i);
      twist += c.gamma * c.radius * s.spin(i);
      const Real most = mu_static * weight;
      limit(held, twist, most, most, sticks);
    }
    c.force = -held;
    c.push = -twist;
    return c;
  }

  /// Brings force and torque over R, where they are beyond `most`, to the limit of `then`. Returns what of it slides.
  PLIANT_INLINE Real limit(Vec<2>& force, Real& twist, Real most, Real then, Real guess) const {
    const Real per = 1 / most, f = force.norm() * per, w = std::abs(twist) * per;
    if (!coupled) {
      Real way = 0;
      if (f > 1) {
        force *= then * per / f;
        way += 1;
      }
      if (w > LimitSurface::most_torque) {
        twist = std::copysign(LimitSurface::most_torque * then, twist);
        way += 2;
      }
      return way > 0 ? way : sticks;
    }
    if (LimitSurface::surely_inside(f, w)) return sticks;
    if (guess == sticks) guess = w / (f + w);
    LimitSurface::Nearest held = surface->nearest(f, w, guess);
    if (!held.outside) return sticks;
    if (then != most) held = surface->nearest(f * most / then, w * most / then, held.slip);
    if (f > 0) force *= then * per * held.force / f;
    twist = std::copysign(then * held.torque, twist);
    return held.slip;
  }

  Real work_of_spring(const StateView<2>& s, Index i, const Hold& c) const {
    return -c.k * (c.spring.dot(s.velocity(i)) + c.wound * c.radius * s.spin(i));
  }
  Real damping_power(const StateView<2>& s, Index i, const Hold& c) const {
    if (c.slides) return 0;
    return -(c.force.dot(s.velocity(i)) + c.push * c.radius * s.spin(i)) + work_of_spring(s, i, c);
  }
  Real stiffest(const Topology& topology) const {
    return 1 /
           smallest_over_points(topology, [&](Index i) { return topology.mass(i) / stiffness(topology.diameter[i]); });
  }
};

}  // namespace pliant
