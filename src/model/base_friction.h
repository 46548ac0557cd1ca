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

  struct Touch {
    Index i;
    bool known, slides;
    Real k, radius, most;
    Real gamma;                        ///< of what sticks
    std::array<Real, 2> spring, held;  ///< r − r₀; its force, within the limit
    Real wound, twist;                 ///< R (θ − θ₀); its torque over R, within the limit
    Real way;                          ///< to keep
  };

  PLIANT_INLINE bool find(const StateView<2>& s, Index i, std::span<const Real> past, Touch& c) const {
    if (past.empty()) {
      c = Touch();
      c.i = i;
      return true;
    }
    c.i = i;
    c.known = true;
    const Real m = s.topology.mass(i), sigma = s.topology.diameter[i], weight = m * gravity;
    c.radius = sigma / 2;
    c.k = stiffness(sigma);
    c.most = mu_static * weight;
    Vec<2> spring = s.position(i) - Vec<2>(past[0], past[1]), held = c.k * spring;
    c.wound = c.radius * (s.angle(i) - past[2]);
    c.twist = c.k * c.wound;
    const Real dynamic = mu_dynamic * weight;
    c.way = limit(held, c.twist, past[3] != sticks ? dynamic : c.most, dynamic, past[3]);
    c.slides = c.way != sticks;
    c.gamma = 0;
    if (c.slides) {
      const Real per = 1 / c.k;
      spring = per * held;
      c.wound = per * c.twist;
    } else if (damping > 0) {
      c.gamma = 2 * damping * std::sqrt(c.k * m);
    }
    c.spring = {spring[0], spring[1]};
    c.held = {held[0], held[1]};
    return true;
  }
  Real energy(const StateView<2>&, const Touch& c) const {
    return c.known ? c.k / 2 * (vector(c.spring).squaredNorm() + square(c.wound)) : 0;
  }
  Real power(const StateView<2>& s, const Touch& c) const {
    if (!c.known) return 0;
    return c.slides ? std::max(-work_of_spring(s, c), 0.0) : damping_power(s, c);
  }
  template <class F>
  PLIANT_INLINE void add_force(const StateView<2>& s, const Touch& c, F& force) const {
    if (!c.known) return;
    const Grip grip = grip_of(s, c);
    force.add(c.i, grip.force);
    force.add_torque(c.i, c.radius * grip.push);
  }
  PLIANT_INLINE void advance(const StateView<2>& s, const Touch& c, Real h, bool known, std::span<Real> numbers,
                             std::span<Real> heat) const {
    const Vec<2> r = s.position(c.i);
    if (!known) {
      numbers[0] = r[0], numbers[1] = r[1], numbers[2] = s.angle(c.i), numbers[3] = sticks;
      return;
    }
    if (!c.slides) {
      heat[0] += h * damping_power(s, c);
    } else {
      const Vec<2> before(numbers[0], numbers[1]), spring = vector(c.spring), slid = r - before - spring;
      const Real turned = c.radius * (s.angle(c.i) - numbers[2]) - c.wound;
      heat[1] += c.k * (spring.dot(slid) + c.wound * turned);
      // Where it comes from the limit of μ_static, the spring has lost what it held beyond that of μ_dynamic.
      if (numbers[3] == sticks)
        heat[1] += c.k / 2 * square(mu_static / mu_dynamic - 1) * (spring.squaredNorm() + square(c.wound));
      numbers[0] = r[0] - spring[0];
      numbers[1] = r[1] - spring[1];
      numbers[2] = s.angle(c.i) - c.wound / c.radius;
    }
    numbers[3] = c.way;
  }
  /// Of the rotation: ω² = k R²/I = 2k/m.
  Real max_rate(const Topology& topology) const { return off() ? 0 : std::sqrt(2 * stiffest(topology)); }
  Real max_damping(const Topology& topology) const { return off() ? 0 : 4 * damping * std::sqrt(stiffest(topology)); }

 private:
  Real stiffness(Real sigma) const { return all_alike ? epsilon : epsilon / square(sigma); }

  static constexpr Real sticks =
      -1;  ///< else the slip of the limit surface; uncoupled 1, 2 or 3: force, torque or both
  static Vec<2> vector(const std::array<Real, 2>& a) { return {a[0], a[1]}; }

  struct Grip {
    Vec<2> force;
    Real push;  ///< torque over R
  };
  PLIANT_INLINE Grip grip_of(const StateView<2>& s, const Touch& c) const {
    Vec<2> held = vector(c.held);
    Real twist = c.twist;
    if (!c.slides && damping > 0) {
      held += c.gamma * s.velocity(c.i);
      twist += c.gamma * c.radius * s.spin(c.i);
      limit(held, twist, c.most, c.most, sticks);
    }
    return {-held, -twist};
  }

  /// Brings force and torque over R, where they are beyond `most`, to the limit of `then`. Returns what of it slides.
  PLIANT_INLINE Real limit(Vec<2>& force, Real& twist, Real most, Real then, Real guess) const {
    if (coupled && LimitSurface::surely_inside(force.squaredNorm(), std::abs(twist), most)) return sticks;
    return limit_by_surface(force, twist, most, then, guess);
  }
  [[gnu::noinline]] Real limit_by_surface(Vec<2>& force, Real& twist, Real most, Real then, Real guess) const {
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
    if (guess == sticks) guess = w / (f + w);
    LimitSurface::Nearest held = surface->nearest(f, w, guess);
    if (!held.outside) return sticks;
    if (then != most) held = surface->nearest(f * most / then, w * most / then, held.slip);
    if (f > 0) force *= then * per * held.force / f;
    twist = std::copysign(then * held.torque, twist);
    return held.slip;
  }

  PLIANT_INLINE Real work_of_spring(const StateView<2>& s, const Touch& c) const {
    return -c.k * (vector(c.spring).dot(s.velocity(c.i)) + c.wound * c.radius * s.spin(c.i));
  }
  /// Of what sticks.
  PLIANT_INLINE Real damping_power(const StateView<2>& s, const Touch& c) const {
    const Grip grip = grip_of(s, c);
    return -(grip.force.dot(s.velocity(c.i)) + grip.push * c.radius * s.spin(c.i)) + work_of_spring(s, c);
  }
  Real stiffest(const Topology& topology) const {
    return 1 /
           smallest_over_points(topology, [&](Index i) { return topology.mass(i) / stiffness(topology.diameter[i]); });
  }
};

}  // namespace pliant
