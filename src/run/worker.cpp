#include <pliant/run/worker.h>

#include <fcntl.h>
#include <fmt/format.h>
#include <omp.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <string_view>

#include <pliant/base/errors.h>
#include <pliant/base/regular_file.h>

namespace pliant {
namespace {

/// Whether all bytes were read; false at the end of the stream.
bool read_all(int descriptor, void* to, std::size_t count) {
  for (auto* at = static_cast<char*>(to); count > 0;) {
    const ssize_t n = read_some(descriptor, at, count);
    if (n <= 0) return false;
    at += n;
    count -= static_cast<std::size_t>(n);
  }
  return true;
}

template <class T>
std::string_view raw_bytes(const T& number) {
  return {reinterpret_cast<const char*>(&number), sizeof number};
}

/// The work of the child until its parent closes the pipe. The child ends without the exit handlers and
/// destructors of the program: MPI, PETSc and open files are the parent's.
[[noreturn]] void serve(int tasks, int results, const std::function<std::string(Index)>& make) {
  for (Index task = 0; read_all(tasks, &task, sizeof task);) {
    const std::string bytes = make(task);
    const std::uint64_t size = bytes.size();
    if (write_all(results, raw_bytes(size)) != 0 || write_all(results, bytes) != 0) break;
  }
  ::_exit(0);
}

}  // namespace

Worker::Worker(const std::function<std::string(Index task)>& make) {
  std::array<int, 2> tasks{}, results{};
  if (::pipe2(tasks.data(), O_CLOEXEC) != 0) throw MemoryError("a pipe to a process");
  if (::pipe2(results.data(), O_CLOEXEC) != 0) {
    for (const int d : tasks) ::close(d);
    throw MemoryError("a pipe to a process");
  }
  // A large buffer lets the worker begin its next task before the parent has read the result.
  (void)::fcntl(results[1], F_SETPIPE_SZ, 1 << 20);
  const pid_t parent = ::getpid();
  process_ = ::fork();
  if (process_ == 0) {
    ::close(tasks[1]);
    ::close(results[0]);
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(0);
    serve(tasks[0], results[1], make);
  }
  ::close(tasks[0]);
  ::close(results[1]);
  tasks_ = tasks[1];
  results_ = results[0];
  if (process_ < 0) {
    for (const int d : {tasks_, results_}) ::close(d);
    throw MemoryError("a process");
  }
}

Worker::~Worker() {
  if (process_ < 0) return;
  ::kill(process_, SIGKILL);  // the end of its pipe would not reach it: processes that are younger hold it open
  for (const int d : {tasks_, results_}) ::close(d);
  while (::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

void Worker::swap(Worker& other) noexcept {
  std::swap(process_, other.process_);
  std::swap(tasks_, other.tasks_);
  std::swap(results_, other.results_);
  std::swap(waiting_, other.waiting_);
  std::swap(death_, other.death_);
}

void Worker::add(Index task) {
  waiting_.push_back(task);
  (void)write_all(tasks_, raw_bytes(task));  // of a dead process, result() is empty
}

std::optional<std::string> Worker::result() {
  std::uint64_t size = 0;
  std::string bytes;
  if (read_all(results_, &size, sizeof size)) {
    bytes.resize(size);
    if (read_all(results_, bytes.data(), size)) {
      waiting_.pop_front();
      return bytes;
    }
  }
  waiting_.clear();
  int status = 0;
  while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) {
  }
  process_ = -1;
  for (const int d : {tasks_, results_}) ::close(d);
  death_ = WIFSIGNALED(status) ? fmt::format("was killed by signal {}", WTERMSIG(status))
                               : fmt::format("ended with exit code {}", WEXITSTATUS(status));
  return {};
}

}  // namespace pliant
