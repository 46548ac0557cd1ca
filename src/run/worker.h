// A process that makes results for its parent.
#pragma once

#include <sys/types.h>

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

  void begin(Index task);
  std::optional<Index> task() const { return task_; }
  /// Readable when the result is there, or when the process has died.
  int result_descriptor() const { return results_; }
  /// The result of its task, or nothing if the process has died: see death().
  std::optional<std::string> result();
  /// "was killed by signal 9".
  const std::string& death() const { return death_; }

 private:
  void swap(Worker& other) noexcept;

  pid_t process_ = -1;
  int tasks_ = -1, results_ = -1;  ///< descriptors
  std::optional<Index> task_;
  std::string death_;
};

}  // namespace pliant
