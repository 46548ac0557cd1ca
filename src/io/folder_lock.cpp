#include <fcntl.h>
#include <fmt/format.h>
#include <pliant/base/cure.h>
#include <pliant/base/errors.h>
#include <pliant/base/regular_file.h>
#include <pliant/io/folder_lock.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>

namespace pliant {
namespace {

namespace fs = std::filesystem;

int lock_now(int descriptor, int how = LOCK_EX) {
  int result = 0;
  do result = ::flock(descriptor, how | LOCK_NB);
  while (result != 0 && errno == EINTR);
  return result == 0 ? 0 : errno;
}

/// Locks the file, and waits for readers of the note, who hold a shared lock for a moment (holder_of, pliant-sweep).
int lock_for_writing(int descriptor) {
  constexpr int patience = 1000;
  for (int attempt = 0;; ++attempt) {
    const int error = lock_now(descriptor);
    if (error != EWOULDBLOCK || lock_now(descriptor, LOCK_SH) != 0 || attempt == patience) return error;
    ::flock(descriptor, LOCK_UN);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

/// Whether the file still has its name: the one before may have removed it.
bool has_name(int descriptor, const fs::path& file) {
  struct stat open {
  }, named{};
  return ::fstat(descriptor, &open) == 0 && ::stat(file.c_str(), &named) == 0 && open.st_ino == named.st_ino &&
         open.st_dev == named.st_dev;
}

std::string note_of(int descriptor) {
  std::array<char, 300> text{};
  const ssize_t length = ::pread(descriptor, text.data(), text.size(), 0);
  return {text.data(), length > 0 ? static_cast<std::size_t>(length) : 0};
}

void write_note(int descriptor) {
  std::array<char, 256> host{};
  (void)::gethostname(host.data(), host.size() - 1);
  const std::string note = fmt::format("process {} on host {}", ::getpid(), host.data());
  // Without a note the lock holds as well.
  if (::ftruncate(descriptor, 0) == 0) (void)!::pwrite(descriptor, note.data(), note.size(), 0);
}

}  // namespace

void create_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!error && !fs::is_directory(folder)) error = std::make_error_code(std::errc::not_a_directory);
  if (error)
    throw OutputError("cannot create the folder {}: {}; choose {}", folder.string(), error.message(),
                      cures({Cure::other_folder}));
}

std::optional<std::string> holder_of(const fs::path& folder) {
  const int file = open_regular(folder / "run.lock", O_RDONLY | O_NOFOLLOW);
  if (file < 0) return {};
  // A shared lock: several processes may test at a time.
  std::optional<std::string> holder;
  if (lock_now(file, LOCK_SH) == EWOULDBLOCK) holder = note_of(file);
  ::close(file);
  if (holder && holder->empty()) holder = "another process";
  return holder;
}

FolderLock::FolderLock(const fs::path& folder) : folder_(folder), file_(folder / "run.lock") {
  std::vector<fs::path> missing;
  std::error_code ignored;
  fs::path path = fs::absolute(folder).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();  // "runs/one/" means "runs/one"
  for (; !fs::exists(path, ignored) && path != path.root_path(); path = path.parent_path()) missing.push_back(path);
  create_folder(folder);
  made_ = std::move(missing);
  acquire();
}

void FolderLock::acquire() {
  for (;;) {
    descriptor_ = open_regular(file_, O_RDWR | O_CREAT | O_NOFOLLOW);
    if (descriptor_ < 0)
      throw OutputError("cannot write in the folder {}: {}; check permissions and free space, or choose {}",
                        folder_.string(), std::strerror(errno), cures({Cure::other_folder}));
    const int error = lock_for_writing(descriptor_);
    if (error == 0 && has_name(descriptor_, file_)) break;
    const std::string holder = note_of(descriptor_);
    if (error != 0 && error != EWOULDBLOCK) {
      warning_ = fmt::format("{} is on a file system without locks ({}); take care that no other run writes there",
                             folder_.string(), std::strerror(error));
      break;
    }
    ::close(std::exchange(descriptor_, -1));
    if (error == EWOULDBLOCK)
      throw FolderInUse("{} is in use by {}; wait until it has ended, stop it by kill, or choose {}", folder_.string(),
                        holder.empty() ? "another process" : holder, cures({Cure::other_folder}));
  }
  write_note(descriptor_);
}

FolderLock::~FolderLock() {
  if (descriptor_ < 0) return;
  // Removed while the lock is held: no other process uses this file.
  ::unlink(file_.c_str());
  ::close(descriptor_);
  for (const fs::path& folder : made_)
    if (::rmdir(folder.c_str()) != 0) break;
}

void FolderLock::swap(FolderLock& other) noexcept {
  std::swap(folder_, other.folder_);
  std::swap(file_, other.file_);
  std::swap(made_, other.made_);
  std::swap(descriptor_, other.descriptor_);
  std::swap(warning_, other.warning_);
}

}  // namespace pliant
