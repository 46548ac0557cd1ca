#include <fcntl.h>
#include <fmt/format.h>
#include <pliant/base/errors.h>
#include <pliant/base/regular_file.h>
#include <pliant/io/atomic_file.h>
#include <pliant/io/crc32.h>
#include <pliant/io/journaled_file.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace pliant {
namespace {

static_assert(std::endian::native == std::endian::little);

// Larger pieces are not copied.
constexpr std::size_t most_kept = 1 << 16;
// More new bytes than this are synced separately instead of being written twice.
constexpr std::uint64_t most_journaled = 1 << 21;
// A new file begins with a promise of nothing: its first bytes, the signature of a format, come with the first commit.
constexpr std::uint64_t empty_head = 8;

constexpr std::array<char, 8> magic{'P', 'L', 'I', 'A', 'N', 'T', 'J', '1'};
struct Trailer {
  std::uint64_t start, changes, checksum;
  std::array<char, 8> magic;
};
struct Change {
  std::uint64_t address, size;
};

template <class T>
std::span<const std::byte> bytes_of(const T& value) {
  return std::as_bytes(std::span(&value, 1));
}

[[noreturn]] void fail() { throw std::system_error(errno, std::generic_category()); }

}  // namespace

// ---- extents ---------------------------------------------------------------------------------------------------

void Extents::put(std::uint64_t address, std::span<const std::byte> bytes) {
  if (bytes.empty()) return;
  auto block = blocks_.upper_bound(address);
  if (block != blocks_.begin()) --block;
  if (block == blocks_.end() || block->first > address || block->first + block->second.size() <= address)
    block = blocks_.try_emplace(address).first;
  std::pmr::string& mine = block->second;
  mine.replace(address - block->first, bytes.size(), reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::uint64_t end = block->first + mine.size();
  auto next = std::next(block);
  while (next != blocks_.end() && next->first < end) {
    const std::uint64_t covered = std::min<std::uint64_t>(end - next->first, next->second.size());
    mine.append(next->second, covered);
    next = blocks_.erase(next);
  }
}

bool Extents::intersects(std::uint64_t address, std::uint64_t size) const {
  const auto after = blocks_.lower_bound(address + size);
  if (size == 0 || after == blocks_.begin()) return false;
  const auto& [start, bytes] = *std::prev(after);
  return start + bytes.size() > address;
}

std::uint64_t Extents::bytes() const {
  std::uint64_t sum = 0;
  for (const auto& [address, block] : blocks_) sum += block.size();
  return sum;
}

void Extents::overlay(std::uint64_t address, std::span<std::byte> bytes) const {
  const std::uint64_t end = address + bytes.size();
  auto block = blocks_.upper_bound(address);
  if (block != blocks_.begin()) --block;
  for (; block != blocks_.end() && block->first < end; ++block) {
    const std::uint64_t first = std::max(address, block->first),
                        last = std::min<std::uint64_t>(end, block->first + block->second.size());
    if (first < last)
      std::memcpy(bytes.data() + (first - address), block->second.data() + (first - block->first), last - first);
  }
}

// ---- the file --------------------------------------------------------------------------------------------------

JournaledFile::JournaledFile(const std::filesystem::path& path, int flags)
    : name_(path.string()), file_(open_regular(name_, flags)), writable_((flags & O_ACCMODE) != O_RDONLY) {
  if (file_ < 0) fail();
  // File systems without locks are used without locks.
  if (::flock(file_, (writable_ ? LOCK_EX : LOCK_SH) | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    ::close(file_);
    throw InputError("cannot open {}: another program has it open", name_);
  }
}

JournaledFile JournaledFile::create(const std::filesystem::path& path) {
  try {
    JournaledFile file(path, O_RDWR | O_CREAT | O_EXCL);
    file.committed_ = empty_head;
    return file;
  } catch (const std::system_error& error) {
    throw OutputError("cannot create {}: {}; check permissions and free space, or choose another folder", path.string(),
                      error.code().message());
  }
}

JournaledFile JournaledFile::open_read(const std::filesystem::path& path) {
  try {
    JournaledFile file(path, O_RDONLY);
    file.read_journal();
    return file;
  } catch (const std::system_error& error) {
    throw InputError("cannot open {}: {}; check the name and permissions", path.string(), error.code().message());
  }
}

JournaledFile JournaledFile::open_write(const std::filesystem::path& path) {
  bool writing = false;
  try {
    JournaledFile file(path, O_RDWR);
    file.read_journal();
    writing = true;
    if (!file.changes_.empty()) {
      file.make_changes(file.committed_);
      file.changes_.clear();
    }
    return file;
  } catch (const std::system_error& error) {
    if (!writing && error.code() == std::errc::no_such_file_or_directory)
      throw InputError("there is no file {}; check the name", path.string());
    throw OutputError("cannot write {}: {}; check its permissions and free space", path.string(),
                      error.code().message());
  }
}

JournaledFile::JournaledFile(JournaledFile&& other) noexcept
    : name_(std::move(other.name_)),
      file_(std::exchange(other.file_, -1)),
      writable_(other.writable_),
      promised_(other.promised_),
      lost_(other.lost_),
      abandoned_(other.abandoned_),
      unjournaled_(other.unjournaled_),
      committed_(other.committed_),
      size_(other.size_),
      changes_(std::move(other.changes_)),
      tail_(std::move(other.tail_)) {}

JournaledFile::~JournaledFile() {
  if (file_ < 0) return;
  if (writable_ && !promised_ && size_ > committed_) (void)!::ftruncate(file_, static_cast<off_t>(committed_));
  ::close(file_);
}

std::uint64_t JournaledFile::size() const {
  struct stat found {};
  if (::fstat(file_, &found) != 0) fail();
  return static_cast<std::uint64_t>(found.st_size);
}

/// Takes the changes of a whole journal.
void JournaledFile::read_journal() {
  committed_ = size_ = size();
  Trailer trailer{};
  if (size_ < sizeof trailer) return;
  read(size_ - sizeof trailer, std::as_writable_bytes(std::span(&trailer, 1)));
  if (trailer.magic != magic || trailer.start > size_ - sizeof trailer) return;
  std::vector<std::byte> bytes(size_ - trailer.start);
  read(trailer.start, bytes);
  constexpr std::size_t unchecked = sizeof trailer.checksum + sizeof trailer.magic;
  if (crc32_of(std::span(bytes).first(bytes.size() - unchecked)) != trailer.checksum) return;
  std::span<const std::byte> left = std::span(bytes).first(bytes.size() - sizeof trailer);
  std::vector<std::pair<std::uint64_t, std::span<const std::byte>>> changes;
  for (std::uint64_t k = 0; k < trailer.changes; ++k) {
    Change change{};
    if (left.size() < sizeof change) return;
    std::memcpy(&change, left.data(), sizeof change);
    left = left.subspan(sizeof change);
    if (left.size() < change.size || change.address + change.size > trailer.start) return;
    changes.emplace_back(change.address, left.first(change.size));
    left = left.subspan(change.size);
  }
  for (const auto& [address, change] : changes) changes_.put(address, change);
  committed_ = size_ = trailer.start;
}

std::vector<std::byte> JournaledFile::journal(std::uint64_t end, bool with_tail) const {
  std::vector<std::byte> bytes;
  bytes.reserve(changes_.bytes() + (with_tail ? tail_.bytes() : 0) + sizeof(Trailer) +
                sizeof(Change) * (changes_.blocks().size() + (with_tail ? tail_.blocks().size() : 0)));
  std::uint64_t number = 0;
  const auto add = [&](std::span<const std::byte> more) { bytes.insert(bytes.end(), more.begin(), more.end()); };
  const auto add_changes = [&](const Extents& extents) {
    for (const auto& [address, block] : extents.blocks()) {
      if (address >= end) continue;
      const std::uint64_t size = std::min<std::uint64_t>(block.size(), end - address);
      add(bytes_of(Change{address, size}));
      add(std::as_bytes(std::span(block)).first(size));
      ++number;
    }
  };
  add_changes(changes_);
  if (with_tail) add_changes(tail_);
  add(bytes_of(end));
  add(bytes_of(number));
  add(bytes_of(std::uint64_t{crc32_of(bytes)}));
  add(bytes_of(magic));
  return bytes;
}

void JournaledFile::write(std::uint64_t address, std::span<const std::byte> bytes) {
  if (abandoned_) return;
  const bool lost = std::exchange(lost_, true);  // unless there is memory for all of it
  if (address < committed_) {
    const auto below = static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), committed_ - address));
    changes_.put(address, bytes.first(below));
    address += below;
    bytes = bytes.subspan(below);
  }
  if (bytes.size() >= most_kept && !tail_.intersects(address, bytes.size())) {
    try {
      unjournaled_ = true;
      write_through(address, bytes);
      lost_ = lost;
      return;
    } catch (const std::system_error&) {
      // Kept in memory, like small pieces.
    }
  }
  tail_.put(address, bytes);
  lost_ = lost;
}

void JournaledFile::write_through(const Extents& extents) {
  const Extents::Blocks& blocks = extents.blocks();
  for (auto first = blocks.begin(), last = first; first != blocks.end(); first = last) {
    // Neighbours in one call of the system.
    std::array<iovec, 256> pieces;
    std::size_t count = 0;
    for (std::uint64_t end = first->first; last != blocks.end() && last->first == end && count < pieces.size();
         ++last) {
      pieces[count++] = {const_cast<char*>(last->second.data()), last->second.size()};
      end += last->second.size();
    }
    const ssize_t written = ::pwritev(file_, pieces.data(), static_cast<int>(count), static_cast<off_t>(first->first));
    auto left = static_cast<std::size_t>(std::max<ssize_t>(written, 0));  // the loop writes the other bytes
    for (auto block = first; block != last; ++block) {
      const std::size_t done = std::min(left, block->second.size());
      write_through(block->first + done, std::as_bytes(std::span(block->second)).subspan(done));
      left -= done;
    }
  }
}

void JournaledFile::write_through(std::uint64_t address, std::span<const std::byte> bytes) {
  size_ = std::max<std::uint64_t>(size_, address + bytes.size());
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(file_, bytes.data(), bytes.size(), static_cast<off_t>(address));
    if (written < 0 && errno != EINTR) fail();
    if (written <= 0) continue;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    address += static_cast<std::uint64_t>(written);
  }
}

void JournaledFile::read(std::uint64_t address, std::span<std::byte> bytes) const {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::pread(file_, &bytes[done], bytes.size() - done, static_cast<off_t>(address + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw InputError("cannot read {}: {}", name_, std::generic_category().message(errno));
    if (count == 0) break;
    done += static_cast<std::size_t>(count);
  }
  std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(done), bytes.end(), std::byte{0});
  changes_.overlay(address, bytes);
  tail_.overlay(address, bytes);
}

std::uint64_t JournaledFile::end() const { return std::max({size_, changes_.end(), tail_.end()}); }

void JournaledFile::truncate(std::uint64_t size) {
  if (::ftruncate(file_, static_cast<off_t>(size)) != 0) fail();
  size_ = size;
}

void JournaledFile::cut(std::uint64_t end) {
  if (!changes_.empty() || !tail_.empty()) throw std::logic_error(name_ + " was changed before it was cut");
  try {
    if (end < size_) truncate(end);
  } catch (const std::system_error& error) {
    throw OutputError("cannot write {}: {}", name_, error.code().message());
  }
  committed_ = end;
}

/// If the file has been deleted, the data would be lost.
void JournaledFile::check_place() const {
  struct stat open {
  }, named{};
  if (::fstat(file_, &open) != 0 || ::stat(name_.c_str(), &named) != 0) fail();
  if (open.st_dev != named.st_dev || open.st_ino != named.st_ino) {
    errno = ENOENT;
    fail();
  }
}

/// From a journal at `end` that is whole, but not synced.
void JournaledFile::make_changes(std::uint64_t end) {
  sync();
  promised_ = true;
  write_through(changes_);
  sync();
  truncate(end);
  promised_ = false;
}

void JournaledFile::commit(std::uint64_t end) {
  if (end < committed_) throw std::logic_error(name_ + ": a commit cannot take back what was promised");
  try {
    check_place();
    if (promised_ || lost_) throw std::system_error(EIO, std::generic_category());
    if (changes_.empty() && tail_.empty() && end == committed_ && size_ == end) return;
    write_through(tail_);
    if (size_ > end) truncate(end);
    const bool with_tail = !unjournaled_ && tail_.bytes() <= most_journaled;
    if (!with_tail) sync();
    write_through(end, journal(end, with_tail));
    make_changes(end);
  } catch (const std::system_error& error) {
    if (error.code() == std::errc::no_such_file_or_directory)
      throw OutputError("{} was removed or replaced while it was being written", name_);
    throw OutputError("cannot write {}: {}; free space or mend the disk, then restart from the last checkpoint", name_,
                      error.code().message());
  }
  committed_ = end;
  unjournaled_ = false;
  tail_.clear();
  changes_.clear();
}

void JournaledFile::rename(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::rename(name_, path, error);
  if (error) throw OutputError("cannot create {}: {}; check permissions", path.string(), error.message());
  name_ = path.string();
  sync_folder(path.parent_path());
}

/// After a failed sync the file system may have dropped any page.
void JournaledFile::sync() {
  if (::fdatasync(file_) == 0) return;
  lost_ = true;
  fail();
}

}  // namespace pliant
