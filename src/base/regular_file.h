// Files that users name: other objects with a name (FIFOs, devices, folders) would block, never end, or be changed.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <string_view>

namespace pliant {

/// open(2) of a regular file, with O_CLOEXEC; never waits. With O_NOFOLLOW in `flags`, refuses symbolic links and files
/// with several names. Returns the descriptor, or -1 and errno. Errors: InputError if the name belongs to something
/// other than a regular file.
int open_regular(const std::filesystem::path& path, int flags);

/// The same for reading a file that messages call `what`, with the pipes of a shell, such as /dev/stdin and <(…), too;
/// not FIFOs.
int open_readable(const std::filesystem::path& path, std::string_view what);

/// read(2), again where a signal has interrupted it. Returns the number of bytes, 0 at the end, or −1 and errno.
ssize_t read_some(int file, void* to, std::size_t most);

/// write(2) of all bytes. Returns 0, or the errno of the call that failed.
int write_all(int file, std::string_view bytes);

}  // namespace pliant
