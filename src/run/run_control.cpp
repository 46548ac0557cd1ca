#include <pliant/run/run_control.h>

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <ctime>
#include <utility>

#include <pliant/base/console.h>

namespace pliant {
namespace {

/// One request may come as several signals: to the process and to its group, or forwarded.
constexpr std::int64_t nanoseconds_of_one_request = 2'000'000'000;

// A signal handler can reach nothing but static storage.
std::atomic<std::int64_t> requested_at = 0;  // 0: not at all
std::atomic<int> first_signal = 0;
int stop_signals = 0;  ///< objects
static_assert(std::atomic<std::int64_t>::is_always_lock_free && std::atomic<int>::is_always_lock_free);

thread_local RunMonitor* monitor = nullptr;

std::int64_t nanoseconds(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return t.tv_sec * std::int64_t{1'000'000'000} + t.tv_nsec;
}

void on_signal(int signal) {
  const std::int64_t now = nanoseconds(CLOCK_MONOTONIC);
  std::int64_t first = 0;
  if (requested_at.compare_exchange_strong(first, now)) {
    first_signal = signal;
    return;
  }
  if (now - first < nanoseconds_of_one_request) return;
  if (signal == SIGXCPU) return;  // the system repeats it every second
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void forget_request() {
  requested_at = 0;
  first_signal = 0;
}

Real process_cpu_seconds() { return 1e-9 * static_cast<Real>(nanoseconds(CLOCK_PROCESS_CPUTIME_ID)); }

}  // namespace

InheritedSignals::InheritedSignals() {
  for (int signal = 1; signal < count; ++signal) sigaction(signal, nullptr, &responses_[signal]);
}

void InheritedSignals::restore() const {
  constexpr std::array others{SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGSEGV, SIGSYS, SIGTRAP, SIGCHLD, SIGKILL, SIGSTOP};
  for (int signal = 1; signal < count; ++signal)
    if (std::ranges::find(others, signal) == others.end()) sigaction(signal, &responses_[signal], nullptr);
}

StopSignals::StopSignals() {
  if (stop_signals++ == 0) forget_request();
  struct sigaction ask {};
  ask.sa_handler = on_signal;
  ask.sa_flags = SA_RESTART;
  for (std::size_t k = 0; k < signals.size(); ++k) {
    sigaction(signals[k], nullptr, &before_[k]);
    if (before_[k].sa_handler != SIG_IGN) sigaction(signals[k], &ask, nullptr);
  }
}

StopSignals::~StopSignals() {
  const bool inner = --stop_signals > 0;
  // A second signal right after the first must not change how a stopped program ends.
  if (!inner && requested()) return;
  if (inner) forget_request();
  for (std::size_t k = 0; k < signals.size(); ++k) sigaction(signals[k], &before_[k], nullptr);
}

bool StopSignals::requested() { return requested_at != 0; }
int StopSignals::signal() { return first_signal; }

RunMonitor::RunMonitor() : before_(std::exchange(monitor, this)) {}
RunMonitor::~RunMonitor() { monitor = before_; }
RunMonitor* RunMonitor::current() { return monitor; }

RunControl::RunControl(Real checkpoint_interval, Real max_wall_time, Ranks ranks, Real progress_interval)
    : ranks_(ranks),
      checkpoint_interval_(checkpoint_interval),
      max_wall_time_(max_wall_time),
      progress_interval_(progress_interval),
      start_(Clock::now()),
      last_look_(start_),
      last_checkpoint_(start_),
      last_progress_(start_),
      last_line_(start_),
      cpu_start_(process_cpu_seconds()),
      terminal_(ranks.root() && isatty(STDERR_FILENO) == 1),
      prints_lines_(ranks.root() && progress_interval > 0 && isatty(STDOUT_FILENO) == 0) {}

Real RunControl::seconds_since(Clock::time_point t) const {
  return std::chrono::duration<Real>(Clock::now() - t).count();
}

bool RunControl::due() {
  if (--left_ > 0) return false;
  // Aim at ten checks a second, for any cost of a step.
  const Real passed = seconds_since(last_look_);
  last_look_ = Clock::now();
  const Real factor = std::clamp(0.1 / std::max(passed, 1e-6), 0.5, 2.0);
  steps_to_look_ = ranks_.broadcast(std::clamp(static_cast<int>(std::lround(steps_to_look_ * factor)), 1, 100000));
  left_ = steps_to_look_;
  return true;
}

bool RunControl::stop() const {
  return ranks_.any(StopSignals::requested() || (monitor != nullptr && monitor->stop()) ||
                    (ranks_.root() && max_wall_time_ > 0 && wall_seconds() > max_wall_time_));
}

bool RunControl::checkpoint_due() {
  const bool due = checkpoint_interval_ > 0 && seconds_since(last_checkpoint_) >= checkpoint_interval_;
  if (!ranks_.broadcast(due)) return false;
  last_checkpoint_ = Clock::now();
  return true;
}

Real RunControl::wall_seconds() const { return seconds_since(start_); }
Real RunControl::cpu_seconds() const { return ranks_.sum(process_cpu_seconds() - cpu_start_); }

void RunControl::progress(Real t, Real end, const std::function<std::string()>& text) {
  if (monitor != nullptr) return monitor->progress(t, end, text());
  if (prints_lines_ && seconds_since(last_line_) >= progress_interval_) {
    last_line_ = Clock::now();
    say("{}\n", text());
  }
  if (!terminal_ || seconds_since(last_progress_) < 0.5) return;
  last_progress_ = Clock::now();
  complain(fmt::format("\r{}\x1b[K", text()));
  line_open_ = true;
}

void RunControl::end_progress() {
  if (line_open_) complain("\n");
  line_open_ = false;
}

std::string duration_text(Real seconds) {
  if (!std::isfinite(seconds)) return "?";
  const auto s = std::llround(seconds);
  if (s < 60) return fmt::format("{} s", s);
  if (s < 3600) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} h {:02} min", s / 3600, s / 60 % 60);
}

}  // namespace pliant
