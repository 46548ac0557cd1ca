// The folder of a run: run.h5 with frames and series, and run.xdmf. docs/reference/file-format.md lists their content.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/base/types.h>
#include <pliant/io/frame.h>
#include <pliant/io/hdf5.h>
#include <pliant/io/xdmf.h>
#include <pliant/model/topology.h>

namespace pliant {

/// Program and input of the run. The version of HDF5 is added by the writer.
struct Manifest {
  std::string program = "pliant", version, build, petsc_version, scenario, model, created;
  int dim = 2;
  std::int64_t seed = 0;
  nlohmann::ordered_json options;          ///< option name → {"value", "unit", "source"}
  nlohmann::ordered_json start = nullptr;  ///< file of the particles at the start; null: none
};

struct RunGeometry {
  std::string kind;                        ///< "hopper2d", "hopper3d", "raft", "wedge"
  std::vector<Real> segments;              ///< [S, 4] of the walls, in their order, at the start
  std::map<std::string, Real> attributes;  ///< "W", "w", "angle"
  std::vector<Real> radius = {};           ///< [S] of disks, which have their centre twice; 0: a segment. Or empty
  std::vector<Real> box = {};  ///< [2, D] of a periodic box: origin and lengths, infinite in open directions
};

/// Sizes of the shapes that run.xdmf draws.
struct DrawnShapes {
  std::uint64_t wall_points = 0, wall_connectivity = 0;  ///< numbers of points, and of values of connectivity
  std::uint64_t faces = 0;                               ///< triangles of all closed surfaces
};

/// One number or one row of numbers of a sample.
struct SeriesValue {
  SeriesValue(std::string column, Real value) : name(std::move(column)), values{value} {}
  SeriesValue(std::string column, std::span<const Real> row)
      : name(std::move(column)), values(row.begin(), row.end()), is_row(true) {}
  std::string name;
  std::vector<Real> values;
  bool is_row = false;
};

/// One dataset of /series: values [rows, width].
struct SeriesColumn {
  std::uint64_t rows = 0, width = 1;
  std::vector<Real> values;
};
using Series = std::map<std::string, SeriesColumn>;

/// All columns of /series of folder/run.h5. Errors: InputError.
Series read_series(const std::filesystem::path& folder);
/// In folder/run.h5. Errors: InputError.
std::size_t count_frames(const std::filesystem::path& folder);

/// How much of a run a checkpoint counts on.
struct RunCounts {
  std::uint64_t samples = 0, frames = 0, events = 0;
};
/// Errors: InputError if folder/run.h5 cannot be read, or has fewer rows or frames; `source` names, in the message, the
/// file that has the counts.
void check_counts(const std::filesystem::path& folder, const RunCounts& needed, std::string_view source);

/// Writes the folder. Frames are written without a full copy in memory. Data written by a frame or flush() survive a
/// kill of the program and a loss of power. Errors of all members: OutputError; the data of the last frame or flush()
/// stay.
///
/// On several ranks each has a writer. create, append and write_frame are collective, and an error of one rank is
/// thrown on all ranks; the other members, except frames(), are for the root alone. The root calls HDF5 and allocates a
/// frame in the file; all ranks then write the arrays.
class RunWriter {
 public:
  /// Starts a run: creates the folder and its parents. Errors: InputError if the folder holds a run already;
  /// OutputError.
  static RunWriter create(const std::filesystem::path& folder, const Manifest& manifest, const Topology& topology,
                          const RunGeometry& geometry, const Ranks& ranks = Ranks());
  /// Starts a run without a folder, views and run.xdmf, whose objects are kept in memory; see recorded(). On one rank.
  static RunWriter recorder(const Manifest& manifest, const Topology& topology, const RunGeometry& geometry);
  /// Continues the run in the folder from a checkpoint that counts `series_rows` samples, `frames` frames and
  /// `event_rows` events. Later samples and events are dropped; later frames stay until they are written again. All
  /// data counted by the checkpoint are compared with their checksums. Errors: InputError if the folder holds no run,
  /// fewer data, other particles, or if anything but frames is damaged.
  static RunWriter append(const std::filesystem::path& folder, const Topology& topology, std::uint64_t series_rows,
                          std::uint64_t frames, std::uint64_t event_rows = 0, const Ranks& ranks = Ranks());
  RunWriter(RunWriter&&) noexcept = default;
  RunWriter& operator=(RunWriter&&) = delete;
  /// Takes back all since the last frame or flush(), of which a failure may have left a part.
  ~RunWriter();

  /// Writes /series_axes/name, or leaves it if it is there (after a restart).
  void write_axis(const std::string& name, std::span<const Real> values);
  /// Removes the frames from number frames() on, which append() has left.
  void drop_later_frames();
  /// Stores one row of every series in memory until the next frame or flush(). The first sample names the columns for
  /// the run. After append() the first sample may add columns, as a newer version does: NaN in the rows before.
  void add_sample(std::span<const SeriesValue> sample) { samples_.add(sample); }
  /// Adds a row to /events, which may stay empty.
  void add_event(std::span<const SeriesValue> event) { events_.add(event); }
  /// Writes the next frame and the samples before it, and flushes. format: the same on all ranks.
  void write_frame(const Frame& frame, const FrameFormat& format = {});
  /// Writes the samples in memory.
  void flush();
  void close();
  /// Ends a recorder: a message with the objects of run.h5 (io/recording.h).
  std::string recorded();

  /// All samples so far.
  Series read_series();
  std::uint64_t frames() const { return frames_; }         ///< number of the next frame
  std::uint64_t samples() const { return samples_.rows; }  ///< those kept included
  std::uint64_t events() const { return events_.rows; }    ///< those kept included
  const std::filesystem::path& folder() const { return folder_; }
  /// Damage that append() found in frames, one message each; these frames are not changed.
  const std::vector<std::string>& damage() const { return damage_; }

 private:
  /// Rows of a group of datasets that grow together.
  struct Table {
    struct Column {
      std::string name;
      std::uint64_t width;
      bool is_row;
      std::optional<hdf5::Rows> stored = {};  ///< once there is a row in the file
      std::vector<Real> kept = {};
    };
    std::string group;
    std::uint64_t rows = 0;
    std::vector<Column> columns = {};
    bool accepts_columns = true;  ///< until the first row of this writer

    /// The table in the file, cut to its first `rows`.
    static Table stored(hdf5::File& file, const std::string& group, std::uint64_t rows);
    void add(std::span<const SeriesValue> row);
    void write(hdf5::File& file);
    /// All rows at once, if none is in the file yet.
    void write_whole(hdf5::File& file);
  };
  // NOLINTNEXTLINE(performance-unnecessary-value-param): once per run
  RunWriter(std::filesystem::path folder, const Ranks& ranks, int dim) : folder_(folder), ranks_(ranks), dim_(dim) {}
  void start(const Manifest& manifest, const Topology& topology, const RunGeometry& geometry);
  void write_head(const Manifest& manifest, const Topology& topology, const RunGeometry& geometry);
  void go_on(const Topology& topology, std::uint64_t series_rows, std::uint64_t event_rows);
  void check_frames();
  void write_views(hdf5::Group& frame, const std::string& path, hdf5::Type stored) const;
  void write_arrays(const std::vector<FrameArray>& arrays, std::vector<hdf5::Dataset>& datasets, bool compressed);

  std::filesystem::path folder_;
  Ranks ranks_;
  int dim_;
  std::optional<hdf5::File> file_;  ///< on the root
  std::optional<XdmfFile> xdmf_;    ///< on the root; none for a recorder
  std::uint64_t walls_ = 0, frames_ = 0;
  bool periodic_ = false, recorder_ = false, ended_ = false;
  DrawnShapes drawn_;
  Table samples_{"/series"}, events_{"/events"};
  std::vector<std::string> damage_;
};

}  // namespace pliant
