// Output of the program: results, which must be written, and remarks about a run, whose results are in its folder.
#pragma once

#include <fmt/format.h>

#include <string>
#include <string_view>
#include <utility>

namespace pliant {

/// Replaces closed standard streams by /dev/null; otherwise the next opened file would get their number, and the
/// output. Writing to such a stream still fails. Ignores SIGPIPE, so that a closed pipe does not end a run. To be
/// called first in main.
void guard_standard_streams();

/// A receiver of remarks and warnings, in place of the standard streams: for a program that embeds runs. From
/// construction to destruction, it receives the remarks and warnings of its thread. Its functions do not throw.
class ConsoleSink {
 public:
  ConsoleSink();
  virtual ~ConsoleSink();
  ConsoleSink(const ConsoleSink&) = delete;
  ConsoleSink& operator=(const ConsoleSink&) = delete;
  virtual void say(std::string_view text) noexcept = 0;
  virtual void warn(std::string_view text) noexcept = 0;

 private:
  ConsoleSink* before_;
};

/// Name of the program in messages: "pliant" unless a program with another name sets it.
void set_program_name(std::string name);
const std::string& program_name();

/// Prints a result to the standard output. Errors: OutputError if it cannot be written, unless the reader has closed
/// the pipe (`| head`).
void print_result(std::string_view text);

/// Prints `text` to the standard error; a failure to do so is ignored.
void complain(std::string_view text) noexcept;

/// Prints a remark of a run to the standard output. The first remark that cannot be written gives a warning, unless the
/// reader has closed the pipe; the run continues.
void say_text(std::string_view text) noexcept;
template <class... Args>
void say(fmt::format_string<Args...> text, Args&&... args) {
  say_text(fmt::format(text, std::forward<Args>(args)...));
}

/// A line "PROGRAM: warning: …" on the standard error.
void warn_text(std::string_view text);
template <class... Args>
void warn(fmt::format_string<Args...> text, Args&&... args) {
  warn_text(fmt::format(text, std::forward<Args>(args)...));
}

}  // namespace pliant
