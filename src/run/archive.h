// A checkpoint in both directions: a run lists each quantity once, to write it or to read it.
#pragma once

#include <concepts>
#include <span>
#include <string>
#include <vector>

#include <pliant/run/shared_checkpoint.h>
#include <pliant/run/stored_particles.h>

namespace pliant {

/// Writes the quantities that it visits to a checkpoint, or sets them from one. Quantities have names of their own;
/// `own` means: of this rank's particles. All functions are collective. Values that are read are finite and least …
/// most; errors: InputError, as of Checkpoint.
class Archive {
 public:
  static constexpr Real any = Checkpoint::any;
  static constexpr std::int64_t any_count = Checkpoint::any_count;

  explicit Archive(SharedCheckpoint& to) : to_(&to) {}
  /// particles: may be null where no own data are visited.
  Archive(const Checkpoint& from, const StoredParticles* particles) : from_(&from), particles_(particles) {}

  bool reads() const { return from_ != nullptr; }
  /// Of an archive that reads, and of one that writes.
  const Checkpoint& from() const { return *from_; }
  const StoredParticles& particles() const { return *particles_; }
  SharedCheckpoint& to() { return *to_; }
  /// Time of the checkpoint that is read: the limit of times in it.
  Real t() const { return reads() ? from_->t : any; }

  /// A number, equal on all ranks.
  void number(const std::string& name, Real& value, Real least = -any, Real most = any) {
    if (reads())
      value = from_->real(name, least, most);
    else
      to_->add(name, value);
  }
  template <std::integral Integer>
  void number(const std::string& name, Integer& value, std::int64_t least = 0, std::int64_t most = any_count) {
    if (reads())
      value = static_cast<Integer>(from_->integer(name, least, most));
    else
      to_->add(name, value);
  }
  void flag(const std::string& name, bool& value) { number(name, value, 0, 1); }
  /// A number that checkpoints of older versions lack: then it stays as it is.
  template <class Number, class... Limits>
  void newer(const std::string& name, Number& value, Limits... limits) {
    if (!reads() || from_->reals.contains(name) || from_->integers.contains(name)) number(name, value, limits...);
  }

  /// An array of any length, equal on all ranks.
  void array(const std::string& name, std::vector<std::int64_t>& values, std::int64_t least = 0,
             std::int64_t most = any_count) {
    if (reads())
      values = from_->integer_array(name, from_->length(name), least, most);
    else
      to_->add(name, values);
  }
  /// An array of this length.
  void array(const std::string& name, std::vector<Real>& values, std::size_t length, Real least = -any,
             Real most = any) {
    if (reads())
      values = from_->real_array(name, length, least, most);
    else
      to_->add(name, values);
  }

  /// An integer for each own particle.
  template <std::integral Integer>
  void per_particle(const std::string& name, std::vector<Integer>& own, std::int64_t least, std::int64_t most) {
    if (reads()) {
      const auto values = particles_->particles(name, least, most);
      own.assign(values.begin(), values.end());
    } else {
      to_->add_parts(name, own);
    }
  }
  /// Coordinates of own points, at most `most` large; set(span) takes those that were read.
  template <class Set>
  void points(const std::string& name, std::span<const Real> own, Real most, Set&& set) {
    if (reads())
      set(particles_->points(name, most));
    else
      to_->add_parts(name, own);
  }
  /// `width` numbers for each own particle.
  template <class Set>
  void rotations(const std::string& name, std::span<const Real> own, int width, Set&& set) {
    if (reads())
      set(particles_->rotations(name, width));
    else
      to_->add_parts(name, own);
  }

 private:
  SharedCheckpoint* to_ = nullptr;
  const Checkpoint* from_ = nullptr;
  const StoredParticles* particles_ = nullptr;
};

}  // namespace pliant
