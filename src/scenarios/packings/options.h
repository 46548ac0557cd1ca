// Options of the scenarios of packings in a periodic box.
#pragma once

#include <optional>
#include <vector>

#include <pliant/catalogue/model_choice.h>
#include <pliant/run/options.h>
#include <pliant/setup/particles.h>

namespace pliant {

/// Units: σ_avg and the energy ε in which contact energies are given.
struct PackingOptions : RunOptions {
  PackingOptions();

  ModelChoice model;
  int dim = 2;
  Index particles = 64;
  SizeDistribution sizes;
  PolygonShape shape;
  std::optional<Real> fraction;
  Real force_tolerance = 1e-6;
  std::int64_t max_iterations = 1000000;
  Real contact_threshold = 1e-5;
  bool moduli = false;
  Index modes = 0;

  Index points() const { return model.deformable() ? particles * shape.vertices : particles; }
  /// Errors: InputError for options that the model does not read.
  void refuse_unread(const Options& options) const;

 protected:
  void bind_particles(Options& options);     ///< the groups "Model" and "Particles"
  void bind_minimisation(Options& options);  ///< the group "Minimisation"
  void bind_analysis(Options& options);      ///< the group "Analysis"
  void bind_packing_output(Options& options, const std::string& step);
};

enum class PackingPath { decompress, compress, quench };

struct PackOptions : PackingOptions {
  PackingPath path = PackingPath::decompress;
  Real pressure = 1e-6, start_pressure = 1e-2, fraction_step = 1e-3;
  Index per_decade = 1;

  void bind(Options& options);
  void resolve();
  void bind_path(Options& options);  ///< the groups before "Minimisation"
  /// The pressures of a decompression, the last one of a compression, or none.
  std::vector<Real> pressures() const;
};

enum class ShearControl { volume, pressure };

struct ShearOptions : PackOptions {
  ShearOptions();

  Real strain_step = 1e-3, strain = 0.1;
  ShearControl control = ShearControl::volume;

  void bind(Options& options);
  /// Errors: InputError as of PackOptions, and for a path that does not end at a known packing.
  void resolve();
};

}  // namespace pliant
