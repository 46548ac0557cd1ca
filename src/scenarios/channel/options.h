// Options of the scenario `channel`.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/catalogue/model_choice.h>
#include <pliant/model/rest_shape.h>
#include <pliant/run/options.h>
#include <pliant/run/start_particles.h>
#include <pliant/scenarios/channel/channel_shape.h>
#include <pliant/scenarios/channel/distributions.h>
#include <pliant/scenarios/channel/push_schedule.h>
#include <pliant/setup/rest_outlines.h>

namespace pliant {

enum class OnJam { proceed, end };

/// As given by the user; `resolve` fills in automatic values. Units: cm, g, s.
struct ChannelOptions : RunOptions {
  ChannelKind kind = ChannelKind::l;
  ChannelSize size;
  std::string outline, plungers;  ///< empty: none, automatic
  Real shear = 0;
  std::optional<Channel> channel;  ///< made by `resolve` from the options above

  StartOption start;
  std::string distribution = "T4", radii, counts;
  std::vector<SizeClass> sizes;  ///< resolved from the options above; with -start the sizes in the file
  std::vector<Index> disks;      ///< number of disks of each size
  Real area_fraction = 0.77;
  Real density = 1.19, thickness = 0.29;
  Real start_overlap = 1e-4;

  /// disk: frictional disks; rough: stiff polygons of any outline, whose friction is from the disks on their vertices.
  ModelChoice model;
  OutlineShape shape{.kind = OutlineKind::ellipse, .aspect = 2};
  std::string shape_outline;  ///< outline from a file; empty: `shape`
  Index n_vertices = 16;      ///< vertices of the smallest polygons; the number grows in proportion to the size
  std::shared_ptr<const RestOutlines> outlines;  ///< made by `resolve` from the options above

  Real stiffness = 2e7;  ///< stiffness of contacts with particles and walls

  Index pushes = 10;
  PushOptions push;
  Real jam_overlap = 0.02, jam_force = 10;
  OnJam on_jam = OnJam::proceed;

  std::optional<Real> dt, t_end, skin;
  Real sample_travel = 0.011;

  ChannelOptions();
  void bind(Options& options);
  /// Takes the particles of -start. Errors: InputError.
  void take_start(const std::optional<Checkpoint>& checkpoint);
  /// Errors: InputError.
  void resolve();
  /// Errors: InputError for options that another option makes ineffective.
  void refuse_unread(const Options& options) const;

  /// Area of the channel without the stroke of one plunger, cm²: reference of -area_fraction.
  Real filled_area() const;
  /// g; for the area of a disk.
  Real mass(Real radius) const { return density * thickness * pi * square(radius); }
  bool rough() const { return model.deformable(); }
  Real gravity() const { return model.value(Role::normal_gravity); }
  Surroundings<2> surroundings() const {
    return {.substrate = true, .rest_outlines = outlines, .rest_stiffness = stiffness};
  }
  /// "disk" or "polygon"
  const char* particle() const { return rough() ? "polygon" : "disk"; }
  /// How many vertices a polygon has that covers the area of a disk, and the length of its edges in cm.
  Index vertices(Real radius) const;
  Real edge(Real radius) const;
  /// The particles, in the order of their ids.
  Topology particles() const;

 private:
  void resolve_sizes();
  /// Of polygons. Returns the largest radius of a circle around one.
  Real resolve_outlines();
  template <class Visit>
  void for_each_polygon(Visit&& visit) const;
  Real edge_of(Index k) const;
};

}  // namespace pliant
