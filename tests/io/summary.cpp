#include <catch2/catch.hpp>
#include <limits>
#include <nlohmann/json.hpp>

#include <pliant/base/errors.h>
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
  CHECK(nlohmann::ordered_json::parse(contents(folder / "summary.json")) == summary);
  CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 1);
  // Not UTF-8: the rest must still arrive.
  write_summary(folder.path(), {{"message", "\xff"}, {"steps", 3}});
  CHECK(nlohmann::json::parse(contents(folder / "summary.json"))["steps"] == 3);
  CHECK_THAT(message_of<OutputError>([&] { write_summary(folder / "none", summary); }),
             Contains("none/summary.json") && Contains("No such file"));
}

}  // namespace pliant::test::summary_test
