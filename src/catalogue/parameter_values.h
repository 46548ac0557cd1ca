// Values of parameters that a program sets without options.
#pragma once

#include <initializer_list>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <pliant/model/parameter.h>

namespace pliant {

/// Values by the names of parameters, or by their roles; all others have their defaults. Numbers are not held against
/// their ranges.
class ParameterValues final : public ParameterReader {
 public:
  using Key = std::variant<std::string, Role>;
  using Value = std::variant<Real, std::string>;  ///< of a flag 0 or 1, of a choice its name

  ParameterValues() = default;
  ParameterValues(std::initializer_list<std::pair<Key, Value>> values) : values_(values) {}

  /// The value of a parameter from now on.
  void set(Key key, Value value);

  Real number(const Parameter& p) override { return automatic(p, p.value); }
  Real automatic(const Parameter& p, Real value) override;
  bool flag(const Parameter& p) override { return number(p) != 0; }
  /// Errors: InputError for a choice that is not among the names.
  std::size_t choose(const Parameter& p, std::span<const std::string_view> names) override;
  bool is_set(std::string_view name) const override { return find(name, Role::none) != nullptr; }

 private:
  const Value* find(std::string_view name, Role role) const;

  std::vector<std::pair<Key, Value>> values_;
};

}  // namespace pliant
