#include <pliant/scenarios/hopper/report.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <pliant/analysis/block_average.h>
#include <pliant/base/console.h>
#include <pliant/io/summary.h>
#include <pliant/run/overlap_check.h>

namespace pliant {

std::string percent(Real fraction) { return std::isnan(fraction) ? "?" : fmt::format("{:.2g}", 100 * fraction); }

namespace {

/// Of samples, and of particles that passed through each other between two samples.
Real deepest_overlap(const HopperEnd& end, const Series& series) {
  return std::max(end.pair_overlap, std::ranges::max(series.at("max_overlap").values));
}

/// Twice the time, with as many samples as an error needs.
std::string longer(const HopperEnd& end) {
  const Real later = 2 * std::max(end.t, 64 * end.options.sample_interval);
  return fmt::format("{} -t_end {:.3g}", end.restart_command, later);
}

/// For a run that -t_end ended first.
void warn_of_error(const HopperEnd& end, const nlohmann::ordered_json& measured) {
  const bool known = measured.contains("Q") && !measured["Q"]["error"].is_null();
  const std::string error =
      known ? percent(Real(measured["Q"]["error"]) / Real(measured["Q"]["value"])) + " %" : "unknown";
  warn("the run reached -t_end {:g} before the accuracy -hopper_q_rtol {:g}: the error of Q is {}; continue with {}",
       *end.options.t_end, end.options.q_rtol, error, longer(end));
}

/// For a run whose flow has ended without a clog: remaining particles may bounce if dissipation is low.
void warn_of_standstill(const HopperEnd& end, const Series& series) {
  const Real last = last_crossing(series), since = end.t - last;
  if (end.in_hopper > 0 && since >= end.options.clog_time && since > 0.2 * end.t)
    warn(
        "no particle has crossed the orifice since t = {:.4g} t0, but particles still move at up to {:.2g} "
        "sigma_avg/t0: the run counts neither as clogged nor as at rest, and averages include that time",
        last, end.max_speed);
}

/// Counts of samples. No particle has crossed itself in a run that such a particle ends.
void report_self_crossings(const HopperEnd& end, const Series& series, nlohmann::ordered_json& s) {
  const bool counted = end.options.self_crossing == OnSelfCrossing::count;
  const Index most = counted ? static_cast<Index>(std::ranges::max(series.at(self_crossing_column).values)) : 0;
  s[self_crossing_column] = most;
  if (most > 0)
    warn("up to {} of {} particles cross themselves: their areas and contacts are wrong", most, end.options.particles);
}

/// Centres that meet pass through each other.
void warn_of_overlap(const HopperEnd& end, const Series& series) {
  if (const Real deepest = deepest_overlap(end, series); deepest > passing_overlap)
    warn("particles overlapped by {:.3g} of their contact distance: they pass through each other; raise {}, now {:g}",
         deepest, end.options.model.option(Role::contact_energy), end.options.model.value(Role::contact_energy));
  if (end.wall_overlap > passing_overlap)
    warn("a particle overlapped a wall by {:.3g} radii: it passes through the wall; raise {}, now {:g}",
         end.wall_overlap, end.options.model.option(Role::wall_energy), end.options.model.value(Role::wall_energy));
}

/// Why averages of the run have no error.
std::string reason_without_error(const HopperEnd& end, const nlohmann::ordered_json& measured) {
  const bool few = measured.contains("steady_samples") && measured["steady_samples"] <= BlockAverage::least_samples;
  const bool drifts = measured.contains("steady") && !measured["steady"] &&
                      std::string(measured["steady_explanation"]).starts_with("not steady");
  if (measured.contains("passing_overlap")) return "particles passed through each other or a wall";
  if (end.rests()) return std::string(end.ended_as("clogged") ? no_flow::clogged : no_flow::at_rest);
  if (measured.contains("Q") && measured["Q"]["value"] == 0) return "nothing has crossed";
  if (drifts) return "the flow is not steady";
  if (few) return fmt::format("fewer than {} steady samples", BlockAverage::least_samples);
  return "its correlations are too long for the run";
}

void print(const HopperEnd& end, const nlohmann::ordered_json& measured) {
  const auto print = [&](const char* name, const char* text, const char* scope = "") {
    if (!measured.contains(name) || measured[name]["value"].is_null()) return;
    const Real value = measured[name]["value"];
    const std::string unit = measured[name]["unit"], space = unit.empty() ? "" : " ";
    if (measured[name]["error"].is_null())
      say("{} = {:.3g}{}{} ({}{})\n", text, value, space, unit,
          end.rests() && !measured.contains("passing_overlap") ? "" : "no error: ",
          std::string(measured[name]["no_error"]));
    else
      say("{} = {:.5g} ± {:.2g}{}{}{}\n", text, value, Real(measured[name]["error"]), space, unit, scope);
  };
  if (end.rests())
    say("{}: no crossing and no motion since t = {:.4g} t0\n",
        end.ended_as("clogged") ? "clogged" : "at rest without an arch over the orifice", end.quiet_since);
  if (end.precise()) say("ended at t = {:.6g} t0: Q has reached the relative error of -hopper_q_rtol\n", end.t);
  if (measured.contains("steady_explanation")) say("{}\n", std::string(measured["steady_explanation"]));
  if (end.ended_as("done") && !end.precise() && measured.contains("steady") && !measured["steady"])
    say("to run longer: {}\n", longer(end));
  print("Q", "Q");
  print("Q_corrected", "Q'");
  print("contacts_per_particle", "contacts per particle", " (error within this run; seeds can differ more)");
  print("drag_friction_ratio", "drag/friction");
  if (measured.contains("c0")) say("{}\n", discharge_text(measured));
}

}  // namespace

void report_hopper(const HopperEnd& end, const Series& series, nlohmann::ordered_json measured,
                   nlohmann::ordered_json& summary) {
  const HopperOptions& p = end.options;
  // A run at rest has no flow, even if it had before: fits omit it.
  if (end.rests())
    for (const char* name : {"Q", "Q_corrected"})
      if (measured.contains(name)) measured[name].update({{"value", 0}, {"error", nullptr}});
  if (end.rests() || p.flow == FlowKind::discharge)
    measured["flow_ended"] = quantity(last_crossing(series), BlockAverage::unknown, "t0");
  measured["largest_wall_overlap"] = end.wall_overlap;
  const Real deepest = std::max(deepest_overlap(end, series), end.wall_overlap);
  if (deepest > passing_overlap) measured["passing_overlap"] = deepest;
  // Averages over a flow and the rest after it are averages of neither.
  const bool stopped = end.rests() && p.flow == FlowKind::continuous;
  if (stopped && measured.contains("steady") && measured["steady"])
    measured.update({{"steady", false}, {"steady_explanation", "not steady: the flow has stopped"}});
  if (deepest > passing_overlap || stopped)
    for (auto& [name, value] : measured.items())
      if (value.is_object() && value.contains("error")) value["error"] = nullptr;
  for (const char* name : {"Q", "Q_corrected", "orifice_density", "bulk_fraction", "contacts_per_particle",
                           "top_height", "max_overlap", "drag_friction_ratio", "orifice_velocity"})
    if (measured.contains(name) && measured[name]["error"].is_null())
      measured[name]["no_error"] = reason_without_error(end, measured);
  for (const auto& [name, value] : measured.items()) summary[name] = value;
  print(end, measured);
  if (p.deformable()) report_self_crossings(end, series, summary);
  warn_of_overlap(end, series);
  if (end.ended_as("done") && !end.precise()) {
    warn_of_standstill(end, series);
    if (p.q_rtol > 0) warn_of_error(end, measured);
  }
}

}  // namespace pliant
