#include <pliant/scenarios/hopper/steps.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include <pliant/model/bending.h>
#include <pliant/model/drag.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/wall_contact.h>
#include <pliant/scenarios/particles/motions.h>

namespace pliant {

template <int D>
HopperSteps hopper_steps(const HopperOptions& p, const Topology& all, const ForceField<D>& field) {
  HopperSteps steps;
  const CriticalStep critical = field.critical_step(all);
  steps.critical = critical.limit();
  Real lightest = std::numeric_limits<Real>::infinity(), heaviest = 0;
  for (Index m = 0; m < all.particles(); ++m) {
    const Real mass = all.point_mass[m] * all.points_of(m);
    lightest = std::min(lightest, mass);
    heaviest = std::max(heaviest, mass);
  }
  if (p.drag_per_mass()) lightest = heaviest = average_mass<D>;  // drag acts as if all had it
  steps.dt = p.dt.value_or(critical.standard(
      std::min({1e-3, p.elastic_fraction(critical.elastic, lightest) * critical.elastic, 0.5 * critical.damping})));
  steps.motions = motions_of(critical, p.model, field, all);
  const Real one_contact = critical.elastic * critical.elastic * p.drag() / (2 * heaviest);
  if (p.dynamics == Dynamics::overdamped) {
    // Springs k relax at the rate k/ζ; for one contact, k/m = (2/dt)².
    steps.motions = {{.decay = critical.crowded.translation.stiffness * heaviest / p.drag()}};
    steps.dt = p.dt.value_or(std::min(1e-3, 0.2 * one_contact));
  }
  // The distance at which the fixed step is the critical step. The rate at stiff_distance scales as 1/d; without
  // inertia as 1/d².
  const Real elastic = critical.elastic, drag_limit = one_contact;
  const Real unit = BarrierOverlap::stiff_distance / 2,
             outlines = p.model.term(EdgeContact{.law = ContactLaw::barrier}).max_rate(all),
             walls = p.model.term(WallContact<2>{.law = ContactLaw::barrier}).max_rate(all);
  const bool overdamped = p.dynamics == Dynamics::overdamped;
  steps.least_distances = [=](Real dt) {
    const Real factor = unit * (overdamped ? elastic * std::sqrt(dt / drag_limit) : dt);
    return LeastDistances{factor * outlines, factor * walls};
  };
  if (D == 2 && !p.model.parameters(Role::bending).empty())
    if (const Bending bending = p.model.term(Bending{}); bending.edges == EdgeVectors::unit)
      steps.bending_rate = bending.max_rate(all);
  return steps;
}

template HopperSteps hopper_steps(const HopperOptions&, const Topology&, const ForceField<2>&);
template HopperSteps hopper_steps(const HopperOptions&, const Topology&, const ForceField<3>&);

}  // namespace pliant
