#include <pliant/scenarios/hopper_measurements.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include <pliant/analysis/block_average.h>
#include <pliant/analysis/discharge.h>
#include <pliant/analysis/flow_precision.h>
#include <pliant/analysis/profile.h>
#include <pliant/analysis/region.h>
#include <pliant/io/summary.h>
#include <pliant/model/polygon.h>

namespace pliant {
namespace {

/// Adds the magnitude of the force of one term on the particles above the orifice line.
template <int D>
Real sum_of_forces(std::string_view term, const ParticleSystem<D>& system, const StateView<D>& view,
                   const std::vector<Real>& centres, std::vector<Real>& buffer) {
  const Topology& topology = system.topology();
  buffer.resize(static_cast<std::size_t>(topology.points()) * D);
  system.field().force_of(term, view, buffer.data());
  Real sum = 0;
  for (Index m = 0; m < topology.owned(); ++m) {
    if (!topology.active[m] || !(point<D>(centres.data(), m)[D - 1] > 0)) continue;
    sum += (mean_of_points<D>(buffer.data(), topology, m) * topology.points_of(m)).norm();
  }
  return sum;
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

/// Values per particle or point, gathered from all ranks into the order of the ids, on the root.
class NaturalOrder {
 public:
  NaturalOrder(const Ranks& ranks, const Topology& topology) : ranks_(ranks), topology_(topology) {
    std::vector<Index> points;
    for (Index m = 0; m < topology.owned(); ++m) points.push_back(topology.points_of(m));
    id_ = ranks.gather(std::span(topology.id).first(topology.owned()));
    points_ = ranks.gather(points);
    offset_.assign(id_.size() + 1, 0);
    for (std::size_t k = 0; k < id_.size(); ++k) offset_[id_[k] + 1] = points_[k];
    for (std::size_t m = 0; m < id_.size(); ++m) offset_[m + 1] += offset_[m];
  }

  /// values [owned particles · width]
  template <class T>
  std::vector<T> particles(std::span<const T> values, int width = 1) const {
    const std::vector<T> all = ranks_.gather(values.first(static_cast<std::size_t>(topology_.owned()) * width));
    std::vector<T> ordered(all.size());
    for (std::size_t k = 0; k < id_.size(); ++k)
      std::copy_n(&all[k * width], width, &ordered[static_cast<std::size_t>(id_[k]) * width]);
    return ordered;
  }
  /// values [owned points · width]
  std::vector<Real> points(std::span<const Real> values, int width) const {
    const std::vector<Real> all =
        ranks_.gather(values.first(static_cast<std::size_t>(topology_.owned_points()) * width));
    std::vector<Real> ordered(all.size());
    std::size_t from = 0;
    for (std::size_t k = 0; k < id_.size(); ++k) {
      const std::size_t count = static_cast<std::size_t>(points_[k]) * width;
      std::copy_n(&all[from], count, &ordered[static_cast<std::size_t>(offset_[id_[k]]) * width]);
      from += count;
    }
    return ordered;
  }

 private:
  const Ranks& ranks_;
  const Topology& topology_;
  std::vector<Index> id_, points_, offset_;
};

}  // namespace

template <int D>
void Centres<D>::update(const Topology& topology, const State& state) {
  const std::size_t n = static_cast<std::size_t>(topology.owned()) * D;
  position.resize(n);
  velocity.resize(n);
  for (Index m = 0; m < topology.owned(); ++m) {
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

  const Ranks& ranks = system.ranks();
  const auto active = std::span(topology.active).first(topology.owned());

  Sample<D> sample;
  Real kinetic = 0, weight_energy = 0, top = 0, in_hopper = 0;
  for (Index i = 0; i < topology.owned_points(); ++i) {
    kinetic += topology.mass(i) / 2 * view.velocity(i).squaredNorm();
    weight_energy += topology.mass(i) * view.position(i)[D - 1];
  }
  for (Index m = 0; m < topology.owned(); ++m) {
    const Real height = point<D>(centres.position.data(), m)[D - 1];
    if (!active[m] || !(height > 0)) continue;
    ++in_hopper;
    top = std::max(top, height);
    sample.max_speed = std::max(sample.max_speed, point<D>(centres.velocity.data(), m).norm());
  }
  sample.max_speed = ranks.max(sample.max_speed);
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
  std::sort(touching.begin(), touching.end());
  const auto pairs = std::unique(touching.begin(), touching.end()) - touching.begin();
  for (const Deepest& d : ranks.all_gather(std::vector{deepest}))
    if (d.overlap > sample.max_overlap) {
      sample.max_overlap = d.overlap;
      sample.first = d.first;
      sample.second = d.second;
    }

  const std::vector<Real> heights = profile_heights();
  std::vector<Real> momentum(heights.size()), weight(heights.size()), buffer;
  add_axis_profile<D>(heights, 1, centres.position, centres.velocity, active, momentum, weight);
  ranks.sum(momentum);
  ranks.sum(weight);

  std::array sums{kinetic,
                  system.field().energy(view) - weight_energy,
                  in_hopper,
                  static_cast<Real>(pairs),
                  sum_of_forces<D>("drag", system, view, centres.position, buffer),
                  sum_of_forces<D>("friction", system, view, centres.position, buffer),
                  number_density<D>(orifice_region<D>(hopper.orifice), centres.position, active),
                  packing_fraction<D>(bulk_region<D>(hopper, top), centres.position,
                                      std::span(topology.a0).first(topology.owned()), active),
                  static_cast<Real>(flow.crossed),
                  flow.area};
  ranks.sum(sums);
  const auto [kinetic_energy, potential_energy, above, contact_pairs, drag, friction, density, fraction, crossed,
              crossed_area] = sums;
  sample.kinetic_energy = kinetic_energy;
  sample.in_hopper = static_cast<Index>(above);
  sample.crossed = {static_cast<std::int64_t>(crossed), crossed_area};
  const Real each = above > 0 ? 1 / above : 0;

  sample.row = {{"time", state.t},
                {"crossed_count", crossed},
                {"crossed_area", crossed_area},
                {"in_hopper", above},
                {"kinetic_energy", kinetic_energy},
                {"potential_energy", potential_energy},
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

template <int D>
FrameData<D>::FrameData(ParticleSystem<D>& system, const State& state) {
  const StateView<D> view = system.view(state.x().data(), state.v().data(), state.t);
  const Topology& topology = system.topology();
  const Ranks& ranks = system.ranks();
  wall_force_.assign((static_cast<std::size_t>(system.walls().size()) + system.walls().solids().size()) * D, 0);
  system.field().add_wall_forces(view, wall_force_.data());
  ranks.sum(wall_force_);
  gather_particles(ranks, topology, state);

  // Room for every pair that is listed: growing would copy, and memory that nobody touches costs nothing.
  contacts_.reserve(static_cast<std::size_t>(system.neighbours().pairs()));
  system.field().for_each_contact(view, [&](const Contact<D>& c) {
    const Index first = topology.id[c.first], second = topology.id[c.second];
    const Real sign = first < second ? 1 : -1;
    ContactRecord<D>& r = contacts_.emplace_back();
    r.particles = {std::min(first, second), std::max(first, second)};
    r.overlap = c.overlap;
    for (int k = 0; k < D; ++k) {
      r.position[k] = c.position[k];
      r.normal[k] = sign * c.normal[k];
      r.force[k] = sign * c.force[k];
    }
  });
  contacts_ = ranks.gather(std::move(contacts_));
  std::sort(contacts_.begin(), contacts_.end(), [](const auto& a, const auto& b) {
    return std::tie(a.particles[0], a.particles[1], a.position) < std::tie(b.particles[0], b.particles[1], b.position);
  });
  contact_count_.assign(active_.size(), 0);
  for (const ContactRecord<D>& c : contacts_)
    for (const Index m : c.particles) ++contact_count_[m];

  frame.time = state.t;
  frame.step = state.step;
  frame.positions = positions_;
  frame.velocities = velocities_;
  frame.centres = centres_.empty() ? positions_ : centres_;
  frame.active = active_;
  frame.contact_count = contact_count_;
  frame.area = area_;
  frame.perimeter = perimeter_;
  frame.wall_force = wall_force_;
  if (contacts_.empty()) return;
  const ContactRecord<D>& c = contacts_.front();
  constexpr std::size_t stride = sizeof c;
  frame.contacts = {contacts_.size(),          {c.particles.data(), stride}, {c.position.data(), stride},
                    {c.normal.data(), stride}, {&c.overlap, stride},         {c.force.data(), stride}};
}

template <int D>
void FrameData<D>::gather_particles(const Ranks& ranks, const Topology& topology, const State& state) {
  const NaturalOrder order(ranks, topology);
  positions_ = order.points(state.x(), D);
  velocities_ = order.points(state.v(), D);
  active_ = order.particles<std::uint8_t>(topology.active);
  if (!ranks.any(topology.deformable())) return;
  Centres<D> centres;
  centres.update(topology, state);
  centres_ = order.particles<Real>(centres.position, D);
  for (Index m = 0; m < topology.owned(); ++m) {
    area_.push_back(polygon_area(state.x().data(), topology, m));
    perimeter_.push_back(polygon_perimeter(state.x().data(), topology, m));
  }
  area_ = order.particles<Real>(area_);
  perimeter_ = order.particles<Real>(perimeter_);
}

nlohmann::ordered_json evaluate_series(const Series& series, const HopperOptions& options, Real mean_size) {
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

  const SteadyFlow flow = steady_flow(time, column("crossed_area"), column("kinetic_energy"));
  const FlowRate& q = flow.rate;
  const std::size_t from = flow.from, rows = time.size();
  const auto average = [&](const char* name) { return block_average(column(name).subspan(from)); };
  const auto report = [&](const BlockAverage& b, std::string_view unit, Real factor = 1) {
    return quantity(b.mean * factor, b.error * factor, unit);
  };

  const std::string rate_unit = "sigma_avg^" + d + "/t0";
  result["steady"] = flow.steady.steady;
  result["steady_start"] = quantity(time[from], BlockAverage::unknown, "t0");
  result["steady_explanation"] = flow.steady.explanation;
  result["Q"] = quantity(q.value, q.error, rate_unit);
  result["Q_correlation_time"] = quantity(q.correlation_time, BlockAverage::unknown, "t0");

  // Q' = Q a_eff/a_avg, a_eff = 1/ρ_n in the region at the orifice [H App. B].
  const BlockAverage density = average("orifice_density");
  const Real factor = 1 / (density.mean * mean_size);
  result["Q_corrected"] =
      quantity(q.value * factor, factor * std::hypot(q.error, q.value * density.error / density.mean), rate_unit);
  result["orifice_density"] = report(density, "sigma_avg^-" + d);
  result["bulk_fraction"] = report(average("bulk_fraction"), "");
  result["contacts_per_particle"] = report(average("contact_pairs"), "", 2.0 / options.particles);
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
