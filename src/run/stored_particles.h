// The particles of a checkpoint, distributed over the ranks of the continued run.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/geometry/box.h>
#include <pliant/io/checkpoint.h>
#include <pliant/model/topology.h>
#include <pliant/run/shared_checkpoint.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// This rank's part: the previous part if the number of ranks is unchanged, otherwise an equal part. All ranks check
/// the full array, so that they agree on its validity. Errors: InputError, as of Checkpoint.
class StoredParticles {
 public:
  /// No point of a run comes farther from the orifice.
  static constexpr Real far = 1e9;

  /// `all`: the particles of the run, in the order of their ids.
  StoredParticles(const Checkpoint& checkpoint, const Topology& all, int dim, const Ranks& ranks);

  std::span<const Index> ids() const { return {all_ids_.data() + first_, count_}; }
  /// This rank's part of an array of one number, least … most, for each particle.
  std::span<const std::int64_t> particles(const std::string& name, std::int64_t least, std::int64_t most) const {
    return std::span(checkpoint_.integer_array(name, all_ids_.size(), least, most)).subspan(first_, count_);
  }
  /// Three numbers for each particle.
  std::vector<Image> images(const std::string& name) const;
  /// The same of `dim` numbers, −most … most, for each point.
  std::span<const Real> points(const std::string& name, Real most = far) const {
    return own_points(checkpoint_.real_array(name, coordinates(), -most, most));
  }

  /// The same of `width` numbers for each particle.
  std::span<const Real> rotations(const std::string& name, int width) const {
    const auto w = static_cast<std::size_t>(width);
    return std::span(checkpoint_.real_array(name, all_ids_.size() * w)).subspan(first_ * w, count_ * w);
  }
  /// Contacts as save_history() has stored them, of the system, which has these particles.
  template <int D>
  void load_history(ParticleSystem<D>& system) const;

  std::span<const Real> own_points(const std::vector<Real>& all) const {
    return std::span(all).subspan(first_coordinate_, own_coordinates_);
  }

  /// Reference of the lists of the stopped run, for all particles; empty if there were no lists. Checks that no
  /// coordinate differs from the reference, after the shear since then, by more than `reach`.
  struct Lists {
    const std::vector<Real>& reference;
    std::vector<Index> relisted;
    const std::vector<Real>& places;
  };
  Lists lists(Real reach, Real shear = 0, Real y0 = 0) const;

 private:
  std::size_t points_of(Index k) const { return static_cast<std::size_t>(all_.points_of(all_ids_[k])); }
  std::size_t coordinates() const { return static_cast<std::size_t>(all_.points()) * dim_; }

  const Checkpoint& checkpoint_;
  const Topology& all_;
  std::size_t dim_;
  std::vector<Index> all_ids_;  ///< in the order of the arrays
  std::size_t first_ = 0, count_ = 0, first_coordinate_ = 0, own_coordinates_ = 0;
};

// Writes the data that StoredParticles reads. Collective; data per particle or point are stored in the order of the
// ranks, and within a rank in the order of its memory.
/// Which particles are where.
void save_particles(const Topology& topology, SharedCheckpoint& checkpoint);
/// The lists of Neighbours::history: reference, relisted and places.
void save_lists(std::vector<Real> reference, const std::vector<Index>& relisted, const std::vector<Real>& places,
                SharedCheckpoint& checkpoint);
/// Contact histories of all terms, each contact once.
void save_history(const ContactHistory& history, const Topology& topology, SharedCheckpoint& checkpoint);

}  // namespace pliant
