#include <pliant/base/nearest.h>
#include <pliant/scenarios/evaluate/case_value.h>

#include <algorithm>
#include <cmath>

namespace pliant {

using nlohmann::json;

void CaseValue::check_present() const {
  if (!present()) fail("is missing");
}

std::string CaseValue::shown() const {
  constexpr std::size_t longest = 40;
  const std::string text = value_->dump(-1, ' ', true, json::error_handler_t::replace);
  return text.size() > longest ? text.substr(0, longest) + "…" : text;
}

const json& CaseValue::require(json::value_t type, std::string_view what) const {
  check_present();
  if (value_->type() != type) fail("is {}, but must be {}", shown(), what);
  return *value_;
}

CaseValue CaseValue::operator[](std::string_view key) const {
  const json& object = require(json::value_t::object, "an object");
  const auto child = object.find(key);
  return CaseValue(child == object.end() ? nullptr : &*child, fmt::format("{}{}{}", path_, root_ ? ": " : ".", key),
                   false);
}

CaseValue CaseValue::operator[](std::size_t i) const {
  return CaseValue(&require(json::value_t::array, "an array").at(i), fmt::format("{}[{}]", path_, i), false);
}

std::vector<std::string> CaseValue::keys() const {
  std::vector<std::string> names;
  for (const auto& item : require(json::value_t::object, "an object").items()) names.push_back(item.key());
  return names;
}

void CaseValue::check_keys(std::span<const std::string_view> known) const {
  const std::vector<std::string> candidates(known.begin(), known.end());
  for (const std::string& key : keys()) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    const auto guess = nearest(key, candidates);
    (*this)[key].fail("is not a known key; {}", guess ? fmt::format("did you mean {}?", *guess)
                                                      : fmt::format("known are {}", fmt::join(known, ", ")));
  }
}

std::size_t CaseValue::size() const {
  const std::size_t count = require(json::value_t::array, "an array").size();
  if (count == 0) fail("is empty");
  return count;
}

void CaseValue::check_size(std::size_t count, std::string_view what) const {
  if (const std::size_t length = require(json::value_t::array, "an array").size(); length != count)
    fail("has {} entries, but must have {}, one per {}", length, count, what);
}

Real CaseValue::number(Sign sign) const {
  constexpr Real largest = 1e100, smallest = 1 / largest;
  check_present();
  if (!value_->is_number()) fail("is {}, but must be a number", shown());
  const Real value = value_->get<Real>();
  if (!std::isfinite(value)) fail("is {}, but must be a finite number", value);
  if (std::abs(value) > largest) fail("is {}, but numbers must be within ±{}", value, largest);
  if (sign == Sign::positive && value < smallest) fail("is {}, but must be positive", value);
  if (sign == Sign::not_negative && value < 0) fail("is {}, but must not be negative", value);
  return value;
}

bool CaseValue::flag_or(bool fallback) const {
  return present() ? require(json::value_t::boolean, "true or false").get<bool>() : fallback;
}

Index CaseValue::index(Index count, std::string_view what) const {
  const Real value = number();
  if (!(value >= 0 && value < count && value == std::floor(value)))
    fail("is {}, but must be the number of one of {} {}, from 0", value, count, what);
  return static_cast<Index>(value);
}

const std::string& CaseValue::text() const {
  return require(json::value_t::string, "a text").get_ref<const std::string&>();
}

std::size_t CaseValue::choice(std::span<const std::string_view> choices) const {
  const auto found = std::find(choices.begin(), choices.end(), text());
  if (found == choices.end()) fail("is {}, but this version has {}", shown(), fmt::join(choices, ", "));
  return static_cast<std::size_t>(found - choices.begin());
}

}  // namespace pliant
