// How points without inertia follow the forces on them.
#pragma once

#include <vector>

#include <pliant/model/force_field.h>

namespace pliant {

/// Velocities at which drag balances the forces of a model.
template <int D>
class Mobility {
 public:
  virtual ~Mobility() = default;
  /// Writes v [owned points · D]. s.v [points · D] and v come with the velocities of the evaluation before. Collective.
  virtual void find_velocities(const ForceField<D>& field, const StateView<D>& s, Real* v) = 0;
  /// Power that drag dissipates at s.v, this rank's share.
  virtual Real power(const StateView<D>& s) const = 0;
  /// Whether the velocities before enter, if only as a first guess: then a restart needs them.
  virtual bool remembers() const = 0;
  /// Pairs of particles up to so far beyond contact must be listed.
  virtual Real beyond_contact() const = 0;
  /// New lists. numbers [points]: the row of each point in the full system; a ghost has the row of its original.
  virtual void set_numbers(std::vector<Index> numbers) = 0;
};

}  // namespace pliant
