// The lock of a run's folder.
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <fstream>
#include <sstream>
#include <thread>

#include <pliant/base/errors.h>
#include <pliant/io/folder_lock.h>

namespace pliant::test::folder_lock_test {

namespace {

namespace fs = std::filesystem;

struct Scratch {
  Scratch() { fs::remove_all(path); }
  ~Scratch() { fs::remove_all(path); }
  fs::path path = fs::temp_directory_path() / ("pliant-lock-" + std::to_string(getpid()));
};

/// Why the lock cannot be had; empty if it can.
std::string refusal(const fs::path& folder) {
  try {
    const FolderLock lock(folder);
    return lock.warning();
  } catch (const FolderInUse& error) {
    CHECK(static_cast<int>(error.code()) == 6);
    return error.what();
  } catch (const InputError& error) {
    return error.what();
  }
}

}  // namespace

TEST_CASE("a folder has one lock", "[lock]") {
  const Scratch scratch;
  {
    const FolderLock lock(scratch.path);
    CHECK(lock.warning().empty());
    const std::string text = refusal(scratch.path);
    INFO(text);
    CHECK(text.find("is in use by process " + std::to_string(getpid()) + " on host ") != text.npos);
    CHECK(fs::exists(scratch.path / "run.lock"));  // the refused one has left it
  }
  CHECK(refusal(scratch.path).empty());
}

TEST_CASE("readers of the note are no obstacle to a lock", "[lock]") {
  const Scratch scratch;
  create_folder(scratch.path);
  const int reader = ::open((scratch.path / "run.lock").c_str(), O_RDWR | O_CREAT, 0600);
  REQUIRE(::flock(reader, LOCK_SH) == 0);
  std::thread ends([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    ::close(reader);
  });
  CHECK(refusal(scratch.path).empty());
  ends.join();
}

TEST_CASE("a lock ends with its process", "[lock]") {
  const Scratch scratch;
  int ready[2];
  REQUIRE(pipe(ready) == 0);
  const pid_t child = fork();
  if (child == 0) {
    const FolderLock lock(scratch.path);
    (void)!::write(ready[1], "x", 1);
    pause();
  }
  char byte = 0;
  REQUIRE(read(ready[0], &byte, 1) == 1);
  CHECK(refusal(scratch.path).find("process " + std::to_string(child)) != std::string::npos);
  kill(child, SIGKILL);
  REQUIRE(waitpid(child, nullptr, 0) == child);
  CHECK(fs::exists(scratch.path / "run.lock"));  // stale
  CHECK(refusal(scratch.path).empty());
}

TEST_CASE("a lock leaves nothing behind but what is in the folder", "[lock]") {
  const Scratch scratch;
  const fs::path folder = scratch.path / "a" / "b";
  { const FolderLock lock(folder); }
  CHECK(!fs::exists(scratch.path));
  {
    FolderLock lock;
    lock = FolderLock(folder);
    std::ofstream(folder / "mine") << "text";
  }
  CHECK(fs::exists(folder / "mine"));
  CHECK(!fs::exists(folder / "run.lock"));
  { const FolderLock lock(folder); }
  CHECK(fs::exists(folder / "mine"));
}

TEST_CASE("a folder that cannot be locked", "[lock]") {
  const Scratch scratch;
  std::ofstream(scratch.path) << "a file";
  CHECK_THROWS_AS(FolderLock(scratch.path), OutputError);
  CHECK_THROWS_AS(FolderLock(scratch.path / "below"), OutputError);
}

TEST_CASE("run.lock is a separate file", "[lock]") {
  const Scratch scratch;
  const fs::path lock = scratch.path / "run.lock", precious = scratch.path / "precious";
  fs::create_directories(scratch.path);
  std::ofstream(precious) << "mine";
  const auto unchanged = [&] {
    std::stringstream text;
    text << std::ifstream(precious).rdbuf();
    return text.str() == "mine" && fs::exists(fs::symlink_status(lock));
  };
  fs::create_symlink(precious, lock);
  CHECK(refusal(scratch.path).find("run.lock is a symbolic link, not a file") != std::string::npos);
  CHECK(unchanged());
  fs::remove(lock);
  fs::create_symlink(scratch.path / "none", lock);
  CHECK(refusal(scratch.path).find("run.lock is a symbolic link") != std::string::npos);
  CHECK(!fs::exists(scratch.path / "none"));
  fs::remove(lock);
  fs::create_hard_link(precious, lock);
  CHECK(refusal(scratch.path).find("run.lock is a file with other names") != std::string::npos);
  CHECK(unchanged());
  fs::remove(lock);
  REQUIRE(::mkfifo(lock.c_str(), 0666) == 0);
  CHECK(refusal(scratch.path).find("run.lock is a FIFO") != std::string::npos);
  fs::remove(lock);
  fs::create_directory(lock);
  CHECK(refusal(scratch.path).find("run.lock is a folder") != std::string::npos);
  fs::remove(lock);
  CHECK(refusal(scratch.path).empty());
}

}  // namespace pliant::test::folder_lock_test
