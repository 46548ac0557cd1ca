// Friction of polygons with the table that they lie on.
#pragma once

#include <array>
#include <cmath>
#include <span>

#include <pliant/model/base_friction.h>
#include <pliant/model/term.h>

namespace pliant {

/// BaseFriction of points without spin: every vertex presses on the plane in which it moves with N = m g, m its share
/// of the mass, and sticks to it by a spring at its place r₀, with the force −k (r − r₀), k = ε/δ². Beyond Coulomb's
/// limit the force is reduced to the limit, and r₀ follows: an implicit step of sliding. Therefore a sticking vertex
/// does not creep, and the force on a sliding vertex is μN against its displacement; the torque on a polygon follows
/// from the forces on its vertices. A sticking vertex begins to slide at μ_static N, and slides at μ_dynamic N until
/// the spring force falls below it. While the vertex sticks, −2ζ √(k m) v is added as far as the limit allows. Contact
/// history: r₀ and whether the vertex slides. The energy of the spring is k/2 |r − r₀|². Elements: points.
struct VertexBaseFriction {
  Real gravity = 0;  ///< g, normal to the plane
  Real mu_static = 0, mu_dynamic = 0;
  Real epsilon = 0;
  Real damping = 0.1;  ///< ζ

  static constexpr Elements elements = Elements::points;
  static constexpr int history = 3;
  static constexpr std::array<Loss, 2> losses{{{"damping", true}, {"sliding", false}}};
  static std::string_view name() { return "base_friction"; }
  void read(ParameterReader& p, Real contacts) { read_base_friction(p, *this, contacts); }

  bool enabled(const StateView<2>&) const { return !off(); }
  bool off() const { return !(mu_static > 0 && gravity > 0); }

  struct Touch {
    Index i;
    bool known, slides;
    Real k, most;
    Real gamma;                  ///< damping of a sticking vertex
    std::array<Real, 2> spring;  ///< r − r₀, within the limit
  };

  bool find(const StateView<2>& s, Index i, std::span<const Real> past, Touch& c) const {
    c = {};
    c.i = i;
    if (past.empty()) return true;
    c.known = true;
    const Real m = s.topology.mass(i), weight = m * gravity;
    c.k = epsilon / square(s.topology.diameter[i]);
    c.most = mu_static * weight;
    Vec<2> spring = s.position(i) - Vec<2>(past[0], past[1]);
    const Real held = c.k * spring.norm();
    c.slides = held > (past[2] != 0 ? mu_dynamic * weight : c.most);
    if (c.slides)
      spring *= mu_dynamic * weight / held;
    else
      c.gamma = 2 * damping * std::sqrt(c.k * m);
    c.spring = {spring[0], spring[1]};
    return true;
  }
  Real energy(const StateView<2>&, const Touch& c) const { return c.k / 2 * spring_of(c).squaredNorm(); }
  Real power(const StateView<2>& s, const Touch& c) const {
    return c.slides ? std::max(c.k * spring_of(c).dot(s.velocity(c.i)), 0.0) : damping_power(s, c);
  }
  template <class F>
  void add_force(const StateView<2>& s, const Touch& c, F& force) const {
    if (c.known) force.add(c.i, Vec<2>(-pull(s, c)));
  }
  void keep(const StateView<2>& s, const Touch& c, std::span<const Real> past, Real* numbers, Real* lost) const {
    if (c.known && !c.slides) {
      lost[0] += damping_power(s, c);
      numbers[0] = past[0], numbers[1] = past[1], numbers[2] = 0;
      return;
    }
    const Vec<2> spring = spring_of(c), place = s.position(c.i) - spring;
    if (c.known) {
      lost[1] += c.k * spring.dot(place - Vec<2>(past[0], past[1]));
      // Where it comes from the limit of μ_static, the spring has lost its energy above the limit of μ_dynamic.
      if (past[2] == 0) lost[1] += c.k / 2 * square(mu_static / mu_dynamic - 1) * spring.squaredNorm();
    }
    numbers[0] = place[0], numbers[1] = place[1];
    numbers[2] = c.slides ? 1 : 0;
  }
  Real max_rate(const Topology& topology) const { return off() ? 0 : std::sqrt(stiffest(topology)); }
  Real max_damping(const Topology& topology) const { return off() ? 0 : 2 * damping * std::sqrt(stiffest(topology)); }

 private:
  static Vec<2> spring_of(const Touch& c) { return {c.spring[0], c.spring[1]}; }
  /// The opposite of the force.
  static Vec<2> pull(const StateView<2>& s, const Touch& c) {
    Vec<2> held = c.k * spring_of(c);
    if (c.gamma > 0) {
      held += c.gamma * s.velocity(c.i);
      if (const Real size = held.norm(); size > c.most) held *= c.most / size;
    }
    return held;
  }
  static Real damping_power(const StateView<2>& s, const Touch& c) {
    return (pull(s, c) - c.k * spring_of(c)).dot(s.velocity(c.i));
  }
  Real stiffest(const Topology& topology) const {
    return epsilon /
           smallest_over_points(topology, [&](Index i) { return topology.mass(i) * square(topology.diameter[i]); });
  }
};

}  // namespace pliant
