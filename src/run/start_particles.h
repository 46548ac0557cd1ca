// Particles of a new run from a file, -start: a frame of an earlier run, or a table.
#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/io/checkpoint.h>
#include <pliant/model/topology.h>
#include <pliant/run/archive.h>
#include <pliant/run/simulation.h>

namespace pliant {

/// The particles that a scenario can take.
struct StartNeeds {
  int dim = 2;
  std::string model;                    ///< name of the run's model
  bool polygons = false;                ///< particles have several points
  bool rotates = false;                 ///< particles have angles and spins
  std::string length;                   ///< unit of length
  std::optional<Real> edge_width = {};  ///< smooth polygons: width of an edge over its rest length, if a table lacks it
  Real density = 1;                     ///< mass over area, or volume, if a table lacks masses
};

/// Particles with ids 0 …, in their order in the file.
struct StartParticles {
  Topology topology;
  std::vector<Real> x, v;           ///< [points · D]; v is empty if the file has no velocities
  std::vector<Real> angles, spins;  ///< [particles · rotations], or empty
  bool has_widths = true;           ///< the file has the widths of edges of polygons
  bool has_masses = true;           ///< the file has masses
  Real height = 0;                  ///< largest of the last coordinates
  nlohmann::ordered_json source;    ///< "file", "frame" (of run.h5), "crc32" of the numbers
};

/// file: FILE.h5 (the last frame), FILE.h5:FRAME, or a table with a line of column names. Particles that
/// had left the run of a frame are left out. Errors: InputError for a file that cannot be read, a frame that does not
/// exist, another dimension, unit or shape of particles than needed; in a table for missing, unknown and repeated
/// columns, repeated ids, and numbers that are not finite or not positive.
StartParticles read_start(const std::string& file, const StartNeeds& needs);

/// CRC-32 of a file with such a name; none for a file that cannot be read, and for a pipe, which can be read once only.
std::optional<std::uint32_t> crc32_of_start(const std::string& file);

/// The fault of polygon m: an edge without length, an outline that meets itself, or clockwise vertices; else nothing.
std::optional<std::string> outline_fault(const Topology& topology, Index m, const Real* x);

/// The option -start of a scenario. Checkpoints keep sizes and masses, so that a restart does not read the file.
class StartOption {
 public:
  void bind(Options& options);
  bool given() const { return !file_.empty(); }
  const std::string& file() const { return file_; }
  /// Reads the file, or takes the particles, without positions, from the checkpoint of a run that has read it. Does
  /// nothing without the option. Errors: InputError.
  void take(const StartNeeds& needs, const std::optional<Checkpoint>& checkpoint);
  const StartParticles& particles() const { return *particles_; }
  /// Whether the particles have positions: at the start of the run, not of a restart.
  bool fresh() const { return given() && !particles_->x.empty(); }

  /// Errors: InputError for an option of the user that the particles of the file make meaningless.
  void refuse(const Options& options, std::initializer_list<const char*> names) const;
  /// Errors: InputError for a particle m in which fault(m) finds a fault ("is in a wall; move it"), one that moves by
  /// more than its diameter in a step dt, two disks or spheres whose overlap, over their contact distance, exceeds
  /// passing_overlap, and two polygons whose outlines meet or of which one contains the other.
  template <int D>
  void check(Real dt, const std::function<std::optional<std::string>(Index)>& fault) const;
  /// Sets the velocities, angles and spins of the rank's particles, at the start of the run.
  template <int D>
  void set_motion(Simulation<D>& simulation) const;
  /// At the start of a run with gravity 1 along the last axis: prints the energy of contacts, and
  /// warns if it is large, as overlaps of a softer or pressed packing become motion and heat. contact_energy: the
  /// option to lower. Collective.
  template <int D>
  void report_energy(Simulation<D>& simulation, const std::string& contact_energy) const;
  /// Writes the particles to a checkpoint; take() reads them.
  void visit(Archive& archive) const;
  /// For the manifest; null without the option.
  nlohmann::ordered_json source() const { return given() ? particles_->source : nlohmann::ordered_json(); }

 private:
  std::string file_;
  std::shared_ptr<const StartParticles> particles_;
};

}  // namespace pliant
