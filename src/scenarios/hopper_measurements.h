// What a hopper run measures: samples, frames, and the evaluation at its end.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <pliant/io/run_writer.h>
#include <pliant/model/state.h>
#include <pliant/scenarios/hopper_options.h>
#include <pliant/ts/particle_system.h>

namespace pliant {

/// Centres of the own particles, and their velocities: [owned · D].
template <int D>
struct Centres {
  std::vector<Real> position, velocity;
  void update(const Topology& topology, const State& state);
};

/// Counters that a run keeps from its start; each rank its share.
struct FlowCount {
  std::int64_t crossed = 0;  ///< particles that have crossed the orifice line
  Real area = 0;             ///< their a0
};

/// One row of `/series`, and what messages and the clog detector want of it.
template <int D>
struct Sample {
  std::vector<SeriesValue> row;
  FlowCount crossed;  ///< of all ranks
  Real kinetic_energy = 0;
  Real max_speed = 0;  ///< above the orifice line
  Index in_hopper = 0;
  Real max_overlap = 0;
  Index first = -1, second = -1;  ///< ids of the particles of the largest overlap
};

/// Heights of the velocity profile on the axis, in σ_avg above the orifice [H Fig. 5].
std::vector<Real> profile_heights();

/// Of all ranks, the same on each. Collective.
template <int D>
Sample<D> take_sample(ParticleSystem<D>& system, const State& state, const Hopper& hopper, const FlowCount& flow,
                      Real dt);

/// A contact of a frame, the lower id first. Plain data, to be sent.
template <int D>
struct ContactRecord {
  std::array<Index, 2> particles;
  Real overlap;
  std::array<Real, D> position, normal, force;
};

/// A frame with particles and contacts in the order of their ids, on the root; empty elsewhere. Owns the arrays. The
/// constructor is collective.
template <int D>
class FrameData {
 public:
  FrameData(ParticleSystem<D>& system, const State& state);
  FrameData(const FrameData&) = delete;
  FrameData& operator=(const FrameData&) = delete;
  Frame frame;

 private:
  void gather_particles(const Ranks& ranks, const Topology& topology, const State& state);

  std::vector<Real> positions_, velocities_, wall_force_;
  std::vector<Real> centres_, area_, perimeter_;  ///< of polygons; the centre of a soft particle is its position
  std::vector<std::uint8_t> active_;
  std::vector<Index> contact_count_;
  std::vector<ContactRecord<D>> contacts_;
};

/// Measured quantities of a finished run from its series, for summary.json: Q and the rest with errors, from the steady
/// state on. mean_size: mean a0 of all particles.
nlohmann::ordered_json evaluate_series(const Series& series, const HopperOptions& options, Real mean_size);

}  // namespace pliant
