#include <pliant/catalogue/unit_system.h>

#include <cstdlib>

#include <fmt/format.h>

namespace pliant {
namespace {

/// d · per_dimension + plain, as an exponent.
std::string exponent_in_space(int per_dimension, int plain) {
  std::string text = per_dimension == 1 ? "d" : fmt::format("{}d", per_dimension);
  return plain == 0 ? text : fmt::format("({}{:+})", text, plain);
}

}  // namespace

std::string UnitSystem::text(const Dimension& dimension, bool in_space) const {
  std::string over, under;
  for (const Base& base : bases_) {
    const int plain =
        base.power.force * dimension.force + base.power.length * dimension.length + base.power.time * dimension.time;
    const int per_dimension = base.power_of_dimension ? dimension.force : 0;
    std::string& side = in_space && per_dimension > 0 ? over : plain + 2 * per_dimension > 0 ? over : under;
    if (in_space && per_dimension != 0) {
      side += fmt::format(" {}^{}", base.name, exponent_in_space(per_dimension, plain));
      continue;
    }
    const int power = plain + 2 * per_dimension, size = std::abs(power);
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
