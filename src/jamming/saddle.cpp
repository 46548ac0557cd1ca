#include <pliant/jamming/saddle.h>

#include <algorithm>
#include <vector>

#include <pliant/jamming/backbone.h>
#include <pliant/jamming/modes.h>

namespace pliant {

template <int D>
bool leave_saddle(ParticleSystem<D>& system, std::span<Real> x, std::span<const Index> rattlers) {
  constexpr Real part_of_diameter = 0.01;
  constexpr Index most_points_by_factors = 20000;
  std::vector<Real> displacements;
  {
    const Backbone<D> backbone(system, rattlers);
    // For a large system the factors of is_stable() could need too much memory; modes() orders the matrix differently.
    if (system.topology().owned_points() <= most_points_by_factors && is_stable<D>(system, x)) return false;
    const Modes lowest = modes<D>(system, x, {.lowest = 1});
    if (lowest.unstable == 0) return false;
    displacements = mode_displacements(system, lowest, 0);
  }
  const Topology& t = system.topology();
  const Real step = part_of_diameter * *std::min_element(t.diameter.begin(), t.diameter.begin() + t.owned_points());
  for (std::size_t k = 0; k < displacements.size(); ++k) x[k] += step * displacements[k];
  return true;
}

template bool leave_saddle<2>(ParticleSystem<2>&, std::span<Real>, std::span<const Index>);
template bool leave_saddle<3>(ParticleSystem<3>&, std::span<Real>, std::span<const Index>);

}  // namespace pliant
