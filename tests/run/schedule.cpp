// When samples and frames are due.
#include <catch2/catch.hpp>

#include <cmath>
#include <limits>

#include <pliant/base/rng.h>
#include <pliant/run/schedule.h>

namespace pliant::test::schedule_test {

namespace {

/// What Schedule computes, by counting.
std::int64_t counted(std::int64_t next, Real interval, Real t) {
  while (static_cast<Real>(next) * interval * (1 - 1e-12) <= t) ++next;
  return next;
}

}  // namespace

TEST_CASE("a schedule counts as one would by hand, to the last bit", "[schedule]") {
  std::int64_t compared = 0;
  for (std::uint64_t k = 0; k < 200; ++k) {
    const auto draw = [&](std::uint64_t i) { return rng::uniform(1, 7, 100000 * k + i); };
    const Real dt = std::pow(10, -5 + 5 * draw(0));
    // Multiples of dt, where rounding decides, and any others.
    const Real interval = draw(1) < 0.5 ? std::round(1 + 50 * draw(2)) * dt : 50 * dt * draw(2);
    Schedule schedule(interval);
    std::int64_t next = 0, step = 0;
    for (std::uint64_t i = 0; i < 2000; ++i) {
      const Real t = dt * static_cast<Real>(step);
      REQUIRE(schedule.due(t) == (t >= static_cast<Real>(next) * interval * (1 - 1e-12)));
      if (schedule.due(t)) {
        schedule.done(t);
        next = counted(next, interval, t);
        ++compared;
      }
      step += draw(3 + i) < 0.01 ? 1000 : 1;
    }
  }
  CHECK(compared > 10000);
}

TEST_CASE("a schedule of any interval", "[schedule]") {
  for (const Real interval : {std::numeric_limits<Real>::denorm_min(), 1e-300, 1e-20, 1e-4}) {
    INFO(interval);
    Schedule schedule(interval);
    for (int step = 0; step < 100; ++step) {
      const Real t = 1e-3 * step;
      REQUIRE(schedule.due(t));  // every step, and at once
      schedule.done(t);
    }
  }
  for (const Real interval : {1e10, 1e300, std::numeric_limits<Real>::max()}) {
    INFO(interval);
    Schedule schedule(interval);
    REQUIRE(schedule.due(0));
    schedule.done(0);
    CHECK(!schedule.due(1e9));
    schedule.done(1e9);  // as at the end of a run
    CHECK(!schedule.due(2e9));
  }
}

TEST_CASE("a schedule goes on where it was", "[schedule]") {
  const auto loaded = [](Real interval, Real last, Real t) {
    Checkpoint c;
    c.t = t;
    c.step = t > 0 ? 1 : 0;
    c.reals["last"] = {last};
    Schedule schedule(interval);
    schedule.load(c, "last");
    return schedule;
  };
  const Schedule schedule = loaded(0.1, 0.7, 0.75);
  CHECK(schedule.done_at(0.7));
  CHECK(!schedule.due(0.79));
  CHECK(schedule.due(0.8));
  CHECK(loaded(1e-300, 0.7, 0.7).due(0.71));
  CHECK(loaded(0.1, -1, 0).due(0));
  CHECK_THROWS_AS(loaded(0.1, -1, 0.05), InputError);
  CHECK_THROWS_AS(loaded(0.1, 0.7, 0.85), InputError);
  CHECK_THROWS_AS(loaded(1e-300, 0.7, 0.71), InputError);
}

}  // namespace pliant::test::schedule_test
