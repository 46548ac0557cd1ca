#include <pliant/run/start_particles.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <span>
#include <string_view>
#include <utility>

#include <pliant/base/console.h>
#include <pliant/base/cure.h>
#include <pliant/base/errors.h>
#include <pliant/base/text.h>
#include <pliant/io/crc32.h>
#include <pliant/io/hdf5.h>
#include <pliant/model/polygon.h>
#include <pliant/model/surface_arrays.h>
#include <pliant/model/surface_crossing.h>
#include <pliant/run/overlap_check.h>
#include <pliant/run/start_table.h>
#include <pliant/run/stored_sizes.h>

namespace pliant {
namespace {

namespace fs = std::filesystem;

/// FILE.h5:FRAME or FILE.
struct StartName {
  std::string file;
  std::optional<std::uint64_t> frame;
  bool run() const { return file.ends_with(".h5"); }
};

StartName split(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  if (colon == text.npos || text.ends_with(".h5")) return {text, {}};
  const std::string file = text.substr(0, colon), number = text.substr(colon + 1);
  if (!file.ends_with(".h5") && !file.ends_with(".csv")) return {text, {}};
  if (file.ends_with(".csv"))
    throw InputError("-start {}: a table has no frames; leave out :{}", printable(text), number);
  std::uint64_t frame = 0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), frame);
  if (error != std::errc() || end != number.data() + number.size())
    throw InputError(
        "-start {}: \"{}\" is not the number of a frame; give one from 0, or leave it out for the last frame",
        printable(text), printable(number));
  return {file, frame};
}

std::span<const std::byte> bytes(const std::vector<Real>& values) { return std::as_bytes(std::span(values)); }

std::uint32_t crc32_of_numbers(const StartParticles& all) {
  const Topology& t = all.topology;
  std::uint32_t crc = crc32_of(std::as_bytes(std::span(t.offset)));
  for (const std::vector<Real>* values :
       {&t.diameter, &t.point_mass, &t.a0, &t.l0, &all.x, &all.v, &all.angles, &all.spins})
    crc = crc32_of(bytes(*values), crc);
  return crc;
}

/// The frame of an earlier run.
class StoredFrame {
 public:
  StoredFrame(const StartName& name, const StartNeeds& needs)
      : file_(open(name.file)), needs_(needs), name_(printable(name.file)) {
    for (const char* group : {"/manifest", "/topology", "/frames"})
      if (!file_.has_group(group)) throw InputError("{} has no {}: give the run.h5 of a run, or a table", name_, group);
    manifest_.emplace(file_.open_group("/manifest"));
    topology_.emplace(file_.open_group("/topology"));
    check_kind();
    const std::uint64_t frames = file_.open_group("/frames").links().size();
    if (frames == 0) throw InputError("{} has no frames; let its run write one, or give another file", name_);
    number_ = name.frame.value_or(frames - 1);
    if (number_ >= frames)
      throw InputError("{} has no frame {}: the file has {} frames, 0 to {}", name_, number_, frames, frames - 1);
    frame_.emplace(file_.open_group(fmt::format("/frames/{:06}", number_)));
  }

  StartParticles particles() {
    const auto offset = read<Index>(*topology_, "offset", {hdf5::any_length});
    const std::size_t n = offset.empty() ? 0 : offset.size() - 1;
    if (n == 0 || offset[0] != 0 || !std::ranges::is_sorted(offset, std::ranges::less_equal()))
      throw InputError("{}: the points of its particles are damaged; give another file", name_);
    const auto points = static_cast<std::uint64_t>(offset.back()), dim = static_cast<std::uint64_t>(needs_.dim);
    const auto sigma = read<Real>(*topology_, "sigma", {n}), a0 = read<Real>(*topology_, "a0", {n}),
               l0 = read<Real>(*topology_, "l0", {n}), mass = read<Real>(*topology_, "mass", {n}),
               diameter = read<Real>(*topology_, "diameter", {points});
    const auto active = read<std::uint8_t>(*frame_, "active", {n});
    const auto x = read<Real>(*frame_, "positions", {points, dim}), v = optional("velocities", {points, dim});
    const std::uint64_t turns = needs_.dim == 2 ? 1 : 3;
    const hdf5::Shape per_turn = turns == 1 ? hdf5::Shape{n} : hdf5::Shape{n, turns};
    const auto angles = needs_.rotates ? optional("angles", per_turn) : std::vector<Real>(),
               spins = needs_.rotates ? optional("spins", per_turn) : std::vector<Real>();
    StartParticles all;
    all.topology.dim = needs_.dim;
    const auto surfaces = std::make_shared<Surfaces>();
    SurfaceArrays arrays;
    if (needs_.dim == 3 && needs_.polygons) {
      arrays = read_surfaces(n);
      try {
        surfaces->kinds = arrays.kinds();
      } catch (const InputError& error) {
        throw InputError("{}: topology/surfaces: {}; give another file", name_, error.what());
      }
      all.topology.surfaces = surfaces;
    }
    const auto append = [](std::vector<Real>& to, const std::vector<Real>& from, std::size_t first, std::size_t count) {
      if (!from.empty())
        to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(first),
                  from.begin() + static_cast<std::ptrdiff_t>(first + count));
    };
    for (std::size_t m = 0; m < n; ++m) {
      if (active[m] == 0) continue;
      const Index count = offset[m + 1] - offset[m];
      const auto first = static_cast<std::size_t>(offset[m]);
      if ((count > 1) != needs_.polygons || count == 2 ||
          (needs_.dim == 3 && count > 1 && count != arrays.vertices_of_kind[static_cast<std::size_t>(arrays.kind[m])]))
        throw InputError("{}: particle {} has {} {}, but particles of the model {} {}; use another model", name_, m,
                         count, count == 1 ? "point" : "points", needs_.model,
                         !needs_.polygons  ? "have one point each"
                         : needs_.dim == 2 ? "are polygons"
                                           : "are closed surfaces of as many points as their faces have");
      for (const auto& [name, value] : {std::pair("diameter", diameter[first]), std::pair("mass", mass[m]),
                                        std::pair("a0", a0[m]), std::pair("l0", count > 1 ? l0[m] : 1)})
        if (!(value > 0 && std::isfinite(value)))
          throw InputError("{}: {} of particle {} is {:g}, but must be positive and finite", name_, name, m, value);
      if (count == 1)
        all.topology.add_soft(sigma[m], mass[m]);
      else if (needs_.dim == 3)
        surfaces->add_particle(all.topology, arrays.kind[m], a0[m], diameter[first], mass[m]);
      else
        all.topology.add_polygon(count, a0[m], l0[m], diameter[first], mass[m]);
      append(all.x, x, first * dim, static_cast<std::size_t>(count) * dim);
      append(all.v, v, first * dim, static_cast<std::size_t>(count) * dim);
      append(all.angles, angles, m * turns, turns);
      append(all.spins, spins, m * turns, turns);
    }
    if (all.topology.particles() == 0)
      throw InputError("{}: all particles of frame {} have left the run; give an earlier frame", name_, number_);
    all.source["frame"] = number_;
    return all;
  }

 private:
  static hdf5::File open(const std::string& file) {
    std::error_code none;
    if (!fs::exists(file, none)) throw InputError("-start {}: there is no such file", printable(file));
    return hdf5::File::open_read(file);
  }

  void check_kind() const {
    if (const auto dim = manifest_->integer_attribute("dim"); dim != needs_.dim)
      throw InputError("{} is of a run in {}D, but this run is {}D; use {}, or another file", name_, dim, needs_.dim,
                       cures({dim == 2 ? Cure::two_dimensions : Cure::three_dimensions}));
    const std::string model = manifest_->read_text("model");
    for (const auto& [one, other] : {std::pair("rough", "smooth"), std::pair("smooth", "rough")})
      if (model == one && needs_.model == other)
        throw InputError(
            "{} is of the model {}, whose particles have other vertices than the model {}; use the model {}", name_,
            model, needs_.model, model);
    if (!manifest_->has("datasets")) return;  // older versions
    const auto datasets = nlohmann::json::parse(manifest_->read_text("datasets"), nullptr, false);
    if (!datasets.is_object() || !datasets.contains("topology/sigma")) return;
    if (const std::string unit = datasets["topology/sigma"].value("units", ""); unit != needs_.length)
      throw InputError("{} has lengths in {}, but this run has lengths in {}; convert the frame to a table", name_,
                       unit, needs_.length);
  }

  /// Rest shapes of the surfaces of n particles.
  SurfaceArrays read_surfaces(std::size_t n) const {
    if (!topology_->has("surfaces"))
      throw InputError(
          "{} has no closed surfaces with rest shapes: their particles have another shape, or the file is of an older "
          "version; give the file of a newer run of rough or smooth particles",
          name_);
    const hdf5::Group group = topology_->open_group("surfaces");
    SurfaceArrays arrays;
    SurfaceArrays::for_each(
        arrays, [&]<class Number>(const std::string& name, std::vector<Number>& values, std::uint64_t width) {
          hdf5::Shape shape{name == "kind" ? n : hdf5::any_length};
          if (width > 1) shape.push_back(width);
          values = read<Number>(group, name, shape);
        });
    return arrays;
  }

  template <class T>
  std::vector<T> read(const hdf5::Group& group, const std::string& name, const hdf5::Shape& shape) const {
    group.check(name);
    return group.read<T>(name, shape);
  }
  std::vector<Real> optional(const std::string& name, const hdf5::Shape& shape) const {
    return frame_->has(name) ? read<Real>(*frame_, name, shape) : std::vector<Real>();
  }

  hdf5::File file_;
  const StartNeeds& needs_;
  std::string name_;
  std::optional<hdf5::Group> manifest_, topology_, frame_;
  std::uint64_t number_ = 0;
};

/// Under which names the particles are in a checkpoint.
constexpr const char *sizes_prefix = "start_", *height_entry = "start_height", *source_entry = "start_source";

StartParticles stored_start(const Checkpoint& c, const StartNeeds& needs) {
  StartParticles all;
  all.topology = read_sizes(sizes_prefix, needs.dim, c);
  if (all.topology.particles() == 0 || all.topology.deformable() != needs.polygons)
    c.refuse("{}points: the particles do not fit the model {}", sizes_prefix, needs.model);
  all.height = c.real(height_entry);
  all.source = nlohmann::ordered_json::parse(c.text(source_entry), nullptr, false);
  return all;
}

/// Whether particles m and n are inside each other.
template <int D>
bool overlap_too_much(const Topology& topology, const Real* x, Index m, Index n) {
  const Index i = topology.offset[m], j = topology.offset[n];
  if constexpr (D == 2) {
    if (topology.deformable()) {
      const Real far = (polygon_perimeter(x, topology, m) + polygon_perimeter(x, topology, n)) / 2;
      if ((point<2>(x, i) - point<2>(x, j)).norm() > far) return false;
      if (inside_polygon(x, topology, m, point<2>(x, j)) || inside_polygon(x, topology, n, point<2>(x, i))) return true;
      for (Index a = i; a < topology.offset[m + 1]; ++a)
        for (Index b = j; b < topology.offset[n + 1]; ++b)
          if (segments_meet(point<2>(x, a), point<2>(x, topology.next[a]), point<2>(x, b),
                            point<2>(x, topology.next[b])))
            return true;
      return false;
    }
  }
  const auto width = [&](Index k) { return topology.diameter[static_cast<std::size_t>(k)]; };
  return (point<D>(x, i) - point<D>(x, j)).norm() < (1 - passing_overlap) * (width(i) + width(j)) / 2;
}

template <int D>
void check_overlaps(const StartParticles& particles, const std::string& file) {
  const Topology& topology = particles.topology;
  const Real* const x = particles.x.data();
  struct Extent {
    Index m;
    Real low, high;  // of the last coordinates, with half the contact diameter of one point
  };
  std::vector<Extent> order;
  for (Index m = 0; m < topology.particles(); ++m) {
    Extent e{m, std::numeric_limits<Real>::infinity(), -std::numeric_limits<Real>::infinity()};
    for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) {
      const Real half = topology.diameter[static_cast<std::size_t>(i)] / 2, height = point<D>(x, i)[D - 1];
      e.low = std::min(e.low, height - half), e.high = std::max(e.high, height + half);
    }
    order.push_back(e);
  }
  std::ranges::sort(order, {}, &Extent::low);
  for (auto a = order.begin(); a != order.end(); ++a)
    for (auto b = a + 1; b != order.end() && b->low < a->high; ++b) {
      const auto [m, n] = std::minmax(a->m, b->m);
      if (overlap_too_much<D>(topology, x, m, n))
        throw InputError("-start {}: particles {} and {} are inside each other; move one of them", printable(file), m,
                         n);
    }
}

/// Errors: InputError for a surface without a meaning, or one that crosses itself or another one.
void check_surfaces(const StartParticles& all, const std::string& text) {
  const Neighbours<3> none{NeighbourNeeds{}, 0};
  const Walls<3> walls;
  const StateView<3> view{all.x.data(), nullptr, all.topology, none, walls};
  const SurfacesLook seen = look_at_surfaces(view);
  const auto refuse = [&](Index m, const std::string& fault) {
    throw InputError("-start {}: particle {} {}; give another frame", printable(text), m, fault);
  };
  if (const auto& shape = seen.bad_shape)
    refuse(shape->particle, shape->kind == BadShape::Kind::inverted
                                ? "is inverted: its volume is not positive"
                                : fmt::format("has no area in its face {}", shape->face));
  if (seen.crossing_itself) refuse(*seen.crossing_itself, "crosses itself");
  if (seen.piercing) refuse(seen.piercing->particle, fmt::format("pierces particle {}", seen.piercing->other));
  if (const auto& pair = seen.enclosure) refuse(pair->inner, fmt::format("is inside particle {}", pair->outer));
}

}  // namespace

std::optional<std::uint32_t> crc32_of_start(const std::string& file) {
  const fs::path path = split(file).file;
  std::error_code none;
  std::ifstream in;
  if (fs::is_regular_file(path, none)) in.open(path, std::ios::binary);
  if (!in.is_open()) return {};
  std::vector<char> part(1 << 20);
  std::uint32_t crc = 0;
  while (in.read(part.data(), static_cast<std::streamsize>(part.size())) || in.gcount() > 0)
    crc = crc32_of(std::as_bytes(std::span(part).first(static_cast<std::size_t>(in.gcount()))), crc);
  return crc;
}

std::optional<std::string> outline_fault(const Topology& topology, Index m, const Real* x) {
  const Index first = topology.offset[m];
  for (Index i = first; i < topology.offset[m + 1]; ++i)
    if (point<2>(x, i) == point<2>(x, topology.next[i]))
      return fmt::format("vertices {} and {} are the same point; an edge must have a length", i - first,
                         topology.next[i] - first);
  if (self_intersects(x, topology, m)) return "its outline meets itself";
  if (const Real area = polygon_area(x, topology, m); !(area > 0))
    return fmt::format("its signed area is {:g}; give the vertices counter-clockwise", area);
  return {};
}

StartParticles read_start(const std::string& text, const StartNeeds& needs) {
  const StartName name = split(text);
  if (std::error_code none; fs::is_directory(name.file, none))
    throw InputError("-start {}: is a folder; give its run.h5, or a table", printable(name.file));
  if (!name.run() && needs.dim == 3 && needs.polygons)
    throw InputError("-start {}: a table has no faces, which closed surfaces need; give the run.h5 of a run",
                     printable(text));
  StartParticles all = name.run() ? StoredFrame(name, needs).particles() : read_start_table(name.file, needs);
  const Topology& topology = all.topology;
  const int dim = needs.dim;
  for (const auto& [values, what] : {std::pair(&all.x, "position"), std::pair(&all.v, "velocity")})
    for (std::size_t k = 0; k < values->size(); ++k)
      if (!std::isfinite((*values)[k]))
        throw InputError("-start {}: a {} of particle {} is {}; give finite numbers", printable(text), what,
                         topology.particle[k / static_cast<std::size_t>(dim)], (*values)[k]);
  if (topology.surfaces) check_surfaces(all, text);
  for (Index m = 0; needs.polygons && dim == 2 && m < topology.particles(); ++m)
    if (const auto fault = outline_fault(topology, m, all.x.data()))
      throw InputError("-start {}: particle {}: {}", printable(text), m, *fault);
  all.height = all.x[static_cast<std::size_t>(dim) - 1];
  for (std::size_t k = static_cast<std::size_t>(dim) - 1; k < all.x.size(); k += static_cast<std::size_t>(dim))
    all.height = std::max(all.height, all.x[k]);
  nlohmann::ordered_json source{{"file", fs::absolute(name.file).lexically_normal().string()}};
  source.update(all.source.is_null() ? nlohmann::ordered_json::object() : all.source);
  source["crc32"] = crc32_of_numbers(all);
  all.source = std::move(source);
  return all;
}

void StartOption::bind(Options& o) {
  o.bind("start", file_,
         {.help = "particles from a table FILE.csv, or from a run: FILE.h5 or FILE.h5:FRAME",
          .on_restart = OnRestart::fixed,
          .read = [](const std::string& text, const fs::path& folder) { return path_from(folder, text); }});
}

void StartOption::take(const StartNeeds& needs, const std::optional<Checkpoint>& checkpoint) {
  if (!given()) return;
  particles_ =
      std::make_shared<StartParticles>(checkpoint ? stored_start(*checkpoint, needs) : read_start(file_, needs));
}

void StartOption::refuse(const Options& options, std::initializer_list<const char*> names) const {
  if (!given()) return;
  for (const char* name : names)
    if (options.given(name))
      throw InputError("-{} ({}) with -start {}: the particles come from this file; leave one of the options out", name,
                       options.source(name), printable(file_));
}

template <int D>
void StartOption::check(Real dt, const std::function<std::optional<std::string>(Index)>& fault) const {
  const Topology& all = particles_->topology;
  const std::string file = printable(file_);
  for (Index m = 0; m < all.particles(); ++m) {
    if (const auto found = fault(m))
      throw InputError("-start {}: particle {}, at ({:.4g}), {}", file, m,
                       fmt::join(mean_of_points<D>(particles_->x.data(), all, m), ", "), *found);
    if (particles_->v.empty()) continue;
    if (const Real speed = mean_of_points<D>(particles_->v.data(), all, m).norm(); speed * dt > all.sigma[m])
      throw InputError(
          "-start {}: particle {} has the speed {:.3g}, and would move by more than its diameter in a step of {:.3g}; "
          "give a lower velocity, or a shorter -dt",
          file, m, speed, dt);
  }
  if (!all.surfaces) check_overlaps<D>(*particles_, file_);
}

template <int D>
void StartOption::set_motion(Simulation<D>& simulation) const {
  if (!fresh()) return;
  const StartParticles& from = *particles_;
  const Topology& own = simulation.topology();
  State& state = simulation.state();
  const auto copy = [](const std::vector<Real>& all, Index first, Index count, int width, std::span<Real> to,
                       Index at) {
    const auto w = static_cast<std::size_t>(width);
    if (!all.empty() && !to.empty())
      std::copy_n(all.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(first) * w),
                  static_cast<std::size_t>(count) * w,
                  to.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(at) * w));
  };
  for (Index m = 0; m < own.owned(); ++m) {
    const Index id = own.id[m];
    copy(from.v, from.topology.offset[id], own.points_of(m), D, state.v(), own.offset[m]);
    copy(from.angles, id, 1, rotations<D>, simulation.angles(), m);
    copy(from.spins, id, 1, rotations<D>, simulation.spins(), m);
  }
}

template <int D>
void StartOption::report_energy(Simulation<D>& simulation, const std::string& contact_energy) const {
  if (!fresh()) return;
  constexpr Real large = 0.1;
  const StateView<D> s = simulation.view();
  Real floor = std::numeric_limits<Real>::infinity();
  std::array<Real, 3> sums{};  // energy of contacts, mass, mass times height (the energy of gravity)
  for (Index i = 0; i < s.topology.owned_points(); ++i) {
    const Real mass = s.topology.mass(i), height = s.position(i)[D - 1];
    floor = std::min(floor, height);
    sums[1] += mass;
    sums[2] += mass * height;
  }
  for (const TermReport& term : simulation.particles().field().report(s))
    if (term.has_energy && term.particle_energy.empty()) sums[0] += term.energy;  // all but the shape's
  sums[0] -= sums[2];
  simulation.ranks().sum(sums);
  floor = simulation.ranks().min(floor);
  const Real lift = sums[0] / sums[1], height = sums[2] / sums[1] - floor;
  if (!simulation.ranks().root()) return;
  say("started from {}; the energy of contacts could lift all particles by {:.3g} sigma_avg\n", printable(file_), lift);
  if (lift > large * std::max(height, Real(1)))
    warn(
        "-start {}: contacts store an energy that could lift all particles by {:.3g} sigma_avg, which becomes motion "
        "and heat; lower the contact energy ({}), or start from a frame with smaller overlaps",
        printable(file_), lift, contact_energy);
}

void StartOption::visit(Archive& a) const {
  if (!given() || a.reads()) return;
  SharedCheckpoint& to = a.to();
  save_sizes(sizes_prefix, particles_->topology, to);
  to.add(height_entry, particles_->height);
  to.add_text(source_entry, particles_->source.dump());
}

template void StartOption::check<2>(Real, const std::function<std::optional<std::string>(Index)>&) const;
template void StartOption::check<3>(Real, const std::function<std::optional<std::string>(Index)>&) const;
template void StartOption::set_motion(Simulation<2>&) const;
template void StartOption::set_motion(Simulation<3>&) const;
template void StartOption::report_energy(Simulation<2>&, const std::string&) const;
template void StartOption::report_energy(Simulation<3>&, const std::string&) const;

}  // namespace pliant
