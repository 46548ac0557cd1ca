// The part of a relative velocity that viscous friction opposes, for points and edges.
#pragma once

#include <pliant/geometry/distance.h>
#include <pliant/model/parameter.h>

namespace pliant {

enum class Friction {
  whole,      ///< all of it, as [H 6, 12] print
  tangential  ///< without its component along the normal of the contact
};

/// The parameters of viscous friction.
inline void read_friction(ParameterReader& p, Real& mu, Friction& friction) {
  mu = p.number({.name = "mu",
                 .symbol = "\\mu/\\mu_0",
                 .unit = dimension::drag,
                 .help = "coefficient mu of viscous friction: force / relative velocity",
                 .role = Role::kinetic_friction});
  friction = p.choice(
      {.name = "friction", .help = "friction force along the relative velocity [H 6, 12], or its tangential part"},
      named<Friction>({{"whole", Friction::whole}, {"tangential", Friction::tangential}}));
}

/// The part of u that friction opposes; r is along the normal. Where r = 0 there is no normal, and it opposes all of u.
template <int D>
Vec<D> rubbed_part(Friction friction, const Vec<D>& u, const Vec<D>& r) {
  const Real r2 = r.squaredNorm();
  return friction == Friction::tangential && r2 > 0 ? Vec<D>(u - u.dot(r) / r2 * r) : u;
}

/// Its derivative with respect to u: 1, or 1 − n nᵀ.
template <int D>
Mat<D> rubbed_projector(Friction friction, const Vec<D>& r) {
  const Real r2 = r.squaredNorm();
  Mat<D> p = Mat<D>::Identity();
  if (friction == Friction::tangential && r2 > 0) p -= r * r.transpose() / r2;
  return p;
}

/// Of the tangential part, with respect to the unit normal n.
template <int D>
Mat<D> rubbed_turn(const Vec<D>& u, const Vec<D>& n) {
  return -n.dot(u) * Mat<D>::Identity() - n * u.transpose();
}

}  // namespace pliant
