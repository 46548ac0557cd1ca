// Friction of disks with the substrate.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include <pliant/model/surface_friction.h>
#include <pliant/model/term.h>

namespace pliant {

class LimitSurface;

/// The parameters of friction with the substrate. T: BaseFriction or VertexBaseFriction; contacts: the stiffness of
/// contacts between particles, or its energy scale.
template <class T>
void read_base_friction(ParameterReader& p, T& term, Real contacts) {
  term.gravity = p.number({.name = "gravity",
                           .symbol = "g",
                           .unit = dimension::acceleration,
                           .help = "gravity, normal to the substrate; presses the particles on the substrate",
                           .role = Role::normal_gravity});
  const Coulomb mu = read_coulomb(p, {.name = "mu_base",
                                      .symbol = "\\mu_{base}",
                                      .help = "static friction with the substrate",
                                      .value = 0.5,
                                      .max = 10,
                                      .role = Role::base_friction});
  term.mu_static = mu.mu_static, term.mu_dynamic = mu.mu_dynamic;
  term.epsilon = contacts * p.number({.name = "base_stiffness",
                                      .symbol = "k_b/k_n",
                                      .help = "stiffness of springs to the substrate, divided by the normal stiffness",
                                      .value = 0.1,
                                      .max = 10,
                                      .min_open = true});
  term.damping = p.number({.name = "base_damping",
                           .symbol = "\\zeta_b",
                           .help = "damping of springs to the substrate, divided by critical damping",
                           .value = 0.1,
                           .max = 10});
}

/// A disk presses on the plane in which it moves with N = m g, evenly spread over its area, and sticks to it by a
/// spring at its place r₀ and angle θ₀: the force −k (r − r₀) and the torque −k R² (θ − θ₀), k = ε/σ². If force and
/// torque exceed the limit of Coulomb friction, they are projected to the nearest point within the limit, in the metric
/// of the spring, and r₀ and θ₀ follow. This is an implicit step of sliding, in the direction of largest dissipation.
/// Therefore a sticking disk does not creep, and a sliding disk has the resistance of its area elements, each with μ p
/// against its velocity: sliding and spinning are coupled, and a sliding disk spins almost freely (LimitSurface). If
/// not coupled, force and torque have separate limits, μN and 2/3 μNR. A sticking disk begins to slide at the limit of
/// μ_static, and slides at the limit of μ_dynamic until the spring force falls below it. If not coupled, this holds for
/// force and torque separately. While the disk sticks, −2ζ √(k m) (v, R² ω) is added as far as the limit allows, so
/// that the disk stops. Contact history: r₀, θ₀ and the direction of sliding. The energy of the spring is k/2
/// (|r − r₀|² + R² (θ − θ₀)²). Elements: points.
struct BaseFriction {
  Real gravity = 0;  ///< g, normal to the plane
  Real mu_static = 0, mu_dynamic = 0;
  Real epsilon = 0;
  Real damping = 0.1;  ///< ζ
  bool coupled = true;
  bool all_alike = false;  ///< k = ε for all sizes
  const LimitSurface* surface = the_surface();

  static constexpr Elements elements = Elements::points;
  static constexpr bool rotates = true;
  static constexpr int history = 4;
  static constexpr std::array<Loss, 2> losses{{{"damping", true}, {"sliding", false}}};
  static std::string_view name() { return "base_friction"; }
  void read(ParameterReader& p, Real contacts) {
    read_base_friction(p, *this, contacts);
    coupled = p.flag({.name = "base_coupled",
                      .help = "substrate friction couples sliding and spinning; no: each has its own limit",
                      .value = 1});
  }

  bool enabled(const StateView<2>&) const { return !off(); }
  bool off() const { return !(mu_static > 0 && gravity > 0); }

  /// Stored direction of sliding: `sticks`, else the slip of the limit surface. If not coupled, 1, 2 or 3: the force,
  /// the torque or both slide.
  static constexpr Real sticks = -1;

  struct Touch {
    std::array<Real, 4> next;             ///< next history
    std::array<Real, 2> held;             ///< force of the spring, within the limit
    Real twist;                           ///< and its torque over R
    Real lost;                            ///< energy turned into heat by sliding
    Real stiffness, gamma, most, radius;  ///< gamma: damping of sticking disks; most: μ_static N
    Index i;
  };

  /// add_forces() computes four elements at a time; find() gives the same numbers for a single element.
  bool find(const StateView<2>& s, Index i, std::span<const Real> past, Touch& c) const;
  Real energy(const StateView<2>&, const Touch& c) const {
    return (square(c.held[0]) + square(c.held[1]) + square(c.twist)) / (2 * c.stiffness);
  }
  Real power(const StateView<2>& s, const Touch& c) const {
    return c.next[3] != sticks ? std::max(held_power(s, c), 0.0) : damping_power(s, c);
  }
  template <class F>
  void add_force(const StateView<2>& s, const Touch& c, F& force) const {
    const std::array<Real, 3> pull = damped(s, c);
    force.add(c.i, Vec<2>(-pull[0], -pull[1]));
    force.add_torque(c.i, -c.radius * pull[2]);
  }
  void add_forces(const StateView<2>& s, Range range, const ContactTable& table, ContactWorkspace& workspace,
                  const Scatter<2, 1>& force) const;

  /// Frequency of the rotation: ω² = k R²/I = 2k/m.
  Real max_rate(const Topology& topology) const { return off() ? 0 : std::sqrt(2 * stiffest(topology)); }
  Real max_damping(const Topology& topology) const { return off() ? 0 : 4 * damping * std::sqrt(stiffest(topology)); }
  MotionRates crowded(const Topology& topology) const {
    if (off()) return {};
    const Real spring = stiffest(topology), dashpot = 2 * damping * std::sqrt(spring);
    return {{spring, dashpot}, {2 * spring, 2 * dashpot}};
  }

 private:
  static const LimitSurface* the_surface();
  Real stiffness(Real sigma) const { return all_alike ? epsilon : epsilon / square(sigma); }

  /// Force and torque over R with damping.
  std::array<Real, 3> damped(const StateView<2>& s, const Touch& c) const;
  static Real along(const StateView<2>& s, const Touch& c, Real x, Real y, Real twist) {
    return s.velocity(c.i).dot(Vec<2>(x, y)) + twist * c.radius * s.spin(c.i);
  }
  static Real held_power(const StateView<2>& s, const Touch& c) { return along(s, c, c.held[0], c.held[1], c.twist); }
  /// Power of the damping of sticking disks.
  Real damping_power(const StateView<2>& s, const Touch& c) const {
    const std::array<Real, 3> pull = damped(s, c);
    return along(s, c, pull[0] - c.held[0], pull[1] - c.held[1], pull[2] - c.twist);
  }
  Real stiffest(const Topology& topology) const {
    return 1 /
           smallest_over_points(topology, [&](Index i) { return topology.mass(i) / stiffness(topology.diameter[i]); });
  }
};

}  // namespace pliant
