#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>

#include <pliant/base/errors.h>
#include <pliant/io/atomic_file.h>

#include "io/io_support.h"

namespace pliant::test::atomic_file_test {
namespace fs = std::filesystem;

TEST_CASE("a file is written beside its name, through no link, and replaces it") {
  const ScratchFolder folder;
  std::ofstream(folder / "precious") << "mine";
  for (const char* link : {"a", "a.tmp"}) fs::create_symlink(folder / "precious", folder / link);
  write_file_atomically(folder / "a", {"one ", "two"});
  CHECK(contents(folder / "precious") == "mine");
  CHECK(contents(folder / "a") == "one two");
  CHECK_FALSE(fs::is_symlink(folder / "a"));
  const mode_t mask = ::umask(0);
  ::umask(mask);
  CHECK((static_cast<unsigned>(fs::status(folder / "a").permissions()) & 0777) == (0666 & ~mask));
}

TEST_CASE("what a killed process has left of a file goes when nobody can be writing it") {
  const ScratchFolder folder;
  for (const char* name : {"a.0123abcd.tmp", "a.89ab0123.tmp", "b.0123abcd.tmp", "a.h5"})
    std::ofstream(folder / name) << "x";
  for (const char* name : {"a.0123abcd.tmp", "b.0123abcd.tmp", "a.h5"})
    fs::last_write_time(folder / name, fs::file_time_type::clock::now() - std::chrono::hours(1));
  write_file_atomically(folder / "a", {"whole"});
  CHECK_FALSE(fs::exists(folder / "a.0123abcd.tmp"));
  for (const char* name : {"a", "a.89ab0123.tmp", "b.0123abcd.tmp", "a.h5"}) CHECK(fs::exists(folder / name));
}

}  // namespace pliant::test::atomic_file_test
