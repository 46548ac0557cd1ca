// The particles of a simulation that Python drives, outside of the engine.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <pliant/model/contact_history.h>
#include <pliant/model/state.h>
#include <pliant/model/topology.h>
#include <pliant/python/simulation.h>

namespace pliant::python {

/// Zeros [rows, columns].
Array new_array(std::size_t rows, std::size_t columns);
inline std::span<const Real> numbers_of(const Array& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}
/// Errors: InputError.
void check_finite(std::span<const Real> values, std::size_t columns, const char* name);

/// The data of particles, in the order of the ids.
struct ParticleTable {
  Topology topology;
  std::vector<Real> x, v, angles, spins;
  std::vector<Image> images;
  struct Contacts {
    std::string term;
    bool pairs;  ///< of particles, or of particles with walls
    int width;
    StoredContacts stored;
    std::vector<Real> heat;  ///< by cause
  };
  std::vector<Contacts> history;
};

/// Appends the particles of arrays, with ids that continue the present ids. Errors: InputError.
template <int D>
void append_particles(ParticleTable& to, const ParticleArrays& arrays);

/// The particles `kept`, in increasing order, with new ids.
template <int D>
ParticleTable select_particles(const ParticleTable& all, const std::vector<Index>& kept);

}  // namespace pliant::python
