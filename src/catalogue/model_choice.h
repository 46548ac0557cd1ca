// The models that a scenario offers, with their options, and the model of a run.
#pragma once

#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/catalogue/parameter_table.h>
#include <pliant/catalogue/unit_system.h>

namespace pliant {

/// Binds the options of the models that a scenario offers. Copies have separate values; bind an object that is not
/// moved or copied later.
class ModelChoice {
 public:
  /// The first model is the default. Errors: std::logic_error for parameters that two terms declare differently.
  explicit ModelChoice(std::vector<ModelDefinition> models, ModelSurroundings surroundings = {});

  std::string name;  ///< name of the run's model

  // Choices of a scenario, before `bind`.
  /// Parameters of this role have values that the scenario sets, and no options.
  void keep(Role role) { kept_.push_back(role); }
  /// Parameters that only such terms read have default values, and no options: terms without a use in the scenario.
  void leave_out(std::string_view term) { left_out_.emplace_back(term); }
  /// Numbers of this role have a default that the scenario finds and sets after `bind`; text: for the help.
  void make_automatic(Role role, const std::string& text);
  /// The default of numbers of this role, in 2D and in 3D.
  void set_default(Role role, Real in_plane, Real in_space) { table_.set_default(role, in_plane, in_space); }
  void set_default(Role role, Real value) { set_default(role, value, value); }
  /// The default of choices of this role.
  void set_default(Role role, std::string_view choice) { table_.set(role, choice); }

  /// -model, if there are several, and the parameters of all models, in the group "Model"; parameters of models that
  /// are not in the catalogue have separate groups. any_dimension: the scenario exists in 2D and 3D.
  void bind(Options& options, const UnitSystem& units, bool any_dimension = false);
  /// Call after `resolve`. Errors: InputError for an option that the user has given though the model does not read it
  /// in the dimensions of the run. but: parameters of this term are read by the scenario.
  void refuse_unread(const Options& options, std::string_view but = {}) const;
  /// Finds automatic values for a run in D dimensions. Errors: InputError for parameters that contradict each other.
  template <int D>
  void resolve(const Surroundings<D>& s) {
    table_.set_dimension(D);
    ParameterTable::Reader reader(table_, name, D, &table_);
    model().make<D>(reader, s);
    if constexpr (D == 3) check_surfaces();
  }

  const ModelDefinition& model() const;
  const std::vector<ModelDefinition>& models() const { return models_; }
  /// Whether the model belongs to the catalogue.
  bool in_catalogue() const { return in_catalogue(model()); }
  ModelKind particles() const { return model().particles; }
  /// Whether particles are polygons.
  bool deformable() const;

  template <int D>
  std::unique_ptr<ForceField<D>> force_field(const Surroundings<D>& s) const {
    ParameterTable::Reader reader(table_, name, D);
    return model().make<D>(reader, s);
  }
  /// A term as the run's model has it; the model need not have it.
  template <class Term, class... More>
  Term term(Term term, More&&... more) const {
    ParameterTable::Reader reader(table_, name, table_.dimension());
    return configured(reader, term, std::forward<More>(more)...);
  }

  // Parameters of the run's model by their roles; 0 or an empty text if the model has no such parameter.
  std::vector<const ParameterTable::Entry*> parameters(Role role) const { return table_.with(role, name); }
  Real value(Role role) const;
  std::string choice(Role role) const;
  /// "-e_c", "-k_l or -k_b".
  std::string option(Role role) const { return options({role}); }
  std::string options(std::initializer_list<Role> roles) const;
  /// Whether a number with this role, of any model, has a value other than an automatic value that is not resolved yet.
  bool is_set(Role role) const;
  void set(Role role, Real value) { table_.set(role, value); }
  void set(Role role, std::string_view choice) { table_.set(role, choice); }
  void set(std::string_view parameter, Real value) { table_.set(parameter, value); }
  const ParameterTable& table() const { return table_; }

 private:
  void bind(Options& options, ParameterTable::Entry& entry, const UnitSystem& units, bool any_dimension);
  bool kept(const ParameterTable::Entry& entry) const;
  void check_surfaces() const;
  static bool in_catalogue(const ModelDefinition& model) { return to_string(model.particles) == model.name; }
  /// The only model that reads a parameter, if it is a model of a user program; else nothing.
  std::optional<std::string> owner(const ParameterTable::Entry& entry) const;
  /// Names of the models that read it.
  std::vector<std::string> readers(const ParameterTable::Entry& entry) const;
  std::string condition(const ParameterTable::Entry& entry, bool any_dimension) const;

  std::vector<ModelDefinition> models_;
  ParameterTable table_;
  std::vector<Role> kept_;
  std::vector<std::string> left_out_;
};

}  // namespace pliant
