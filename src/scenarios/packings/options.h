// Options of the scenarios of packings in a periodic box.
#pragma once

#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/catalogue/model_choice.h>
#include <pliant/jamming/minimise.h>
#include <pliant/model/term.h>
#include <pliant/run/options.h>
#include <pliant/setup/particles.h>

namespace pliant {

/// Units: σ_avg and the energy ε in which contact energies are given.
struct PackingOptions : RunOptions {
  /// unused: terms of the models that the scenario has no use for, besides friction and walls.
  explicit PackingOptions(std::initializer_list<std::string_view> unused = {"drag"});

  ModelChoice model;
  int dim = 2;
  Index particles = 64;
  SizeDistribution sizes;
  PolygonShape shape{.vertices = 0};
  std::string mesh;  ///< text of an OFF file, of which shape.mesh is made; empty: none
  std::optional<Real> fraction;
  Minimiser minimiser = Minimiser::lbfgs;
  Real force_tolerance = 1e-6;
  std::int64_t max_iterations = 1000000;
  Real contact_threshold = 1e-5;
  bool moduli = false;
  Index modes = 0;
  PreStress pre_stress = PreStress::kept;
  std::optional<Real> mode_amplitude;  ///< largest displacement of a point

  /// The value of the option -minimiser.
  std::string minimiser_name() const;
  /// Of the energies along modes, in ascending order; none without -mode_amplitude.
  std::vector<Real> mode_amplitudes() const;
  /// Coordinates of a particle that the stiffness of its shape leaves free; nothing for surfaces, and for polygons
  /// whose edges or area have no stiffness.
  std::optional<Index> free_coordinates() const;
  Index points() const { return model.deformable() ? particles * shape.vertices : particles; }
  /// Errors: InputError for options that the model does not read.
  void refuse_unread(const Options& options) const;

 protected:
  void bind_particles(Options& options);  ///< the groups "Model" and "Particles"
  void resolve_particles();
  void bind_minimisation(Options& options);  ///< the group "Minimisation"
  void bind_analysis(Options& options);      ///< the group "Analysis"
  void bind_packing_output(Options& options, const std::string& step);
};

enum class PackingPath { decompress, compress, quench };

struct PackOptions : PackingOptions {
  using PackingOptions::PackingOptions;

  PackingPath path = PackingPath::decompress;
  Real pressure = 1e-6, start_pressure = 1e-2, fraction_step = 1e-3;
  Index per_decade = 1;

  void bind(Options& options);
  void resolve();
  /// The groups before "Minimisation". compresses: whether the path may be `compress`, whose number of packings is
  /// unknown at the start.
  void bind_path(Options& options, bool compresses);
  /// The pressures of a decompression, the last one of a compression, or none.
  std::vector<Real> pressures() const;
  /// The path in a title.
  std::string path_text() const;
  /// Errors: InputError for options that the model or the path does not read.
  void refuse_unread(const Options& options) const;

 protected:
  void refuse_unread_by_path(const Options& options) const;
  std::string path_name() const;
};

enum class ShearControl { volume, pressure };

enum class ShearIntegrator { verlet, ts };

struct ShearOptions : PackOptions {
  ShearOptions();

  Real strain_step = 1e-3;
  std::optional<Real> strain;
  Index cycles = 0;  ///< 0: the strain grows in one direction; else cycles of oscillatory quasistatic shear
  ShearControl control = ShearControl::volume;
  std::optional<Real> rate;  ///< of steady shear, in 1/t0; nothing: quasistatic steps
  ShearIntegrator integrator = ShearIntegrator::verlet;
  std::optional<Real> dt;

  void bind(Options& options);
  /// Errors: InputError as of PackOptions.
  void resolve();
  /// Errors: InputError, also for options that only the other kind of shear reads.
  void refuse_unread(const Options& options) const;

 private:
  std::optional<Real> samples_, frames_;  ///< intervals, as the user gave them
};

}  // namespace pliant
