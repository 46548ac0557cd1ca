// Looks for vertices that have crossed an outline and for outlines that cross themselves, as often as one can have.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include <pliant/model/crossing.h>
#include <pliant/model/state.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// Outlines that cross themselves: no area, no pressure and no inside can be trusted where one does.
struct SelfCrossingWatch {
  bool stops = true;            ///< one that does is an error
  bool refuses_trials = false;  ///< a trial step with one is not admitted: where a barrier keeps outlines simple
  std::string cure = "raise the stiffness of the particles' shape";  ///< in the message of the error
};

/// Finds a vertex inside the outline of another particle in the very state in which it is there, as if it looked after
/// every step: a vertex and an outline that are a distance apart cannot have met before both together have gone that
/// far. So it remembers the smallest distance, and looks again only when twice the longest way of any point has used it
/// up, which takes tens to hundreds of steps. A vertex that enters and leaves within a single step is not seen. An
/// outline that crosses itself is found in the same way, by the distance of its vertices from its other edges.
/// All functions are collective. Errors: NumericalError on all ranks, which names the vertex.
class CrossingWatch {
 public:
  CrossingWatch() = default;
  /// Finds contacts too that are nearer than `least`, where a barrier is too stiff for the fixed step dt; with
  /// controlled steps none is, and dt is 0. Walls that are looked for count in admits().
  CrossingWatch(const LeastDistances& least, Real dt) : least_(least), dt_(dt) {}

  /// Treatment of outlines that cross themselves; by default an error.
  void set_self_crossing(SelfCrossingWatch self) { self_ = std::move(self); }

  /// Before the first step. Finds vertices however deep inside they are.
  void start(ParticleSystem<2>& system, const State& s) { look(system, s, std::numeric_limits<Real>::infinity()); }
  /// After every step.
  void after_step(ParticleSystem<2>& system, const State& s);
  /// After particles were put somewhere else or into another order.
  void after_change(ParticleSystem<2>& system, const State& s) { look(system, s, 0); }

  /// Whether x [own points · 2], which a step tries, has no vertex inside another particle, no outline that crosses
  /// itself where these are refused, no particle that meets a wall or has gone through one, and no point that has gone
  /// farther than σ_avg since the last look.
  bool admits(ParticleSystem<2>& system, const Real* x) const;

 private:
  /// No vertex can be deeper inside than `deepest`.
  void look(ParticleSystem<2>& system, const State& s, Real deepest);
  Real farthest_from_reference(const ParticleSystem<2>& system, const Real* x) const;

  LeastDistances least_;
  SelfCrossingWatch self_;
  Real dt_ = 0;
  Real gap_ = 0;  ///< how far vertices were from outlines and other edges, or these from `least`, at the last look
  std::vector<Real> reference_;  ///< positions of the own points then
};

}  // namespace pliant
