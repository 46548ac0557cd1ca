#include <pliant/python/run_output.h>

#include <unistd.h>

#include <algorithm>
#include <cmath>

#include <pliant/geometry/container.h>
#include <pliant/io/crc32.h>
#include <pliant/io/summary.h>
#include <pliant/run/folder.h>
#include <pliant/run/frame_data.h>
#include <pliant/run/heat.h>

namespace pliant::python {
namespace {

/// Checksum of the numbers in a frame, without its time.
std::uint32_t crc32_of(const Frame& frame, int dim) {
  std::uint32_t crc = 0;
  for (const std::span<const Real> values :
       {frame.positions, frame.velocities, frame.angles, frame.spins, frame.wall_force, frame.wall_segments, frame.box})
    crc = pliant::crc32_of(std::as_bytes(values), crc);
  for (const FrameContacts* contacts : {&frame.contacts, &frame.wall_contacts})
    for (std::uint64_t k = 0; k < contacts->count; ++k)
      crc = pliant::crc32_of(std::as_bytes(std::span(contacts->force[k], static_cast<std::size_t>(dim))), crc);
  return crc;
}

std::optional<Schedule> schedule(std::optional<Real> interval) {
  return interval ? std::optional<Schedule>(*interval) : std::nullopt;
}

}  // namespace

template <int D>
Region<D>::Region(const Simulation<D>& simulation) {
  const State& state = simulation.state();
  const Topology& topology = simulation.topology();
  Vec<D> low = point<D>(state.x().data(), 0), high = low;
  for (Index i = 0; i < topology.owned_points(); ++i) {
    low = low.cwiseMin(Vec<D>(point<D>(state.x().data(), i)));
    high = high.cwiseMax(Vec<D>(point<D>(state.x().data(), i)));
  }
  middle = (low + high) / 2;
  extent = (high - low).maxCoeff() / 2 + 2 * *std::ranges::max_element(topology.sigma);
}

template <int D>
std::vector<Real> Region<D>::drawn(const Walls<D>& walls, Real t) const {
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
    const Real most = 2 * extent + (in_plane<D>(middle) - wall.origin).norm();
    set(k, wall.origin, std::isfinite(wall.length) ? wall.end() : Vec<2>(wall.origin + most * wall.direction));
  }
  for (Index part = segments; part < walls.part_count(); ++part)
    if (const auto solid = walls.solid(part, t)) {
      // The line of the plane next to the particles; in 3D in the plane (ρ, z), exact for a horizontal plane.
      const Vec<D> foot = middle - (middle - solid->place).dot(solid->out) * solid->out;
      if constexpr (D == 2)
        set(part, foot - extent * solid->along, foot + extent * solid->along);
      else
        set(part, Vec<2>(0, foot[2]), Vec<2>(extent, foot[2]));
    }
  return all;
}

template <int D>
std::vector<Real> wall_radii(const Walls<D>& walls) {
  std::vector<Real> all(static_cast<std::size_t>(walls.size()), 0);
  for (Index k = 0; k < static_cast<Index>(walls.segments().size()); ++k)
    all[static_cast<std::size_t>(walls.wall_of_part(k))] = walls.segments()[static_cast<std::size_t>(k)].radius;
  return all;
}

void OutputIntervals::check() const {
  for (const auto& [value, name] : {std::pair(frames, "frame_interval"), std::pair(samples, "sample_interval"),
                                    std::pair(std::optional(checkpoints), "checkpoint_interval")})
    if (value && !(*value > 0 && std::isfinite(*value)))
      throw InputError("{} is {}, but must be positive and finite", name, *value);
}

template <int D>
RunOutput<D>::RunOutput(FolderLock lock, const OutputIntervals& intervals, std::string model)
    : process_(::getpid()),
      lock_(std::move(lock)),
      framing_(schedule(intervals.frames)),
      sampling_(schedule(intervals.samples)),
      between_saves_(intervals.checkpoints),
      model_(std::move(model)) {}

template <int D>
RunOutput<D>::RunOutput(const std::filesystem::path& folder, const OutputIntervals& intervals, const Topology& all,
                        const std::string& model, const Options& options, Simulation<D>& simulation,
                        EnergyAudit<D>& audit)
    : RunOutput(FolderLock(), intervals, model) {
  if (folder.empty()) throw InputError("output is empty; give the name of a folder");
  region_ = Region<D>(simulation);
  const Walls<D>& walls = simulation.particles().walls();
  first_walls_ = region_.drawn(walls, simulation.state().t);
  RunGeometry geometry{.kind = python_scenario, .segments = first_walls_, .attributes = {}};
  geometry.radius = wall_radii(walls);
  if (const Box<D>& box = simulation.particles().box(); !box.open())
    for (const Vec<D>& row : {box.origin(), box.length()})
      geometry.box.insert(geometry.box.end(), row.begin(), row.end());
  lock_ = FolderLock(folder);
  writer_.emplace(RunWriter::create(folder, make_manifest(python_scenario, model, D, 0, options), all, geometry));
  checkpoints_.emplace(folder);
  write_sample(simulation, audit);
  write_frame(simulation);
}

template <int D>
void RunOutput<D>::go_on(const std::filesystem::path& checkpoint, const Topology& all) {
  const std::filesystem::path folder = checkpoint.parent_path();
  const auto count = [](std::int64_t n) { return static_cast<std::uint64_t>(n); };
  writer_.emplace(RunWriter::append(folder, all, count(restored_samples_), count(restored_frames_)));
  writer_->drop_later_frames();
  drop_summary(folder);
  checkpoints_.emplace(folder, checkpoint);
}

template <int D>
bool RunOutput<D>::save_due() const {
  return std::chrono::steady_clock::now() - last_save_ >= between_saves_;
}

template <int D>
void RunOutput<D>::save(const State& state, const std::map<std::string, std::string>& texts,
                        const std::function<void(Archive&)>& visit) {
  writer_->flush();
  checkpoints_->begin(state.t, state.step);
  const Ranks ranks;
  SharedCheckpoint to(&*checkpoints_, ranks);
  Archive archive(to);
  visit(archive);
  to.add_text("scenario", python_scenario);
  for (const auto& [name, text] : texts) to.add_text(name, text);
  checkpoints_->finish();
  save_asked_ = false;
  last_save_ = std::chrono::steady_clock::now();
}

template <int D>
void RunOutput<D>::visit(Archive& a) {
  if (!a.reads()) {
    restored_samples_ = static_cast<std::int64_t>(writer_->samples());
    restored_frames_ = static_cast<std::int64_t>(writer_->frames());
  }
  a.number("samples", restored_samples_, 1);
  a.number("frames", restored_frames_, 1);
  a.number("last_frame", last_frame_, -1, a.t());
  a.number("last_sample", last_sample_, -1, a.t());
  for (const auto& [schedule, name] :
       {std::pair(&sampling_, "last_sample_at"), std::pair(&framing_, "last_frame_at")}) {
    if (!*schedule) continue;
    if (a.reads() && !a.from().reals.contains(name))
      (*schedule)->done(a.t());  // there was no interval before
    else
      (*schedule)->visit(a, name);
  }
  std::vector<Real> region(region_.middle.begin(), region_.middle.end());
  region.push_back(region_.extent);
  a.array("region", region, D + 1);
  std::copy_n(region.begin(), D, region_.middle.begin());
  region_.extent = region.back();
  a.array("first_walls", first_walls_, a.reads() ? a.from().length("first_walls") : 0);
}

template <int D>
bool RunOutput<D>::owned() const {
  return process_ == ::getpid();
}

template <int D>
void RunOutput<D>::follow(Simulation<D>& simulation, EnergyAudit<D>& audit) {
  const Real t = simulation.state().t;
  if (sampling_ && sampling_->due(t)) write_sample(simulation, audit);
  if (framing_ && framing_->due(t)) write_frame(simulation);
}

template <int D>
void RunOutput<D>::write_frame(Simulation<D>& simulation) {
  simulation.find_velocities();
  const State& state = simulation.state();
  const bool again = last_frame_ == state.t;
  last_frame_ = state.t;
  if (framing_) framing_->done(state.t);
  FrameData<D> data(simulation.particles(), state);
  const std::vector<Real> walls = region_.drawn(simulation.particles().walls(), state.t);
  if (walls != first_walls_) data.frame.wall_segments = walls;
  const auto before = std::exchange(frame_crc_, crc32_of(data.frame, D));
  if (again && before == frame_crc_) return;
  writer_->write_frame(data.frame);
}

template <int D>
void RunOutput<D>::write_sample(Simulation<D>& simulation, EnergyAudit<D>& audit) {
  const StateView<D> s = simulation.view();
  last_sample_ = s.t;
  if (sampling_) sampling_->done(s.t);
  const IntegratorStatistics& taken = simulation.integrator().statistics();
  std::vector<SeriesValue> row{{"time", s.t},
                               {"dt", taken.steps > 0 ? taken.last_dt : simulation.integrator().next_dt()}};
  Real energy = 0;
  if (simulation.overdamped() == nullptr) {
    energy = kinetic_energy(s);
    row.emplace_back("kinetic_energy", energy);
  }
  for (const TermReport& term : simulation.particles().field().report(s))
    if (term.has_energy) {
      row.emplace_back(fmt::format("{}_energy", term.name), term.energy);
      energy += term.energy;
    }
  row.emplace_back("energy", energy);
  add_budget(row, audit, simulation);
  std::vector<Real> numbers;
  for (const SeriesValue& value : row) numbers.insert(numbers.end(), value.values.begin(), value.values.end());
  if (numbers == std::exchange(sample_row_, numbers)) return;
  writer_->add_sample(row);
}

template <int D>
void RunOutput<D>::finish(const Options& options, std::int64_t force_evaluations, const std::string& failure,
                          Simulation<D>& simulation, EnergyAudit<D>& audit) {
  const State& state = simulation.state();
  const auto finite = [](std::span<const Real> values) {
    return std::ranges::all_of(values, [](Real a) { return std::isfinite(a); });
  };
  if (finite(state.x()) && finite(state.v())) {
    if (last_sample_ != state.t) write_sample(simulation, audit);
    if (last_frame_ != state.t) write_frame(simulation);
  }
  const std::string status = !failure.empty() ? "failed" : !interruption_.empty() ? "stopped" : "done";
  nlohmann::ordered_json s = summary_head(python_scenario, model_, status, "close", options);
  if (status != "done") s["message"] = failure.empty() ? interruption_ : failure;
  s["particles"] = simulation.topology().owned();
  s["t"] = state.t;
  s["integrator"] = simulation.integrator().name();
  s["dt"] = simulation.integrator().next_dt();
  s["steps"] = state.step;
  s["force_evaluations"] = force_evaluations;
  if (failure.empty()) s["energy_audit"] = audit.budget().json();
  writer_->flush();
  write_summary(folder(), s);
  writer_->close();
}

template struct Region<2>;
template struct Region<3>;
template std::vector<Real> wall_radii(const Walls<2>&);
template std::vector<Real> wall_radii(const Walls<3>&);
template class RunOutput<2>;
template class RunOutput<3>;

}  // namespace pliant::python
