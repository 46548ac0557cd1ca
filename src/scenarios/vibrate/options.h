// Options of the scenario `vibrate`.
#pragma once

#include <algorithm>
#include <optional>

#include <pliant/base/options.h>
#include <pliant/catalogue/model_choice.h>
#include <pliant/run/options.h>
#include <pliant/run/start_particles.h>
#include <pliant/setup/particles.h>

namespace pliant {

enum class ShakeDirection { vertical, horizontal };
enum class VibrateIntegrator { verlet, ts };

/// As given by the user; `resolve` fills in automatic values. Units: σ_avg = g = ρ = 1, times in t0.
struct VibrateOptions : RunOptions {
  ModelChoice model;
  int dim = 2;
  StartOption start;
  Index particles = 100;  ///< resolved: with -start their number in the file
  SizeDistribution sizes;
  PolygonShape shape;
  std::optional<Real> pack_fraction;
  Real pack_tolerance = 1e-4;

  Real width = 10;          ///< between the side walls; in 3D the diameter
  std::optional<Real> lid;  ///< height above the floor
  Real amplitude = 0.1, frequency = 1;
  ShakeDirection direction = ShakeDirection::vertical;

  VibrateIntegrator integrator = VibrateIntegrator::verlet;
  std::optional<Real> dt, skin;
  Index cycles = 200, samples_per_cycle = 16;
  Real frames_per_cycle = 4;

  VibrateOptions();
  void bind(Options& options);
  /// Takes the particles of -start. Errors: InputError.
  void take_start(const std::optional<Checkpoint>& checkpoint);
  /// Errors: InputError.
  void resolve();
  /// Errors: InputError for options that the model or another option makes ineffective.
  void refuse_unread(const Options& options) const;

  bool deformable() const { return model.deformable(); }
  Index points() const {
    return start.given() ? start.particles().topology.points() : deformable() ? particles * shape.vertices : particles;
  }
  Real angular_frequency() const { return 2 * pi * frequency; }
  /// Largest acceleration of the container over g.
  Real acceleration() const { return amplitude * square(angular_frequency()); }
};

}  // namespace pliant
