#include <pliant/ts/integrator.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace pliant {

std::vector<FastestRates> fastest_motions(const CriticalStep& critical, Real drag) {
  std::vector<FastestRates> motions;
  for (const Rates& r : {critical.crowded.translation, critical.crowded.rotation})
    motions.push_back({.oscillation = std::sqrt(r.stiffness), .drag = drag, .decay = r.damping});
  return motions;
}

Real longest_stable_step(const Integrator& method, std::span<const FastestRates> motions) {
  Real longest = std::numeric_limits<Real>::infinity();
  for (const FastestRates& motion : motions) longest = std::min(longest, method.longest_stable_step(motion));
  return longest;
}

Real standard_step(const Integrator& method, std::span<const FastestRates> motions, Real usual) {
  const Real longest = longest_stable_step(method, motions);
  return method.explicit_fixed_step() && longest > 0 ? std::min(usual, CriticalStep::safe_part * longest) : usual;
}

}  // namespace pliant
