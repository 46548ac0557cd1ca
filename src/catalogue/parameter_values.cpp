#include <pliant/catalogue/parameter_values.h>

#include <algorithm>

#include <fmt/ranges.h>

#include <pliant/base/errors.h>

namespace pliant {

void ParameterValues::set(Key key, Value value) {
  const auto found = std::ranges::find(values_, key, [](const auto& entry) { return entry.first; });
  if (found == values_.end())
    values_.emplace_back(std::move(key), std::move(value));
  else
    found->second = std::move(value);
}

const ParameterValues::Value* ParameterValues::find(std::string_view name, Role role) const {
  for (const auto& [key, value] : values_) {
    const std::string* own = std::get_if<std::string>(&key);
    if (own != nullptr ? *own == name : role != Role::none && std::get<Role>(key) == role) return &value;
  }
  return nullptr;
}

Real ParameterValues::automatic(const Parameter& p, Real value) {
  const Value* found = find(p.name, p.role);
  if (found == nullptr) return value;
  const Real* number = std::get_if<Real>(found);
  if (number == nullptr) throw InputError("{} is \"{}\", but must be a number", p.name, std::get<std::string>(*found));
  return *number;
}

std::size_t ParameterValues::choose(const Parameter& p, std::span<const std::string_view> names) {
  const Value* found = find(p.name, p.role);
  if (found == nullptr) return 0;
  const std::string* name = std::get_if<std::string>(found);
  const auto at = name != nullptr ? std::ranges::find(names, *name) : names.end();
  if (at == names.end())
    throw InputError("{} is {}, but must be one of {}", p.name,
                     name != nullptr ? *name : fmt::format("{}", std::get<Real>(*found)), fmt::join(names, ", "));
  return static_cast<std::size_t>(at - names.begin());
}

}  // namespace pliant
