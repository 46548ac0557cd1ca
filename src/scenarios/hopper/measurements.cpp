#include <pliant/scenarios/hopper/measurements.h>

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include <pliant/analysis/block_average.h>
#include <pliant/analysis/discharge.h>
#include <pliant/analysis/flow_precision.h>
#include <pliant/analysis/profile.h>
#include <pliant/analysis/region.h>
#include <pliant/io/summary.h>
#include <pliant/model/polygon.h>
#include <pliant/run/frame_data.h>

namespace pliant {
namespace {

/// Adds the magnitudes of the force of these terms on the particles above the orifice line.
template <int D>
Real sum_of_forces(std::initializer_list<std::string_view> terms, const ParticleSystem<D>& system,
                   const StateView<D>& view, const std::vector<Real>& centres, std::vector<Real>& buffer) {
  const Topology& topology = system.topology();
  buffer.resize(static_cast<std::size_t>(topology.points()) * static_cast<std::size_t>(system.coordinates().all()));
  system.field().force_of(terms, view, buffer.data());
  Real sum = 0;
  for (Index m = 0; m < topology.owned(); ++m) {
    if (!topology.active[m] || !(point<D>(centres.data(), m)[D - 1] > 0)) continue;
    sum += (mean_of_points<D>(buffer.data(), topology, m) * topology.points_of(m)).norm();
  }
  return sum;
}

/// The middle of the filling, away from the walls, the orifice and the free surface.
template <int D>
auto bulk_region(const Container& container, Real top) {
  const Real low = 0.3 * top, high = 0.7 * top, half = 0.8 * container.half_width(D, low);
  if constexpr (D == 2)
    return BoxRegion<2>{{-half, low}, {half, high}};
  else
    return CylinderRegion{half, low, high};
}

/// Share of the region of `orifice_density` that lies between the walls, and in no obstacle.
Real share_inside(const HopperOptions& p) {
  const Real w = p.container->orifice();
  const Real whole = p.dim == 2 ? orifice_region<2>(w).measure() : orifice_region<3>(w).measure();
  return p.container->capacity_near_axis(p.dim, w, w) / whole;
}

}  // namespace

std::vector<Real> profile_heights() {
  std::vector<Real> heights(61);
  for (std::size_t k = 0; k < heights.size(); ++k) heights[k] = 0.5 * static_cast<Real>(k);
  return heights;
}

template <int D>
Sample<D> take_sample(ParticleSystem<D>& system, const State& state, const Container& container, const FlowCount& flow,
                      Real dt) {
  const Topology& topology = system.topology();
  const StateView<D> view = system.view(state.x().data(), state.v().data());
  Centres<D> centres;
  centres.update(topology, state);

  const Ranks& ranks = system.ranks();
  const auto active = std::span(topology.active).first(topology.owned());

  Sample<D> sample;
  Real kinetic = 0, weight_energy = 0, top = 0, in_hopper = 0;
  for (Index i = 0; i < topology.owned_points(); ++i) {
    if (!active[topology.particle[i]]) continue;
    kinetic += view.kinetic_energy(i);
    weight_energy += topology.mass(i) * view.position(i)[D - 1];
  }
  for (Index m = 0; m < topology.owned(); ++m) {
    if (!active[m]) continue;
    const Real height = point<D>(centres.position.data(), m)[D - 1],
               speed = point<D>(centres.velocity.data(), m).norm();
    sample.fastest = std::max(sample.fastest, speed);
    if (!(height > 0)) continue;
    ++in_hopper;
    top = std::max(top, height);
    sample.max_speed = std::max(sample.max_speed, speed);
  }
  for (Real* const largest : {&sample.max_speed, &sample.fastest}) *largest = ranks.max(*largest);
  top = ranks.max(top);

  std::vector<std::pair<Index, Index>> touching;
  struct Deepest {
    Real overlap;
    Index first, second;
  } deepest{0, -1, -1};
  system.field().for_each_contact(view, [&](const Contact<D>& c) {
    const auto [first, second] = std::minmax(topology.id[c.first], topology.id[c.second]);
    touching.emplace_back(first, second);
    if (c.overlap > deepest.overlap) deepest = {c.overlap, first, second};
  });
  if (topology.deformable()) {  // polygons may touch in several places
    std::sort(touching.begin(), touching.end());
    touching.erase(std::unique(touching.begin(), touching.end()), touching.end());
  }
  for (const Deepest& d : ranks.all_gather(std::vector{deepest}))
    if (d.overlap > sample.max_overlap) {
      sample.max_overlap = d.overlap;
      sample.first = d.first;
      sample.second = d.second;
    }
  if constexpr (D == 2) {
    if (topology.deformable())
      for (Index m = 0; m < topology.owned(); ++m)
        if (active[m])
          sample.shortest_edge = std::min(sample.shortest_edge, shortest_edge(view.x, topology, m) / topology.l0[m]);
    sample.shortest_edge = ranks.min(sample.shortest_edge);  // a rank without particles has no polygons
  }

  const std::vector<Real> heights = profile_heights();
  std::vector<Real> momentum(heights.size()), weight(heights.size()), buffer;
  add_axis_profile<D>(heights, 1, centres.position, centres.velocity, active, momentum, weight);
  ranks.sum(momentum);
  ranks.sum(weight);

  std::array sums{kinetic,
                  system.field().energy(view) - weight_energy,
                  weight_energy,
                  in_hopper,
                  static_cast<Real>(touching.size()),
                  sum_of_forces<D>({"drag"}, system, view, centres.position, buffer),
                  sum_of_forces<D>({"friction", "friction_vertex", "friction_edge", "disk_contact", "sphere_contact"},
                                   system, view, centres.position, buffer),
                  number_density<D>(orifice_region<D>(container.orifice()), centres.position, active),
                  packing_fraction<D>(bulk_region<D>(container, top), centres.position,
                                      std::span(topology.a0).first(topology.owned()), active),
                  static_cast<Real>(flow.crossed),
                  flow.area};
  ranks.sum(sums);
  const auto [kinetic_energy, potential_energy, gravity_energy, above, contact_pairs, drag, friction, density, fraction,
              crossed, crossed_area] = sums;
  sample.kinetic_energy = kinetic_energy;
  sample.top_height = top;
  sample.bulk_fraction = fraction;
  sample.in_hopper = static_cast<Index>(above);
  sample.crossed = {static_cast<std::int64_t>(crossed), crossed_area};
  const Real each = above > 0 ? 1 / above : 0;

  sample.row = {{"time", state.t},
                {"crossed_count", crossed},
                {"crossed_area", crossed_area},
                {"in_hopper", above},
                {"kinetic_energy", kinetic_energy},
                {"potential_energy", potential_energy},
                {"gravity_energy", gravity_energy},
                {"contact_pairs", contact_pairs},
                {"drag_force", drag * each},
                {"friction_force", friction * each},
                {"orifice_density", density},
                {"bulk_fraction", fraction},
                {"top_height", top},
                {"max_speed", sample.max_speed},
                {"max_overlap", sample.max_overlap},
                {"dt", dt},
                {"profile_momentum", std::span<const Real>(momentum)},
                {"profile_weight", std::span<const Real>(weight)}};
  return sample;
}

Real last_crossing(const Series& series) {
  const std::vector<Real>& crossed = series.at("crossed_count").values;
  const auto last = std::lower_bound(crossed.begin(), crossed.end(), crossed.back());
  return series.at("time").values[static_cast<std::size_t>(last - crossed.begin())];
}

nlohmann::ordered_json evaluate_series(const Series& series, const HopperOptions& options, Real mean_size) {
  nlohmann::ordered_json result;
  const auto column = [&](const char* name) { return std::span<const Real>(series.at(name).values); };
  const std::span<const Real> time = column("time");
  const std::string d = std::to_string(options.dim);
  if (options.flow == FlowKind::discharge) {
    const std::span<const Real> in_hopper = column("in_hopper");
    const DischargeFit fit = fit_discharge(time, std::vector<std::int64_t>(in_hopper.begin(), in_hopper.end()));
    const auto without_error = [](Real value, std::string_view unit) {
      return quantity(value, DischargeFit::unknown, unit);
    };
    const bool fitted = std::isfinite(fit.c0);
    result["c0"] = quantity(fit.c0, fit.error, "1/t0");
    result["c0_chi2_per_dof"] = without_error(fit.chi2_per_dof, "");
    result["c0_start"] = without_error(fitted ? time[fit.begin] : DischargeFit::unknown, "t0");
    result["c0_end"] = without_error(fitted ? time[fit.end - 1] : DischargeFit::unknown, "t0");
    result["c0_start_count"] = without_error(fit.start_count, "");
    result["c0_residue"] = fit.residue;
    result["total_time"] = without_error(fit.total_time, "t0");
    result["left_in_hopper"] = in_hopper.empty() ? 0 : in_hopper.back();
    return result;
  }
  if (time.size() < 2) return result;

  const SteadyFlow flow = steady_flow(
      {time, column("crossed_area"), column("kinetic_energy"), column("top_height"), column("bulk_fraction")});
  const FlowRate& q = flow.rate;
  const std::size_t from = flow.from, rows = time.size();
  const auto average = [&](const char* name) { return slow_average(column(name).subspan(from)); };
  const auto report = [&](const BlockAverage& b, std::string_view unit, Real factor = 1) {
    return quantity(b.mean * factor, flow.steady.steady ? b.error * factor : BlockAverage::unknown, unit);
  };

  const std::string rate_unit = "sigma_avg^" + d + "/t0";
  result["steady"] = flow.steady.steady;
  result["steady_start"] = quantity(time[from], BlockAverage::unknown, "t0");
  result["steady_explanation"] = flow.steady.explanation;
  result["steady_samples"] = rows - from;
  result["Q"] = quantity(q.value, q.error, rate_unit);
  result["Q_correlation_time"] =
      quantity(flow.steady.steady ? q.correlation_time : BlockAverage::unknown, BlockAverage::unknown, "t0");

  // Q' = Q a_eff/a_avg [H App. B]. a_eff is the part of the region at the orifice that lies inside, over the number of
  // centres there: the whole region is inside above a flat bottom, and then a_eff = 1/ρ_n.
  const BlockAverage density = average("orifice_density");
  const Real factor = share_inside(options) / (density.mean * mean_size);
  result["Q_corrected"] =
      quantity(q.value * factor, factor * std::hypot(q.error, q.value * density.error / density.mean), rate_unit);
  result["orifice_density"] = report(density, "sigma_avg^-" + d);
  result["bulk_fraction"] = report(average("bulk_fraction"), "");
  result["contacts_per_particle"] = report(average("contact_pairs"), "", 2.0 / options.particles);
  result["top_height"] = report(average("top_height"), "sigma_avg");
  // A few deep contacts decide the mean of a maximum; block averages miss them, therefore it has no error.
  result["max_overlap"] = quantity(average("max_overlap").mean, BlockAverage::unknown, "");
  if (options.kinetic_friction() > 0 && options.drag() > 0)
    result["drag_friction_ratio"] =
        report(block_ratio(column("drag_force").subspan(from), column("friction_force").subspan(from)), "");

  const std::size_t heights = series.at("profile_weight").width;
  const auto rows_of = [&](const char* name) { return column(name).subspan(from * heights, (rows - from) * heights); };
  const std::vector<BlockAverage> profile =
      axis_profile(rows_of("profile_momentum"), rows_of("profile_weight"), heights);
  result["orifice_velocity"] = report(profile.front(), "sigma_avg/t0");
  auto errors = nlohmann::ordered_json::array();  // for python/pliant, which reads the velocities from the series
  for (const BlockAverage& velocity : profile) errors.push_back(report(velocity, "").at("error"));
  result["axis_velocity"] = {{"error", errors}, {"unit", "sigma_avg/t0"}};
  return result;
}

std::string discharge_text(const nlohmann::ordered_json& measured) {
  const auto number = [&](const char* name, const char* part = "value") {
    const nlohmann::ordered_json& entry = measured.at(name).at(part);
    return entry.is_null() ? DischargeFit::unknown : Real(entry);
  };
  std::string text = fmt::format("particles left: {}", Index(measured.at("left_in_hopper")));
  if (const Real total = number("total_time"); !std::isnan(total))
    text += fmt::format(", empty after {:.5g} t0", total);
  text += "\nc0 ";
  if (std::isnan(number("c0")))
    return text + "unknown: fewer than 3 samples, or 3 different numbers of particles, while the middle of them left";
  const Real error = number("c0", "error"), chi2 = number("c0_chi2_per_dof");
  const Index residue = measured.at("c0_residue");
  text += fmt::format(
      "= {:.4g} {} 1/t0 in dN/dt = -c0 sqrt(N{}), fitted from t = {:.4g} to {:.4g} t0", number("c0"),
      std::isnan(error) ? "(no error: fewer than 3 samples in a tenth of the fit)" : fmt::format("± {:.2g}", error),
      residue > 0 ? fmt::format(" - {}", residue) : "", number("c0_start"), number("c0_end"));
  if (!std::isnan(chi2))
    text += fmt::format(", chi^2/dof {:.2g}{}", chi2, chi2 > 1.5 ? ": the law does not hold there" : "");
  return text;
}

template Sample<2> take_sample(ParticleSystem<2>&, const State&, const Container&, const FlowCount&, Real);
template Sample<3> take_sample(ParticleSystem<3>&, const State&, const Container&, const FlowCount&, Real);

}  // namespace pliant
