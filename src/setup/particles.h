// Sizes and shapes of the particles of a run.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <pliant/catalogue/catalogue.h>
#include <pliant/geometry/mesh.h>
#include <pliant/model/topology.h>

namespace pliant {

/// Distribution of diameters, always with mean σ_avg = 1.
struct SizeDistribution {
  std::string kind = "bidisperse";  ///< bidisperse, normal, mono
  Real ratio = 1.4;                 ///< bidisperse: σ_l/σ_s
  Real fraction = 0.5;              ///< bidisperse: fraction of large particles, by number
  Real deviation = 0.1;             ///< normal: standard deviation of the diameter in σ_avg

  /// Bounds of the diameters.
  Real smallest() const;
  Real largest() const;
};

/// n diameters; large and small diameters in random order. A normal diameter outside ±3 standard deviations is drawn
/// again. Errors: InputError if a normal diameter could be less than 0.1.
std::vector<Real> draw_diameters(const SizeDistribution& distribution, Index n, std::uint64_t seed);

/// Distribution of the radii of droplets, in units of the radius of a large droplet.
struct RadiusDistribution {
  Real deviation = 0;       ///< δ: standard deviation over mean, of each kind
  Real small_fraction = 0;  ///< φ: fraction of small droplets, by number [T 2.38]
  Real small = 0.765;       ///< mean radius of a small one
};

/// n radii; small droplets are in random places. Deviations beyond ±3 δ are drawn again.
std::vector<Real> draw_radii(const RadiusDistribution& distribution, Index n, std::uint64_t seed);

/// Parameters of a deformable particle: a polygon, or in space an icosphere or another surface.
struct PolygonShape {
  Index vertices = 16;
  Real shape_parameter = 0;  ///< 𝒜0 = (Nv l0)²/(4π a0), in space S0^(3/2)/(6 √π V0); 0: regular polygon, icosphere
  Real edge_width = 0.1;     ///< smooth particles: δ/l0
  std::shared_ptr<const TriangleMesh> mesh = nullptr;  ///< in space: the shape, in any size, instead of an icosphere
};

/// (Nv/π) tan(π/Nv).
Real regular_shape_parameter(Index vertices);

/// Particles of the given diameters with ρ = 1: soft particles, polygons with a0 = πσ²/4 and l0 from 𝒜0, or in space
/// surfaces of the volume πσ³/6. Errors: InputError for a shape parameter that no such shape has, and in space for a
/// number of vertices that no icosphere has, a mesh that crosses itself, and one of rough particles with faces through
/// which vertices pass.
Topology make_particles(ModelKind kind, int dim, const std::vector<Real>& diameters, const PolygonShape& shape);

/// Margin of the neighbour lists at the start of a run, in mean diameters.
Real usual_skin(ModelKind kind, int dim);

/// Distance from the centre of particle m in its shape at the start to its rim: the radius of the disk or sphere that
/// holds it.
Real outer_radius(const Topology& topology, Index m);

/// Writes the regular polygon of particle m, of area a0, around `centre` with its first vertex at `angle`; for a soft
/// particle its centre. x: positions of all points [points · D].
void place_particle(const Topology& topology, Index m, const Real* centre, Real angle, Real* x);

/// Writes particle m, a surface in the shape of its mesh, turned by `rotation`. x [points · 3].
void place_surface(const Topology& topology, Index m, const Vec<3>& centre, const Mat<3>& rotation, Real* x);

/// Places all particles in their shapes at the start, at random angles. centres [particles · D], x [points · D].
void place_at_random_angles(const Topology& topology, const Real* centres, std::uint64_t seed, Real* x);

/// A uniformly random rotation from three numbers in [0, 1).
Mat<3> random_rotation(Real u, Real v, Real w);

}  // namespace pliant
