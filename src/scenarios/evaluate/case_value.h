// A value in a user's JSON file with its path, which messages about the value contain.
#pragma once

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/base/types.h>

namespace pliant {

/// Allowed range of a number. Sizes beyond 1e100 are refused everywhere: nothing could be computed from them.
enum class Sign { any, not_negative, positive };

/// View of a JSON value with its path ("case.json: inputs.hopper.w"); the value must outlive it. A key that is null or
/// missing gives an absent field: asking it for a value is an InputError, asking it for one with a fallback gives the
/// fallback. All errors are InputErrors.
class CaseValue {
 public:
  /// The whole document; `file` is its name in messages.
  CaseValue(const nlohmann::json& document, std::string file) : value_(&document), path_(std::move(file)) {}

  bool is_array() const { return value_ != nullptr && value_->is_array(); }
  bool present() const { return value_ != nullptr && !value_->is_null(); }
  const std::string& path() const { return path_; }

  /// Child of an object.
  CaseValue operator[](std::string_view key) const;
  /// Element of an array.
  CaseValue operator[](std::size_t i) const;
  /// Keys of an object.
  std::vector<std::string> keys() const;
  /// Errors: a key that is not in `known`, with the nearest known key.
  void check_keys(std::span<const std::string_view> known) const;

  /// Length of an array that must not be empty.
  std::size_t size() const;
  /// Errors: an array that has not `count` elements, one per `what`.
  void check_size(std::size_t count, std::string_view what) const;

  Real number(Sign sign = Sign::any) const;
  Real number_or(Real fallback, Sign sign = Sign::any) const { return present() ? number(sign) : fallback; }
  bool flag_or(bool fallback) const;
  /// A whole number from 0 to count − 1; `what` names the counted items.
  Index index(Index count, std::string_view what) const;
  const std::string& text() const;
  /// Position of a text among the choices.
  std::size_t choice(std::span<const std::string_view> choices) const;
  template <int D>
  Vec<D> vector() const {
    check_size(D, "coordinate");
    Vec<D> r;
    for (int k = 0; k < D; ++k) r[k] = (*this)[k].number();
    return r;
  }

  /// Throws an InputError that starts with the path.
  template <class... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> text, Args&&... args) const {
    throw InputError("{} {}", path_, fmt::format(text, std::forward<Args>(args)...));
  }

 private:
  CaseValue(const nlohmann::json* value, std::string path, bool root)
      : value_(value), path_(std::move(path)), root_(root) {}

  const nlohmann::json& require(nlohmann::json::value_t type, std::string_view what) const;
  std::string shown() const;
  /// Errors: an absent field.
  void check_present() const;

  const nlohmann::json* value_;
  std::string path_;
  bool root_ = true;
};

}  // namespace pliant
