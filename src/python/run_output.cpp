#include <pliant/python/run_output.h>

#include <unistd.h>

#include <algorithm>
#include <cmath>

#include <pliant/geometry/container.h>
#include <pliant/io/summary.h>
#include <pliant/run/folder.h>
#include <pliant/run/frame_data.h>

namespace pliant::python {
namespace {

constexpr const char* scenario = "simulation";

std::optional<Schedule> schedule(std::optional<Real> interval, const char* name) {
  if (!interval) return {};
  if (!(*interval > 0 && std::isfinite(*interval)))
    throw InputError("{} is {}, but must be positive and finite", name, *interval);
  return Schedule(*interval);
}

}  // namespace

template <int D>
RunOutput<D>::RunOutput(const std::filesystem::path& folder, std::optional<Real> frame_interval,
                        std::optional<Real> sample_interval, const Topology& all, const std::string& model,
                        const Options& options, Simulation<D>& simulation)
    : process_(::getpid()),
      framing_(schedule(frame_interval, "frame_interval")),
      sampling_(schedule(sample_interval, "sample_interval")),
      model_(model) {
  if (folder.empty()) throw InputError("output is empty; give the name of a folder");
  const State& state = simulation.state();
  Vec<D> low = point<D>(state.x().data(), 0), high = low;
  for (Index i = 0; i < all.points(); ++i) {
    low = low.cwiseMin(Vec<D>(point<D>(state.x().data(), i)));
    high = high.cwiseMax(Vec<D>(point<D>(state.x().data(), i)));
  }
  middle_ = (low + high) / 2;
  extent_ = (high - low).maxCoeff() / 2 + 2 * *std::ranges::max_element(all.sigma);
  const Walls<D>& walls = simulation.particles().walls();
  first_walls_ = drawn_walls(walls, state.t);
  RunGeometry geometry{.kind = scenario, .segments = first_walls_, .attributes = {}};
  geometry.radius.assign(static_cast<std::size_t>(walls.size()), 0);
  for (Index k = 0; k < static_cast<Index>(walls.segments().size()); ++k)
    geometry.radius[static_cast<std::size_t>(walls.wall_of_part(k))] =
        walls.segments()[static_cast<std::size_t>(k)].radius;
  if (const Box<D>& box = simulation.particles().box(); !box.open())
    for (const Vec<D>& row : {box.origin(), box.length()})
      geometry.box.insert(geometry.box.end(), row.begin(), row.end());
  lock_ = FolderLock(folder);
  writer_.emplace(RunWriter::create(folder, make_manifest(scenario, model, D, 0, options), all, geometry));
  write_sample(simulation);
  write_frame(simulation);
}

template <int D>
std::vector<Real> RunOutput<D>::drawn_walls(const Walls<D>& walls, Real t) const {
  std::vector<Real> all(static_cast<std::size_t>(walls.size()) * 4, 0);
  const auto set = [&](Index part, const Vec<2>& a, const Vec<2>& b) {
    const auto at = all.begin() + 4 * static_cast<std::ptrdiff_t>(walls.wall_of_part(part));
    std::copy_n(a.begin(), 2, at);
    std::copy_n(b.begin(), 2, at + 2);
  };
  const auto segments = static_cast<Index>(walls.segments().size());
  for (Index k = 0; k < segments; ++k) {
    WallSegment wall = walls.segments()[static_cast<std::size_t>(k)];
    if constexpr (D == 2) wall = walls.segment(k, t);
    const Real most = 2 * extent_ + (in_plane<D>(middle_) - wall.origin).norm();
    set(k, wall.origin, std::isfinite(wall.length) ? wall.end() : Vec<2>(wall.origin + most * wall.direction));
  }
  for (Index part = segments; part < walls.part_count(); ++part)
    if (const auto solid = walls.solid(part, t)) {
      // The line of the plane next to the particles; in 3D in the plane (ρ, z), exact for a horizontal plane.
      const Vec<D> foot = middle_ - (middle_ - solid->place).dot(solid->out) * solid->out;
      if constexpr (D == 2)
        set(part, foot - extent_ * solid->along, foot + extent_ * solid->along);
      else
        set(part, Vec<2>(0, foot[2]), Vec<2>(extent_, foot[2]));
    }
  return all;
}

template <int D>
bool RunOutput<D>::owned() const {
  return process_ == ::getpid();
}

template <int D>
void RunOutput<D>::follow(Simulation<D>& simulation) {
  const Real t = simulation.state().t;
  if (sampling_ && sampling_->due(t)) write_sample(simulation);
  if (framing_ && framing_->due(t)) write_frame(simulation);
}

template <int D>
void RunOutput<D>::write_frame(Simulation<D>& simulation) {
  const State& state = simulation.state();
  last_frame_ = state.t;
  if (framing_) framing_->done(state.t);
  FrameData<D> data(simulation.particles(), state);
  const std::vector<Real> walls = drawn_walls(simulation.particles().walls(), state.t);
  if (walls != first_walls_) data.frame.wall_segments = walls;
  writer_->write_frame(data.frame);
}

template <int D>
void RunOutput<D>::write_sample(Simulation<D>& simulation) {
  const StateView<D> s = simulation.view();
  last_sample_ = s.t;
  if (sampling_) sampling_->done(s.t);
  const IntegratorStatistics& taken = simulation.integrator().statistics();
  Real kinetic = 0;
  for (Index i = 0; i < s.topology.owned_points(); ++i) kinetic += s.kinetic_energy(i);
  Real energy = kinetic;
  std::vector<SeriesValue> row{{"time", s.t},
                               {"dt", taken.steps > 0 ? taken.last_dt : simulation.integrator().next_dt()},
                               {"kinetic_energy", kinetic}};
  for (const TermReport& term : simulation.particles().field().report(s))
    if (term.is_energy) {
      row.emplace_back(fmt::format("{}_energy", term.name), term.energy);
      energy += term.energy;
    }
  row.emplace_back("energy", energy);
  writer_->add_sample(row);
}

template <int D>
void RunOutput<D>::finish(const Options& options, std::int64_t force_evaluations, const std::string& failure,
                          Simulation<D>& simulation) {
  const State& state = simulation.state();
  const auto finite = [](std::span<const Real> values) {
    return std::ranges::all_of(values, [](Real a) { return std::isfinite(a); });
  };
  if (finite(state.x()) && finite(state.v())) {
    if (last_sample_ != state.t) write_sample(simulation);
    if (last_frame_ != state.t) write_frame(simulation);
  }
  nlohmann::ordered_json s = summary_head(scenario, model_, failure.empty() ? "done" : "failed", "close", options);
  if (!failure.empty()) s["message"] = failure;
  s["particles"] = simulation.topology().owned();
  s["t"] = state.t;
  s["integrator"] = simulation.integrator().name();
  s["dt"] = simulation.integrator().next_dt();
  s["steps"] = state.step;
  s["force_evaluations"] = force_evaluations;
  writer_->flush();
  write_summary(folder(), s);
  writer_->close();
}

template class RunOutput<2>;
template class RunOutput<3>;

}  // namespace pliant::python
