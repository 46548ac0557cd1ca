// Finds vertices that have crossed an outline, and outlines that cross themselves, and checks again as soon as a
// crossing is possible.
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
  bool stops = true;            ///< an outline that crosses itself is an error
  bool refuses_trials = false;  ///< trial steps with such an outline are rejected: for barriers
  std::string cure = "raise the stiffness of the particles' shape";  ///< in the message of the error
};

/// Finds a vertex inside the outline of another particle in the first accepted state in which it is there, as a check
/// after every step would: a vertex and an outline cannot meet before the sum of their displacements reaches their
/// distance. Therefore CrossingWatch stores the smallest distance, and checks again when twice the largest displacement
/// of a point reaches it, which takes tens to hundreds of steps. A vertex that enters and leaves within a single step
/// is not found. An outline that crosses itself is found in the same way, by the distance of its vertices from its
/// other edges.
/// All functions are collective. Errors: NumericalError on all ranks, which names the vertex.
class CrossingWatch {
 public:
  CrossingWatch() = default;
  /// Finds contacts too that are nearer than `least`, where a barrier is too stiff for the fixed step dt; with
  /// controlled steps none is, and dt is 0. Walls that are looked for count in admits().
  CrossingWatch(const LeastDistances& least, Real dt) : least_(least), dt_(dt) {}

  /// Treatment of outlines that cross themselves; by default an error.
  void set_self_crossing(SelfCrossingWatch self) { self_ = std::move(self); }

  /// To be called before the first step. Finds vertices at any depth.
  void start(ParticleSystem<2>& system, const State& s) { look(system, s, std::numeric_limits<Real>::infinity()); }
  /// After every step.
  void after_step(ParticleSystem<2>& system, const State& s);
  /// To be called after particles were moved to other places or reordered.
  void after_change(ParticleSystem<2>& system, const State& s) { look(system, s, 0); }

  /// Whether x [owned points · 2], a trial state, is free of vertices inside other particles, of outlines that cross
  /// themselves (if these are errors), of particles that meet a wall or have passed through one, and of points that
  /// have moved farther than σ_avg since the last check.
  bool admits(ParticleSystem<2>& system, const Real* x) const;

 private:
  /// No vertex can be deeper inside than `deepest`.
  void look(ParticleSystem<2>& system, const State& s, Real deepest);
  Real farthest_from_reference(const ParticleSystem<2>& system, const Real* x) const;

  LeastDistances least_;
  SelfCrossingWatch self_;
  Real dt_ = 0;
  Real gap_ = 0;  ///< distance of vertices from outlines and other edges, or of these from `least`, at the last check
  std::vector<Real> reference_;  ///< positions of the own points then
};

}  // namespace pliant
