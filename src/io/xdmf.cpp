#include <pliant/io/xdmf.h>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string_view>

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

constexpr std::string_view real = R"(NumberType="Float" Precision="8")";
constexpr std::string_view integer = R"(NumberType="Int" Precision="4")";
constexpr std::string_view byte = R"(NumberType="UChar" Precision="1")";

std::string data(std::string_view type, const std::string& dimensions, const std::string& path) {
  return fmt::format(R"(<DataItem Dimensions="{}" {} Format="HDF">run.h5:{}</DataItem>)", dimensions, type, path);
}

std::string grid(std::string_view name, std::uint64_t cells, int dim, const std::string& connectivity,
                 const std::string& points, const std::string& attributes) {
  return fmt::format(R"(        <Grid Name="{}" GridType="Uniform">
          <Topology TopologyType="Mixed" NumberOfElements="{}">{}</Topology>
          <Geometry GeometryType="{}">{}</Geometry>
{}        </Grid>
)",
                     name, cells, connectivity, dim == 2 ? "XY" : "XYZ", points, attributes);
}

struct CaseValue {
  std::string_view name, type;
  std::string_view constant;  ///< dataset for cells that have no such value
};
// ParaView colours a frame by a field only if all grids have it. Where it is NaN it shows the colour for NaN; active is
// 1, so that who keeps what is active keeps walls and contacts.
constexpr CaseValue fields[] = {{"speed", real, "nan"},
                                {"sigma", real, "nan"},
                                {"particle", integer, "minus_one"},
                                {"active", byte, "one"},
                                {"contact_count", integer, "minus_one"},
                                {"area_ratio", real, "nan"},
                                {"force", real, "nan"},
                                {"overlap", real, "nan"}};

/// All fields of `cells` cells: the datasets `own`, by names of fields, and constants in `folder` for the others.
std::string attributes(const XdmfFrame& frame, std::uint64_t cells, const std::map<std::string_view, std::string>& own,
                       const std::string& folder) {
  std::string text;
  for (const CaseValue& field : fields) {
    if (field.name == "area_ratio" && !frame.polygons) continue;
    const auto found = own.find(field.name);
    const std::string path = found != own.end() ? found->second : fmt::format("{}/{}", folder, field.constant);
    text += fmt::format("          <Attribute Name=\"{}\" AttributeType=\"Scalar\" Center=\"Cell\">{}</Attribute>\n",
                        field.name, data(field.type, std::to_string(cells), path));
  }
  return text;
}

/// Cells of `length` values of connectivity over `points` points.
std::string lines(std::string_view name, std::uint64_t count, int dim, std::uint64_t length, std::uint64_t points,
                  const std::string& connectivity, const std::string& places, const std::string& attributes) {
  return grid(name, count, dim, data(integer, std::to_string(length), connectivity),
              data(real, fmt::format("{} {}", points, dim), places), attributes);
}

}  // namespace

std::string xdmf_grid(const XdmfFrame& frame) {
  const std::string group = "/frames/" + frame.name, own = group + "/xdmf";
  std::string grids = grid("particles", frame.particles, frame.dim,
                           data(integer, std::to_string(frame.connectivity), own + "/connectivity"),
                           data(real, fmt::format("{} {}", frame.points, frame.dim), group + "/positions"),
                           attributes(frame, frame.particles,
                                      {{"speed", own + "/speed"},
                                       {"sigma", "/topology/sigma"},
                                       {"particle", own + "/particle"},
                                       {"active", group + "/active"},
                                       {"contact_count", group + "/contact_count"},
                                       {"area_ratio", own + "/area_ratio"}},
                                      "/topology/xdmf"));
  // The contacts come last, as a frame without them has no such grid: the numbers of the others stay.
  if (frame.walls > 0 && frame.dim == 2)
    grids += lines("walls", frame.walls, frame.dim, frame.wall_connectivity, frame.wall_points,
                   "/geometry/xdmf/connectivity", frame.moving_walls ? own + "/wall_points" : "/geometry/xdmf/points",
                   attributes(frame, frame.walls, {}, "/geometry/xdmf"));
  if (frame.contacts > 0)
    grids += lines(
        "contacts", frame.contacts, frame.dim, 4 * frame.contacts, 2 * frame.contacts, own + "/contact_connectivity",
        own + "/contact_points",
        attributes(frame, frame.contacts, {{"force", own + "/contact_force"}, {"overlap", group + "/contacts/overlap"}},
                   own + "/contact_constants"));
  return fmt::format(R"(      <Grid Name="{}" GridType="Collection" CollectionType="Spatial">
        <Time Value="{}"/>
{}      </Grid>
)",
                     frame.name, frame.time, grids);
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

std::int32_t xdmf_line(std::uint64_t k) {
  const auto i = static_cast<std::int32_t>(k / 4);
  return std::array<std::int32_t, 4>{polyline, 2, 2 * i, 2 * i + 1}[k % 4];
}

XdmfLines xdmf_walls(const std::vector<Real>& segments, const std::vector<Real>& radius) {
  constexpr std::int32_t corners = 64;
  XdmfLines lines{segments, {}};
  for (std::size_t k = 0; k < segments.size() / 4; ++k) {
    if (radius.empty() || radius[k] == 0) {
      for (std::uint64_t i = 4 * k; i < 4 * k + 4; ++i) lines.cells.push_back(xdmf_line(i));
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
    // A frame after a restart: what follows it belongs to the past that is simulated again.
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

/// Writes `grid`, or nothing, in the place of number `index` and those after it.
void XdmfFile::replace_from(std::size_t index, const std::string& grid) {
  std::string text(starts_[index], '\0');
  if (!std::ifstream(path_, std::ios::binary).read(text.data(), static_cast<std::streamsize>(text.size())))
    throw OutputError("cannot read {} back; was it changed while the run was going?", path_.string());
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
