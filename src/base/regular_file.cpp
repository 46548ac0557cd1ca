#include <fcntl.h>
#include <linux/magic.h>
#include <pliant/base/errors.h>
#include <pliant/base/regular_file.h>
#include <pliant/base/text.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <cerrno>

namespace pliant {
namespace {

const char* kind_of(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISLNK(mode)) return "a symbolic link";
  if (S_ISFIFO(mode)) return "a FIFO";
  if (S_ISSOCK(mode)) return "a socket";
  return "a device";
}

void check(const std::string& name, const struct stat& found, bool own) {
  const char* cure = own ? "remove it" : "put a file in its place, or name another";
  if (!S_ISREG(found.st_mode)) throw InputError("{} is {}, not a file; {}", name, kind_of(found.st_mode), cure);
  if (own && found.st_nlink > 1) throw InputError("{} is a file with other names (hard links); {}", name, cure);
}

int open_checked(const std::filesystem::path& path, const std::string& name, int flags) {
  const bool own = (flags & O_NOFOLLOW) != 0;
  struct stat found {};
  // Before it is opened, which could change a device; and after, as it may have been replaced.
  if ((own ? ::lstat : ::stat)(path.c_str(), &found) == 0) check(name, found, own);
  const int file = ::open(path.c_str(), flags | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, 0666);
  if (file < 0 || ::fstat(file, &found) != 0) return file;
  try {
    check(name, found, own);
  } catch (const InputError&) {
    ::close(file);
    throw;
  }
  return file;
}

bool is_pipe_of_shell(const std::filesystem::path& path) {
  struct stat found {};
  struct statfs system {};
  return ::stat(path.c_str(), &found) == 0 && S_ISFIFO(found.st_mode) && ::statfs(path.c_str(), &system) == 0 &&
         system.f_type == PIPEFS_MAGIC;
}

}  // namespace

int open_regular(const std::filesystem::path& path, int flags) {
  return open_checked(path, printable(path.string()), flags);
}

int open_readable(const std::filesystem::path& path, std::string_view what) {
  if (is_pipe_of_shell(path)) return ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  return open_checked(path, fmt::format("{} {}", what, printable(path.string())), O_RDONLY);
}

ssize_t read_some(int file, void* to, std::size_t most) {
  for (;;)
    if (const ssize_t got = ::read(file, to, most); got >= 0 || errno != EINTR) return got;
}

int write_all(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written >= 0)
      bytes.remove_prefix(static_cast<std::size_t>(written));
    else if (errno != EINTR)
      return errno;
  }
  return 0;
}

}  // namespace pliant
