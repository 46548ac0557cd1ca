// Ghosts: copies of other ranks' particles that own ones can touch.
#pragma once

#include <memory>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/model/topology.h>

namespace pliant {

/// Finds ghosts and keeps their positions and velocities up to date. Whole particles are copied. All functions but
/// strays() are collective.
template <int D>
class Halo {
 public:
  explicit Halo(Ranks ranks);
  ~Halo();
  Halo(Halo&&) noexcept;
  Halo& operator=(Halo&&) noexcept;

  /// Takes the box around the rank's particles, and a diameter more, as its home; x [owned points · D].
  void set_home(const Topology& topology, const Real* x);

  /// Replaces the ghosts at the end of the topology by the particles of other ranks that can come within a contact +
  /// margin of an own one. Needs set_home() before. x [owned points · D].
  void build(Topology& topology, const Real* x, Real margin);

  /// local [points · D] becomes own [owned points · D] and the same of the ghosts.
  void update(const Real* own, std::vector<Real>& local) const;
  /// The same where local begins with the own points already, and of two arrays at the same time.
  void update(std::vector<Real>& local, std::vector<Real>& other) const;

  /// Own particles that have left home, at the last build.
  Index strays() const { return strays_; }

 private:
  struct Exchange;

  void begin(std::vector<Real>& local) const;
  void end(std::vector<Real>& local) const;

  Ranks ranks_;
  Vec<D> low_ = Vec<D>::Zero(), high_ = Vec<D>::Zero();  ///< home
  Index strays_ = 0;
  std::size_t own_ = 0, all_ = 0;       ///< points
  std::unique_ptr<Exchange> exchange_;  ///< hides PETSc from those who include this
};

}  // namespace pliant
