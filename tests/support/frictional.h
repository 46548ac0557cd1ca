// Disks with the terms of the model disk.
#pragma once

#include <pliant/model/base_friction.h>
#include <pliant/model/disk_contact.h>
#include <pliant/model/disk_wall_contact.h>

#include "disks.h"

namespace pliant::test {

/// Constant acceleration, as of a slope.
struct Slope {
  pliant::Vec<2> g;
  static constexpr Elements elements = Elements::points;
  static std::string_view name() { return "slope"; }
  bool enabled(const StateView<2>&) const { return true; }
  Real energy(const StateView<2>& s, Index i) const { return -s.topology.mass(i) * g.dot(s.position(i)); }
  template <class G>
  void add_gradient(const StateView<2>& s, Index i, G& grad) const {
    grad.add(i, pliant::Vec<2>(-s.topology.mass(i) * g));
  }
  void add_hessian(const StateView<2>&, Index, BlockSink<2>&) const {}
  Real max_rate(const Topology&) const { return 0; }
};

inline auto disk_pairs(Real epsilon, const SurfaceFriction& surface, ContactLaw law = ContactLaw::harmonic) {
  return Fused<DiskKernel, PairContact<2>, DiskContact>(PairContact<2>{epsilon, "pair", law},
                                                        DiskContact{epsilon, surface, law});
}

/// Contacts at the start have a history.
inline void touch(Simulation<2>& s) {
  s.particles().accepted(s.state().t, s.state().x().data(), s.state().v().data(), 0);
}

inline Real sum_of_heat(const Simulation<2>& s, std::string_view term) {
  Real sum = 0;
  for (const Real heat : s.particles().history().of(term).heat()) sum += heat;
  return sum;
}

inline Real energy(Simulation<2>& s) {
  const StateView<2> view = s.view();
  return kinetic_energy(view) + s.particles().field().energy(view);
}

}  // namespace pliant::test
