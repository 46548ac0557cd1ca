#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/io/message_log.h>

#include "io_support.h"

using namespace pliant;
using namespace pliant::test;

namespace {

std::vector<std::string> found(const std::filesystem::path& path, const std::string& owner = "owner") {
  std::vector<std::string> all;
  for (const auto& [number, bytes] : MessageLog(path, owner).messages()) all.push_back(std::to_string(number) + bytes);
  return all;
}

}  // namespace

TEST_CASE("a log has the messages that were written, at every byte that is written") {
  const ScratchFolder folder;
  const auto path = folder / "log";
  CHECK(found(path).empty());
  std::vector<std::uintmax_t> ends{0};
  {
    MessageLog log(path, "owner");
    for (const std::string bytes : {"first", "", "the third"}) {
      log.add(static_cast<std::int64_t>(ends.size()), bytes);
      ends.push_back(std::filesystem::file_size(path));
    }
  }
  const std::vector<std::string> whole{"1first", "2", "3the third"};
  CHECK(found(path) == whole);
  CHECK(found(path, "another").empty());
  for (std::uintmax_t size = ends.back(); size-- > 0;) {
    std::filesystem::resize_file(path, size);
    std::size_t count = 0;
    while (count + 1 < ends.size() && ends[count + 1] <= size) ++count;
    CHECK(found(path) == std::vector(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(count)));
  }
}

TEST_CASE("a log without a damaged message, and the messages after it") {
  const ScratchFolder folder;
  const auto path = folder / "log";
  MessageLog log(path, "owner");
  log.add(1, "first");
  const auto size = std::filesystem::file_size(path);
  log.add(2, "second");
  for (std::uintmax_t k = 0; k < size; ++k) {
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
    file.seekg(static_cast<std::streamoff>(k));
    const int byte = file.get();
    file.seekp(static_cast<std::streamoff>(k));
    file.put(static_cast<char>(byte ^ 1));
    file.close();
    CHECK(found(path).empty());
    std::fstream back(path, std::ios::binary | std::ios::in | std::ios::out);
    back.seekp(static_cast<std::streamoff>(k));
    back.put(static_cast<char>(byte));
  }
  CHECK(found(path).size() == 2);
}

TEST_CASE("a log is cleared, removed and begun again") {
  const ScratchFolder folder;
  const auto path = folder / "log";
  {
    MessageLog log(path, "owner");
    log.clear();
    CHECK(!std::filesystem::exists(path));
    log.add(1, "first");
    log.clear();
    CHECK(found(path).empty());
    log.add(2, "second");
    CHECK(found(path) == std::vector<std::string>{"2second"});
    log.remove();
    CHECK(!std::filesystem::exists(path));
    log.add(3, "third");
  }
  MessageLog next(path, "owner");
  CHECK(next.messages().size() == 1);
  next.add(4, "fourth");
  CHECK(found(path) == std::vector<std::string>{"4fourth"});
}

TEST_CASE("a log that cannot be written or read") {
  const ScratchFolder folder;
  CHECK_THROWS_AS(MessageLog(folder / "missing/log", "owner").add(1, "first"), OutputError);
  std::filesystem::create_directory(folder / "log");
  CHECK_THROWS_AS(found(folder / "log"), InputError);
}
