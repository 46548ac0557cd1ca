// The state of a simulation in a checkpoint: with it the motion continues bit for bit.
#pragma once

#include <optional>
#include <string>
#include <utility>

#include <pliant/run/archive.h>
#include <pliant/run/simulation.h>

namespace pliant {

/// Numbers of the motion in a checkpoint.
struct MotionNumbers {
  bool changed = false;  ///< the state, after the last step: the integrator restarts
  Real dt = 0, last_dt = 0, skin = 0;
  std::int64_t evaluations = 0, rebuilds_since_sort = 0, rebuilds = 0;
  IntegratorStatistics taken;
};

/// Visits the state of a simulation, part by part in the order of these functions, as each part needs those before. The
/// integrator is set between state() and carried(). All functions are collective. Errors: InputError, as of Archive.
template <int D>
class MotionArchive {
 public:
  /// A simulation that reads has the list of all its particles.
  MotionArchive(Archive& archive, Simulation<D>& simulation, MotionNumbers& numbers)
      : a_(archive), simulation_(simulation), n_(numbers) {}

  /// Places of the particles, and whether they are active.
  void particles();
  /// longest: step that may occur; skin: margin of the lists, if it is fixed.
  void numbers(Real longest, std::optional<Real> skin);
  /// Positions, velocities, contact histories, and images in a periodic box; without inertia also the integrated
  /// quantities and the last velocities.
  void state();
  /// Numbers that the integrator carries from step to step.
  void carried();
  /// The lists of the stopped run: the order of their sums is part of the state.
  void lists();

 private:
  /// Positions and angles, or velocities and spins: `own` is written, set(values) takes those that were read.
  template <class Set>
  void coordinates(const std::string& name, const std::string& of_angles, std::span<const Real> own, Real most,
                   Set&& set);
  void images();
  void overdamped();
  /// A particle that moves by some diameters in a step has gone through others.
  Real fastest() const;

  Archive& a_;
  Simulation<D>& simulation_;
  MotionNumbers& n_;
};

extern template class MotionArchive<2>;
extern template class MotionArchive<3>;

}  // namespace pliant
