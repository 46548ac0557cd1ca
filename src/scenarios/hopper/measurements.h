// Measurements of a hopper run: samples, and the evaluation at its end.
#pragma once

#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <pliant/io/run_writer.h>
#include <pliant/model/state.h>
#include <pliant/scenarios/hopper/options.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// Counters since the start of a run; each rank has its share.
struct FlowCount {
  std::int64_t crossed = 0;  ///< particles that have crossed the orifice line
  Real area = 0;             ///< their a0
};

/// One row of `/series`, and its values for messages and the clog detector.
template <int D>
struct Sample {
  std::vector<SeriesValue> row;
  FlowCount crossed;  ///< count of all ranks
  Real kinetic_energy = 0, top_height = 0, bulk_fraction = 0;
  Real max_speed = 0;  ///< above the orifice line
  Real fastest = 0;    ///< above or below it
  Index in_hopper = 0;
  Real max_overlap = 0;
  Index first = -1, second = -1;                               ///< ids of the particles of the largest overlap
  Real shortest_edge = std::numeric_limits<Real>::infinity();  ///< of polygons, over l0
};

/// Heights of the velocity profile on the axis, in σ_avg above the orifice [H Fig. 5].
std::vector<Real> profile_heights();

/// Of all ranks, the same on each. Collective.
template <int D>
Sample<D> take_sample(ParticleSystem<D>& system, const State& state, const Container& container, const FlowCount& flow,
                      Real dt);

/// Time of the last sample that has counted a crossing; of the first one where none has.
Real last_crossing(const Series& series);

/// Measured quantities of a finished run from its series, for summary.json: Q and the rest with errors, from the steady
/// state on. mean_size: mean a0 of all particles.
nlohmann::ordered_json evaluate_series(const Series& series, const HopperOptions& options, Real mean_size);

/// Two lines about a discharge, for the screen, from the result of evaluate_series.
std::string discharge_text(const nlohmann::ordered_json& measured);

}  // namespace pliant
