#include <catch2/catch.hpp>
#include <cmath>

#include <pliant/analysis/clog.h>

namespace pliant::test::clog_test {

TEST_CASE("clogged after the whole quiet time, not before") {
  ClogDetector clog(10, 1e-3);
  CHECK_FALSE(clog.update(0, 7, 50, 1e-4));
  CHECK_FALSE(clog.update(9.99, 7, 50, 1e-4));
  CHECK(clog.update(10, 7, 50, 1e-4));
  CHECK(clog.update(11, 7, 50, 1e-4));
}

TEST_CASE("a crossing or a fast particle starts the time anew") {
  ClogDetector clog(10, 1e-3);
  clog.update(0, 7, 50, 1e-4);
  SECTION("crossing") {
    CHECK_FALSE(clog.update(5, 8, 49, 1e-4));
    CHECK_FALSE(clog.update(14, 8, 49, 1e-4));
    CHECK(clog.update(15, 8, 49, 1e-4));
  }
  SECTION("speed at the limit counts as moving; the quiet time starts at the next sample") {
    CHECK_FALSE(clog.update(5, 7, 50, 1e-3));
    CHECK_FALSE(clog.update(6, 7, 50, 1e-4));
    CHECK_FALSE(clog.update(15, 7, 50, 1e-4));
    CHECK(clog.update(16, 7, 50, 1e-4));
  }
  SECTION("a speed that is not a number") {
    CHECK_FALSE(clog.update(20, 7, 50, std::nan("")));
    CHECK(std::isnan(clog.state().quiet_since));
  }
  SECTION("a clog can break") {
    CHECK(clog.update(12, 7, 50, 1e-4));
    CHECK_FALSE(clog.update(13, 7, 50, 1));
  }
}

TEST_CASE("an empty hopper is not clogged") {
  ClogDetector clog(10, 1e-3);
  clog.update(0, 7, 0, 0);
  CHECK_FALSE(clog.update(20, 7, 0, 0));
}

TEST_CASE("the state can be saved and restored") {
  ClogDetector before(10, 1e-3), after(10, 1e-3), fresh(10, 1e-3);
  before.update(0, 7, 50, 1e-4);
  before.update(4, 7, 50, 1e-4);
  after.restore(before.state());
  CHECK(after.update(10, 7, 50, 1e-4));
  CHECK_FALSE(fresh.update(10, 7, 50, 1e-4));
  CHECK(after.state().quiet_since == 0);
  CHECK(after.state().crossed == 7);
}

TEST_CASE("clog detection: bad input") {
  CHECK_THROWS_AS(ClogDetector(0, 1e-3), InputError);
  CHECK_THROWS_AS(ClogDetector(1, std::nan("")), InputError);
}

}  // namespace pliant::test::clog_test
