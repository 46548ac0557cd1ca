#include <sys/resource.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>
#include <span>

#include <pliant/base/errors.h>
#include <pliant/io/checkpoint.h>

#include "io/io_support.h"
#include "support/edit_checkpoint.h"

namespace pliant::test::checkpoint_test {
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

Checkpoint newest(const std::filesystem::path& folder) { return read_checkpoint(find_checkpoints(folder).files.at(0)); }

}  // namespace

TEST_CASE("a checkpoint comes back bit for bit") {
  const ScratchFolder folder;
  write(folder.path(), make_checkpoint(3));
  CHECK(find_checkpoints(folder.path()).problems.empty());
  CHECK(same(newest(folder.path()), make_checkpoint(3)));
  CHECK_FALSE(same(newest(folder.path()), make_checkpoint(4)));
}

TEST_CASE("a checkpoint begins with a line that says what it is") {
  const ScratchFolder folder;
  write(folder.path(), make_checkpoint(3));
  const std::string file = contents(folder / "checkpoint-a.h5"), image = file.substr(512);
  CHECK(file == checkpoint_head(image) + image);
}

TEST_CASE("checkpoints take turns, across restarts too") {
  const ScratchFolder folder;
  std::filesystem::path going_on_from;
  for (std::int64_t step = 1; step <= 4; ++step) {
    CheckpointWriter writer(folder.path(), going_on_from);
    write(writer, make_checkpoint(2 * step - 1));
    CHECK(find_checkpoints(folder.path()).files[0] == folder / "checkpoint-a.h5");
    write(writer, make_checkpoint(2 * step));
    CHECK(find_checkpoints(folder.path()).files[0] == folder / "checkpoint-b.h5");
    CHECK(newest(folder.path()).step == 2 * step);
    going_on_from = folder / "checkpoint-b.h5";
  }
}

TEST_CASE("the checkpoint that a run goes on from is the last to be overwritten") {
  const ScratchFolder folder;
  CheckpointWriter writer(folder.path());
  write(writer, make_checkpoint(1));
  write(writer, make_checkpoint(2));
  CheckpointWriter again(folder.path(), folder / "checkpoint-a.h5");  // the other checkpoint was damaged
  write(again, make_checkpoint(3));
  CHECK(read_checkpoint(folder / "checkpoint-a.h5").step == 1);
  CHECK(read_checkpoint(folder / "checkpoint-b.h5").step == 3);
}

TEST_CASE("a damaged checkpoint is told from a whole one") {
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
  StoredCheckpoints found = find_checkpoints(folder.path());
  REQUIRE(found.files.size() == 1);
  CHECK(same(read_checkpoint(found.files[0]), make_checkpoint(1)));
  REQUIRE(found.problems.size() == 1);
  CHECK_THAT(found.problems[0], Contains("checkpoint-b.h5") && Contains("damaged"));

  damage(folder / "checkpoint-a.h5", whole.substr(0, 100));
  found = find_checkpoints(folder.path());
  CHECK(found.files.empty());
  CHECK(found.problems.size() == 2);
}

TEST_CASE("no bit of a checkpoint can change and no byte get lost without notice") {
  const ScratchFolder folder;
  write(folder.path(), make_checkpoint(2, 4));
  const auto path = folder / "checkpoint-a.h5";
  const auto size = static_cast<long>(std::filesystem::file_size(path));
  const auto noticed = [&] { return find_checkpoints(folder.path()).files.empty(); };
  REQUIRE_FALSE(noticed());
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  long missed = 0;
  const auto flip = [&](long at, int bit) {
    file.seekg(at);
    const char byte = static_cast<char>(file.peek() ^ (1 << bit));
    file.seekp(at);
    file.put(byte).flush();
  };
  for (long at = 0; at < size; ++at)
    for (int bit = static_cast<int>(at % 8); bit < 8; bit += at < 600 ? 1 : 8) {
      flip(at, bit);
      missed += !noticed();
      flip(at, bit);
    }
  CHECK(missed == 0);
  REQUIRE_FALSE(noticed());
  for (long length = size - 1; length >= 0; --length) {
    std::filesystem::resize_file(path, static_cast<std::uintmax_t>(length));
    missed += !noticed();
  }
  CHECK(missed == 0);
}

TEST_CASE("checkpoints of other formats are refused by their format") {
  const ScratchFolder folder;
  write(folder.path(), make_checkpoint(1));
  const std::string now = contents(folder / "checkpoint-a.h5");
  const auto problem = [&] { return find_checkpoints(folder.path()).problems.at(0); };
  damage(folder / "checkpoint-a.h5", now.substr(512));  // without a head
  CHECK_THAT(problem(), Contains("is of format 1") && Contains("the version that wrote it"));
  std::string later = now;
  later.replace(later.find("format 2"), 8, "format 3");
  damage(folder / "checkpoint-a.h5", later);
  CHECK_THAT(problem(), Contains("is of format 3, and this version reads format 2"));
  damage(folder / "checkpoint-a.h5", "a text");
  CHECK_THAT(problem(), Contains("is not a checkpoint"));
}

TEST_CASE("entries of a checkpoint are checked") {
  Checkpoint c;
  c.file = "there/checkpoint-a.h5";
  c.reals = {{"x", {1, 2, -3}}, {"nan", {1, NAN}}, {"dt", {0.5}}, {"infinite", {INFINITY}}};
  c.integers = {{"id", {2, 0, 1}}, {"on", {1}}, {"two", {2}}};
  c.strings = {{"scenario", "raft"}};
  CHECK(c.real("dt", 0, 1) == 0.5);
  CHECK(c.integer("two") == 2);
  CHECK(c.flag("on"));
  CHECK(c.real_array("x", 3).at(2) == -3);
  CHECK(c.integer_array("id", 3, 0, 2).at(0) == 2);
  CHECK(c.length("x") == 3);
  CHECK(c.length("id") == 3);
  CHECK(c.text("scenario") == "raft");
  const auto refused = [](auto&& read) { return message_of<InputError>(read); };
  CHECK_THAT(refused([&] { c.real("skin"); }), Contains("there/checkpoint-a.h5") && Contains("skin"));
  CHECK_THAT(refused([&] { c.real("two"); }), Contains("no real numbers named two"));
  CHECK_THAT(refused([&] { c.integer("dt"); }), Contains("no integers named dt"));
  CHECK_THAT(refused([&] { c.text("dt"); }), Contains("no text named dt"));
  CHECK_THAT(refused([&] { c.length("y"); }), Contains("no array named y"));
  CHECK_THAT(refused([&] { c.real("x"); }), Contains("x has 3 values instead of 1"));
  CHECK_THAT(refused([&] { c.real("dt", 0.6, 1); }), Contains("dt = 0.5 is not in the range 0.6 … 1"));
  CHECK_THAT(refused([&] { c.real("infinite"); }), Contains("infinite = inf is not finite"));
  CHECK_THAT(refused([&] { c.flag("two"); }), Contains("two = 2 is not in the range 0 … 1"));
  CHECK_THAT(refused([&] { c.real_array("nan", 2); }), Contains("nan[1] = nan is not finite"));
  CHECK_THAT(refused([&] { c.real_array("x", 3, -2); }), Contains("x[2] = -3"));
  CHECK_THAT(refused([&] { c.real_array("x", 4); }), Contains("x has 3 values instead of 4"));
  CHECK_THAT(refused([&] { c.integer_array("id", 3, 1); }), Contains("id[1] = 0 is less than 1"));
  CHECK_THAT(refused([&] { c.integer("two", 3, 3); }), Contains("two = 2 instead of 3"));
}

TEST_CASE("an edited checkpoint whose checksum fits is read with care") {
  const ScratchFolder folder;
  write(folder.path(), make_checkpoint(1));
  const auto path = folder / "checkpoint-a.h5";
  const auto refused = [&] { return message_of<InputError>([&] { newest(folder.path()); }); };
  SECTION("nothing changed") {
    edit_checkpoint(path, [](hdf5::Group&) {});
    CHECK(same(newest(folder.path()), make_checkpoint(1)));
  }
  SECTION("a time that is none") {
    edit_checkpoint(path, [](hdf5::Group& state) { state.set_attribute("time", std::nan("")); });
    CHECK_THAT(refused(), Contains("time nan"));
  }
  SECTION("a step that is none") {
    edit_checkpoint(path, [](hdf5::Group& state) { state.set_attribute("step", std::int64_t{-1}); });
    CHECK_THAT(refused(), Contains("step -1"));
  }
  SECTION("an array longer than the file") {
    edit_checkpoint(path, [](hdf5::Group& state) {
      state.remove("rows");
      state.write_constant("rows", std::int64_t{1}, {1'000'000'000'000});
    });
    CHECK_THAT(refused(), Contains("the stated length of rows, 1e+12 values"));
  }
  SECTION("a group in place of an array") {
    edit_checkpoint(path, [](hdf5::Group& state) {
      state.remove("rows");
      state.create_group("rows");
    });
    CHECK_THAT(refused(), Contains("rows"));
  }
}

TEST_CASE("no checkpoint: the message says what to do") {
  const ScratchFolder folder;
  CHECK_THAT(message_of<InputError>([&] { find_checkpoints(folder / "none"); }),
             Contains("none") && Contains("from the folder of a run that has one"));
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
  CHECK(newest(folder.path()).step == 2);
  CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 2);  // no temporary file remains
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
    CHECK(find_checkpoints(folder.path()).problems.empty());
    const Checkpoint found = newest(folder.path());
    CHECK(same(found, make_checkpoint(found.step, 20000)));
  }
}

}  // namespace pliant::test::checkpoint_test
