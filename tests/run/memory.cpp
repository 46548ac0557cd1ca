// Whether the memory of the machine holds a run.
#include <catch2/catch.hpp>

#include <pliant/base/errors.h>
#include <pliant/run/memory.h>

namespace pliant::test::memory_test {

using Catch::Contains;

TEST_CASE("a run that needs more memory than there is, or more points than can be numbered, is refused", "[memory]") {
  CHECK(available_memory() > 1e6);
  CHECK_NOTHROW(check_memory({1000, 20000}, "-n 1000", Ranks()));
  CHECK(least_memory({100'000'000, 100'000'000}) > 2e10);
  CHECK(least_memory({1000, 20000, 3}) > least_memory({1000, 20000, 2}));
  CHECK_THROWS_AS(check_memory({100'000'000, 1'000'000'000'000}, "-n 1e8", Ranks()), InputError);
  CHECK_THROWS_WITH(check_memory({100'000'000, 1'000'000'000'000}, "-n 1e8", Ranks()),
                    Contains("-n 1e8") && Contains("and the limit is"));
}

}  // namespace pliant::test::memory_test
