// The folder of a run: run.h5 with frames and series, and run.xdmf beside it. docs/file-format.md lists what is in
// them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include <pliant/base/types.h>
#include <pliant/io/hdf5.h>
#include <pliant/io/xdmf.h>
#include <pliant/model/topology.h>

namespace pliant {

/// Who made the run and from what. The version of HDF5 is added by the writer.
struct Manifest {
  std::string program = "pliant", version, build, petsc_version, scenario, model, created;
  int dim = 2;
  std::int64_t seed = 0;
  nlohmann::ordered_json options;  ///< option name → {"value", "unit", "source"}
};

struct RunGeometry {
  std::string kind;                        ///< "hopper2d", "hopper3d", "raft", "wedge"
  std::vector<Real> segments;              ///< [S, 4] of the walls, in their order, at the start
  std::map<std::string, Real> attributes;  ///< "W", "w", "angle"
};

/// Equally many numbers of each of some structures in an array; the first ones at `data`, others `stride` bytes apart.
template <class T>
struct Strided {
  const T* data = nullptr;
  std::size_t stride = 0;
  const T* operator[](std::size_t k) const {
    return reinterpret_cast<const T*>(reinterpret_cast<const char*>(data) + k * stride);
  }
};

/// C contacts of a frame in D dimensions; the arrays are the caller's.
struct FrameContacts {
  std::uint64_t count = 0;         ///< C
  Strided<Index> particles;        ///< [C, 2]; the second is −1 for a wall
  Strided<Real> position, normal;  ///< [C, D]
  Strided<Real> overlap;           ///< [C]
  Strided<Real> force;             ///< [C, D], on the first particle
};

/// One frame of N particles with P points in D dimensions; the arrays are the caller's.
struct Frame {
  Real time = 0;  ///< t0
  std::int64_t step = 0;
  std::span<const Real> positions, velocities;  ///< [P, D]
  std::span<const Real> centres;                ///< [N, D]
  std::span<const std::uint8_t> active;         ///< [N]
  std::span<const Index> contact_count;         ///< [N]
  std::span<const Real> area, perimeter;        ///< [N], or empty
  std::span<const Real> wall_force;             ///< [S, D]
  std::span<const Real> wall_segments = {};     ///< [S, 4] where the walls are now, or empty: as in the geometry
  FrameContacts contacts;
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

/// Everything in /series of folder/run.h5. Errors: InputError.
Series read_series(const std::filesystem::path& folder);

/// Writes the folder. Of a frame nothing is copied as a whole. After each frame both files are complete on disk for
/// whoever reads them, and stay so if the program is killed. Errors of all members: OutputError; frames written before
/// stay readable.
class RunWriter {
 public:
  /// Starts a run: creates the folder and its parents. Errors: InputError if the folder holds a run already;
  /// OutputError.
  static RunWriter create(const std::filesystem::path& folder, const Manifest& manifest, const Topology& topology,
                          const RunGeometry& geometry);
  /// Goes on with the run in the folder from a checkpoint that knew of `series_rows` samples, `frames` frames and
  /// `event_rows` events. Later samples and events are dropped; later frames stay until they are written again. Errors:
  /// InputError if the folder holds no run, less than that, or other particles.
  static RunWriter append(const std::filesystem::path& folder, const Topology& topology, std::uint64_t series_rows,
                          std::uint64_t frames, std::uint64_t event_rows = 0);
  RunWriter(RunWriter&&) noexcept = default;
  RunWriter& operator=(RunWriter&&) = delete;
  /// Closes; silent about errors, unlike close().
  ~RunWriter();

  /// Writes /series_axes/name, or leaves it if it is there (after a restart).
  void write_axis(const std::string& name, std::span<const Real> values);
  /// Keeps one row of every series until the next frame or flush(). The first sample names the columns for the run.
  void add_sample(std::span<const SeriesValue> sample) { samples_.add(sample); }
  /// The same for /events, of which a run may have none.
  void add_event(std::span<const SeriesValue> event) { events_.add(event); }
  /// Writes the next frame and the samples before it, and flushes.
  void write_frame(const Frame& frame);
  /// Writes the samples kept so far; needed before a checkpoint that counts them.
  void flush();
  void close();

  /// What is in the file, after flush().
  Series read_series();
  std::uint64_t frames() const { return frames_; }         ///< number of the next frame
  std::uint64_t samples() const { return samples_.rows; }  ///< those kept included
  std::uint64_t events() const { return events_.rows; }    ///< those kept included
  const std::filesystem::path& folder() const { return folder_; }

 private:
  /// Rows of a group of datasets that grow together.
  struct Table {
    struct Column {
      std::string name;
      std::uint64_t width;
      bool is_row;
      std::vector<Real> kept;
    };
    std::string group;
    std::uint64_t rows = 0;
    std::vector<Column> columns = {};

    /// The table in the file, cut to its first `rows`.
    static Table stored(hdf5::File& file, const std::string& group, std::uint64_t rows);
    void add(std::span<const SeriesValue> row);
    std::uint64_t kept_bytes() const;
    void write(hdf5::File& file);
  };

  RunWriter(std::filesystem::path folder, hdf5::File file, const Topology& topology, XdmfFile xdmf);
  std::uint64_t kept_bytes() const { return samples_.kept_bytes() + events_.kept_bytes(); }
  void write_tables();
  void write_xdmf_data(hdf5::Group& group, const Frame& frame) const;

  std::filesystem::path folder_;
  hdf5::File file_;
  int dim_;
  std::vector<Index> offset_;  ///< of the points of each particle
  std::vector<Real> a0_;       ///< of each polygon; none of soft particles
  XdmfFile xdmf_;
  std::uint64_t walls_ = 0, frames_ = 0;
  Table samples_{"/series"}, events_{"/events"};
};

}  // namespace pliant
