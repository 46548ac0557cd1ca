#include <hdf5.h>
#include <zlib.h>

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>

#include <pliant/base/errors.h>
#include <pliant/io/crc32.h>
#include <pliant/io/hdf5.h>

#include "io/io_support.h"

namespace pliant::test::hdf5_test {
using Catch::Matchers::Contains;
using hdf5::File;

TEST_CASE("HDF5 datasets keep values, types and shapes") {
  const ScratchFolder folder;
  const std::vector<double> reals{1.5, -0.0, std::numeric_limits<double>::denorm_min(), 4, 5, 6};
  const std::vector<std::int32_t> ints{-1, 2, std::numeric_limits<std::int32_t>::max()};
  const std::vector<std::int64_t> longs{std::numeric_limits<std::int64_t>::min(), 1};
  const std::vector<std::uint8_t> bytes{0, 255};
  {
    auto file = File::create(folder / "a.h5");
    file.write("x/y/reals", reals, {2, 3});
    file.write("ints", ints, {3}, hdf5::Storage::crc32);
    file.write("longs", longs, {2});
    file.write("bytes", bytes, {2});
    file.write("none", std::vector<double>{}, {0, 2});
    file.write("none_checked", std::vector<double>{}, {0}, hdf5::Storage::crc32);
    file.write_constant("constant", std::int32_t{-1}, {1000000});
    file.write_constant("no_number", std::numeric_limits<double>::quiet_NaN(), {2});
    CHECK_THROWS_AS(file.write_constant("ints", std::int32_t{-1}, {3}), OutputError);
    CHECK_THROWS_AS(file.write("wrong", reals, {7}), std::invalid_argument);
    CHECK_THROWS_AS(file.write("ints", ints, {3}), OutputError);  // never over something
    file.close();
    CHECK_FALSE(file.is_open());
  }
  const auto file = File::open_read(folder / "a.h5");
  CHECK(file.links() ==
        std::vector<std::string>{"bytes", "constant", "ints", "longs", "no_number", "none", "none_checked", "x"});
  const auto back = file.read<double>("/x/y/reals", {2, hdf5::any_length});
  REQUIRE(back.size() == reals.size());
  CHECK(std::memcmp(back.data(), reals.data(), 8 * reals.size()) == 0);
  CHECK(file.read<std::int32_t>("ints") == ints);
  CHECK(file.read<std::int64_t>("longs") == longs);
  CHECK(file.read<std::uint8_t>("bytes") == bytes);
  CHECK(file.shape("none") == hdf5::Shape{0, 2});
  CHECK(file.read<double>("none").empty());
  CHECK(file.read<double>("none_checked").empty());
  CHECK(file.read<std::int32_t>("constant") == std::vector<std::int32_t>(1000000, -1));
  CHECK(std::isnan(file.read<double>("no_number", {2})[1]));
  CHECK(std::filesystem::file_size(folder / "a.h5") < 100000);  // constants take no space
  CHECK(file.holds_integers("bytes"));
  CHECK_FALSE(file.holds_integers("x/y/reals"));
  // Conversions that lose nothing are made, others refused.
  CHECK(file.read<std::int64_t>("ints") == std::vector<std::int64_t>{-1, 2, 2147483647});
  CHECK(file.read<double>("ints")[1] == 2.0);
  CHECK_THROWS_AS(file.read<std::int32_t>("x/y/reals"), InputError);
}

TEST_CASE("HDF5 attributes keep numbers and text") {
  const ScratchFolder folder;
  const std::string text = "σ_avg " + std::string(200000, 'x');  // longer than an attribute may be that is not variable
  {
    auto file = File::create(folder / "a.h5");
    auto group = file.create_group("g");
    group.set_attribute("real", 0.1);
    group.set_attribute("real", 0.2);
    group.set_attribute("integer", std::int64_t{1} << 60);
    group.set_attribute("text", text);
    group.set_attribute("empty", std::string());
    file.close();
  }
  const auto file = File::open_read(folder / "a.h5");
  const auto group = file.open_group("g");
  CHECK(group.real_attribute("real") == 0.2);
  CHECK(group.integer_attribute("integer") == std::int64_t{1} << 60);
  CHECK(group.string_attribute("text") == text);
  CHECK(group.string_attributes() == std::map<std::string, std::string>{{"empty", ""}, {"text", text}});
  CHECK_THROWS_AS(group.string_attribute("real"), InputError);
  CHECK_THROWS_AS(group.real_attribute("missing"), InputError);
}

TEST_CASE("HDF5 rows are appended, cut and checked") {
  const ScratchFolder folder;
  {
    auto file = File::create(folder / "a.h5");
    auto scalar = file.create_rows("scalar", {}, 4), profile = file.create_rows("profile", {3}, 2);
    for (int i = 0; i < 7; ++i) {
      scalar.append(std::vector<double>{1.0 * i});
      profile.append(std::vector<double>{1.0 * i, 2.0 * i, 3.0 * i});
    }
    CHECK(file.shape("scalar") == hdf5::Shape{7});
    CHECK(file.read<double>("profile", {7, 3})[20] == 18);
    CHECK_THROWS_AS(profile.append(std::vector<double>{1, 2}), std::invalid_argument);
    file.close();
  }
  {
    auto file = File::open_write(folder / "a.h5");
    auto scalar = file.open_rows("scalar", 5);
    CHECK(scalar.rows() == 5);
    scalar.append(std::vector<double>{50, 60});
    CHECK(file.open_rows("profile", 0).rows() == 0);
    CHECK_THROWS_AS(file.open_rows("scalar", 8), InputError);
    file.close();
  }
  const auto file = File::open_read(folder / "a.h5");
  CHECK(file.read<double>("scalar") == std::vector<double>{0, 1, 2, 3, 4, 50, 60});
  CHECK(file.shape("profile") == hdf5::Shape{0, 3});
  for (const char* name : {"scalar", "profile"}) CHECK_NOTHROW(file.check(name));
  // Rows and pieces have the checksum that anybody would compute.
  std::uint32_t stored = 0;
  const hid_t id = H5Fopen((folder / "a.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT),
              attribute = H5Aopen_by_name(id, "scalar", "crc32", H5P_DEFAULT, H5P_DEFAULT);
  H5Aread(attribute, H5T_NATIVE_UINT32, &stored);
  H5Aclose(attribute);
  H5Fclose(id);
  const std::vector<double> values{0, 1, 2, 3, 4, 50, 60};
  CHECK(stored == crc32(0, reinterpret_cast<const Bytef*>(values.data()), 56));
}

TEST_CASE("HDF5 links: groups appear when they are linked") {
  const ScratchFolder folder;
  {
    auto file = File::create(folder / "a.h5");
    file.create_unlinked_group().write("lost", std::vector<double>{1}, {1});
    auto group = file.create_unlinked_group();
    group.write("x", std::vector<double>{1}, {1});
    CHECK(file.links().empty());
    file.link(group, "frames/0");
    auto second = file.create_unlinked_group();
    second.write("x", std::vector<double>{2}, {1});
    file.link(second, "frames/0");
    file.link("/frames/0/x", "again");
    file.write("gone", std::vector<double>{2}, {1});
    file.remove("gone");
    CHECK_FALSE(file.has("no/such/path"));
    CHECK(file.has("frames/0/x"));
    file.close();
  }
  const auto file = File::open_read(folder / "a.h5");
  CHECK(file.links() == std::vector<std::string>{"again", "frames"});
  CHECK(file.read<double>("frames/0/x") == std::vector<double>{2});
  CHECK(file.read<double>("again") == std::vector<double>{2});
}

TEST_CASE("a file that is left by an exception holds the last flush") {
  const ScratchFolder folder;
  try {
    auto file = File::create(folder / "a.h5");
    auto rows = file.create_rows("rows", {}, 4);
    rows.append(std::vector<double>{1, 2});
    file.flush();
    rows.append(std::vector<double>{3});
    file.write("half", std::vector<double>(20000, 1), {20000});
    throw std::runtime_error("memory");
  } catch (const std::runtime_error&) {
  }
  {
    const auto file = File::open_read(folder / "a.h5");
    CHECK(file.links() == std::vector<std::string>{"rows"});
    CHECK(file.read<double>("rows") == std::vector<double>{1, 2});
  }
  auto file = File::open_write(folder / "a.h5");
  file.open_rows("rows", 2).append(std::vector<double>{4});
  file.close();
  CHECK(File::open_read(folder / "a.h5").read<double>("rows") == std::vector<double>{1, 2, 4});
}

TEST_CASE("HDF5 errors name file, object and reason, and print nothing") {
  const ScratchFolder folder;
  H5E_auto2_t before = nullptr, after = nullptr;
  void* data = nullptr;
  H5Eget_auto2(H5E_DEFAULT, &before, &data);
  REQUIRE(before != nullptr);  // the printing that must not happen is on outside

  // The standard error stream is redirected to a file.
  const std::string printed = folder / "stderr";
  const int saved = ::dup(2);
  REQUIRE(std::freopen(printed.c_str(), "w", stderr) != nullptr);
  const auto missing = message_of<InputError>([&] { File::open_read(folder / "missing.h5"); });
  std::ofstream(folder / "text.h5") << "not HDF5 at all";
  const auto text = message_of<InputError>([&] { File::open_read(folder / "text.h5"); });
  const auto nowhere = message_of<OutputError>([&] { File::create(folder / "no/such/folder.h5"); });
  auto file = File::create(folder / "a.h5");
  const auto exists = message_of<OutputError>([&] { File::create(folder / "a.h5"); });
  file.write("g/x", std::vector<double>{1, 2}, {2});
  const auto dataset = message_of<InputError>([&] { file.open_group("g").read<double>("y"); });
  const auto shape = message_of<InputError>([&] { file.read<double>("g/x", {3}); });
  file.close();
  const auto read_only = message_of<OutputError>([&] { File::open_read(folder / "a.h5").create_group("new"); });
  std::fflush(stderr);
  ::dup2(saved, 2);
  ::close(saved);

  CHECK(contents(printed).empty());
  CHECK_THAT(missing, Contains("missing.h5"));
  CHECK_THAT(text, Contains("text.h5") && Contains("signature"));
  CHECK_THAT(nowhere, Contains("no/such/folder.h5") && Contains("No such file or directory"));
  CHECK_THAT(exists, Contains("a.h5") && Contains("exists"));
  CHECK_THAT(dataset, Contains("/g/y") && Contains("a.h5") && !Contains("no reason"));
  CHECK_THAT(shape, Contains("/g/x") && Contains("[2]") && Contains("[3]"));
  CHECK_THAT(read_only, Contains("/new") && Contains("a.h5") && !Contains("no reason"));
  H5Eget_auto2(H5E_DEFAULT, &after, &data);
  CHECK(after == before);
}

TEST_CASE("HDF5 rows that are written piece by piece, and past HDF5") {
  const ScratchFolder folder;
  const std::uint64_t width = GENERATE(1, 3), rows = 1000;
  const hdf5::Shape shape = width == 1 ? hdf5::Shape{rows} : hdf5::Shape{rows, width};
  std::vector<std::int32_t> values(rows * width);
  std::iota(values.begin(), values.end(), 5);
  std::uint64_t address = 0;
  {
    auto file = File::create(folder / "a.h5");
    auto pieces = file.create_dataset("pieces", hdf5::Type::int32, shape);
    pieces.write(700, 300, &values[700 * width]);
    pieces.write(0, 700, values.data());
    pieces.write(0, 0, nullptr);
    auto past = file.create_dataset("past", hdf5::Type::int32, shape);
    address = past.address();
    REQUIRE(address > 0);
    CHECK(file.create_dataset("none", hdf5::Type::int32, {0}).address() == 0);
    CHECK_THROWS_AS(pieces.write(701, 300, values.data()), OutputError);
    CHECK_THROWS_AS(file.create_dataset("pieces", hdf5::Type::int32, shape), OutputError);
    file.close();
  }
  std::fstream(folder / "a.h5", std::ios::in | std::ios::out | std::ios::binary)
      .seekp(static_cast<std::streamoff>(address))
      .write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(4 * values.size()));
  const auto file = File::open_read(folder / "a.h5");
  CHECK(file.read<std::int32_t>("pieces", shape) == values);
  CHECK(file.read<std::int32_t>("past", shape) == values);
}

TEST_CASE("the image of an HDF5 file in memory is a whole file") {
  const ScratchFolder folder;
  std::vector<double> values(100000);
  for (std::size_t k = 0; k < values.size(); ++k) values[k] = 0.5 * static_cast<double>(k);
  {
    auto file = File::in_memory("a.h5");
    file.write("first", values, {values.size()}, hdf5::Storage::crc32);
    REQUIRE_FALSE(file.image().empty());
    file.write("second", values, {values.size() / 2, 2});
    std::ofstream(folder / "a.h5", std::ios::binary) << file.image();
  }
  CHECK(std::filesystem::file_size(folder / "a.h5") < 8 * 2 * values.size() + 300000);
  const auto file = File::open_read(folder / "a.h5");
  CHECK(file.read<double>("first") == values);
  CHECK(file.read<double>("second") == values);
}

TEST_CASE("HDF5 checksums find damage") {
  const ScratchFolder folder;
  const std::size_t damaged = GENERATE(500, 19999);
  std::vector<double> values(20000);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = 1.0 + static_cast<double>(i);
  {
    auto file = File::create(folder / "a.h5");
    file.write("x", values, {values.size()}, hdf5::Storage::crc32);
    file.check("x");
    file.close();
  }
  std::string bytes = contents(folder / "a.h5");
  const double one = values[damaged];
  const auto at = bytes.find(std::string(reinterpret_cast<const char*>(&one), sizeof one));
  REQUIRE(at != bytes.npos);
  bytes[at + 3] ^= 1;
  std::ofstream(folder / "a.h5", std::ios::binary) << bytes;
  const auto file = File::open_read(folder / "a.h5");
  CHECK_THAT(message_of<InputError>([&] { file.check("x"); }), Contains("/x") && Contains("CRC-32"));
}

TEST_CASE("HDF5: what can be checked") {
  const ScratchFolder folder;
  {
    auto file = File::create(folder / "a.h5");
    auto group = file.create_group("g");
    group.write_text("text", "all is well");
    group.write_text("nothing", "");
    group.write("below/x", std::vector<double>{1, 2}, {2}, hdf5::Storage::crc32);
    group.write("plain", std::vector<double>{1, 2}, {2});
    group.write("empty", std::vector<double>{}, {0}, hdf5::Storage::crc32);
    group.write_constant("constant", 1.0, {7});
    group.write("linked", std::vector<double>{1, 2}, {2}, hdf5::Storage::crc32);
    group.link("/g/linked", "again");
    auto pieces = group.create_dataset("pieces", hdf5::Type::int32, {3});
    const std::array<std::int32_t, 3> values{1, 2, 3};
    pieces.write(0, 3, values.data());
    pieces.set_crc32(crc32_of(std::as_bytes(std::span(values))));
    CHECK(crc32_joined(crc32_of(std::as_bytes(std::span(values).first(1))),
                       crc32_of(std::as_bytes(std::span(values).last(2))),
                       8) == crc32_of(std::as_bytes(std::span(values))));
    CHECK(group.datasets() == std::vector<std::string>{"below/x", "nothing", "pieces", "text"});
    for (const char* name : {"below/x", "pieces", "empty", "linked", "again", "text", "nothing"})
      CHECK_NOTHROW(group.check(name));
    CHECK_THAT(message_of<InputError>([&] { group.check("plain"); }), Contains("/g/plain") && Contains("no checksum"));
    file.close();
  }
  CHECK(File::open_read(folder / "a.h5").read_text("g/text") == "all is well");
  CHECK(File::open_read(folder / "a.h5").read_text("g/nothing").empty());
  CHECK_THROWS_AS(File::open_read(folder / "a.h5").read_text("g/below/x"), InputError);
  std::string bytes = contents(folder / "a.h5");
  const auto at = bytes.find("all is well");
  REQUIRE(at != bytes.npos);
  bytes[at] = 'A';
  std::ofstream(folder / "a.h5", std::ios::binary) << bytes;
  CHECK_THAT(message_of<InputError>([&] { File::open_read(folder / "a.h5").read_text("g/text"); }),
             Contains("/g/text") && Contains("CRC-32"));
}

}  // namespace pliant::test::hdf5_test
