// The names of units: how scenarios write the dimension of a parameter.
#pragma once

#include <string>
#include <vector>

#include <pliant/model/parameter.h>

namespace pliant {

/// Units as products of powers of base units, such as g, cm and s.
class UnitSystem {
 public:
  struct Base {
    std::string name;
    Dimension power;  ///< its powers in the units of force, length and time; for dyn = g cm/s², the power of s is −2
    bool power_of_dimension = false;  ///< the unit of force has another factor name^d, in d dimensions of space
  };
  explicit UnitSystem(std::vector<Base> bases) : bases_(std::move(bases)) {}

  /// "g cm/s^2" in dim = 2 or 3 dimensions; with powers of d for dim = 0.
  std::string text(const Dimension& dimension, int dim) const;

  static UnitSystem gravitational();    ///< σ_avg = g = ρ = 1
  static UnitSystem droplets();         ///< F, R, t0
  static UnitSystem static_packings();  ///< energies, and σ_avg; without times
  static UnitSystem cgs();

 private:
  std::vector<Base> bases_;
};

}  // namespace pliant
