#include <pliant/scenarios/hopper_measurements.h>

#include <algorithm>
#include <cmath>

#include <pliant/analysis/block_average.h>
#include <pliant/analysis/discharge.h>
#include <pliant/analysis/profile.h>
#include <pliant/analysis/region.h>
#include <pliant/analysis/steady_state.h>
#include <pliant/io/summary.h>
#include <pliant/model/polygon.h>

namespace pliant {
namespace {

/// Mean magnitude, over the particles above the orifice line, of the force of one term.
template <int D>
Real mean_force(std::string_view term, const ParticleSystem<D>& system, const StateView<D>& view,
                const std::vector<Real>& centres, std::vector<Real>& buffer) {
  const Topology& topology = system.topology();
  buffer.resize(static_cast<std::size_t>(topology.points()) * D);
  system.field().force_of(term, view, buffer.data());
  Real sum = 0;
  Index count = 0;
  for (Index m = 0; m < topology.particles(); ++m) {
    if (!topology.active[m] || !(point<D>(centres.data(), m)[D - 1] > 0)) continue;
    sum += (mean_of_points<D>(buffer.data(), topology, m) * topology.points_of(m)).norm();
    ++count;
  }
  return count > 0 ? sum / count : 0;
}

/// The middle of the filling, away from the walls, the orifice and the free surface.
template <int D>
auto bulk_region(const Hopper& hopper, Real top) {
  const Real low = 0.3 * top, high = 0.7 * top, half = 0.8 * hopper.half_width(low);
  if constexpr (D == 2)
    return BoxRegion<2>{{-half, low}, {half, high}};
  else
    return CylinderRegion{half, low, high};
}

}  // namespace

template <int D>
void Centres<D>::update(const Topology& topology, const State& state) {
  const std::size_t n = static_cast<std::size_t>(topology.particles()) * D;
  position.resize(n);
  velocity.resize(n);
  for (Index m = 0; m < topology.particles(); ++m) {
    point<D>(position.data(), m) = mean_of_points<D>(state.x().data(), topology, m);
    point<D>(velocity.data(), m) = mean_of_points<D>(state.v().data(), topology, m);
  }
}

std::vector<Real> profile_heights() {
  std::vector<Real> heights(61);
  for (std::size_t k = 0; k < heights.size(); ++k) heights[k] = 0.5 * static_cast<Real>(k);
  return heights;
}

template <int D>
Sample<D> take_sample(ParticleSystem<D>& system, const State& state, const Hopper& hopper, const FlowCount& flow,
                      Real dt) {
  const Topology& topology = system.topology();
  const StateView<D> view = system.view(state.x().data(), state.v().data());
  Centres<D> centres;
  centres.update(topology, state);

  Sample<D> sample;
  Real kinetic = 0, weight_energy = 0, top = 0;
  for (Index i = 0; i < topology.points(); ++i) {
    kinetic += topology.mass[i] / 2 * view.velocity(i).squaredNorm();
    weight_energy += topology.mass[i] * view.position(i)[D - 1];
  }
  for (Index m = 0; m < topology.particles(); ++m) {
    const Real height = point<D>(centres.position.data(), m)[D - 1];
    if (!topology.active[m] || !(height > 0)) continue;
    ++sample.in_hopper;
    top = std::max(top, height);
    sample.max_speed = std::max(sample.max_speed, point<D>(centres.velocity.data(), m).norm());
  }

  std::vector<std::pair<Index, Index>> touching;
  system.field().for_each_contact(view, [&](const Contact<D>& c) {
    touching.push_back(std::minmax(c.first, c.second));
    if (c.overlap <= sample.max_overlap) return;
    sample.max_overlap = c.overlap;
    sample.first = c.first;
    sample.second = c.second;
  });
  std::sort(touching.begin(), touching.end());
  const auto pairs = std::unique(touching.begin(), touching.end()) - touching.begin();

  const std::vector<Real> heights = profile_heights();
  std::vector<Real> momentum(heights.size()), weight(heights.size()), buffer;
  add_axis_profile<D>(heights, 1, centres.position, centres.velocity, topology.active, momentum, weight);

  const Real potential = system.field().energy(view) - weight_energy;

  sample.row = {
      {"time", state.t},
      {"crossed_count", static_cast<Real>(flow.crossed)},
      {"crossed_area", flow.area},
      {"in_hopper", static_cast<Real>(sample.in_hopper)},
      {"kinetic_energy", kinetic},
      {"potential_energy", potential},
      {"contact_pairs", static_cast<Real>(pairs)},
      {"drag_force", mean_force<D>("drag", system, view, centres.position, buffer)},
      {"friction_force", mean_force<D>("friction", system, view, centres.position, buffer)},
      {"orifice_density", number_density<D>(orifice_region<D>(hopper.orifice), centres.position, topology.active)},
      {"bulk_fraction",
       packing_fraction<D>(bulk_region<D>(hopper, top), centres.position, topology.a0, topology.active)},
      {"top_height", top},
      {"max_speed", sample.max_speed},
      {"max_overlap", sample.max_overlap},
      {"dt", dt},
      {"profile_momentum", std::span<const Real>(momentum)},
      {"profile_weight", std::span<const Real>(weight)}};
  return sample;
}

template <int D>
FrameData<D>::FrameData(ParticleSystem<D>& system, const State& state) {
  const Topology& topology = system.topology();
  const StateView<D> view = system.view(state.x().data(), state.v().data());
  centres_.update(topology, state);
  contact_count_.assign(topology.particles(), 0);
  wall_force_.assign(static_cast<std::size_t>(system.walls().size()) * D, 0);
  system.field().add_wall_forces(view, wall_force_.data());
  FrameContacts& contacts = frame.contacts;
  system.field().for_each_contact(view, [&](const Contact<D>& c) {
    ++contact_count_[c.first];
    ++contact_count_[c.second];
    contacts.particles.insert(contacts.particles.end(), {c.first, c.second});
    for (int k = 0; k < D; ++k) {
      contacts.position.push_back(c.position[k]);
      contacts.normal.push_back(c.normal[k]);
      contacts.force.push_back(c.force[k]);
    }
    contacts.overlap.push_back(c.overlap);
  });
  if (topology.deformable())
    for (Index m = 0; m < topology.particles(); ++m) {
      area_.push_back(polygon_area(state.x().data(), topology, m));
      perimeter_.push_back(polygon_perimeter(state.x().data(), topology, m));
    }
  frame.time = state.t;
  frame.step = state.step;
  frame.positions = state.x();
  frame.velocities = state.v();
  frame.centres = centres_.position;
  frame.active = topology.active;
  frame.contact_count = contact_count_;
  frame.area = area_;
  frame.perimeter = perimeter_;
  frame.wall_force = wall_force_;
}

nlohmann::ordered_json evaluate_series(const Series& series, const HopperOptions& options, const Topology& topology) {
  nlohmann::ordered_json result;
  const auto column = [&](const char* name) { return std::span<const Real>(series.at(name).values); };
  const std::span<const Real> time = column("time");
  const std::string d = std::to_string(options.dim);
  if (options.flow == FlowKind::discharge) {
    const std::span<const Real> in_hopper = column("in_hopper");
    const DischargeFit fit = fit_discharge(time, std::vector<std::int64_t>(in_hopper.begin(), in_hopper.end()));
    result["c0"] = quantity(fit.c0, fit.error, "1/t0");
    result["total_time"] = quantity(fit.total_time, BlockAverage::unknown, "t0");
    result["left_in_hopper"] = in_hopper.empty() ? 0 : in_hopper.back();
    return result;
  }
  if (time.size() < 2) return result;

  const std::vector<Real> rate = rate_series(time, column("crossed_area"));
  const std::array<NamedSeries, 2> judged{NamedSeries{"flow rate", rate},
                                          NamedSeries{"kinetic energy", column("kinetic_energy").subspan(1)}};
  const SteadyState steady = steady_state(time.subspan(1), judged);
  const std::size_t from = steady.index + 1, rows = time.size();
  const auto average = [&](const char* name) { return block_average(column(name).subspan(from)); };
  const auto report = [&](const BlockAverage& b, std::string_view unit, Real factor = 1) {
    return quantity(b.mean * factor, b.error * factor, unit);
  };

  const FlowRate q = flow_rate(time.subspan(from), column("crossed_area").subspan(from));
  const std::string rate_unit = "sigma_avg^" + d + "/t0";
  result["steady"] = steady.steady;
  result["steady_start"] = quantity(time[from], BlockAverage::unknown, "t0");
  result["steady_explanation"] = steady.explanation;
  result["Q"] = quantity(q.value, q.error, rate_unit);
  result["Q_correlation_time"] = quantity(q.correlation_time, BlockAverage::unknown, "t0");

  // Q' = Q a_eff/a_avg, a_eff = 1/ρ_n in the region at the orifice [H App. B].
  const BlockAverage density = average("orifice_density");
  Real a_avg = 0;
  for (const Real a : topology.a0) a_avg += a / topology.particles();
  const Real factor = 1 / (density.mean * a_avg);
  result["Q_corrected"] =
      quantity(q.value * factor, factor * std::hypot(q.error, q.value * density.error / density.mean), rate_unit);
  result["orifice_density"] = report(density, "sigma_avg^-" + d);
  result["bulk_fraction"] = report(average("bulk_fraction"), "");
  result["contacts_per_particle"] = report(average("contact_pairs"), "", 2.0 / topology.particles());
  result["top_height"] = report(average("top_height"), "sigma_avg");
  result["max_overlap"] = report(average("max_overlap"), "");
  if (options.mu > 0 && options.zeta > 0)
    result["drag_friction_ratio"] =
        report(block_ratio(column("drag_force").subspan(from), column("friction_force").subspan(from)), "");

  const std::size_t heights = series.at("profile_weight").width;
  const auto rows_of = [&](const char* name) { return column(name).subspan(from * heights, (rows - from) * heights); };
  const std::vector<BlockAverage> profile =
      axis_profile(rows_of("profile_momentum"), rows_of("profile_weight"), heights);
  result["orifice_velocity"] = report(profile.front(), "sigma_avg/t0");
  return result;
}

template struct Centres<2>;
template struct Centres<3>;
template Sample<2> take_sample(ParticleSystem<2>&, const State&, const Hopper&, const FlowCount&, Real);
template Sample<3> take_sample(ParticleSystem<3>&, const State&, const Hopper&, const FlowCount&, Real);
template class FrameData<2>;
template class FrameData<3>;

}  // namespace pliant
