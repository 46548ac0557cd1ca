#include <pliant/analysis/flow_precision.h>

#include <algorithm>
#include <array>
#include <cmath>

#include <pliant/base/errors.h>

namespace pliant {

SteadyFlow steady_flow(std::span<const Real> time, std::span<const Real> crossed_area,
                       std::span<const Real> kinetic_energy) {
  if (time.size() < 2) throw InputError("steady flow rate: {} samples; give at least two", time.size());
  const std::vector<Real> rate = rate_series(time, crossed_area);
  const std::array<NamedSeries, 2> judged{NamedSeries{"flow rate", rate},
                                          NamedSeries{"kinetic energy", kinetic_energy.subspan(1)}};
  SteadyFlow flow;
  flow.steady = steady_state(time.subspan(1), judged);
  flow.from = flow.steady.index + 1;
  flow.rate = flow_rate(time.subspan(flow.from), crossed_area.subspan(flow.from));
  return flow;
}

bool FlowPrecision::add(Real time, Real crossed, Real crossed_area, Real kinetic_energy) {
  time_.push_back(time);
  crossed_.push_back(crossed);
  area_.push_back(crossed_area);
  energy_.push_back(kinetic_energy);
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
    // The mean of the rest differs from that of all by error · √share if there is no drift.
    const Real by_chance = 2 * flow.rate.error * std::sqrt(share);
    if (std::abs(late - flow.rate.value) > std::max(by_chance, max_drift * asked_ * flow.rate.value)) return true;
  }
  return false;
}

bool FlowPrecision::judge() {
  const SteadyFlow flow = steady_flow(time_, area_, energy_);
  const BlockAverage& blocks = flow.rate.blocks;
  rate_ = flow.rate.value;
  error_ = flow.rate.error / flow.rate.value;
  // Particles that come evenly are anticorrelated: more than one independent sample per sample, which counts as one.
  const Real independent = static_cast<Real>(blocks.samples) / std::max(Real{1}, blocks.inefficiency);
  return flow.steady.steady && error_ <= asked_ && independent >= min_independent && blocks.blocks >= min_blocks &&
         crossed_.back() - crossed_[flow.from] >= min_crossings && !drifts(flow);
}

}  // namespace pliant
