// run.xdmf: the frames of run.h5 for ParaView. Written so that all readers of stock ParaView 5.11 open
// it: whole datasets only, as they have no hyperslabs or functions in common; names relative to the folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

/// Input of a frame's XML; the values stay in run.h5.
struct XdmfFrame {
  std::string name;  ///< name of the group in /frames
  Real time = 0;     ///< in t0
  int dim = 2;
  std::uint64_t particles = 0, points = 0, contacts = 0, wall_contacts = 0, walls = 0;
  std::uint64_t wall_points = 0, wall_connectivity = 0;  ///< sizes of the wall grid
  std::uint64_t faces = 0;                               ///< triangles of all closed surfaces; 0: other particles
  std::uint64_t connectivity = 0;                        ///< length of the particles' connectivity
  bool moving_walls = false;                             ///< whether the frame has separate places of the walls
  bool single = false;                                   ///< whether its real numbers have 4 bytes
  std::set<std::string, std::less<>> datasets = {};      ///< the datasets of xdmf_datasets() that the frame has

  bool has(std::string_view dataset) const { return datasets.contains(dataset); }
};

/// Datasets of a frame that run.xdmf shows where they are there, as paths relative to the frame: in the plane vectors
/// are views (Group::write_view) in the frame's group xdmf, as readers need three components.
std::vector<std::string> xdmf_datasets(int dim);

/// The `<Grid>` element of one frame.
std::string xdmf_grid(const XdmfFrame& frame);

/// Connectivity of particles in topology "Mixed": a polygon of its points, or a Polyvertex of its one point.
std::vector<std::int32_t> xdmf_particles(const std::vector<Index>& offset);

/// Lines in the plane that draw walls.
struct XdmfLines {
  std::vector<Real> points;         ///< [P, 2], first the ends of the segments
  std::vector<std::int32_t> cells;  ///< connectivity
};
/// segments: [S, 4] ends; radius: [S], where positive a circle about the first end, or empty.
XdmfLines xdmf_walls(const std::vector<Real>& segments, const std::vector<Real>& radius);

/// The file, complete and valid XML after every call. Errors: OutputError.
class XdmfFile {
 public:
  /// Writes the file with the grids of these frames, replacing an older file.
  XdmfFile(std::filesystem::path path, const std::vector<std::string>& grids);
  /// Makes `grid` number `index` and the last; index ≤ size().
  void put(std::size_t index, const std::string& grid);
  /// Leaves the first `count` grids, or all if there are fewer.
  void cut(std::size_t count);
  std::size_t size() const { return starts_.size(); }

 private:
  void append(const std::string& grid);
  void replace_from(std::size_t index, const std::string& grid);

  std::filesystem::path path_;
  std::vector<std::size_t> starts_;  ///< position of each grid in the file
  std::size_t end_ = 0;              ///< position behind the last one
};

}  // namespace pliant
