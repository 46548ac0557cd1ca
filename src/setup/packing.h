// Dense packings without overlaps: where a run starts.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include <pliant/geometry/container.h>
#include <pliant/model/topology.h>

namespace pliant {

template <int D>
class ParticleSystem;

struct PackingParameters {
  Real fraction =
      0.84;  ///< to start from: of the filled part of the hopper that the particles' outer disks (spheres) cover
  Real tolerance = 1e-4;  ///< largest overlap, relative to a contact's range, that counts as none
  std::uint64_t seed = 1;
  Real clearance = 0;  ///< from walls, in σ_avg
};

struct Packing {
  Real fraction = 0;            ///< reached
  Real height = 0;              ///< of the lid, σ_avg
  std::int64_t iterations = 0;  ///< of FIRE
  Real max_overlap = 0;         ///< largest 1 − r/σ_mn of the outer disks, or 1 − 2 d/σ_m at walls
};

/// Disks (spheres) that were pushed apart.
struct RelaxedDisks {
  std::int64_t iterations = 0;  ///< of FIRE
  Real max_overlap = 0;         ///< as of Packing
  bool done = false;            ///< within the tolerance, and all inside
  std::string reason;           ///< why it ended
};

/// The largest overlap of points among each other and with walls, over the distance of contact; of x [points · D].
template <int D>
Real largest_overlap(ParticleSystem<D>& system, const Real* x);

/// Pushes disks, which may lie on top of each other, apart and off the walls with FIRE. inside(m, r): whether disk m is
/// in the container at centres r, where the walls alone do not keep it in. centres [disks · D], by id.
template <int D>
RelaxedDisks relax_disks(Topology disks, const Walls<D>& walls, Real tolerance, std::int64_t max_iterations,
                         const std::function<bool(Index, const Real*)>& inside, std::span<Real> centres);

/// Errors: InputError for a particle that is wider than the container where particles come in.
void check_fit(const Topology& topology, const Container& container);

/// Places the particles at random in the closed container, filled up to the height that gives the fraction, and relaxes
/// them with FIRE until their outer disks do not overlap [H 2.4]. Where they jam with overlaps left the lid is raised
/// by two percent, until they fit: the densest start that this preparation reaches. Polygons get their regular shape
/// and a random orientation. Writes x [points · D]. Errors: those of check_fit; NumericalError if they do not fit at
/// half the fraction.
template <int D>
Packing pack(const Topology& topology, const Container& container, const PackingParameters& p, Real* x);

}  // namespace pliant
