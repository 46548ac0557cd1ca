#include <catch2/catch.hpp>
#include <limits>
#include <nlohmann/json.hpp>

#include <pliant/base/errors.h>
#include <pliant/io/json_file.h>
#include <pliant/io/summary.h>

#include "io/io_support.h"

namespace pliant::test::summary_test {
using Catch::Matchers::Contains;

TEST_CASE("a quantity without a finite value or error has null") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  CHECK(quantity(4.1, 0.1, "t0").dump() == R"({"value":4.1,"error":0.1,"unit":"t0"})");
  CHECK(quantity(4.1, nan, "t0").dump() == R"({"value":4.1,"error":null,"unit":"t0"})");
  CHECK(quantity(-inf, inf, "t0").dump() == R"({"value":null,"error":null,"unit":"t0"})");
}

TEST_CASE("summary.json is replaced as a whole and keeps its order") {
  const ScratchFolder folder;
  nlohmann::ordered_json summary{{"status", "done"}, {"Q", quantity(1.0 / 3, 0, "")}, {"a", 1}};
  write_summary(folder.path(), {{"old", std::string(10000, 'x')}});
  write_summary(folder.path(), summary);
  CHECK(read_json(folder / "summary.json") == summary);
  CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 1);
  // Not UTF-8: the rest must still arrive.
  write_summary(folder.path(), {{"message", "\xff"}, {"steps", 3}});
  CHECK(nlohmann::json::parse(contents(folder / "summary.json"))["steps"] == 3);
  CHECK_THAT(message_of<OutputError>([&] { write_summary(folder / "none", summary); }),
             Contains("none/summary.json") && Contains("No such file"));
}

TEST_CASE("no bit of a JSON file can change, and no byte get lost, without notice") {
  const ScratchFolder folder;
  const auto path = folder / "a.json";
  CHECK(read_json(path).is_null());
  write_json(path, {{"status", "done"}});
  const std::string whole = contents(path);
  // python/tests/test_files.py reads the same.
  CHECK(whole == "{\n  \"format\": 2,\n  \"status\": \"done\",\n  \"crc32\": \"e20d29dc\"\n}\n");
  CHECK(read_json(path) == nlohmann::ordered_json{{"status", "done"}});
  const auto refused = [&](const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
    return message_of<InputError>([&] { read_json(path); });
  };
  for (std::size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    std::string text = whole;
    text[bit / 8] = static_cast<char>(text[bit / 8] ^ 1 << bit % 8);
    CAPTURE(text);
    CHECK_THAT(refused(text), Contains("a.json is damaged or was edited"));
  }
  for (std::size_t size = 0; size < whole.size(); ++size)
    CHECK_THAT(refused(whole.substr(0, size)), Contains("a.json is damaged"));
  // A summary of an older version.
  CHECK(refused("{\"status\": \"done\"}").empty());
  for (const char* text : {"[]", "3", "null", "[1, 2"}) CHECK_THAT(refused(text), Contains("not a JSON object"));
}

}  // namespace pliant::test::summary_test
