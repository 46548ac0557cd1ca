// Files that users name: what else can have a name (FIFOs, devices, folders) would wait, never end, or be changed.
#pragma once

#include <filesystem>
#include <string_view>

namespace pliant {

/// open(2) of a regular file, with O_CLOEXEC; never waits. With O_NOFOLLOW in `flags`, neither a symbolic link nor a
/// file that has other names. Returns the descriptor, or -1 and errno. Errors: InputError if the name is that of
/// something else.
int open_regular(const std::filesystem::path& path, int flags);

/// The same for reading what messages call `what`, with the pipes of a shell, such as /dev/stdin and <(…), too; not
/// FIFOs.
int open_readable(const std::filesystem::path& path, std::string_view what);

}  // namespace pliant
