#include <pliant/analysis/flow_precision.h>

#include <algorithm>
#include <array>
#include <cmath>

#include <pliant/base/errors.h>

namespace pliant {

SteadyFlow steady_flow(const FlowColumns& columns) {
  const std::span<const Real> time = columns.time;
  if (time.size() < 2) throw InputError("steady flow rate: {} samples; give at least two", time.size());
  constexpr Real tolerance = 0.05;
  const std::vector<Real> rate = rate_series(time, columns.crossed_area);
  const std::array<NamedSeries, 4> judged{
      NamedSeries{.name = "flow rate", .values = rate},
      NamedSeries{"kinetic energy", columns.kinetic_energy.subspan(1), tolerance},
      NamedSeries{"height of the filling", columns.top_height.subspan(1), tolerance, false},
      NamedSeries{"bulk fraction", columns.bulk_fraction.subspan(1), tolerance, false}};
  SteadyFlow flow;
  flow.steady = steady_state(time.subspan(1), judged);
  flow.from = flow.steady.index + 1;
  flow.rate = flow_rate(time.subspan(flow.from), columns.crossed_area.subspan(flow.from));
  if (flow.steady.steady && flow.rate.value == 0)
    flow.steady = {flow.steady.index, flow.steady.time, false,
                   fmt::format("not steady: nothing has crossed since t = {:.6g}", flow.steady.time)};
  if (!flow.steady.steady) flow.rate.error = BlockAverage::unknown;
  return flow;
}

bool FlowPrecision::add(const FlowSample& sample) {
  time_.push_back(sample.time);
  crossed_.push_back(sample.crossed);
  area_.push_back(sample.crossed_area);
  energy_.push_back(sample.kinetic_energy);
  top_.push_back(sample.top_height);
  fraction_.push_back(sample.bulk_fraction);
  if (time_.size() < next_) return false;
  next_ += (next_ + 19) / 20;
  const bool held_before = held_;
  held_ = judge();
  return held_ && held_before;
}

bool FlowPrecision::drifts(const SteadyFlow& flow) const {
  const std::size_t last = time_.size() - 1;
  for (const std::size_t part : {2, 4, 8, 16}) {
    const std::size_t cut = flow.from + (last - flow.from) / part;
    const Real late = (area_[last] - area_[cut]) / (time_[last] - time_[cut]);
    const Real share = (time_[cut] - time_[flow.from]) / (time_[last] - time_[cut]);
    // Without drift, the mean of the rest differs from the mean of all samples by error · √share.
    const Real by_chance = 2 * flow.rate.error * std::sqrt(share);
    if (std::abs(late - flow.rate.value) > std::max(by_chance, max_drift * asked_ * flow.rate.value)) return true;
  }
  return false;
}

bool FlowPrecision::judge() {
  const SteadyFlow flow = steady_flow({time_, area_, energy_, top_, fraction_});
  const BlockAverage& blocks = flow.rate.blocks;
  rate_ = flow.rate.value;
  error_ = flow.rate.error / flow.rate.value;
  // Particles that come evenly are anticorrelated: more than one independent sample per sample, which counts as one.
  const Real independent = static_cast<Real>(blocks.samples) / std::max(Real{1}, blocks.inefficiency);
  return flow.steady.steady && error_ <= asked_ && independent >= min_independent && blocks.blocks >= min_blocks &&
         crossed_.back() - crossed_[flow.from] >= min_crossings && !drifts(flow);
}

}  // namespace pliant
