// A packing without its rattlers.
#pragma once

#include <pliant/system/particle_system.h>

namespace pliant {

/// For the life of the object the particles `without`, by id, are out of the run: they touch nothing and have no rows
/// in a Stiffness. Places of points in arrays stay the same.
template <int D>
class Backbone {
 public:
  /// Errors: InputError for a system with contact history, or that has no such active particle.
  Backbone(ParticleSystem<D>& system, std::span<const Index> without);
  ~Backbone() { system_.take(std::move(all_)); }
  Backbone(const Backbone&) = delete;
  Backbone& operator=(const Backbone&) = delete;

 private:
  ParticleSystem<D>& system_;
  Topology all_;
};

extern template class Backbone<2>;
extern template class Backbone<3>;

}  // namespace pliant
