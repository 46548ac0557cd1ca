// Options of the program: typed, with unit, range and help, on top of the PETSc options database.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>
#include <pliant/base/options_source.h>
#include <pliant/base/types.h>

namespace pliant {

/// Rule on restart for an option of the stored run.
enum class OnRestart {
  keep,    ///< takes the stored value unless the user gives another
  fixed,   ///< takes the stored value; giving another is an error
  forget,  ///< starts from the default again (paths, wall-time limits)
};

/// A cure that messages advise, and the value of the option that brings it about, if it takes a certain one.
struct OptionCure {
  OptionCure(Cure which, std::string of_value = {})  // NOLINT(*-explicit-*): a cure alone, in lists of them
      : cure(which), value(std::move(of_value)) {}
  Cure cure;
  std::string value;
};

/// Declaration of an option, except its name and its variable. Ranges apply to numbers, choices to strings.
struct OptionSpec {
  std::string help = {};
  std::string unit = {};                 ///< "sigma_avg", "t0", "degrees" …; empty for pure numbers
  std::string symbol = {};               ///< in figures, as TeX, over its unit
  std::vector<std::string> models = {};  ///< parameters only: the models that read it
  std::string only_with = {};            ///< setting of another option without which it is not read: "-model rough"
  /// Parameters of models only: the term of the run's model that reads the parameter, or nothing.
  std::function<std::optional<std::string>()> term = {};
  /// Parameters of models only: unit and default in the dimensions of the run (2D before these are known), if 2D and 3D
  /// differ.
  std::function<std::string()> unit_of_run = {};
  std::function<Real()> default_of_run = {};
  Real min = -std::numeric_limits<Real>::infinity();
  Real max = std::numeric_limits<Real>::infinity();
  bool min_open = false;                  ///< min itself is not allowed
  bool max_open = false;                  ///< max itself is not allowed
  std::vector<std::string> choices = {};  ///< empty: any text
  std::vector<OptionCure> cures = {};     ///< messages that advise them name the option
  /// `ended_by` of a finished run that a restart with another value extends, and this value: {"t_end", "LATER"}.
  std::pair<std::string, std::string> extends = {};
  std::string automatic = {};  ///< meaning of an empty std::optional, for the help ("0.1 of the shortest time")
  OnRestart on_restart = OnRestart::keep;
  /// Texts only: returns the value to store in place of the given one, such as the content of the named file; files of
  /// a run and restarts use the stored value. Relative file names refer to `folder`, the folder of the options file, or
  /// to the working directory if it is empty. Errors: InputError.
  std::function<std::string(const std::string& text, const std::filesystem::path& folder)> read = {};
};

/// A path that a user wrote, relative to `folder` unless it is absolute.
std::string path_from(const std::filesystem::path& folder, const std::string& path);

/// An option of the user differs from the stored run.
struct RestartConflict : InputError {
  using InputError::InputError;
};

/// Registry of the program's options.
///
/// Each part of a program binds its variables to names; their values at that time are the defaults. `parse` then reads
/// options files and arguments, checks everything and sets the variables, before any work is done:
///
///     options.group("Hopper geometry");
///     options.bind("hopper_width", p.width, {.help = "orifice width w", .unit = "sigma_avg", .min = 0, .min_open =
///     true}); if (options.parse({argv + 2, argv + argc}) == Options::Request::help) fmt::print("{}", options.help());
///
/// Bound variables must outlive the calls of `parse` and `from_json`. A PetscSession must be alive from `parse` on.
/// Binding errors (a name bound twice, a default out of range) are the programmer's: std::logic_error.
class Options {
 public:
  enum class Request { run, help, version };

  /// Title of the group that the following `bind`s belong to.
  void group(std::string title);

  void bind(const std::string& name, Real& target, OptionSpec spec);
  void bind(const std::string& name, std::optional<Real>& target, OptionSpec spec);
  void bind(const std::string& name, Index& target, OptionSpec spec);
  void bind(const std::string& name, std::int64_t& target, OptionSpec spec);
  void bind(const std::string& name, bool& target, OptionSpec spec);
  void bind(const std::string& name, std::string& target, OptionSpec spec);
  /// An enumeration by the names of its values; spec.choices is filled from them.
  template <class E>
  requires std::is_enum_v<E>
  void bind(const std::string& name, E& target, const std::vector<std::pair<std::string, E>>& values, OptionSpec spec);

  /// Names of quantities that are units and therefore not options: an option of such a name is refused with `text`, a
  /// sentence such as "g is the unit of acceleration".
  void explain_units(std::map<std::string, std::string> text) { units_ = std::move(text); }

  /// Accepts options that start with `prefix` and leaves them to PETSc (an object with a separate options prefix).
  void accept_petsc_prefix(std::string prefix);

  /// Reads `-options_file FILE`s (in their order) and then the arguments (without program and scenario); the last
  /// setting of an option wins. Replaces the content of the PETSc options database, so that PETSc's objects see their
  /// options. With `-help` or `-version` nothing is checked or set. Errors: InputError for unknown options, bad values,
  /// unreadable files.
  Request parse(const std::vector<std::string>& arguments);

  /// Fills in options from `json()` of an earlier run that neither files nor command line have set, after `parse`.
  /// Errors: InputError for an unknown name or a bad value, RestartConflict for a setting that differs from an
  /// OnRestart::fixed one.
  void from_json(const nlohmann::json& stored);

  /// Restores the values of `parse`: drops the values of `from_json`, also if it failed half-way.
  void reset();

  /// Call after PETSc's objects have been configured. Errors: InputError for a PETSc option that no object has read;
  /// `solvers` is then the cure, unless the option is misspelt.
  void check_consumed(std::string_view solvers = {}) const;

  /// Whether the user (or a restart) has set the option, and from where: "default", "command line", "restart" or the
  /// file.
  bool given(const std::string& name) const { return source(name) != "default"; }
  const std::string& source(const std::string& name) const;

  bool declared(const std::string& name) const { return find(name) != nullptr; }

  /// Options that the text of `-help` begins with, in this order. std::logic_error for a name that is not bound.
  void most_used(std::vector<std::string> names);
  /// The word after `-help`, the title of a group; empty without one.
  const std::string& help_group() const { return help_group_; }
  /// Text of `-help`, a line for each option: the most used options, then all options by groups; or one group, given by
  /// the beginning of its title in upper or lower case. Errors: InputError for a group that does not exist.
  std::string help(const std::string& group = "") const;
  /// Reference of all options: a heading and a table for each group.
  std::string markdown() const;
  /// "integrator verlet": the option that declares this cure, and that the run's model reads, with the value if it
  /// needs a certain one; empty without one.
  std::string curing(Cure cure) const;
  /// "t_end LATER": the option that extends runs which ended by this; empty without one.
  std::string extending(std::string_view ended_by) const;
  /// The options as JSON for other programs: name → {"default", "unit"}, "symbol" if the option has one, and for
  /// parameters of models "models", the names of the models that read it.
  nlohmann::json reference() const;
  /// All options, by groups: [{"name", "group", "help", "type", "default", "default_text", "unit", "range", "choices",
  /// "on_restart"}]; the type of choices is "choice", and the default null where it is automatic.
  nlohmann::ordered_json table() const;
  /// name → {"value", "unit", "source", "is_default"}, "symbol" where the option has one, and for parameters of models
  /// "term", null where the run's model does not read them. PETSc's options (as strings) included.
  nlohmann::json json() const;

 private:
  struct Enumeration {
    void* target;
    void (*write)(void* target, std::int64_t value);
    std::int64_t (*read)(const void* target);
    std::vector<std::int64_t> values = {};

    void set(std::size_t choice) const { write(target, values[choice]); }
    /// values.size() if the variable has none of the values.
    std::size_t get() const {
      return static_cast<std::size_t>(std::ranges::find(values, read(target)) - values.begin());
    }
  };
  using Target = std::variant<Real*, std::optional<Real>*, Index*, std::int64_t*, bool*, std::string*, Enumeration>;
  struct Option {
    std::string name, group;
    OptionSpec spec;
    Target target;
    nlohmann::json default_value = {};
    std::string source = "default";
  };

  void add(const std::string& name, Target target, OptionSpec spec);
  /// stored: its text is the value of an earlier run, or the default.
  void assign(Option& option, const Setting& setting, bool stored = false);
  void assign(Option& option, const nlohmann::json& value, const std::string& source);
  static nlohmann::json value(const Option& option);
  static std::string type_text(const Option& option);
  static std::string range_text(const Option& option);
  static std::string default_text(const Option& option);
  const Option* find(const std::string& name) const;
  Option* find(const std::string& name);
  bool is_petsc(const std::string& name) const;
  void refuse_unknown(const Setting& setting) const;
  void insert_petsc(const Setting& setting);
  using Group = std::pair<std::string, std::vector<const Option*>>;
  std::vector<Group> by_group() const;
  static std::string help_line(const Option& option);

  std::string group_ = "General", help_group_;
  std::vector<std::string> most_used_;
  std::vector<Option> options_;
  std::vector<std::string> prefixes_;
  std::map<std::string, std::string> units_;
  std::map<std::string, Setting> given_;  // set by the user
  std::map<std::string, Setting> petsc_;  // options that PETSc's objects read
};

template <class E>
requires std::is_enum_v<E>
void Options::bind(const std::string& name, E& target, const std::vector<std::pair<std::string, E>>& values,
                   OptionSpec spec) {
  Enumeration all{&target, [](void* to, std::int64_t value) { *static_cast<E*>(to) = static_cast<E>(value); },
                  [](const void* from) { return static_cast<std::int64_t>(*static_cast<const E*>(from)); }};
  spec.choices.clear();
  for (const auto& [text, item] : values) {
    spec.choices.push_back(text);
    all.values.push_back(static_cast<std::int64_t>(item));
  }
  add(name, std::move(all), std::move(spec));
}

}  // namespace pliant
