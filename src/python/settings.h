// Model, integrator and step of a simulation that Python drives, as options.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/catalogue/model_choice.h>
#include <pliant/system/jacobian.h>
#include <pliant/system/neighbour_drag.h>

namespace pliant::python {

enum class Method { verlet, ts };
enum class Dynamics { inertial, overdamped };

/// Parsed from arguments, with the checks and messages of the command line. PETSc's options are in its database until
/// others are parsed; restore() puts them back.
class Settings {
 public:
  Settings();
  /// Errors: InputError.
  explicit Settings(const std::vector<std::string>& arguments);
  Settings(const Settings&) = delete;
  Settings& operator=(const Settings&) = delete;

  void restore() { options.reset(); }
  bool droplets() const { return model.particles() == ModelKind::bubble; }
  /// Whether particles have no inertia: droplets, and others with -dynamics overdamped.
  bool overdamped() const { return droplets() || dynamics == Dynamics::overdamped; }
  /// Without inertia. Errors: InputError.
  template <int D>
  std::unique_ptr<Mobility<D>> mobility() const;
  /// Fastest rate at which contacts relax without inertia. walls: whether there are any.
  template <int D>
  Real relaxation_rate(const Topology& particles, const CriticalStep& critical, bool walls) const;

  /// After model.resolve. Errors: InputError for a parameter that the model does not read in these dimensions.
  void refuse_unread() const;
  const std::vector<std::string>& arguments() const { return arguments_; }
  nlohmann::ordered_json table() const { return options.table(); }

  Options options;
  ModelChoice model;
  Dynamics dynamics = Dynamics::inertial;
  Method method = Method::verlet;
  TermGroup implicit = TermGroup::all;
  JacobianKind jacobian = JacobianKind::assembled;
  std::optional<Real> dt, skin;
  bool allow_unstable_dt = false, allow_energy_error = false, allow_passing_overlap = false;
  Index threads = 1;
  // Friction of droplets.
  Real b = 1;
  Coupling coupling = Coupling::exact;
  bool wall_friction = false;

 private:
  void bind();
  /// Errors: InputError for options that contradict each other.
  void check() const;
  std::vector<std::string> arguments_;
};

}  // namespace pliant::python
