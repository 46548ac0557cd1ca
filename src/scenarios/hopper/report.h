// The end of a hopper run on the screen and in summary.json.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include <pliant/scenarios/hopper/measurements.h>
#include <pliant/scenarios/hopper/options.h>

namespace pliant {

/// Column of the series, and entry of the summary: particles that cross themselves.
inline constexpr const char* self_crossing_column = "self_crossing_particles";

/// A fraction in percent; "?" if it is unknown.
std::string percent(Real fraction);

/// State of a hopper run at its end.
struct HopperEnd {
  const HopperOptions& options;
  std::string status, ended_by;
  Real t;
  Real quiet_since;  ///< time of the last crossing or motion, of a run at rest
  Index in_hopper;
  Real max_speed;     ///< above the orifice line
  Real wall_overlap;  ///< largest of a point with a wall, over its radius
  Real pair_overlap;  ///< largest, in any step, of particles that pass through each other, else 0
  std::string restart_command;

  bool ended_as(std::string_view what) const { return status == what; }
  bool rests() const { return ended_as("clogged") || ended_as("at_rest"); }
  /// -hopper_q_rtol has ended the run.
  bool precise() const { return ended_as("done") && ended_by == "q_rtol"; }
};

/// Adds the measured quantities to the summary, without errors where particles passed through each other or a wall, and
/// with Q = 0 for a run at rest. Prints them and warnings. measured: result of evaluate_series. On the root.
void report_hopper(const HopperEnd& end, const Series& series, nlohmann::ordered_json measured,
                   nlohmann::ordered_json& summary);

}  // namespace pliant
