// Dense packings without overlaps: where a run starts.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include <pliant/geometry/box.h>
#include <pliant/geometry/container.h>
#include <pliant/model/topology.h>

namespace pliant {

struct FireOptions;
template <int D>
class ParticleSystem;

struct PackingParameters {
  Real fraction = 0.84;   ///< at the start: fraction of the filled part of the hopper that the particles' outer disks
                          ///< (spheres) cover
  Real tolerance = 1e-4;  ///< largest overlap, relative to a contact's range, that counts as none
  std::uint64_t seed = 1;
  Real clearance = 0;                     ///< from walls, in σ_avg
  std::function<void()> check = nullptr;  ///< called often; ends the packing if it throws
};

struct Packing {
  Real fraction = 0;            ///< reached
  Real height = 0;              ///< of the lid, σ_avg
  std::int64_t iterations = 0;  ///< number of FIRE iterations
  Real max_overlap = 0;         ///< largest 1 − r/σ_mn of the outer disks, or 1 − 2 d/σ_m at walls
};

/// Particles that were pushed apart.
struct Relaxed {
  std::int64_t iterations = 0;  ///< number of FIRE iterations
  Real max_overlap = 0;         ///< as of Packing, of points
  bool done = false;            ///< within the tolerance, and all inside
  std::string reason;           ///< why it ended
};

/// Pushes the points x [points · D] of the system apart and off the walls with FIRE, by its forces and with equal
/// masses, until no overlap is larger than the tolerance and inside(x), or until options.done. options: without the
/// forces. check: as in PackingParameters.
template <int D>
Relaxed push_apart(ParticleSystem<D>& system, FireOptions options, Real tolerance,
                   const std::function<bool(const Real*)>& inside, std::span<Real> x,
                   const std::function<void()>& check = nullptr);

/// How disks are pushed apart.
struct DiskPush {
  Real tolerance = 1e-4;            ///< as of PackingParameters
  std::int64_t iterations = 20000;  ///< largest number of FIRE iterations
  /// After each `looks` · 10 iterations the overlapping pairs are counted: disks jam if there are more than 0.9 D pairs
  /// for each disk at the first look; this limit falls by half in 300 iterations. 0: no looks.
  std::int64_t looks = 0;
  Real margin = 0;  ///< by this part of their diameters disks are widened while they are pushed
  Real skin = 0.3;  ///< of the neighbour lists, in σ_avg
};

/// Pushes disks, which may lie on top of each other, apart and off the walls with FIRE, until no overlap is larger than
/// the tolerance, they jam, or the iterations end. inside(m, r): whether the m-th centre of r is in the container,
/// needed if the walls alone do not confine the disks. centres [disks · D], by id. check: as in PackingParameters.
template <int D>
Relaxed relax_disks(Topology disks, const Walls<D>& walls, const DiskPush& options,
                    const std::function<bool(Index, const Real*)>& inside, std::span<Real> centres,
                    const Box<D>& box = {}, const std::function<void()>& check = nullptr);

/// Errors: InputError for a particle that is wider than the container where particles come in.
void check_fit(const Topology& topology, const Container& container);

/// Places the particles at random in the closed container, filled up to the height that gives the fraction, and relaxes
/// them with FIRE until their outer disks do not overlap [H 2.4]. If they jam with overlaps, the lid is raised by two
/// percent, until they fit. Polygons get their regular shape and a random orientation. Writes x [points · D]. Errors:
/// as check_fit; NumericalError if the particles do not fit at half the fraction.
template <int D>
Packing pack(const Topology& topology, const Container& container, const PackingParameters& p, Real* x);

/// The same in a periodic box, whose volume gives the fraction (p.fraction is unused). Errors: InputError for a box
/// that is open in a direction, and a particle that is wider than the box; NumericalError if overlaps remain.
template <int D>
Packing pack(const Topology& topology, const Box<D>& box, const PackingParameters& p, Real* x);

}  // namespace pliant
