#include <pliant/io/run_writer.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <utility>

#include <pliant/base/errors.h>
#include <pliant/io/atomic_file.h>
#include <pliant/io/crc32.h>
#include <pliant/io/dataset_table.h>
#include <pliant/io/folder_lock.h>
#include <pliant/io/recording.h>
#include <pliant/io/shared_file.h>
#include <pliant/model/surface_arrays.h>

namespace pliant {
namespace {

using hdf5::File;
using hdf5::Group;
using hdf5::Storage;

constexpr std::uint64_t chunk_values = 512;
constexpr const char* run_name = "run.h5";

std::string frame_name(std::uint64_t n) { return fmt::format("{:06}", n); }

void refuse_existing_run(const std::filesystem::path& folder) {
  for (const char* name : {run_name, "checkpoint-a.h5", "checkpoint-b.h5"}) {
    std::error_code ignored;
    if (std::filesystem::exists(folder / name, ignored))
      throw InputError("{} holds a run already ({}); choose another folder", folder.string(), name);
  }
}

void write_manifest(File& file, const Manifest& manifest) {
  auto group = file.create_group("/manifest");
  group.write_text("program", manifest.program);
  group.write_text("version", manifest.version);
  group.write_text("build", manifest.build);
  group.write_text("petsc_version", manifest.petsc_version);
  group.write_text("hdf5_version", hdf5::library_version());
  group.write_text("scenario", manifest.scenario);
  group.write_text("model", manifest.model);
  group.set_attribute("dim", static_cast<std::int64_t>(manifest.dim));
  group.set_attribute("seed", manifest.seed);
  group.write_text("created", manifest.created);
  group.write_text("options", manifest.options.dump());
  if (!manifest.start.is_null()) group.write_text("start", manifest.start.dump());
  group.write_text("datasets", dataset_table(manifest));
}

/// Constants of each of `count` cells, or points, that run.xdmf shows where they have no such field, in the group
/// `name`. vectors: also three components each.
void write_xdmf_constants(Group& parent, const std::string& name, std::uint64_t count, bool vectors = true) {
  auto group = parent.has(name) ? parent.open_group(name) : parent.create_group(name);
  const auto write = [&](const char* constant, auto value, const hdf5::Shape& shape) {
    if (!group.has(constant)) group.write_constant(constant, value, shape);
  };
  constexpr Real nan = std::numeric_limits<Real>::quiet_NaN();
  write("nan", nan, {count});
  write("minus_one", Index{-1}, {count});
  write("one", std::uint8_t{1}, {count});
  if (vectors) write("nan_vector", nan, {count, 3});
}

/// Constants of particles and walls; runs of older versions have fewer.
void write_xdmf_constants(File& file, int dim, const DrawnShapes& drawn, std::uint64_t walls) {
  auto topology = file.open_group("/topology"), geometry = file.open_group("/geometry");
  write_xdmf_constants(topology, "xdmf", file.shape("/topology/sigma").at(0));
  if (drawn.faces > 0) {
    write_xdmf_constants(topology, "xdmf/of_faces", drawn.faces);
    write_xdmf_constants(topology, "xdmf/of_points", file.shape("/topology/diameter").at(0));
  }
  if (dim != 2) return;
  write_xdmf_constants(geometry, "xdmf", walls);
  if (!geometry.has("xdmf/of_points/nan_vector"))
    geometry.write_constant("xdmf/of_points/nan_vector", std::numeric_limits<Real>::quiet_NaN(),
                            {drawn.wall_points, 3});
}

void write_topology(File& file, const Topology& topology) {
  auto group = file.create_group("/topology");
  const auto write = [&](const std::string& name, const auto& values) {
    group.write(name, values, {values.size()}, Storage::crc32);
  };
  write("offset", topology.offset);
  write("sigma", topology.sigma);
  write("a0", topology.a0);
  write("l0", topology.l0);
  write("diameter", topology.diameter);
  std::vector<Real> mass(static_cast<std::size_t>(topology.particles()), 0);
  std::vector<Index> number(mass.size());
  for (Index i = 0; i < topology.points(); ++i) mass[topology.particle[i]] += topology.mass(i);
  for (Index m = 0; m < topology.particles(); ++m) number[m] = m;
  write("mass", mass);
  write("xdmf/particle", number);
  if (!topology.surfaces) {
    write("xdmf/connectivity", xdmf_particles(topology.offset));
    return;
  }
  std::vector<Index> faces, of_face, offset{0};
  for (Index m = 0; m < topology.particles(); ++m) {
    for (const Face& face : topology.surfaces->of(topology, m).faces) {
      for (const Index vertex : face) faces.push_back(topology.offset[m] + vertex);
      of_face.push_back(m);
    }
    offset.push_back(static_cast<Index>(of_face.size()));
  }
  const SurfaceArrays surfaces(*topology.surfaces);
  SurfaceArrays::for_each(surfaces, [&](const std::string& name, const auto& values, std::uint64_t width) {
    const std::uint64_t rows = values.size() / width;
    group.write("surfaces/" + name, values, width == 1 ? hdf5::Shape{rows} : hdf5::Shape{rows, width}, Storage::crc32);
  });
  write("face_offset", offset);
  group.write("faces", faces, {of_face.size(), 3}, Storage::crc32);
  write("xdmf/face_particle", of_face);
}

void write_geometry(File& file, const RunGeometry& geometry, int dim) {
  auto group = file.create_group("/geometry");
  const std::uint64_t walls = geometry.segments.size() / 4;
  const bool disks = std::any_of(geometry.radius.begin(), geometry.radius.end(), [](Real r) { return r > 0; });
  group.write("segments", geometry.segments, {walls, 4}, Storage::crc32);
  if (disks) group.write("radius", geometry.radius, {walls}, Storage::crc32);
  group.write_text("kind", geometry.kind);
  for (const auto& [name, value] : geometry.attributes) group.set_attribute(name, value);
  if (!geometry.box.empty()) group.write("box", geometry.box, {2, static_cast<std::uint64_t>(dim)}, Storage::crc32);
  if (dim == 2) {
    const XdmfLines lines = xdmf_walls(geometry.segments, geometry.radius);
    group.write("xdmf/points", lines.points, {lines.points.size() / 2, 2}, Storage::crc32);
    group.write("xdmf/connectivity", lines.cells, {lines.cells.size()}, Storage::crc32);
  }
}

DrawnShapes drawn_shapes(const File& file, int dim) {
  if (dim != 2) return {.faces = file.has("/topology/faces") ? file.shape("/topology/faces").at(0) : 0};
  return {file.shape("/geometry/xdmf/points").at(0), file.shape("/geometry/xdmf/connectivity").at(0)};
}

/// XML of a frame of a run of `walls` segments and these particles.
std::string grid_of(const Group& group, const std::string& name, int dim, std::uint64_t particles, std::uint64_t points,
                    std::uint64_t walls, const DrawnShapes& drawn) {
  XdmfFrame frame{.name = name,
                  .time = group.real_attribute("time"),
                  .dim = dim,
                  .particles = particles,
                  .points = points,
                  .walls = walls,
                  .wall_points = drawn.wall_points,
                  .wall_connectivity = drawn.wall_connectivity,
                  .faces = drawn.faces};
  const auto count = [&](const char* dataset) { return group.has(dataset) ? group.shape(dataset).at(0) : 0; };
  frame.contacts = count("contacts/overlap");
  frame.wall_contacts = count("wall_contacts/overlap");
  frame.connectivity = points + 2 * particles;
  frame.moving_walls = group.has("wall_segments");
  frame.single = group.value_size("positions") < sizeof(Real);
  for (const std::string& dataset : xdmf_datasets(dim))
    if (group.has(dataset)) frame.datasets.insert(dataset);
  if (group.has("xdmf/connectivity")) frame.datasets.erase("spins");  // older versions: contacts lack such constants
  return xdmf_grid(frame);
}

/// Of all frames, in their order; empty for those that are too damaged.
std::vector<std::string> grids_of(const File& file, const Topology& topology, std::uint64_t walls,
                                  std::uint64_t frames) {
  std::vector<std::string> grids;
  const auto list = file.open_group("/frames");
  const auto drawn = drawn_shapes(file, topology.dim);
  for (std::uint64_t n = 0; list.has(frame_name(n)); ++n) {
    try {
      grids.push_back(grid_of(list.open_group(frame_name(n)), frame_name(n), topology.dim,
                              static_cast<std::uint64_t>(topology.particles()),
                              static_cast<std::uint64_t>(topology.points()), walls, drawn));
    } catch (const InputError& error) {
      if (n >= frames)
        throw InputError(
            "{}; the run cannot write this frame again: restore the file from a backup, or start the run again",
            error.what());
      grids.emplace_back();
    }
  }
  return grids;
}

void check_counts(const File& file, const RunCounts& needed, std::string_view source) {
  const auto check = [&](std::uint64_t found, std::string_view what, std::uint64_t count) {
    if (found < count) throw InputError("{} has {} {}, but {} needs {}", file.name(), found, what, source, count);
  };
  /// Number of rows of the shortest column.
  const auto rows = [&](const std::string& table) {
    if (!file.has(table)) return std::uint64_t{0};
    const auto group = file.open_group(table);
    std::optional<std::uint64_t> least;
    for (const std::string& column : group.links()) {
      const hdf5::Shape shape = group.shape(column);
      least = std::min(least.value_or(-1), shape.empty() ? 0 : shape[0]);
    }
    return least.value_or(0);
  };
  const auto list = file.open_group("/frames");
  std::uint64_t frames = 0;
  while (frames < needed.frames && list.has(frame_name(frames))) ++frames;
  check(frames, "frames", needed.frames);
  check(rows("/series"), "rows of /series", needed.samples);
  check(rows("/events"), "rows of /events", needed.events);
}

/// A rank's part of a dataset.
struct Share {
  std::uint32_t crc32 = 0;
  std::uint64_t bytes = 0;
};

Series read_series_of(const File& file) {
  Series series;
  const auto group = file.open_group("/series");
  for (const std::string& name : group.links()) {
    const auto shape = group.shape(name);
    series[name] = {shape.at(0), shape.size() > 1 ? shape[1] : 1, group.read<Real>(name)};
  }
  return series;
}

}  // namespace

RunWriter RunWriter::create(const std::filesystem::path& folder, const Manifest& manifest, const Topology& topology,
                            const RunGeometry& geometry, const Ranks& ranks) {
  RunWriter writer(folder, ranks, topology.dim);
  ranks.on_root([&] { writer.start(manifest, topology, geometry); });
  return writer;
}

void RunWriter::start(const Manifest& manifest, const Topology& topology, const RunGeometry& geometry) {
  create_folder(folder_);
  refuse_existing_run(folder_);
  // Any of its parents may be new.
  for (auto path = std::filesystem::absolute(folder_); path.has_relative_path(); path = path.parent_path())
    sync_folder(path.parent_path());
  // The file gets its name only when it can be read, so that a kill leaves no unreadable file.
  const auto path = folder_ / run_name, begun = folder_ / "run.h5.new";
  std::error_code ignored;
  std::filesystem::remove(begun, ignored);
  file_.emplace(File::create(begun));
  try {
    write_head(manifest, topology, geometry);
    drawn_ = drawn_shapes(*file_, dim_);
    write_xdmf_constants(*file_, dim_, drawn_, walls_);
    file_->flush();
    file_->rename(path);
    xdmf_.emplace(folder_ / "run.xdmf", std::vector<std::string>());
  } catch (...) {
    // A torso would make the next attempt refuse the folder.
    file_.reset();
    std::filesystem::remove(begun, ignored);
    std::filesystem::remove(path, ignored);
    throw;
  }
}

RunWriter RunWriter::recorder(const Manifest& manifest, const Topology& topology, const RunGeometry& geometry) {
  RunWriter writer({}, Ranks(), topology.dim);
  writer.recorder_ = true;
  writer.file_.emplace(File::recorder(run_name));
  writer.write_head(manifest, topology, geometry);
  return writer;
}

void RunWriter::write_head(const Manifest& manifest, const Topology& topology, const RunGeometry& geometry) {
  if (geometry.segments.size() % 4 != 0) throw std::invalid_argument("run.h5: a wall segment is four numbers");
  write_manifest(*file_, manifest);
  write_topology(*file_, topology);
  write_geometry(*file_, geometry, topology.dim);
  walls_ = geometry.segments.size() / 4;
  periodic_ = !geometry.box.empty();
  for (const char* group : {"/frames", "/series", "/series_axes"}) file_->create_group(group);
}

RunWriter RunWriter::append(const std::filesystem::path& folder, const Topology& topology, std::uint64_t series_rows,
                            std::uint64_t frames, std::uint64_t event_rows, const Ranks& ranks) {
  RunWriter writer(folder, ranks, topology.dim);
  writer.frames_ = frames;
  ranks.on_root([&] { writer.go_on(topology, series_rows, event_rows); });
  return writer;
}

void RunWriter::go_on(const Topology& topology, std::uint64_t series_rows, std::uint64_t event_rows) {
  file_.emplace(File::open_write(folder_ / run_name));
  if (file_->read<Index>("/topology/offset") != topology.offset ||
      file_->open_group("/manifest").integer_attribute("dim") != dim_)
    throw InputError("{} holds other particles than the checkpoint; restart from the folder of the same run",
                     file_->name());
  check_counts(*file_, {series_rows, frames_, event_rows}, "the checkpoint");
  for (const char* group : {"/manifest", "/topology", "/geometry", "/series_axes"})
    for (const std::string& name : file_->open_group(group).datasets()) file_->open_group(group).check(name);
  walls_ = file_->shape("/geometry/segments").at(0);
  periodic_ = file_->has("/geometry/box");
  drawn_ = drawn_shapes(*file_, dim_);
  write_xdmf_constants(*file_, dim_, drawn_, walls_);
  check_frames();
  xdmf_.emplace(folder_ / "run.xdmf", grids_of(*file_, topology, walls_, frames_));
  samples_ = Table::stored(*file_, "/series", series_rows);
  events_ = Table::stored(*file_, "/events", event_rows);
  file_->flush();
}

/// Checks the frames that the checkpoint counts.
void RunWriter::check_frames() {
  const auto list = file_->open_group("/frames");
  for (std::uint64_t n = 0; n < frames_ && list.has(frame_name(n)); ++n) {
    try {
      const auto frame = list.open_group(frame_name(n));
      for (const std::string& name : frame.datasets()) {
        try {
          frame.check(name);
        } catch (const InputError& error) {
          damage_.emplace_back(error.what());
        }
      }
    } catch (const InputError& error) {
      damage_.emplace_back(error.what());
    }
  }
}

void RunWriter::drop_later_frames() {
  auto list = file_->open_group("/frames");
  if (!list.has(frame_name(frames_))) return;
  if (xdmf_) xdmf_->cut(frames_);  // names existing frames only
  for (std::uint64_t n = frames_; list.has(frame_name(n)); ++n) list.remove(frame_name(n));
  list.count_members();
  flush();
}

RunWriter::~RunWriter() = default;

void RunWriter::write_axis(const std::string& name, std::span<const Real> values) {
  auto group = file_->open_group("/series_axes");
  if (group.has(name)) {
    group.read<Real>(name, {values.size()});
    return;
  }
  group.write(name, values, {values.size()}, Storage::crc32);
}

RunWriter::Table RunWriter::Table::stored(File& file, const std::string& name, std::uint64_t rows) {
  Table table{name, rows};
  if (file.has(name)) {
    auto group = file.open_group(name);
    for (const std::string& column : group.links()) {
      const auto shape = group.shape(column);
      table.columns.push_back(
          {column, shape.size() > 1 ? shape[1] : 1, shape.size() > 1, group.open_rows(column, rows)});
    }
  }
  return table;
}

void RunWriter::Table::add(std::span<const SeriesValue> row) {
  const auto named = [&](const std::string& name) {
    return std::find_if(columns.begin(), columns.end(), [&](const Column& c) { return c.name == name; });
  };
  if (std::exchange(accepts_columns, false))
    for (const auto& value : row)
      if (named(value.name) == columns.end())
        columns.push_back({value.name,
                           value.values.size(),
                           value.is_row,
                           {},
                           std::vector<Real>(rows * value.values.size(), std::numeric_limits<Real>::quiet_NaN())});
  const auto column_of = [&](const SeriesValue& value) {
    const auto at = named(value.name);
    if (at == columns.end() || at->is_row != value.is_row || at->width != value.values.size())
      throw std::invalid_argument(group + "/" + value.name + ": not as in the first row");
    return at;
  };
  if (row.size() != columns.size()) throw std::invalid_argument(group + ": not the columns of the first row");
  for (const auto& value : row) column_of(value);
  for (const auto& value : row) {
    auto& kept = column_of(value)->kept;
    kept.insert(kept.end(), value.values.begin(), value.values.end());
  }
  ++rows;
}

void RunWriter::Table::write(File& file) {
  const bool more = std::any_of(columns.begin(), columns.end(), [](const Column& c) { return !c.stored; });
  for (Column& c : columns) {
    if (!c.stored)
      c.stored.emplace(file.create_rows(group + "/" + c.name, c.is_row ? hdf5::Shape{c.width} : hdf5::Shape{},
                                        std::max<std::uint64_t>(1, chunk_values / c.width)));
    if (!c.kept.empty()) c.stored->append(c.kept);
    c.kept.clear();
  }
  if (more) file.open_group(group).count_members();
}

void RunWriter::Table::write_whole(File& file) {
  if (columns.empty()) return;
  auto in = file.has(group) ? file.open_group(group) : file.create_group(group);
  for (const Column& c : columns)
    in.write(c.name, c.kept, c.is_row ? hdf5::Shape{rows, c.width} : hdf5::Shape{rows}, Storage::crc32);
  in.count_members();
}

void RunWriter::write_frame(const Frame& frame, const FrameFormat& format) {
  const FrameLayout layout(frame, dim_, ranks_, format);
  const std::string name = frame_name(frames_);
  std::optional<Group> group;
  std::vector<hdf5::Dataset> datasets;
  ranks_.on_root([&] {
    group.emplace(file_->create_unlinked_group());
    group->set_attribute("time", frame.time);
    group->set_attribute("step", frame.step);
    for (const auto& [attribute, value] : frame.attributes) group->set_attribute(attribute, value);
    if (format.has("wall_force"))
      group->write("wall_force", frame.wall_force, {walls_, static_cast<std::uint64_t>(dim_)}, Storage::crc32);
    if (!frame.wall_segments.empty()) group->write("wall_segments", frame.wall_segments, {walls_, 4}, Storage::crc32);
    if (!frame.box.empty()) group->write("box", frame.box, {3, static_cast<std::uint64_t>(dim_)}, Storage::crc32);
    for (const FrameArray& a : layout.arrays) {
      datasets.push_back(group->create_dataset(a.name, a.type, a.shape, format.deflate));
      if (const auto at = datasets.back().address(); xdmf_ && at != 0 && at < file_->committed())
        throw std::logic_error("run.h5: a new dataset lies where the last flush has put something");
    }
    for (const std::string list : {"contacts", "wall_contacts"})
      if (const std::string overlap = list + "/overlap", friction = list + "/friction";
          group->has(overlap) && !group->has(friction))
        group->write_constant(friction, Real(0), {group->shape(overlap)[0], static_cast<std::uint64_t>(dim_)});
    if (xdmf_)
      write_views(*group, "/frames/" + name, format.single ? hdf5::Type::single : hdf5::Type::real);
    else if (!group->has("centres"))
      group->link("positions", "centres");
  });
  write_arrays(layout.arrays, datasets, format.deflate > 0);
  ranks_.on_root([&] {
    auto list = file_->open_group("/frames");
    list.link(*group, name);
    list.count_members();
    flush();
    if (xdmf_) xdmf_->put(frames_, grid_of(*group, name, dim_, layout.particles, layout.points, walls_, drawn_));
  });
  ++frames_;
}

/// Datasets that refer to values of other datasets: the centres of disks, which are their positions; and data of
/// run.xdmf in a form that ParaView can read, vectors of two components, walls as points, and constants where a field
/// is missing.
void RunWriter::write_views(Group& frame, const std::string& path, hdf5::Type stored) const {
  const auto show = [&](const std::string& source, const char* name, hdf5::Type type, std::uint64_t columns,
                        const auto& shape, std::uint64_t first = 0) {
    if (!frame.has(source)) return;
    const hdf5::Shape rows = frame.shape(source);
    if (rows[0] > 0) frame.write_view(name, {path + "/" + source, type, rows, columns, shape(rows[0]), first});
  };
  using Rows = std::uint64_t;
  const auto vectors = [](Rows rows) { return hdf5::Shape{rows, 3}; };
  const auto dim = static_cast<Rows>(dim_);
  if (!frame.has("centres"))
    show("positions", "centres", stored, dim, [dim](Rows rows) { return hdf5::Shape{rows, dim}; });
  if (dim_ == 2) {
    show("velocities", "xdmf/velocity", stored, 2, vectors);
    show("spins", "xdmf/spin", stored, 1, vectors, 2);  // about z
    show("contacts/force", "xdmf/force", stored, 2, vectors);
    show("wall_contacts/force", "xdmf/wall_contact_force", stored, 2, vectors);
    show("wall_force", "xdmf/wall_force", hdf5::Type::real, 2, vectors);
  }
  show("wall_segments", "xdmf/wall_points", hdf5::Type::real, 4, [](Rows rows) { return hdf5::Shape{2 * rows, 2}; });
  if (periodic_)
    show("contacts/particles", "xdmf/contact_particle", hdf5::Type::int32, 1,
         [](Rows rows) { return hdf5::Shape{rows}; });
  for (const char* list : {"contact", "wall_contact"}) {
    const std::string overlap = fmt::format("{}s/overlap", list);
    if (const Rows count = frame.has(overlap) ? frame.shape(overlap)[0] : 0; count > 0)
      write_xdmf_constants(frame, fmt::format("xdmf/{}_constants", list), count, frame.has("spins"));
  }
}

void RunWriter::write_arrays(const std::vector<FrameArray>& arrays, std::vector<hdf5::Dataset>& datasets,
                             bool compressed) {
  // In pieces, to avoid a second copy of all rows.
  std::vector<std::byte> piece;
  std::vector<Share> shares(arrays.size());
  const auto for_each_piece = [](const FrameArray& a, std::uint64_t rows, const auto& visit) {
    constexpr std::uint64_t piece_bytes = 1 << 19;
    const std::uint64_t at_once = std::max<std::uint64_t>(1, piece_bytes / a.row_bytes());
    for (std::uint64_t row = 0; row < rows; row += at_once) visit(row, std::min(at_once, rows - row));
  };
  const auto make = [&](std::size_t k, std::uint64_t row, std::uint64_t count) {
    piece.resize(count * arrays[k].row_bytes());
    arrays[k].make(row, count, piece.data());
    shares[k] = {crc32_of(piece, shares[k].crc32), shares[k].bytes + piece.size()};
  };
  /// Calls put(k, row) for the pieces of this rank's rows.
  const auto write_own = [&](const auto& put) {
    for (std::size_t k = 0; k < arrays.size(); ++k)
      for_each_piece(arrays[k], arrays[k].rows, [&](std::uint64_t row, std::uint64_t count) {
        make(k, row, count);
        put(k, row, count);
      });
  };
  if (!ranks_.several()) {
    write_own(
        [&](std::size_t k, std::uint64_t row, std::uint64_t count) { datasets[k].write(row, count, piece.data()); });
  } else if (compressed) {
    // Compressed values have no place before they are written: the root writes them, rank after rank.
    for (std::size_t k = 0; k < arrays.size(); ++k) {
      std::uint64_t first = 0;
      for (int rank = 0; rank < ranks_.size(); ++rank) {
        const std::uint64_t rows = ranks_.broadcast(arrays[k].rows, rank);
        for_each_piece(arrays[k], rows, [&](std::uint64_t row, std::uint64_t count) {
          piece.clear();
          if (rank == ranks_.rank()) make(k, row, count);
          const std::vector<std::byte> arrived = ranks_.gather(piece);
          ranks_.on_root([&] { datasets[k].write(first + row, count, arrived.data()); });
        });
        first += rows;
      }
    }
  } else {
    std::vector<std::uint64_t> address;
    for (const hdf5::Dataset& d : datasets) address.push_back(d.address());
    ranks_.broadcast(address);
    SharedFile file(ranks_, folder_ / run_name);
    ranks_.together([&] {
      write_own([&](std::size_t k, std::uint64_t row, std::uint64_t) {
        file.write(address[k] + (arrays[k].first + row) * arrays[k].row_bytes(), piece);
      });
    });
    file.sync();
  }
  const std::vector<Share> all = ranks_.gather(shares);
  ranks_.on_root([&] {
    for (std::size_t k = 0; k < datasets.size(); ++k) {
      std::uint32_t sum = 0;
      for (std::size_t share = k; share < all.size(); share += datasets.size())
        sum = crc32_joined(sum, all[share].crc32, all[share].bytes);
      datasets[k].set_crc32(sum);
    }
  });
}

void RunWriter::flush() {
  if (recorder_) return;  // there is nothing to lose
  samples_.write(*file_);
  events_.write(*file_);
  file_->flush();
}

void RunWriter::close() {
  if (!file_ || !file_->is_open()) return;
  flush();
  file_->close();
}

std::string RunWriter::recorded() {
  if (!std::exchange(ended_, true)) {
    samples_.write_whole(*file_);
    events_.write_whole(*file_);
  }
  return file_->recorded();
}

Series RunWriter::read_series() {
  flush();
  if (!recorder_) return read_series_of(*file_);
  Series series;
  for (const Table::Column& c : samples_.columns) series[c.name] = {samples_.rows, c.width, c.kept};
  return series;
}

std::size_t count_frames(const std::filesystem::path& folder) {
  return File::open_read(folder / run_name).open_group("/frames").links().size();
}

void check_counts(const std::filesystem::path& folder, const RunCounts& needed, std::string_view source) {
  check_counts(File::open_read(folder / run_name), needed, source);
}

Series read_series(const std::filesystem::path& folder) { return read_series_of(File::open_read(folder / run_name)); }

}  // namespace pliant
