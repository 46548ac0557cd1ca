#include <pliant/io/xdmf.h>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <stdexcept>

#include <pliant/base/errors.h>
#include <pliant/base/regular_file.h>
#include <pliant/io/atomic_file.h>

namespace pliant {
namespace {

// Cell types of XDMF's topology "Mixed".
enum CellType : std::int32_t { polyvertex = 1, polyline = 2, polygon = 3 };

constexpr std::string_view header = R"(<?xml version="1.0" encoding="UTF-8"?>
<Xdmf Version="3.0">
  <Domain>
    <Grid Name="run" GridType="Collection" CollectionType="Temporal">
)";
constexpr std::string_view footer = R"(    </Grid>
  </Domain>
</Xdmf>
)";

/// A dataset that is shown.
struct Shown {
  std::string path;
  std::string_view type;
};

constexpr std::string_view real = R"(NumberType="Float" Precision="8")";
constexpr std::string_view real_single = R"(NumberType="Float" Precision="4")";
constexpr std::string_view integer = R"(NumberType="Int" Precision="4")";
constexpr std::string_view byte = R"(NumberType="UChar" Precision="1")";

std::string data(const Shown& shown, const std::string& dimensions) {
  return fmt::format(R"(<DataItem Dimensions="{}" {} Format="HDF">run.h5:{}</DataItem>)", dimensions, shown.type,
                     shown.path);
}

struct Field {
  std::string_view name;
  std::string_view constant;  ///< dataset for cells, or points, that have no such value
  bool of_points = false;
  bool vector() const { return constant == "nan_vector"; }
};
// ParaView colours a frame by a field only if all grids have it. Values of NaN get the colour for NaN; active is 1, so
// that a filter for active particles keeps walls and contacts.
constexpr Field fields[] = {{"velocity", "nan_vector", true}, {"spin", "nan_vector"}, {"sigma", "nan"},
                            {"particle", "minus_one"},        {"active", "one"},      {"reinsertions", "minus_one"},
                            {"contact_count", "minus_one"},   {"area", "nan"},        {"a0", "nan"},
                            {"force", "nan_vector"},          {"overlap", "nan"}};

std::string_view type_of_constant(std::string_view name) {
  return name == "one" ? byte : name == "minus_one" ? integer : real;
}

/// One of the grids of a frame.
struct Grid {
  std::string_view name;
  std::uint64_t cells, points;
  std::string topology;                    ///< the element
  std::string geometry;                    ///< the dataset of its points
  std::string constants, point_constants;  ///< folders with constants of these lengths
  std::map<std::string_view, Shown> own;   ///< by names of fields
};

class FrameGrids {
 public:
  explicit FrameGrids(const XdmfFrame& frame) : f_(frame), group_("/frames/" + frame.name) {}

  std::string text() const {
    std::vector<Grid> grids{particles()};
    // Walls come second, because a frame may have no contacts: the numbers of other grids do not change.
    if (f_.walls > 0 && f_.dim == 2) grids.push_back(walls());
    if (f_.contacts > 0) grids.push_back(contacts());
    if (f_.wall_contacts > 0) grids.push_back(wall_contacts());
    std::set<std::string_view> shown;
    for (const Grid& grid : {particles(), walls(), contacts(), wall_contacts()})
      for (const auto& [name, item] : grid.own) shown.insert(name);
    std::string all;
    for (const Grid& grid : grids) all += text(grid, shown);
    return all;
  }

 private:
  Grid particles() const {
    if (f_.faces > 0) return faces();
    Grid grid{"particles",
              f_.particles,
              f_.points,
              mixed(f_.particles, "/topology/xdmf/connectivity", f_.connectivity),
              group_ + "/positions",
              "/topology/xdmf",
              {},
              {}};
    grid.own = {{"sigma", {"/topology/sigma", real}},
                {"particle", {"/topology/xdmf/particle", integer}},
                {"active", {group_ + "/active", byte}}};
    add(grid, "velocity", vector("velocities", "velocity"), stored());
    add(grid, "spin", vector("spins", "spin"), stored());
    add(grid, "reinsertions", "reinsertions", integer);
    add(grid, "contact_count", "contact_count", integer);
    add(grid, "area", "area", stored());
    if (f_.has("area")) grid.own["a0"] = {"/topology/a0", real};
    return grid;
  }
  /// The triangles of closed surfaces.
  Grid faces() const {
    Grid grid{"particles",
              f_.faces,
              f_.points,
              cells("Triangle", 3, f_.faces, "/topology/faces"),
              group_ + "/positions",
              "/topology/xdmf/of_faces",
              "/topology/xdmf/of_points",
              {}};
    grid.own = {{"particle", {"/topology/xdmf/face_particle", integer}}};
    add(grid, "velocity", "velocities", stored());
    return grid;
  }
  Grid walls() const {
    Grid grid{"walls",
              f_.walls,
              f_.wall_points,
              mixed(f_.walls, "/geometry/xdmf/connectivity", f_.wall_connectivity),
              f_.moving_walls ? group_ + "/xdmf/wall_points" : "/geometry/xdmf/points",
              "/geometry/xdmf",
              "/geometry/xdmf/of_points",
              {}};
    add(grid, "force", "xdmf/wall_force", real);
    return grid;
  }
  /// Lines between centres; in a periodic box, where a line may cross it, points at the centre of the first particle.
  Grid contacts() const {
    const bool lines = !f_.has("xdmf/contact_particle");
    Grid grid{"contacts",
              f_.contacts,
              f_.particles,
              lines ? cells("Polyline", 2, f_.contacts, group_ + "/contacts/particles")
                    : cells("Polyvertex", 1, f_.contacts, group_ + "/xdmf/contact_particle"),
              group_ + "/centres",
              group_ + "/xdmf/contact_constants",
              "/topology/xdmf",
              {}};
    add_contact_fields(grid, "contacts", "force");
    return grid;
  }
  /// Points at the centres of the particles.
  Grid wall_contacts() const {
    Grid grid{"wall_contacts",     f_.wall_contacts,
              f_.particles,        cells("Polyvertex", 1, f_.wall_contacts, group_ + "/wall_contacts/particle"),
              group_ + "/centres", group_ + "/xdmf/wall_contact_constants",
              "/topology/xdmf",    {}};
    add_contact_fields(grid, "wall_contacts", "wall_contact_force");
    return grid;
  }

  std::string_view stored() const { return f_.single ? real_single : real; }
  std::string vector(const std::string& in_space, const std::string& view) const {
    return f_.dim == 2 ? "xdmf/" + view : in_space;
  }
  void add(Grid& grid, std::string_view field, const std::string& dataset, std::string_view type) const {
    if (f_.has(dataset)) grid.own[field] = {group_ + "/" + dataset, type};
  }

  /// Also if the frame has no contact, because all frames must have the same fields.
  void add_contact_fields(Grid& grid, const std::string& list, const std::string& view) const {
    if (!f_.has(list + "/overlap")) return;
    add(grid, "overlap", list + "/overlap", stored());
    const std::string force = vector(list + "/force", view);
    if (grid.cells == 0 || f_.has(force)) grid.own["force"] = {group_ + "/" + force, stored()};
  }

  static std::string mixed(std::uint64_t count, const std::string& connectivity, std::uint64_t length) {
    return fmt::format(R"(<Topology TopologyType="Mixed" NumberOfElements="{}">{}</Topology>)", count,
                       data({connectivity, integer}, std::to_string(length)));
  }
  static std::string cells(std::string_view kind, int nodes, std::uint64_t count, const std::string& connectivity) {
    return fmt::format(
        R"(<Topology TopologyType="{}" NodesPerElement="{}" NumberOfElements="{}">{}</Topology>)", kind, nodes, count,
        data({connectivity, integer}, nodes == 1 ? std::to_string(count) : fmt::format("{} {}", count, nodes)));
  }

  /// All fields that a grid of the frame has, of this one where it has them.
  std::string text(const Grid& grid, const std::set<std::string_view>& shown) const {
    std::string attributes;
    for (const Field& field : fields) {
      if (!shown.contains(field.name)) continue;
      const auto found = grid.own.find(field.name);
      const std::string& folder =
          field.of_points && !grid.point_constants.empty() ? grid.point_constants : grid.constants;
      const Shown item = found != grid.own.end()
                             ? found->second
                             : Shown{fmt::format("{}/{}", folder, field.constant), type_of_constant(field.constant)};
      const std::uint64_t rows = field.of_points ? grid.points : grid.cells;
      attributes += fmt::format("          <Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"{}\">{}</Attribute>\n",
                                field.name, field.vector() ? "Vector" : "Scalar", field.of_points ? "Node" : "Cell",
                                data(item, field.vector() ? fmt::format("{} 3", rows) : std::to_string(rows)));
    }
    const bool of_walls = grid.name == "walls";
    return fmt::format(R"(        <Grid Name="{}" GridType="Uniform">
          {}
          <Geometry GeometryType="{}">{}</Geometry>
{}        </Grid>
)",
                       grid.name, grid.topology, f_.dim == 2 ? "XY" : "XYZ",
                       data({grid.geometry, of_walls ? real : stored()}, fmt::format("{} {}", grid.points, f_.dim)),
                       attributes);
  }

  const XdmfFrame& f_;
  std::string group_;
};

}  // namespace

std::vector<std::string> xdmf_datasets(int dim) {
  std::vector<std::string> names{
      "area", "reinsertions", "contact_count", "contacts/overlap", "wall_contacts/overlap", "xdmf/contact_particle"};
  for (const char* in_plane :
       {"xdmf/velocity", "xdmf/spin", "xdmf/force", "xdmf/wall_contact_force", "xdmf/wall_force"})
    if (dim == 2) names.emplace_back(in_plane);
  for (const char* in_space : {"velocities", "spins", "contacts/force", "wall_contacts/force"})
    if (dim == 3) names.emplace_back(in_space);
  return names;
}

std::string xdmf_grid(const XdmfFrame& frame) {
  return fmt::format(R"(      <Grid Name="{}" GridType="Collection" CollectionType="Spatial">
        <Time Value="{}"/>
{}      </Grid>
)",
                     frame.name, frame.time, FrameGrids(frame).text());
}

std::vector<std::int32_t> xdmf_particles(const std::vector<Index>& offset) {
  std::vector<std::int32_t> cells;
  for (std::size_t m = 0; m + 1 < offset.size(); ++m) {
    const Index n = offset[m + 1] - offset[m];
    cells.insert(cells.end(), {n == 1 ? polyvertex : polygon, n});
    for (Index i = offset[m]; i < offset[m + 1]; ++i) cells.push_back(i);
  }
  return cells;
}

XdmfLines xdmf_walls(const std::vector<Real>& segments, const std::vector<Real>& radius) {
  constexpr std::int32_t corners = 64;
  XdmfLines lines{segments, {}};
  for (std::size_t k = 0; k < segments.size() / 4; ++k) {
    if (radius.empty() || radius[k] == 0) {
      const auto end = static_cast<std::int32_t>(2 * k);
      lines.cells.insert(lines.cells.end(), {polyline, 2, end, end + 1});
      continue;
    }
    const auto first = static_cast<std::int32_t>(lines.points.size() / 2);
    lines.cells.insert(lines.cells.end(), {polyline, corners + 1});
    for (std::int32_t c = 0; c <= corners; ++c) lines.cells.push_back(first + c % corners);
    for (std::int32_t c = 0; c < corners; ++c)
      lines.points.insert(lines.points.end(), {segments[4 * k] + radius[k] * std::cos(2 * pi * c / corners),
                                               segments[4 * k + 1] + radius[k] * std::sin(2 * pi * c / corners)});
  }
  return lines;
}

XdmfFile::XdmfFile(std::filesystem::path path, const std::vector<std::string>& grids) : path_(std::move(path)) {
  std::string text(header);
  for (const auto& one : grids) {
    starts_.push_back(text.size());
    text += one;
  }
  end_ = text.size();
  write_file_atomically(path_, {text, footer});
}

void XdmfFile::put(std::size_t index, const std::string& grid) {
  if (index > size()) throw std::invalid_argument("run.xdmf: frames are numbered without gaps");
  if (index == size()) {
    append(grid);
    starts_.push_back(end_);
  } else {
    // A frame after a restart: later frames belong to the past that is simulated again.
    replace_from(index, grid);
    starts_.resize(index + 1);
    end_ = starts_[index];
  }
  end_ += grid.size();
}

void XdmfFile::cut(std::size_t count) {
  if (count >= size()) return;
  replace_from(count, "");
  end_ = starts_[count];
  starts_.resize(count);
}

/// Replaces grid number `index` and all later grids by `grid`, or by nothing.
void XdmfFile::replace_from(std::size_t index, const std::string& grid) {
  std::string text(starts_[index], '\0');
  if (!std::ifstream(path_, std::ios::binary).read(text.data(), static_cast<std::streamsize>(text.size())))
    throw OutputError("cannot read {} back; was it changed during the run?", path_.string());
  write_file_atomically(path_, {text, grid, footer});
}

void XdmfFile::append(const std::string& grid) {
  // One write over the old footer, so that a kill leaves the file before or after it. Rewriting the whole file for
  // every frame would cost a time quadratic in their number.
  const int file = open_regular(path_, O_WRONLY);
  int error = file < 0 ? errno : 0;
  const std::string text = grid + std::string(footer);
  const auto at = static_cast<off_t>(end_);
  if (error == 0) {
    const ssize_t written = ::pwrite(file, text.data(), text.size(), at);
    if (written != static_cast<ssize_t>(text.size())) {
      error = written < 0 ? errno : ENOSPC;
      // The old footer needs no new space.
      (void)!::pwrite(file, footer.data(), footer.size(), at);
      (void)!::ftruncate(file, at + static_cast<off_t>(footer.size()));
    }
  }
  if (file >= 0) ::close(file);
  if (error != 0)
    throw OutputError("cannot write {}: {}; check free space and permissions", path_.string(), std::strerror(error));
}

}  // namespace pliant
