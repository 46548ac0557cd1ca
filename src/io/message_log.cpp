#include <fcntl.h>
#include <pliant/base/errors.h>
#include <pliant/base/regular_file.h>
#include <pliant/io/crc32.h>
#include <pliant/io/message_log.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <span>
#include <utility>

namespace pliant {
namespace {

/// Before each message.
struct Head {
  std::uint64_t size = 0;
  std::int64_t number = 0;
  std::uint64_t checksum = 0;  ///< of the owner, then of this head with a checksum of 0, then of the message
};

std::uint64_t checksum_of(std::uint32_t owner, Head head, std::string_view message) {
  head.checksum = 0;
  return crc32_of(std::as_bytes(std::span(message)), crc32_of(std::as_bytes(std::span(&head, 1)), owner));
}

}  // namespace

MessageLog::MessageLog(std::filesystem::path path, std::string_view owner)
    : path_(std::move(path)), owner_(crc32_of(std::as_bytes(std::span(owner)))) {}

MessageLog::~MessageLog() {
  if (file_ >= 0) ::close(file_);
}

std::vector<MessageLog::Message> MessageLog::messages() const {
  const int file = open_regular(path_, O_RDONLY | O_NOFOLLOW);
  if (file < 0 && errno == ENOENT) return {};
  std::string bytes;
  ssize_t got = file < 0 ? -1 : 0;
  if (file >= 0) {
    std::array<char, 1 << 16> piece;
    while ((got = read_some(file, piece.data(), piece.size())) > 0)
      bytes.append(piece.data(), static_cast<std::size_t>(got));
    ::close(file);
  }
  if (got < 0) throw InputError("cannot read {}: {}; check its permissions", path_.string(), std::strerror(errno));

  std::vector<Message> all;
  Head head;
  for (std::string_view left = bytes; left.size() >= sizeof head;) {
    std::memcpy(&head, left.data(), sizeof head);
    left.remove_prefix(sizeof head);
    const std::string_view message = left.substr(0, head.size);
    if (message.size() < head.size || checksum_of(owner_, head, message) != head.checksum) break;
    all.push_back({head.number, std::string(message)});
    left.remove_prefix(message.size());
  }
  return all;
}

void MessageLog::add(std::int64_t number, std::string_view bytes) {
  if (file_ < 0) file_ = open_regular(path_, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW);
  if (file_ < 0)
    throw OutputError("cannot write {}: {}; check permissions and free space, or choose another folder", path_.string(),
                      std::strerror(errno));
  Head head{bytes.size(), number};
  head.checksum = checksum_of(owner_, head, bytes);
  std::array<iovec, 2> left{{{&head, sizeof head}, {const_cast<char*>(bytes.data()), bytes.size()}}};
  while (left[0].iov_len + left[1].iov_len > 0) {
    const ssize_t written = ::writev(file_, left.data(), left.size());
    if (written < 0 && errno != EINTR)
      throw OutputError("cannot write {}: {}; free space, then repeat the command", path_.string(),
                        std::strerror(errno));
    auto done = static_cast<std::size_t>(std::max<ssize_t>(written, 0));
    for (iovec& part : left) {
      const std::size_t of_part = std::min(done, part.iov_len);
      part.iov_base = static_cast<char*>(part.iov_base) + of_part;
      part.iov_len -= of_part;
      done -= of_part;
    }
  }
}

void MessageLog::clear() {
  if (file_ < 0) return;
  if (::ftruncate(file_, 0) != 0 || ::lseek(file_, 0, SEEK_SET) != 0)
    throw OutputError("cannot write {}: {}; check permissions, or choose another folder", path_.string(),
                      std::strerror(errno));
}

void MessageLog::remove() {
  if (file_ >= 0) ::close(std::exchange(file_, -1));
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

}  // namespace pliant
