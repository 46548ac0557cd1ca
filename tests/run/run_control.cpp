// Requests to stop.
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <functional>

#include <pliant/run/run_control.h>

using namespace pliant;

namespace {

constexpr int survived = 42;

/// How a process ends that does this: by a signal, or `survived`.
int end_of(const std::function<void()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) std::signal(signal, SIG_DFL);  // not the test program's own
    body();
    _exit(survived);
  }
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  return WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status);
}

}  // namespace

TEST_CASE("a signal asks, another one kills once it is no echo of the first", "[signals]") {
  const auto twice = [](int first, int second, useconds_t between) {
    return end_of([=] {
      const StopSignals signals;
      if (StopSignals::requested()) _exit(1);
      std::raise(first);
      if (!StopSignals::requested()) _exit(2);
      usleep(between);
      std::raise(second);
    });
  };
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1, SIGXCPU}) {
    INFO(signal);
    CHECK(twice(signal, signal, 0) == survived);
    CHECK(twice(signal, SIGTERM, 500'000) == survived);
  }
  CHECK(twice(SIGTERM, SIGTERM, 2'100'000) == SIGTERM);
  CHECK(twice(SIGHUP, SIGINT, 2'100'000) == SIGINT);
  CHECK(twice(SIGXCPU, SIGXCPU, 2'100'000) == survived);  // the system's own repetition
}

TEST_CASE("signals after a run", "[signals]") {
  CHECK(end_of([] {
          { const StopSignals signals; }
          std::raise(SIGTERM);
        }) == SIGTERM);
  // The echo of a request that comes while the program ends.
  CHECK(end_of([] {
          {
            const StopSignals signals;
            std::raise(SIGTERM);
          }
          std::raise(SIGTERM);
        }) == survived);
  CHECK(end_of([] { std::raise(SIGTERM); }) == SIGTERM);
}

TEST_CASE("nohup", "[signals]") {
  CHECK(end_of([] {
          std::signal(SIGHUP, SIG_IGN);
          {
            const StopSignals signals;
            std::raise(SIGHUP);
            if (StopSignals::requested()) _exit(1);
          }
          std::raise(SIGHUP);
        }) == survived);
}
