// The pair law of all contacts of the hopper models.
#pragma once

#include <pliant/base/types.h>

namespace pliant {

/// V(d) = ε/2 (1 − d/δ)² for d < δ, else 0 [H 2, 3, 9, 10]. C¹: V'' jumps from 0 to ε/δ² at touch.
/// Units: ε in ρgσ_avg^(D+1), lengths in σ_avg.
struct HarmonicOverlap {
  Real epsilon, delta;

  bool touches(Real d) const { return d < delta; }
  Real value(Real d) const { return touches(d) ? epsilon / 2 * square(1 - d / delta) : 0; }
  Real slope(Real d) const { return touches(d) ? -epsilon / delta * (1 - d / delta) : 0; }
  Real curvature(Real d) const { return touches(d) ? epsilon / square(delta) : 0; }
};

}  // namespace pliant
