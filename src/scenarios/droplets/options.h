// Options that the scenarios of droplets share.
#pragma once

#include <optional>
#include <vector>

#include <pliant/catalogue/model_choice.h>
#include <pliant/model/depletion.h>
#include <pliant/run/options.h>
#include <pliant/setup/particles.h>
#include <pliant/system/neighbour_drag.h>

namespace pliant {

/// Binds -b and -mobility.
void bind_droplet_drag(Options& options, Real& b, Coupling& mobility);
/// The fastest decay rate of contacts, at touch: of a single droplet between walls_at_once walls, or of droplets
/// against each other, whose friction grows with their number like the stiffness. walls_rub:
/// NeighbourDragOptions::walls.
Real fastest_relaxation(const ModelChoice& model, Real b, const std::vector<Real>& diameters, int walls_at_once,
                        bool walls_rub);

enum class DropletIntegrator { ts };

/// Units: ⟨R⟩ = b = 1, so that forces have the unit of f0 and times the unit t0 = b ⟨R⟩/force. A scenario sets its
/// defaults before it binds.
struct DropletOptions : RunOptions {
  DropletOptions();

  ModelChoice model;
  Real b = 1;
  Coupling mobility = Coupling::exact;
  RadiusDistribution radii;
  DropletIntegrator integrator = DropletIntegrator::ts;
  Real longest_standard_dt = 0.1, skin = 0.3;
  std::optional<Real> dt;
  std::optional<Real> t_end;

  Depletion<2> depletion() const { return model.term(Depletion<2>{}); }
  /// How far beyond contact the attraction acts.
  Real attraction_range() const { return depletion().range(); }
  NeighbourDragOptions drag_options() const {
    return {.b = b, .beyond_contact = attraction_range(), .coupling = mobility};
  }

 protected:
  void bind_model(Options& options);     ///< the group "Model"
  void bind_droplets(Options& options);  ///< `radii.deviation` and `seed`, for a group that the scenario has begun
  /// The group "Integration".
  void bind_integration(Options& options, const std::string& automatic_dt, const std::string& automatic_end);
};

}  // namespace pliant
