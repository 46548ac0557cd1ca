// One process at a time writes into the folder of a run.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pliant/base/errors.h>

namespace pliant {

/// Another process runs in the folder: exit code 6, so that a queue of runs can distinguish it from bad input.
struct FolderInUse : Error {
  template <class... Args>
  explicit FolderInUse(fmt::format_string<Args...> text, Args&&... args)
      : Error(ExitCode::folder_in_use, fmt::format(text, std::forward<Args>(args)...)) {}
};

/// Creates a folder and its parents. Errors: OutputError.
void create_folder(const std::filesystem::path& folder);

/// "process 12 on host x" that holds the lock of a folder; nothing where no process does.
std::optional<std::string> holder_of(const std::filesystem::path& folder);

/// Holds run.lock in a folder from construction to destruction. The lock is the system's (flock) and ends with the
/// process in every case; the file names the process that holds it, and a stale file locks nothing. On a file system
/// without locks, folders are used without a lock: see warning().
class FolderLock {
 public:
  FolderLock() = default;  ///< holds no lock
  /// Makes the folder and its parents where they are missing. Errors: FolderInUse that names process and host if
  /// another one holds the lock; OutputError if the folder or the file cannot be made.
  explicit FolderLock(const std::filesystem::path& folder);
  FolderLock(FolderLock&& other) noexcept { swap(other); }
  FolderLock& operator=(FolderLock&& other) noexcept {
    FolderLock(std::move(other)).swap(*this);
    return *this;
  }
  /// Removes the file, and of the folders that it has made those that are still empty.
  ~FolderLock();

  /// Empty, or that there is no lock, for the user to see.
  const std::string& warning() const { return warning_; }

 private:
  void swap(FolderLock& other) noexcept;
  void acquire();

  std::filesystem::path folder_, file_;
  std::vector<std::filesystem::path> made_;  ///< the innermost first
  int descriptor_ = -1;
  std::string warning_;
};

}  // namespace pliant
