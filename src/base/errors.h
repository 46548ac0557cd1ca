// Errors carry the exit code of the program; messages are one line: the fact with its value, and the cure.
#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace pliant {

enum class ExitCode : int {
  done = 0,
  bad_input = 2,
  numerical_failure = 3,
  output_failure = 4,
  out_of_memory = 5,
  folder_in_use = 6,
  stopped = 75
};

class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

/// Bad input of the user (exit 2).
struct InputError : Error {
  template <class... Args>
  explicit InputError(fmt::format_string<Args...> text, Args&&... args)
      : Error(ExitCode::bad_input, fmt::format(text, std::forward<Args>(args)...)) {}
};

/// The numbers went wrong: not finite, an outline crossed, a solver failed (exit 3).
struct NumericalError : Error {
  template <class... Args>
  explicit NumericalError(fmt::format_string<Args...> text, Args&&... args)
      : Error(ExitCode::numerical_failure, fmt::format(text, std::forward<Args>(args)...)) {}
};

/// A file or folder could not be written (exit 4).
struct OutputError : Error {
  template <class... Args>
  explicit OutputError(fmt::format_string<Args...> text, Args&&... args)
      : Error(ExitCode::output_failure, fmt::format(text, std::forward<Args>(args)...)) {}
};

/// An allocation failed (exit 5).
struct MemoryError : Error {
  /// `allocation` names the allocation, as "80 MB could not be allocated"; the memory in use and the cure are added.
  explicit MemoryError(const std::string& allocation);
};

/// The exception that is being handled, as an Error: std::bad_alloc as a MemoryError with the size of the allocation,
/// exceptions of other types as internal errors (exit 3). To be called in a catch block.
Error error_in_flight();

}  // namespace pliant
