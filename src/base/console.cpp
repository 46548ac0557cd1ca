#include <fcntl.h>
#include <pliant/base/console.h>
#include <pliant/base/errors.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <utility>

namespace pliant {
namespace {

/// Returns 0 or the errno of the failed call. EPIPE is not a failure: the reader has closed the pipe.
int write_out(std::string_view text) {
  errno = 0;
  if (std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0) return 0;
  if (errno == EPIPE) return 0;
  return errno != 0 ? errno : EIO;
}

std::string& name_of_program() {
  static std::string name = "pliant";
  return name;
}

thread_local ConsoleSink* sink = nullptr;

}  // namespace

ConsoleSink::ConsoleSink() : before_(std::exchange(sink, this)) {}
ConsoleSink::~ConsoleSink() { sink = before_; }

void set_program_name(std::string name) { name_of_program() = std::move(name); }

const std::string& program_name() { return name_of_program(); }

void guard_standard_streams() {
  std::signal(SIGPIPE, SIG_IGN);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(stream, F_GETFD) < 0 && errno == EBADF)
      (void)::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);  // the lowest free number is this one
}

void print_result(std::string_view text) {
  if (const int error = write_out(text); error != 0)
    throw OutputError("standard output cannot be written: {}", std::strerror(error));
}

void complain(std::string_view text) noexcept {
  (void)std::fwrite(text.data(), 1, text.size(), stderr);
  (void)std::fflush(stderr);
}

void warn_text(std::string_view text) {
  if (sink != nullptr) return sink->warn(text);
  complain(fmt::format("{}: warning: {}\n", program_name(), text));
}

void say_text(std::string_view text) noexcept {
  if (sink != nullptr) return sink->say(text);
  static bool lost = false;
  if (lost) return;
  if (const int error = write_out(text); error != 0) {
    lost = true;
    warn("standard output cannot be written: {}; the run continues and writes its results into its folder",
         std::strerror(error));
  }
}

}  // namespace pliant
