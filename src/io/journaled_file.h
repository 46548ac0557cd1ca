// A file that changes by transactions: whenever the program dies, or the machine loses power, the file holds the last
// commit or the next one. The content is arbitrary.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <memory_resource>
#include <span>
#include <string>
#include <vector>

namespace pliant {

/// Bytes at addresses, no two for the same. Their memory is freed by clear() alone, all at once.
class Extents {
 public:
  Extents() = default;
  Extents(Extents&&) = default;
  Extents& operator=(Extents&&) = delete;

  /// Replaces the former bytes.
  void put(std::uint64_t address, std::span<const std::byte> bytes);
  /// Copies the bytes in memory of the addresses from `address` on to `bytes`; other bytes do not change.
  void overlay(std::uint64_t address, std::span<std::byte> bytes) const;
  bool intersects(std::uint64_t address, std::uint64_t size) const;
  bool empty() const { return blocks_.empty(); }
  std::uint64_t bytes() const;
  std::uint64_t end() const { return blocks_.empty() ? 0 : blocks_.rbegin()->first + blocks_.rbegin()->second.size(); }
  void clear() {
    blocks_.clear();
    memory_->release();
  }
  /// By address. Neighbours are not joined, because each new piece would then move the bytes after it. Strings, because
  /// vectors with such an allocator construct and destroy each byte by a call.
  using Blocks = std::pmr::map<std::uint64_t, std::pmr::string>;
  const Blocks& blocks() const { return blocks_; }

 private:
  static constexpr std::size_t first_bytes = 1 << 16;
  std::unique_ptr<std::pmr::monotonic_buffer_resource> memory_ =
      std::make_unique<std::pmr::monotonic_buffer_resource>(first_bytes);
  Blocks blocks_{memory_.get()};
};

/// Writes beyond the end of the last commit go to the file; no committed data refer to them. Changes of committed bytes
/// stay in memory. A commit appends them to the file as a journal, makes them, and cuts the journal off. The next open
/// of the file repeats the changes of a complete journal, and ignores an incomplete one.
///
/// A commit syncs the file twice: the journal before the changes are made, and the changes before the journal is cut
/// off. In between, the disk may write any of the pages in any order: the journal holds small new pieces too, so that
/// it is whole without them. Large new pieces are synced before the journal is written.
///
/// The journal, at the end of the file; integers are little-endian:
///   for each change: address, size (uint64), the bytes;
///   address of the journal, number of changes (uint64), CRC-32 of all before (uint64), "PLIANTJ1".
///
/// Writes fail only for lack of memory: bytes without space on the disk stay in memory, and the next commit tries
/// again.
class JournaledFile {
 public:
  /// Errors: OutputError if the file exists or cannot be created.
  static JournaledFile create(const std::filesystem::path& path);
  /// Changes nothing, not even where there is a journal. Errors: InputError if the file is missing or locked.
  static JournaledFile open_read(const std::filesystem::path& path);
  /// Errors: InputError if the file is missing or locked; OutputError if it cannot be written.
  static JournaledFile open_write(const std::filesystem::path& path);
  JournaledFile(JournaledFile&& other) noexcept;
  JournaledFile& operator=(JournaledFile&&) = delete;
  ~JournaledFile();  ///< drops uncommitted changes

  void write(std::uint64_t address, std::span<const std::byte> bytes);
  /// Bytes that were never written are 0. Errors: InputError if the system cannot read.
  void read(std::uint64_t address, std::span<std::byte> bytes) const;
  /// Address behind the last byte written.
  std::uint64_t end() const;
  /// Addresses below belong to the last commit: only write() may write there.
  std::uint64_t committed() const { return committed_; }
  /// Cuts a file that was opened for writing, and not changed yet, to `end`: the bytes after it were never committed.
  void cut(std::uint64_t end);
  /// After this call the file holds all written bytes, up to `end` ≥ committed(), also after a loss of power. Errors:
  /// OutputError if it cannot be written, or was removed; the file then holds the last commit, or a complete journal.
  void commit(std::uint64_t end);
  /// After this call write() has no effect: the file stays at the last commit.
  void abandon() { abandoned_ = true; }
  /// Survives a loss of power. Errors: OutputError.
  void rename(const std::filesystem::path& path);

 private:
  JournaledFile(const std::filesystem::path& path, int flags);
  void read_journal();
  std::vector<std::byte> journal(std::uint64_t end, bool with_tail) const;
  void make_changes(std::uint64_t end);
  void sync();
  void check_place() const;
  void write_through(const Extents& extents);
  void write_through(std::uint64_t address, std::span<const std::byte> bytes);
  void truncate(std::uint64_t size);
  std::uint64_t size() const;

  std::string name_;
  int file_ = -1;
  bool writable_ = false;
  bool promised_ = false;  ///< there is a whole journal, which is for the next who opens the file
  bool lost_ = false;      ///< a sync has failed, or memory for a write: nothing is committed any more
  bool abandoned_ = false;
  bool unjournaled_ = false;  ///< large pieces were written since the last commit, which the journal will not hold
  std::uint64_t committed_ = 0;
  std::uint64_t size_ = 0;  ///< of the file on disk, journal left out
  Extents changes_, tail_;  ///< not in the file yet: below committed_, and beyond
};

}  // namespace pliant
