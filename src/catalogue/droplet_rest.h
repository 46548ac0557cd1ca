// Where two droplets, or a droplet and a wall, are at rest.
#pragma once

#include <pliant/model/bubble_contact.h>
#include <pliant/model/depletion.h>
#include <pliant/model/wall_depletion.h>
#include <pliant/model/wall_repulsion.h>

namespace pliant {

/// A pair in equilibrium.
struct DropletRest {
  Real distance;   ///< where the force vanishes: d_eq of the centres [T 2.12], or of a centre from the wall
  Real stiffness;  ///< U'' there, on the side of contact [T 2.17, 2.24]
  Real energy;     ///< that it takes to separate them [T 2.21, 2.25]
};

/// Two droplets of radii a and b; exact, where [T 2.12–2.23] expand. Errors: InputError where the attraction is so
/// strong that they never rest.
DropletRest droplets_at_rest(const BubbleContactLaw& contact, const DepletionLaw& depletion, Real a, Real b);
/// A droplet at a flat wall. Errors: as above.
DropletRest droplet_at_wall(const WallRepulsionLaw& repulsion, const WallDepletionLaw& depletion, Real radius);

}  // namespace pliant
