// A log whose messages survive a kill of the process, until they are stored in another file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace pliant {

/// A file of messages. A kill of the process loses none of them but the one that is being written. A loss of power may
/// lose all, because messages are not synced. Errors of all functions: OutputError where the file cannot be written,
/// InputError where it cannot be read.
class MessageLog {
 public:
  /// owner: messages() ignores a log that was written with another one.
  MessageLog(std::filesystem::path path, std::string_view owner);
  MessageLog(const MessageLog&) = delete;
  MessageLog& operator=(const MessageLog&) = delete;
  ~MessageLog();

  struct Message {
    std::int64_t number;
    std::string bytes;
  };
  /// The messages of an earlier process, in their order, without a last one that is cut short.
  std::vector<Message> messages() const;
  /// Appends a message. The first call empties the file, so messages() must be called before it.
  void add(std::int64_t number, std::string_view bytes);
  /// Removes the messages that this process has added.
  void clear();
  /// Removes the file; the next message begins a new one.
  void remove();

 private:
  std::filesystem::path path_;
  std::uint32_t owner_;  ///< checksum
  int file_ = -1;
};

}  // namespace pliant
