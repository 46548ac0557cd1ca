#include <sys/resource.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <limits>
#include <random>
#include <span>

#include <pliant/base/errors.h>
#include <pliant/io/checkpoint.h>

#include "io/io_support.h"

using namespace pliant;
using namespace pliant::test;
using Catch::Matchers::Contains;

namespace {

/// Numbers with every kind of bit pattern, depending on the step.
Checkpoint make_checkpoint(std::int64_t step, std::size_t points = 50) {
  Checkpoint c;
  c.t = 0.1 * static_cast<double>(step);
  c.step = step;
  auto &x = c.reals["x"], &v = c.reals["v"];
  std::mt19937_64 random(static_cast<std::uint64_t>(step));
  for (auto* values : {&x, &v}) {
    values->resize(2 * points);
    for (double& value : *values) {
      const std::uint64_t bits = random();
      std::memcpy(&value, &bits, sizeof value);
    }
  }
  x[0] = std::numeric_limits<double>::denorm_min();
  x[1] = -std::numeric_limits<double>::min() / 3;
  x[2] = -0.0;
  x[3] = std::numeric_limits<double>::quiet_NaN();
  c.reals["profile"] = {1.0 / 3, std::numeric_limits<double>::denorm_min()};
  c.reals["empty"] = {};
  c.integers["rows"] = {step, std::numeric_limits<std::int64_t>::min()};
  c.strings = {{"model", "sp"}, {"note", "µ"}};
  return c;
}

bool same_bits(std::span<const double> a, std::span<const double> b) {
  return std::ranges::equal(std::as_bytes(a), std::as_bytes(b));
}

bool same(const Checkpoint& a, const Checkpoint& b) {
  bool reals = a.reals.size() == b.reals.size();
  for (const auto& [name, values] : a.reals)
    reals = reals && b.reals.contains(name) && same_bits(values, b.reals.at(name));
  return reals && same_bits({&a.t, 1}, {&b.t, 1}) && a.step == b.step && a.integers == b.integers &&
         a.strings == b.strings;
}

void write(CheckpointWriter& writer, const Checkpoint& c) {
  writer.begin(c.t, c.step);
  for (const auto& [name, values] : c.reals) writer.add(name, values);
  for (const auto& [name, values] : c.integers) writer.add(name, values);
  for (const auto& [name, text] : c.strings) writer.add_text(name, text);
  writer.finish();
}
void write(const std::filesystem::path& folder, const Checkpoint& c) {
  CheckpointWriter writer(folder);
  write(writer, c);
}

void damage(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

}  // namespace

TEST_CASE("a checkpoint comes back bit for bit") {
  const ScratchFolder folder;
  write(folder.path(), make_checkpoint(3));
  const auto found = read_newest_checkpoint(folder.path());
  CHECK(same(found.checkpoint, make_checkpoint(3)));
  CHECK_FALSE(same(found.checkpoint, make_checkpoint(4)));
  CHECK(found.message.empty());
}

TEST_CASE("checkpoints take turns, across restarts too") {
  const ScratchFolder folder;
  const auto file_of_newest = [&] {
    return std::filesystem::path(read_newest_checkpoint(folder.path()).file).filename().string();
  };
  for (std::int64_t step = 1; step <= 4; ++step) {
    CheckpointWriter writer(folder.path());  // as after a restart
    write(writer, make_checkpoint(2 * step - 1));
    CHECK(file_of_newest() == "checkpoint-a.h5");
    write(writer, make_checkpoint(2 * step));
    CHECK(file_of_newest() == "checkpoint-b.h5");
    CHECK(read_newest_checkpoint(folder.path()).checkpoint.step == 2 * step);
  }
}

TEST_CASE("a damaged checkpoint falls back on the other and says so") {
  const ScratchFolder folder;
  CheckpointWriter writer(folder.path());
  write(writer, make_checkpoint(1));
  write(writer, make_checkpoint(2));
  const std::string whole = contents(folder / "checkpoint-b.h5");
  REQUIRE(whole.size() > 3000);

  std::string damaged;
  SECTION("cut to half") { damaged = whole.substr(0, whole.size() / 2); }
  SECTION("cut by one byte") { damaged = whole.substr(0, whole.size() - 1); }
  SECTION("empty") { damaged.clear(); }
  SECTION("one bit of the data") {
    damaged = whole;
    const auto expected = make_checkpoint(2);
    const auto at = whole.find(std::string(reinterpret_cast<const char*>(&expected.reals.at("x")[40]), 8));
    REQUIRE(at != whole.npos);
    damaged[at] ^= 4;
  }
  damage(folder / "checkpoint-b.h5", damaged);
  const auto found = read_newest_checkpoint(folder.path());
  CHECK(same(found.checkpoint, make_checkpoint(1)));
  CHECK_THAT(found.message, Contains("checkpoint-b.h5") && Contains("checkpoint-a.h5"));

  // The next one replaces the damaged file, not the last good one.
  write(folder.path(), make_checkpoint(5));
  damage(folder / "checkpoint-b.h5", damaged);
  CHECK(same(read_newest_checkpoint(folder.path()).checkpoint, make_checkpoint(1)));

  damage(folder / "checkpoint-a.h5", whole.substr(0, 100));
  CHECK_THAT(message_of<InputError>([&] { read_newest_checkpoint(folder.path()); }), Contains("can be read"));
}

TEST_CASE("no checkpoint: the message says what to do") {
  const ScratchFolder folder;
  CHECK_THAT(message_of<InputError>([&] { read_newest_checkpoint(folder / "none"); }),
             Contains("none") && Contains("-restart"));
}

TEST_CASE("names that cannot be told apart in a checkpoint are refused") {
  const ScratchFolder folder;
  CheckpointWriter writer(folder.path());
  auto c = make_checkpoint(1);
  c.integers["x"] = {1};
  CHECK_THROWS_AS(write(writer, c), std::invalid_argument);
  c = make_checkpoint(1);
  c.strings.emplace("step", "1");
  CHECK_THROWS_AS(write(writer, c), std::invalid_argument);
}

TEST_CASE("a checkpoint that cannot be written leaves the older ones") {
  const ScratchFolder folder;
  CheckpointWriter writer(folder.path());
  write(writer, make_checkpoint(1));
  write(writer, make_checkpoint(2));
  const int status = in_child([&] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{4096, 4096};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    const auto text = message_of<OutputError>([&] { write(writer, make_checkpoint(3)); });
    return text.find("File too large") != text.npos ? 0 : 1;
  });
  CHECK(status == 0);
  CHECK(read_newest_checkpoint(folder.path()).checkpoint.step == 2);
  CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 2);  // no temporary file stays
}

TEST_CASE("a run killed while it writes checkpoints can always be restarted") {
  const ScratchFolder folder;
  write(folder.path(), make_checkpoint(1, 20000));
  for (int kill = 0; kill < 8; ++kill) {
    const pid_t child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      CheckpointWriter writer(folder.path());
      for (std::int64_t step = 10 * (kill + 1);; ++step) write(writer, make_checkpoint(step, 20000));
    }
    ::usleep(20000 + 7000 * static_cast<useconds_t>(kill));
    ::kill(child, SIGKILL);
    int status = 0;
    REQUIRE(::waitpid(child, &status, 0) == child);
    REQUIRE(WIFSIGNALED(status));
    const auto found = read_newest_checkpoint(folder.path());
    CHECK(found.message.empty());
    CHECK(same(found.checkpoint, make_checkpoint(found.checkpoint.step, 20000)));
  }
}
