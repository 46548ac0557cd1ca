// The parameters of several models, by name, for options, input files and the manifest.
#pragma once

#include <deque>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/base/text.h>
#include <pliant/catalogue/catalogue.h>
#include <pliant/catalogue/unit_system.h>
#include <pliant/model/parameter.h>

namespace pliant {

/// The properties of a scenario that decide which parameters its models have.
struct ModelSurroundings {
  bool substrate = false, rest_outlines = false;  ///< as in Surroundings
  std::vector<std::string> materials = {};        ///< as in ParameterReader
  Real usual_dynamic_friction = std::numeric_limits<Real>::infinity();
};

/// All parameters that the terms of some models read, each once, with the value that a run has.
class ParameterTable {
 public:
  enum class Kind { number, automatic, flag, choice };
  /// A term that reads a parameter in so many dimensions, and its choices.
  struct Reading {
    std::string model, term;
    int dim;
    std::vector<std::string> choices;
  };
  /// The declaration of a parameter in 3D, if the declaration in 2D differs.
  struct InSpace {
    std::string symbol, help;
    Dimension unit;
    Real number;  ///< default
  };
  struct Entry {
    std::string name, symbol, help, automatic, alias, printed;
    Dimension unit;
    Real min, max;
    bool min_open;
    Role role;
    Kind kind;
    std::vector<Reading> readings;
    std::optional<InSpace> other_in_space = {};

    // The value, by its kind; first the default.
    Real number = 0;
    std::optional<Real> automatic_number = {};  ///< nothing until it is set, or `resolve` has found it
    bool flag = false;
    std::string choice = {};

    /// Value of a number or automatic number.
    Real value() const { return kind == Kind::automatic ? automatic_number.value_or(number) : number; }
    /// The first term of the model that reads it in so many dimensions; 0: in any.
    std::optional<std::string> term_of(std::string_view model, int dim = 0) const;
    bool read_by(std::string_view model, int dim = 0) const { return term_of(model, dim).has_value(); }
    bool exists_in(int dim) const;
    /// The default of a number.
    Real default_in(int dim) const { return dim == 3 && other_in_space ? other_in_space->number : number; }
    /// Unit in so many dimensions; 0: a text for all dimensions in which it exists.
    std::string unit_text(const UnitSystem& units, int dim = 0) const;
    /// For all dimensions in which it exists.
    std::string help_text() const;
    /// All choices of the terms of one model or, without a name, of any model.
    std::vector<std::string> choices(std::string_view model = {}) const;
  };

  explicit ParameterTable(ModelSurroundings surroundings = {}) : surroundings_(std::move(surroundings)) {}

  /// Adds the parameters that the terms of a model read in so many dimensions; 0: in 2D and 3D. Errors:
  /// std::logic_error for a name that is declared differently by two terms of one dimension.
  void declare(const ModelDefinition& model, int dim = 0);

  /// The dimensions of the run, once they are known: `with` then ignores parameters of other dimensions.
  void set_dimension(int dim) { dimension_ = dim; }
  int dimension() const { return dimension_; }

  std::deque<Entry>& entries() { return entries_; }
  const std::deque<Entry>& entries() const { return entries_; }
  /// Errors: std::logic_error for an unknown name.
  const Entry& at(std::string_view name) const;
  /// Entries with a role that the model reads in the dimensions of the run or, without its name, any model.
  std::vector<const Entry*> with(Role role, std::string_view model = {}) const;

  /// Sets a number, or all numbers and choices with a role. Errors: std::logic_error for an unknown name.
  void set(std::string_view name, Real value);
  void set(Role role, Real value);
  void set(Role role, std::string_view choice);

  /// The default of all numbers with a role, in 2D and in 3D.
  void set_default(Role role, Real in_plane, Real in_space);

  /// Gives terms of a model the values of this table.
  class Reader final : public ParameterReader {
   public:
    /// dim: dimensions of the terms. resolve: table that receives the automatic values, or null; may be `table`.
    Reader(const ParameterTable& table, std::string model, int dim, ParameterTable* resolve = nullptr);
    Real number(const Parameter& p) override;
    Real automatic(const Parameter& p, Real value) override;
    bool flag(const Parameter& p) override { return table_.at(p.name).flag; }
    /// Errors: InputError for a choice that this model does not have.
    std::size_t choose(const Parameter& p, std::span<const std::string_view> names) override;
    bool is_set(std::string_view name) const override;
    std::string spelled(std::string_view name) const override;

   private:
    const ParameterTable& table_;
    std::string model_;
    int dim_;
    ParameterTable* resolve_;
  };

 private:
  class Collector;
  Entry* find(std::string_view name);
  Entry& get(std::string_view name);

  ModelSurroundings surroundings_;
  int dimension_ = 0;
  std::deque<Entry> entries_;
};

}  // namespace pliant
