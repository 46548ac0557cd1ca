// Parameters of terms: each term declares its parameters in `read`, from which options, input files and the manifest
// follow.
#pragma once

#include <array>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

/// Powers of force, length and time in a unit.
struct Dimension {
  int force = 0, length = 0, time = 0;
};

namespace dimension {
inline constexpr Dimension number{}, force{1, 0, 0}, energy{1, 1, 0}, length{0, 1, 0}, acceleration{0, 1, -2},
    drag{1, -1, 1};
}  // namespace dimension

/// Meaning of a parameter for a scenario, which does not use its name.
enum class Role {
  none,
  contact_energy,    ///< energy scale of contacts between particles
  wall_energy,       ///< energy scale of contacts with walls
  wall_diameter,     ///< thickness of walls
  edge_contacts,     ///< the choice of the points and edges that touch
  contact_law,       ///< the choice of V(d)
  kinetic_friction,  ///< force over velocity at contacts
  friction,          ///< Coulomb's coefficient, of sticking surfaces
  dynamic_friction,  ///< Coulomb's coefficient, of sliding surfaces
  restitution,       ///< of collisions, which dissipate where it is less than 1
  drag,              ///< drag coefficient
  volume,            ///< stiffness of volumes
  area,              ///< stiffness of areas
  perimeter,         ///< stiffness of perimeters
  bending,           ///< bending stiffness
  bending_form,      ///< the choice of the bending energy
  rest_shape,        ///< stiffness that holds a rest shape
  self_contact,      ///< switch of the contacts of a particle with itself
  lip_rule,          ///< the choice of the points and edges that touch lips
  attraction,        ///< depletion energy
  depletant,         ///< radius of the depletant
  contact_force,     ///< of droplets
  mean_radius,       ///< of droplets
  base_friction,     ///< friction with the substrate
  normal_gravity     ///< gravity that presses particles on the substrate
};

/// Declaration of a parameter: everything except its value. Numbers are at least `min`; flags are 0 or 1; of a choice
/// the first value is the default.
struct Parameter {
  std::string_view name = {};
  std::string_view symbol = {};  ///< in figures, as TeX, over its unit
  Dimension unit = {};
  std::string_view help = {};
  Real value = 0;  ///< default
  Real min = 0, max = std::numeric_limits<Real>::infinity();
  bool min_open = false;            ///< min itself is not allowed
  std::string_view automatic = {};  ///< a default that follows from other parameters, for the help
  std::string_view alias = {};      ///< an older name in files of `pliant evaluate`
  std::string_view printed = {};    ///< the choice of [H], where it is not the default
  Role role = Role::none;
};

/// Gives terms the values of the parameters that they declare.
class ParameterReader {
 public:
  virtual ~ParameterReader() = default;

  /// The value of a number.
  virtual Real number(const Parameter& p) = 0;
  /// The same where the default is `value`, which follows from other parameters.
  virtual Real automatic(const Parameter& p, Real value) = 0;
  virtual bool flag(const Parameter& p) = 0;
  /// Index of the chosen name.
  virtual std::size_t choose(const Parameter& p, std::span<const std::string_view> names) = 0;
  /// Whether a number has another value than its default or an automatic one.
  virtual bool is_set(std::string_view name) const = 0;
  /// As users write the name of a parameter.
  virtual std::string spelled(std::string_view name) const { return std::string(name); }
  /// The parameters that follow are of this term.
  virtual void begin(std::string_view /*term*/) {}

  template <class E, std::size_t N>
  E choice(const Parameter& p, const std::array<std::pair<std::string_view, E>, N>& values) {
    std::array<std::string_view, N> names;
    for (std::size_t k = 0; k < N; ++k) names[k] = values[k].first;
    return values[choose(p, names)].second;
  }

  /// Names of the materials 1, 2, … of walls (Walls::material), which have separate friction coefficients.
  std::vector<std::string> materials = {};
  /// Upper limit of automatic coefficients of dynamic friction.
  Real usual_dynamic_friction = std::numeric_limits<Real>::infinity();

 protected:
  ParameterReader() = default;
  ParameterReader(const ParameterReader&) = default;
  ParameterReader& operator=(const ParameterReader&) = default;
};

/// The term with the values of its parameters. more: further arguments of its `read`.
template <class Term, class... More>
Term configured(ParameterReader& p, Term term, More&&... more) {
  p.begin(term.name());
  term.read(p, std::forward<More>(more)...);
  return term;
}

/// The type of value → its names, for ParameterReader::choice: named<E>({{"a", E::a}, {"b", E::b}}).
template <class E, std::size_t N>
constexpr std::array<std::pair<std::string_view, E>, N> named(const std::pair<std::string_view, E> (&values)[N]) {
  return std::to_array(values);
}

}  // namespace pliant
