#include <sys/resource.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <cstring>
#include <random>

#include <pliant/base/errors.h>
#include <pliant/io/crc32.h>
#include <pliant/io/journaled_file.h>

#include "io/io_support.h"

namespace pliant::test::journaled_file_test {
using Catch::Matchers::Contains;

namespace {

std::span<const std::byte> bytes_of(const std::string& text) { return std::as_bytes(std::span(text)); }

void put(JournaledFile& file, std::uint64_t address, const std::string& text) { file.write(address, bytes_of(text)); }

std::string whole(const JournaledFile& file) {
  std::string text(file.end(), '?');
  file.read(0, std::as_writable_bytes(std::span(text)));
  return text;
}

std::string random_text(std::mt19937& random, std::size_t size) {
  std::string text(size, ' ');
  for (char& c : text) c = static_cast<char>('a' + random() % 26);
  return text;
}

}  // namespace

TEST_CASE("extents hold the bytes written last") {
  std::mt19937 random(3);
  Extents extents;
  std::string reference(300, '.'), found(300, '.');
  std::size_t blocks = 0;
  for (int k = 0; k < 2000; ++k) {
    const std::size_t at = random() % 280, size = random() % 20;
    const std::string text = random_text(random, size);
    bool there = false;
    for (std::size_t i = at; i < at + size; ++i) there = there || reference[i] != '.';
    CHECK(extents.intersects(at, size) == there);
    extents.put(at, bytes_of(text));
    reference.replace(at, size, text);
    std::fill(found.begin(), found.end(), '.');
    const std::size_t from = random() % 300, to = from + random() % (300 - from);
    extents.overlay(from, std::as_writable_bytes(std::span(found).subspan(from, to - from)));
    CHECK(found.substr(from, to - from) == reference.substr(from, to - from));
    blocks = std::max(blocks, extents.blocks().size());
    std::uint64_t end = 0;
    for (const auto& [address, block] : extents.blocks()) {
      CHECK(address >= end);
      end = address + block.size();
    }
    if (k % 50 == 49) {
      extents.clear();
      std::fill(reference.begin(), reference.end(), '.');
    }
  }
  CHECK(blocks > 5);
}

TEST_CASE("a journaled file holds what was committed, at every byte that is written") {
  const ScratchFolder scratch;
  const auto path = scratch / "file";
  std::vector<std::string> committed{""};
  std::string now;
  {
    JournaledFile file = JournaledFile::create(path);
    CHECK_THROWS_AS(JournaledFile::create(path), OutputError);
    std::mt19937 random(1);
    for (int k = 0; k < 8; ++k) {
      // Changes of committed bytes, and new bytes: a few, and so many that they do not stay in memory.
      for (int c = 0; c < 5; ++c) {
        const std::string text = random_text(random, 1 + random() % (c == 0 ? 100000 : 300));
        const std::size_t at = k == 0 && c == 0 ? 0 : random() % (now.size() + (c == 0 ? 1 : 0));
        put(file, at, text);
        if (now.size() < at + text.size()) now.resize(at + text.size());
        now.replace(at, text.size(), text);
        CHECK(whole(file) == now);
      }
      file.commit(now.size());
      committed.push_back(now);
      CHECK(contents(path) == now);
      CHECK(file.committed() == now.size());
    }
  }
  CHECK(contents(path) == now);

  // A sequence of writes, ended after each write, also within a write, leaves a commit or the next one.
  int mended = 0, torn = 0;
  for (rlim_t limit = 0;; limit += 1 + limit / 12) {
    const auto again = scratch / ("limit" + std::to_string(limit));
    const int status = in_child([&] {
      std::signal(SIGXFSZ, SIG_IGN);
      JournaledFile file = JournaledFile::create(again);
      const rlimit room{limit, limit};
      ::setrlimit(RLIMIT_FSIZE, &room);
      std::mt19937 random(1);
      std::string copy;
      for (int k = 0; k < 8; ++k) {
        for (int c = 0; c < 5; ++c) {
          const std::string text = random_text(random, 1 + random() % (c == 0 ? 100000 : 300));
          const std::size_t at = k == 0 && c == 0 ? 0 : random() % (copy.size() + (c == 0 ? 1 : 0));
          put(file, at, text);
          if (copy.size() < at + text.size()) copy.resize(at + text.size());
          copy.replace(at, text.size(), text);
          if (whole(file) != copy) return 1;  // a writer can read its bytes, also those without space on the disk
        }
        file.commit(copy.size());
      }
      ::kill(::getpid(), SIGKILL);
      return 0;
    });
    if (WIFSIGNALED(status)) break;
    CHECK(WEXITSTATUS(status) == 99);
    const std::string left = contents(again);
    // Before the first commit there is not even the signature of a format.
    const bool known = left.size() <= 8 || std::find(committed.begin(), committed.end(), left) != committed.end();
    CHECK(known);
    ++torn;
    if (left.size() > 8) ++mended;
  }
  CHECK(torn > 20);
  CHECK(mended > 10);
}

TEST_CASE("a journal that is whole is used, a torn one is not") {
  const ScratchFolder scratch;
  const auto path = scratch / "file";
  const std::string before = "signature, and 0123456789", after = "signaturE, and 01234xyz89 and more";
  {
    JournaledFile file = JournaledFile::create(path);
    put(file, 0, before);
    file.commit(before.size());
  }
  // The journal of the next commit, as the header describes it.
  std::string journal;
  const auto number = [&](std::uint64_t n) { journal.append(reinterpret_cast<const char*>(&n), 8); };
  number(8), number(1), journal += "E", number(20), number(3), journal += "xyz", number(after.size()), number(2);
  const std::uint64_t sum = GENERATE(0, 1) + crc32_of(std::as_bytes(std::span(journal)));
  number(sum), journal += "PLIANTJ1";
  const bool whole_sum = sum == crc32_of(std::as_bytes(std::span(journal).first(journal.size() - 16)));
  for (const char* half : {"", "x", "xyz"}) {
    for (std::size_t size = 0; size <= journal.size(); ++size) {
      std::string bytes = before + after.substr(before.size()) + journal.substr(0, size);
      bytes.replace(20, std::strlen(half), half);  // a part of the changes may have been made
      std::ofstream(path, std::ios::binary) << bytes;
      const bool used = whole_sum && size == journal.size();
      {
        const JournaledFile file = JournaledFile::open_read(path);
        CHECK(whole(file).substr(0, after.size()) == (used ? after : bytes.substr(0, after.size())));
        CHECK(file.committed() == (used ? after.size() : bytes.size()));
      }
      CHECK(contents(path) == bytes);  // a reader changes nothing
      JournaledFile file = JournaledFile::open_write(path);
      CHECK(contents(path) == (used ? after : bytes));
      if (used) continue;
      file.cut(before.size());
      CHECK(contents(path) == bytes.substr(0, before.size()));
    }
  }
}

TEST_CASE("what was not committed is taken back") {
  const ScratchFolder scratch;
  const auto path = scratch / "file";
  {
    JournaledFile file = JournaledFile::create(path);
    put(file, 0, "promised");
    file.commit(8);
    put(file, 2, "X");
    put(file, 8, std::string(200000, 'y'));
    CHECK(contents(path).size() == 200008);
    CHECK_THROWS_AS(file.commit(5), std::logic_error);
  }
  CHECK(contents(path) == "promised");
}

TEST_CASE("a commit for which there was no room can be made again") {
  const ScratchFolder scratch;
  const auto path = scratch / "file";
  rlimit before{};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &before) == 0);
  auto* const handler = std::signal(SIGXFSZ, SIG_IGN);
  {
    JournaledFile file = JournaledFile::create(path);
    put(file, 0, "promised");
    file.commit(8);
    const rlimit little{1000, before.rlim_max};
    REQUIRE(::setrlimit(RLIMIT_FSIZE, &little) == 0);
    put(file, 0, "P");
    put(file, 8, std::string(200000, 'y'));
    CHECK_THAT(message_of<OutputError>([&] { file.commit(200008); }), Contains("file: File too large"));
    REQUIRE(::setrlimit(RLIMIT_FSIZE, &before) == 0);
    CHECK(contents(path).substr(0, 8) == "promised");
    file.commit(200008);
  }
  std::signal(SIGXFSZ, handler);
  CHECK(contents(path) == "Promised" + std::string(200000, 'y'));
}

TEST_CASE("a write for which there was no memory prevents later commits") {
  const ScratchFolder folder;
  {
    JournaledFile file = JournaledFile::create(folder / "f");
    put(file, 0, "12345678 is there");
    file.commit(17);
    // Bytes that can be neither read nor copied.
    const std::span endless(reinterpret_cast<const std::byte*>(sizeof(int)), std::size_t{1} << 62);
    CHECK_THROWS_AS(file.write(17, endless), std::bad_alloc);
    put(file, 17, " and more");
    CHECK_THROWS_AS(file.commit(26), OutputError);
  }
  CHECK(whole(JournaledFile::open_read(folder / "f")) == "12345678 is there");
}

TEST_CASE("a file that is gone, or locked, or may not be written") {
  const ScratchFolder scratch;
  const auto path = scratch / "file";
  JournaledFile file = JournaledFile::create(path);
  put(file, 0, "promised");
  file.commit(8);
  CHECK_THAT(message_of<InputError>([&] { JournaledFile::open_write(path); }), Contains("another program"));
  CHECK_THAT(message_of<InputError>([&] { JournaledFile::open_read(path); }), Contains("another program"));
  const auto gone = [&] { return message_of<OutputError>([&] { file.commit(8); }); };
  SECTION("removed") {
    std::filesystem::remove(path);
    CHECK_THAT(gone(), Contains("file was removed"));
    CHECK_THAT(gone(), Contains("file was removed"));  // permanently
    CHECK_THAT(message_of<InputError>([&] { JournaledFile::open_read(path); }), Contains("No such file"));
    CHECK_THAT(message_of<InputError>([&] { JournaledFile::open_write(path); }), Contains("there is no file"));
  }
  SECTION("replaced") {
    std::filesystem::rename(path, scratch / "other");
    std::ofstream(path) << "promised";
    CHECK_THAT(gone(), Contains("replaced"));
  }
}

}  // namespace pliant::test::journaled_file_test
