// Options of the scenario `clog`.
#pragma once

#include <pliant/run/start_particles.h>
#include <pliant/scenarios/droplets/options.h>

namespace pliant {

/// When droplets count as resting.
enum class RestRule {
  minimum,  ///< also if they are next to a minimum of the energy, or hang below an exit that all other droplets have
            ///< passed
  speed     ///< when they are slow, and not before
};

/// Units as in DropletOptions: ⟨R⟩ = b = ρ = 1.
struct ClogOptions : DropletOptions {
  ClogOptions();

  StartOption start;
  Index n = 190;
  Real width = 3;   ///< of the exit, in mean diameters
  Real angle = 45;  ///< of the walls to gravity, degrees
  Real g = 0.01;
  bool wall_friction = true;
  Real fill_fraction = 0.4;
  Real clog_speed = 1e-12;
  RestRule rest = RestRule::minimum;

  void bind(Options& options);
  /// Errors: InputError.
  /// Takes the droplets of -start, in place of n and radii.
  void take_start(const std::optional<Checkpoint>& checkpoint);
  void resolve();

  Real half_width() const { return width; }  ///< of the exit, in ⟨R⟩
};

}  // namespace pliant
