// Requests to stop.
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <pliant/run/run_control.h>

namespace pliant::test::run_control_test {

namespace {

constexpr int survived = 42;

/// A process that does this.
pid_t start(const std::function<void()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) std::signal(signal, SIG_DFL);  // not the test program's own
    body();
    _exit(survived);
  }
  return child;
}

/// How it ends: by a signal, or `survived`.
int end_of(pid_t child) {
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  return WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status);
}

int end_of(const std::function<void()>& body) { return end_of(start(body)); }

}  // namespace

TEST_CASE("a signal asks, another one kills once it is no echo of the first", "[signals]") {
  struct Twice {
    int first, second;
    useconds_t between;
    int expected;
  };
  std::vector<Twice> cases{{SIGTERM, SIGTERM, 2'100'000, SIGTERM},
                           {SIGHUP, SIGINT, 2'100'000, SIGINT},
                           {SIGXCPU, SIGXCPU, 2'100'000, survived}};  // the system's own repetition
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1, SIGXCPU}) {
    cases.push_back({signal, signal, 0, survived});
    cases.push_back({signal, SIGTERM, 100'000, survived});
  }
  std::vector<pid_t> children;  // they sleep at the same time
  for (const Twice& twice : cases)
    children.push_back(start([&] {
      const StopSignals signals;
      if (StopSignals::requested()) _exit(1);
      std::raise(twice.first);
      if (!StopSignals::requested()) _exit(2);
      usleep(twice.between);
      std::raise(twice.second);
    }));
  for (std::size_t i = 0; i < cases.size(); ++i) {
    INFO(cases[i].first << ' ' << cases[i].second << ' ' << cases[i].between);
    CHECK(end_of(children[i]) == cases[i].expected);
  }
}

TEST_CASE("a signal between the runs of a process stops the next of them alone", "[signals]") {
  CHECK(end_of([] {
          const StopSignals of_process;
          std::raise(SIGTERM);
          {
            const StopSignals of_run;
            if (!StopSignals::requested() || StopSignals::signal() != SIGTERM) _exit(1);
          }
          {
            const StopSignals of_next_run;
            if (StopSignals::requested()) _exit(2);
            std::raise(SIGTERM);
            if (!StopSignals::requested()) _exit(3);
          }
          if (StopSignals::requested()) _exit(4);
        }) == survived);
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

TEST_CASE("a signal that is ignored stays ignored, during a run and after", "[signals]") {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1, SIGXCPU})
    CHECK(end_of([=] {
            std::signal(signal, SIG_IGN);
            {
              const StopSignals signals;
              std::raise(signal);
              if (StopSignals::requested()) _exit(1);
            }
            std::raise(signal);
          }) == survived);
}

TEST_CASE("a run gives signals back to their handlers", "[signals]") {
  CHECK(end_of([] {
          std::signal(SIGTERM, [](int) { _exit(7); });
          { const StopSignals signals; }
          std::raise(SIGTERM);
        }) == 7);
}

TEST_CASE("handlers that a library installs give way to what the process was started with", "[signals]") {
  for (const int signal : {SIGHUP, SIGINT, SIGTERM, SIGXCPU, SIGUSR1, SIGUSR2, SIGPIPE, SIGXFSZ})
    CHECK(end_of([=] {
            std::signal(signal, SIG_IGN);
            const InheritedSignals inherited;
            std::signal(signal, [](int) { _exit(1); });
            std::signal(SIGSEGV, [](int) { _exit(7); });
            inherited.restore();
            std::raise(signal);
            std::raise(SIGSEGV);
          }) == 7);
}

TEST_CASE("when a run is asked to stop", "[control]") {
  CHECK_FALSE(RunControl(0, 0).stop());  // no limit
  CHECK_FALSE(RunControl(0, 1e9).stop());
  const RunControl short_one(0, 1e-9);
  while (!(short_one.wall_seconds() > 1e-9)) {
  }
  CHECK(short_one.stop());
  CHECK(end_of([] {
          const RunControl control(0, 0);
          const StopSignals signals;
          if (control.stop()) _exit(1);
          std::raise(SIGUSR1);
          if (!control.stop()) _exit(2);
        }) == survived);
}

TEST_CASE("when a checkpoint is due", "[control]") {
  RunControl never(0, 0), late(1e9, 0), at_once(1e-9, 0);
  while (!(at_once.wall_seconds() > 1e-9)) {
  }
  CHECK_FALSE(never.checkpoint_due());
  CHECK_FALSE(late.checkpoint_due());
  CHECK(at_once.checkpoint_due());
}

TEST_CASE("a run looks at the clock at once, then ever more seldom where steps are short", "[control]") {
  RunControl control(0, 0);
  CHECK(control.due());
  int looks = 0;
  constexpr int steps = 1000000;
  for (int k = 0; k < steps; ++k) looks += control.due() ? 1 : 0;
  CHECK(looks >= steps / 100000);
  CHECK(looks < steps / 10);
  CHECK(control.wall_seconds() >= 0);
  CHECK(control.cpu_seconds() >= 0);
}

TEST_CASE("off the terminal the progress is a line per interval", "[control]") {
  const auto lines = [](Real interval) {
    int ends[2];
    REQUIRE(pipe(ends) == 0);
    const pid_t child = fork();
    if (child == 0) {
      dup2(ends[1], STDOUT_FILENO);
      RunControl control(0, 0, Ranks(), interval);
      for (int k = 0; k < 3; ++k) {
        control.progress(0, 1, [&] { return fmt::format("line {}", k); });
        usleep(150000);
      }
      _exit(0);
    }
    close(ends[1]);
    char text[200] = "";
    std::size_t size = 0;
    for (ssize_t got; (got = read(ends[0], text + size, sizeof text - size)) > 0;)
      size += static_cast<std::size_t>(got);
    close(ends[0]);
    waitpid(child, nullptr, 0);
    return std::string(text, size);
  };
  CHECK(lines(0.1) == "line 1\nline 2\n");
  CHECK(lines(1000).empty());
  CHECK(lines(0).empty());
}

TEST_CASE("durations as text", "[control]") {
  CHECK(duration_text(0.4) == "0 s");
  CHECK(duration_text(59.4) == "59 s");
  CHECK(duration_text(59.6) == "1 min 00 s");
  CHECK(duration_text(754) == "12 min 34 s");
  CHECK(duration_text(3600) == "1 h 00 min");
  CHECK(duration_text(100 * 3600 + 61) == "100 h 01 min");
  CHECK(duration_text(std::numeric_limits<Real>::infinity()) == "?");
}

}  // namespace pliant::test::run_control_test
