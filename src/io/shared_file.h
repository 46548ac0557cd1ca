// One file for all ranks: the root lays out datasets, and all ranks write their parts through MPI-IO.
#pragma once

#include <mpi.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include <pliant/base/ranks.h>

namespace pliant {

/// An existing file that all ranks open; they write to different ranges. Constructor, destructor and sync() are
/// collective. Errors of all members: OutputError.
class SharedFile {
 public:
  SharedFile(const Ranks& ranks, const std::filesystem::path& path);
  ~SharedFile();
  SharedFile(const SharedFile&) = delete;
  SharedFile& operator=(const SharedFile&) = delete;

  /// Not collective; errors are thrown on this rank only.
  void write(std::uint64_t address, std::span<const std::byte> bytes);
  /// All writes are on disk, and visible to all ranks.
  void sync();

 private:
  void check(int code) const;

  const Ranks& ranks_;
  std::string name_;  ///< for messages
  MPI_File file_ = MPI_FILE_NULL;
};

}  // namespace pliant
