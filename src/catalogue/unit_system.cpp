#include <pliant/catalogue/unit_system.h>

#include <cstdlib>

#include <fmt/format.h>

namespace pliant {
namespace {

/// d · per_dimension + plain, as an exponent.
std::string exponent_of(int per_dimension, int plain) {
  std::string text = per_dimension == 1 ? "d" : fmt::format("{}d", per_dimension);
  return plain == 0 ? text : fmt::format("({}{:+})", text, plain);
}

}  // namespace

std::string UnitSystem::text(const Dimension& dimension, int dim) const {
  std::string over, under;
  for (const Base& base : bases_) {
    const int plain =
        base.power.force * dimension.force + base.power.length * dimension.length + base.power.time * dimension.time;
    const int per_dimension = base.power_of_dimension ? dimension.force : 0;
    const int power = plain + (dim == 0 ? 2 : dim) * per_dimension, size = std::abs(power);
    std::string& side = power > 0 || (dim == 0 && per_dimension > 0) ? over : under;
    if (dim == 0 && per_dimension != 0) {
      side += fmt::format(" {}^{}", base.name, exponent_of(per_dimension, plain));
      continue;
    }
    if (power == 0) continue;
    side += (power > 0 ? " " : "/") + base.name + (size > 1 ? fmt::format("^{}", size) : "");
  }
  if (over.empty()) return under.empty() ? "" : "1" + under;
  return over.substr(1) + under;
}

UnitSystem UnitSystem::gravitational() {
  return UnitSystem({{"rho g", {1, 0, 0}}, {"sigma_avg", {0, 1, 0}, true}, {"t0", {0, 0, 1}}});
}
UnitSystem UnitSystem::droplets() { return UnitSystem({{"F", {1, 0, 0}}, {"R", {0, 1, 0}}, {"t0", {0, 0, 1}}}); }
UnitSystem UnitSystem::static_packings() {
  return UnitSystem({{"eps", {1, 0, 0}}, {"sigma_avg", {-1, 1, 0}}, {"t0", {0, 0, 1}}});
}
UnitSystem UnitSystem::cgs() { return UnitSystem({{"g", {1, 0, 0}}, {"cm", {1, 1, 0}}, {"s", {-2, 0, 1}}}); }

}  // namespace pliant
