#include <dirent.h>
#include <fcntl.h>
#include <pliant/base/errors.h>
#include <pliant/base/regular_file.h>
#include <pliant/io/atomic_file.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace pliant {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, int error) {
  throw OutputError("cannot write {}: {}; check permissions and free space, or choose another folder", path.string(),
                    std::strerror(error));
}

/// write(file) writes the content of the new file. Returns 0 or the errno of the failed call.
int write_and_sync(const std::string& name, const std::function<int(int file)>& write) {
  const int file = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
  if (file < 0) return errno;
  int error = write(file);
  if (error == 0 && ::fsync(file) != 0) error = errno;
  if (::close(file) != 0 && error == 0) error = errno;
  return error;
}

/// Removes partial files of killed processes. No process still writes to files of this age.
void remove_leftovers(const std::filesystem::path& folder, const std::string& name) {
  namespace fs = std::filesystem;
  const auto now = fs::file_time_type::clock::now();
  std::error_code ignored;
  // Not a directory_iterator: without memory it ends the program.
  const std::unique_ptr<DIR, int (*)(DIR*)> entries(::opendir(folder.c_str()), ::closedir);
  while (const dirent* const entry = entries != nullptr ? ::readdir(entries.get()) : nullptr) {
    const std::string file = entry->d_name;
    if (!file.starts_with(name + ".") || !file.ends_with(".tmp")) continue;
    const fs::path path = folder / file;
    const auto written = fs::is_symlink(path, ignored) ? fs::file_time_type::min() : fs::last_write_time(path, ignored);
    if (now - std::chrono::minutes(10) > written) fs::remove(path, ignored);
  }
}

void put_atomically(const std::filesystem::path& path, const std::function<int(int file)>& write) {
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  remove_leftovers(folder, path.filename().string());
  const std::string temporary = fmt::format("{}.{:08x}.tmp", path.string(), std::random_device()());
  int error = write_and_sync(temporary, write);
  if (error == 0 && std::rename(temporary.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) {
    ::unlink(temporary.c_str());
    fail(path, error);
  }
  sync_folder(folder);
}

}  // namespace

void sync_folder(const std::filesystem::path& folder) {
  const char* name = folder.empty() ? "." : folder.c_str();
  // Some file systems cannot sync a folder.
  if (const int directory = ::open(name, O_RDONLY | O_DIRECTORY | O_CLOEXEC); directory >= 0) {
    (void)::fsync(directory);
    ::close(directory);
  }
}

void write_file_atomically(const std::filesystem::path& path, std::initializer_list<std::string_view> parts) {
  put_atomically(path, [&](int file) {
    int error = 0;
    for (const std::string_view bytes : parts)
      if (error == 0) error = write_all(file, bytes);
    return error;
  });
}

void copy_file_atomically(const std::filesystem::path& from, const std::filesystem::path& path) {
  const int source = open_regular(from, O_RDONLY);
  if (source < 0) throw InputError("cannot read {}: {}", from.string(), std::strerror(errno));
  int unread = 0;  // errno of the source
  const auto copy = [&](int file) {
    std::vector<char> piece(std::size_t{1} << 20);
    for (;;) {
      const ssize_t got = read_some(source, piece.data(), piece.size());
      if (got == 0) return 0;
      if (got < 0) return unread = errno;
      if (const int error = write_all(file, {piece.data(), static_cast<std::size_t>(got)}); error != 0) return error;
    }
  };
  try {
    put_atomically(path, copy);
  } catch (const Error&) {
    ::close(source);
    if (unread != 0) throw InputError("cannot read {}: {}", from.string(), std::strerror(unread));
    throw;
  }
  ::close(source);
}

}  // namespace pliant
