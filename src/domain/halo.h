// Ghosts: copies of particles that owned particles can touch, from other ranks and across the borders of a periodic
// box.
#pragma once

#include <memory>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/geometry/box.h>
#include <pliant/geometry/rotation.h>
#include <pliant/model/topology.h>

namespace pliant {

/// Finds ghosts and keeps their positions and velocities up to date. Whole particles are copied. In a periodic box a
/// ghost may be an image, also of a particle of the same rank, at the position of its original plus box lengths.
/// Particles may lie anywhere: their positions decide which images are needed. All functions except strays() and
/// widest() are collective.
template <int D>
class Halo {
 public:
  explicit Halo(Ranks ranks, const Box<D>& box = {});
  ~Halo();
  Halo(Halo&&) noexcept;
  Halo& operator=(Halo&&) noexcept;

  /// Another periodic box. Images that are ghosts already move with its edges; where lengths change, the home must be
  /// set again. Returns the largest distance by which an image moves. Not collective.
  Real set_box(const Box<D>& box);

  /// Takes the box around the rank's particles, and a diameter more, as its home; on one rank the home is the periodic
  /// box, for any x. x [owned points · D].
  void set_home(const Topology& topology, const Real* x);

  /// Replaces the ghosts at the end of the topology by the particles, and images of particles, that can come within a
  /// contact + margin of an owned particle. Needs set_home() before. x [owned points · D]. Errors: NumericalError for a
  /// particle that is many box lengths wide.
  void build(Topology& topology, const Real* x, Real margin);

  /// local [points · D] becomes own [owned points · D] followed by the values of the ghosts, from their owners.
  void update(const Real* own, std::vector<Real>& local) const;
  /// As `update`, for positions: the positions of images are shifted.
  void update_positions(const Real* x, std::vector<Real>& local) const;
  /// As `update`, for velocities: in a box that flows, images have other velocities.
  void update_velocities(const Real* v, std::vector<Real>& local) const;
  /// As `update`, for angles or spins: own [owned points · rotations].
  void update_rotations(const Real* own, std::vector<Real>& local) const;
  /// Positions and velocities at the same time, where x and v begin with the own points already.
  void update(std::vector<Real>& x, std::vector<Real>& v) const;

  /// Diameter of the widest point of all ranks, at the last build.
  Real widest() const { return widest_; }
  /// How many particles have left home, at the last build; those by about the same box lengths count once.
  Index strays() const { return strays_; }

 private:
  struct Exchange;
  /// Points of a ghost.
  struct Copy {
    std::size_t from, to, count;
  };
  struct Shifted {
    std::size_t first, last;
    Image image;
    Vec<D> by, velocity;
  };

  void begin(std::vector<Real>& local, int width = D) const;
  void end(std::vector<Real>& local, int width = D) const;
  void shift_images(std::vector<Real>& x) const;
  void shift_velocities(std::vector<Real>& v) const;

  Ranks ranks_;
  Box<D> box_;
  Vec<D> low_ = Vec<D>::Zero(), high_ = Vec<D>::Zero();  ///< home
  Index strays_ = 0;
  Real widest_ = 0;
  std::size_t own_ = 0, all_ = 0;       ///< points
  std::vector<Copy> copies_;            ///< on one rank
  std::unique_ptr<Exchange> exchange_;  ///< on several; hides PETSc from those who include this
  std::vector<Shifted> shifted_;        ///< images
};

}  // namespace pliant
