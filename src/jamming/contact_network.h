// The contacts that hold up a packing, and its rattlers.
#pragma once

#include <span>
#include <vector>

#include <pliant/system/particle_system.h>

namespace pliant {

/// Two particles that touch. If a particle touches several periodic images of another particle, or of itself, each
/// touching image gives a separate pair.
template <int D>
struct TouchingPair {
  Index first, second;  ///< ids
  Vec<D> branch;        ///< from the centre of the first particle to the centre of the touching image of the second
  Vec<D> force;         ///< elastic, on the first: the sum over the contacts of their points
  Index contacts;       ///< contacts of points
};

/// Contacts with an overlap count, and bonds of droplets that attract each other at a distance. A place where two
/// particles touch counts once: a vertex of a smooth polygon at a vertex of another is one contact, though both touch
/// the edges of the other. A vertex of a rough polygon that touches two vertices and the edge between them has three
/// contacts.
///
/// A rattler is a particle that its contacts cannot hold: one with fewer than D + 1 contacts, or a deformable
/// particle with fewer than two touching particles. Contacts of rattlers do not count, so that
/// other particles may become rattlers, and so on.
template <int D>
struct ContactNetwork {
  std::vector<TouchingPair<D>> pairs;  ///< without rattlers
  std::vector<Index> rattlers;         ///< ids, in ascending order
  Index backbone = 0;                  ///< N': active particles without the rattlers
  Index contacts = 0;                  ///< contacts of points in the pairs; N_c for soft particles
  Real typical_force = 0;              ///< Σ f²/Σ f over all contacts: see contact_network()

  Index touching() const { return static_cast<Index>(pairs.size()); }
  /// Mean number of touching particles per particle of the backbone; 0 without any.
  Real coordination() const { return backbone > 0 ? 2.0 * touching() / backbone : 0; }
  /// The mean number of contacts of points, counted in the same way.
  Real contacts_per_particle() const { return backbone > 0 ? 2.0 * contacts / backbone : 0; }
  /// Contacts of a packing in a periodic box that just resists compression and, without pre-stress, lets nothing but
  /// translations free: one for each coordinate that the shape of a particle leaves free, without D translations of
  /// the packing, and one for the size of the box. 0 without any particle.
  Index isostatic(Index free_coordinates = D) const { return backbone > 0 ? free_coordinates * backbone - D + 1 : 0; }
};

/// The network at x [size of the system]. Contacts count if their force exceeds `threshold` times the typical force:
/// Σ f²/Σ f over all contacts, which contacts with very small forces do not change. Errors: InputError for a threshold
/// that is not in [0, 1), for walls, and on several ranks.
template <int D>
ContactNetwork<D> contact_network(ParticleSystem<D>& system, std::span<const Real> x, Real threshold = 0);

}  // namespace pliant
