// Files that are there whole or not at all.
#pragma once

#include <filesystem>
#include <string_view>

namespace pliant {

/// Writes `bytes` to `path`.tmp, syncs it to the disk and renames it to `path`: whenever the program dies, `path` holds
/// either its old content or all of the new. Errors: OutputError with the system's reason; `path` is then untouched.
void write_file_atomically(const std::filesystem::path& path, std::string_view bytes);

}  // namespace pliant
