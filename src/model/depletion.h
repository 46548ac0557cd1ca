// Depletion attraction of droplets after Asakura and Oosawa [T 2.4–2.6].
#pragma once

#include <pliant/model/bubble_contact.h>

namespace pliant {

/// U = −φ_c/(8 a_s³) V, V the lens that spheres of radii R_i + a_s and R_j + a_s share: r < R_i + R_j + 2 a_s. The
/// force attracts; [T 2.5, 2.6] print it as φ_c/(8 a_s³) ∂V/∂r along r̂, and ∂V/∂r is negative. C¹ at the end of the
/// range. Spheres in the plane too: a monolayer. φ_c is an energy.
struct DepletionLaw {
  Real phi_c;
  Real a_s;  ///< radius of the depletant

  void read(ParameterReader& p) {
    phi_c = p.number({.name = "phi_c",
                      .symbol = "\\phi_c",
                      .unit = dimension::energy,
                      .help = "depletion energy phi_c",
                      .value = 1e-4,
                      .max = 1,
                      .role = Role::attraction});
    a_s = p.number({.name = "a_s",
                    .symbol = "a_s",
                    .unit = dimension::length,
                    .help = "radius a_s of the depletant",
                    .value = 0.05,
                    .max = 1,
                    .min_open = true,
                    .role = Role::depletant});
    if (!(a_s > 0)) throw InputError("{} is {}, but it must be positive", p.spelled("a_s"), a_s);
  }

  static constexpr std::string_view name = "depletion";
  Real range() const { return 2 * a_s; }
  Real strength() const { return phi_c / (8 * a_s * square(a_s)); }
  Radial at(Real r, Real a, Real b) const {
    const Radial lens = lens_volume(r, a + a_s, b + a_s);
    return {-strength() * lens.value, -strength() * lens.slope, -strength() * lens.curvature};
  }
  /// The attraction softens the contact along the line of centres, and its transverse stiffness is small compared with
  /// the contact.
  static Real max_rate(const Topology&) { return 0; }
};

/// Its contacts are the bonds between droplets, with the force of depletion and contact together: a negative component
/// along the normal is a tension. The overlap of a bond may be negative.
template <int D>
struct Depletion : DropletPairs<D, DepletionLaw> {
  BubbleContactLaw repulsion;

  void read(ParameterReader& p) {
    this->law.read(p);
    repulsion.read(p);
  }

  bool contact(const StateView<D>& s, Index e, Contact<D>& c) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    const Real a = s.topology.diameter[i] / 2, b = s.topology.diameter[j] / 2;
    Real r;
    const Real slope = this->at(s, e, r, c.normal).slope;
    if (r >= a + b + this->law.range()) return false;
    c.first = s.topology.particle[i];
    c.second = s.topology.particle[j];
    c.position = s.position(j) + b / (a + b) * r * c.normal;
    c.overlap = 1 - r / (a + b);
    c.reach = a + b;
    c.force = -(slope + repulsion.at(r, a, b).slope) * c.normal;
    return true;
  }
};

}  // namespace pliant
