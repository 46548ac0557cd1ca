// Files that are there whole or not at all.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <string_view>

namespace pliant {

/// Writes these parts one after the other to a new file in the folder of `path`, syncs it to the disk and renames it to
/// `path`: whenever the program dies, `path` holds either its old content or all of the new. Errors: OutputError with
/// the system's reason; `path` is then untouched.
void write_file_atomically(const std::filesystem::path& path, std::initializer_list<std::string_view> parts);

/// The same with the content of another file.
void copy_file_atomically(const std::filesystem::path& from, const std::filesystem::path& path);

/// Names that were created, renamed or removed in the folder before survive a loss of power, unless its file system
/// cannot sync folders.
void sync_folder(const std::filesystem::path& folder);

}  // namespace pliant
