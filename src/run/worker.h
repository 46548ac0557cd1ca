// A process that makes results for its parent.
#pragma once

#include <sys/types.h>

#include <deque>
#include <functional>
#include <optional>
#include <string>

#include <pliant/base/types.h>

namespace pliant {

/// A child process, which computes make(task) for the tasks that it gets, one after the other. The process
/// ends with this object, or with its parent.
class Worker {
 public:
  /// make: returns the bytes that the parent gets; must not throw. Errors: MemoryError where no process can be made.
  explicit Worker(const std::function<std::string(Index task)>& make);
  Worker(Worker&& other) noexcept { swap(other); }
  Worker& operator=(Worker&& other) noexcept {
    Worker(std::move(other)).swap(*this);
    return *this;
  }
  ~Worker();

  /// Gives it a task, which it begins after the tasks before.
  void add(Index task);
  /// Tasks whose results have not been read, in their order.
  const std::deque<Index>& tasks() const { return waiting_; }
  /// Readable when a result is there, or when the process has died.
  int result_descriptor() const { return results_; }
  /// The result of its first task; nothing if the process has died, without its other tasks: see death().
  std::optional<std::string> result();
  /// "was killed by signal 9".
  const std::string& death() const { return death_; }

 private:
  void swap(Worker& other) noexcept;

  pid_t process_ = -1;
  int tasks_ = -1, results_ = -1;  ///< descriptors
  std::deque<Index> waiting_;
  std::string death_;
};

}  // namespace pliant
