// Model, integrator and step of a simulation that Python drives, as options.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/catalogue/model_choice.h>
#include <pliant/system/jacobian.h>

namespace pliant::python {

enum class Method { verlet, ts };

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
  const std::vector<std::string>& arguments() const { return arguments_; }
  nlohmann::ordered_json table() const { return options.table(); }

  Options options;
  ModelChoice model;
  Method method = Method::verlet;
  TermGroup implicit = TermGroup::all;
  JacobianKind jacobian = JacobianKind::assembled;
  std::optional<Real> dt, skin;
  bool allow_unstable_dt = false;
  Index threads = 1;

 private:
  void bind();
  std::vector<std::string> arguments_;
};

}  // namespace pliant::python
