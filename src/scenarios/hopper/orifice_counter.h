// Counting of particles at the orifice line, and detection of those below it that leave.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <pliant/analysis/crossing.h>
#include <pliant/domain/migration.h>
#include <pliant/geometry/container.h>
#include <pliant/model/state.h>
#include <pliant/run/protocol.h>
#include <pliant/run/stored_particles.h>
#include <pliant/scenarios/hopper/measurements.h>
#include <pliant/scenarios/hopper/options.h>
#include <pliant/scenarios/hopper/passage.h>
#include <pliant/setup/reinsertion.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// A particle on the orifice line. Plain data, to be sent.
template <int D>
struct OrificeCrossing {
  Index id;
  Sighting<D> at;
};

/// Follows the particles of one rank near the orifice line, y = 0 (z = 0 in 3D). A particle counts once until it is
/// reinserted: at the line, or at the removal depth below it.
template <int D>
class OrificeCounter {
 public:
  /// depth: particles that are farther below the line leave, in σ_avg.
  OrificeCounter(Counting counting, Real depth) : counting_(counting), depth_(depth) {}

  Real depth() const { return depth_; }
  /// To be called after the particles have been placed on this rank; resets their counts.
  void reset(Index owned);
  /// Before the first step.
  void start(const State& state, const Topology& topology);
  void move(const Migration& migration);

  struct Event {
    std::vector<Leaving> leaving;
    std::optional<OrificeCrossing<D>> astray;  ///< has crossed the line outside the orifice
  };
  /// After a step. Between two list rebuilds no particle moves more than skin/2, so only particles that were close
  /// enough to the line or to the removal depth at the last rebuild are followed.
  Event follow(const State& state, const ParticleSystem<D>& system, const Container& container, int rank);

  /// Own particle m has been reinserted.
  void reinserted(Index m, const State& state, const Topology& topology);

  /// Whether own particle m has left through the orifice and has not come back.
  bool outside(Index m) const { return outside_[m] != 0; }
  /// Times each own particle has been reinserted.
  const std::vector<Index>& reinsertions() const { return reinserted_; }
  /// This rank's share.
  const FlowCount& flow() const { return flow_; }
  /// Crossings since the last call.
  std::vector<OrificeCrossing<D>> take_crossings() { return std::exchange(crossings_, {}); }

  /// largest: the largest particle's a0. Returns the number of crossings of all ranks. Errors: InputError.
  std::int64_t visit(Archive& archive, const Ranks& ranks, Real largest);

  /// Centre and velocity of own particle m.
  static Sighting<D> sight(const State& state, const Topology& topology, Index m);

 private:
  void count(Index m, const OrificeCrossing<D>& crossing, const Topology& topology);

  Counting counting_;
  Real depth_;

  // State for checkpoints.
  FlowCount flow_;
  std::vector<std::uint8_t> counted_;  ///< per own particle: has crossed since it was last reinserted
  std::vector<std::uint8_t> outside_;  ///< per own particle
  std::vector<Index> reinserted_;      ///< per own particle: how often

  std::vector<Sighting<D>> seen_;              ///< per owned particle: last observation; current for followed particles
  std::vector<OrificeCrossing<D>> crossings_;  ///< not yet recorded as events
  std::vector<Index> watched_;                 ///< followed until the next list rebuild
  std::int64_t watched_since_ = -1;            ///< list rebuilds when they were chosen
};

}  // namespace pliant
