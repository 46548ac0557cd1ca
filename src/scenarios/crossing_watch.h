// Looks for vertices that have crossed an outline, as often as one can have.
#pragma once

#include <limits>
#include <vector>

#include <pliant/model/state.h>
#include <pliant/ts/particle_system.h>

namespace pliant {

/// Finds a vertex inside the outline of another particle in the very state in which it is there, as if it looked after
/// every step: a vertex and an outline that are a distance apart cannot have met before both together have gone that
/// far. So it remembers the smallest distance, and looks again only when twice the longest way of any point has used it
/// up, which takes tens to hundreds of steps. A vertex that enters and leaves within a single step is not seen.
/// All functions are collective. Errors: NumericalError on all ranks, which names the vertex.
class CrossingWatch {
 public:
  /// Before the first step. Finds vertices however deep inside they are.
  void start(ParticleSystem<2>& system, const State& s) { look(system, s, std::numeric_limits<Real>::infinity()); }
  /// After every step.
  void after_step(ParticleSystem<2>& system, const State& s);
  /// After particles were put somewhere else or into another order.
  void after_change(ParticleSystem<2>& system, const State& s) { look(system, s, 0); }

 private:
  /// No vertex can be deeper inside than `deepest`.
  void look(ParticleSystem<2>& system, const State& s, Real deepest);

  Real gap_ = 0;                 ///< smallest distance of a vertex from an outline at the last look
  std::vector<Real> reference_;  ///< positions of the own points then
};

}  // namespace pliant
