// When samples and frames are due.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <pliant/base/rng.h>
#include <pliant/run/schedule.h>

namespace pliant::test::schedule_test {

namespace {

/// The result of Schedule, by counting.
std::int64_t counted(std::int64_t next, Real interval, Real t) {
  while (static_cast<Real>(next) * interval * (1 - 1e-12) <= t) ++next;
  return next;
}

void visit(Schedule& schedule, const Checkpoint& c) {
  Archive archive(c, nullptr);
  schedule.visit(archive, "last");
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
    visit(schedule, c);
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

TEST_CASE("a restart may change an interval", "[schedule]") {
  struct Case {
    Real before, now, last, t;
  };
  for (const Case& k : {Case{0.5, 0.1, 4, 4.35}, Case{0.1, 0.5, 4.3, 4.35}, Case{0.1, 100, 4.3, 4.35}}) {
    INFO(k.before << " " << k.now);
    Checkpoint c;
    c.t = k.t;
    c.step = 10;
    c.reals = {{"last", {k.last}}, {"last_interval", {k.before}}, {"last_longest_interval", {k.before}}};
    c.integers = {{"last_interval_changed", {0}}};
    Schedule schedule(k.now);
    visit(schedule, c);
    CHECK(schedule.done_at(k.last));
    CHECK(!schedule.done_at(k.t));
    CHECK(!schedule.due(k.t));
    CHECK(schedule.due(k.now * std::ceil(k.t / k.now)));
    CHECK(schedule.changed());
    CHECK(schedule.longest() == std::max(k.before, k.now));
    c.reals["last"] = {k.last - k.before};  // the old interval counts
    Schedule late(k.now);
    CHECK_THROWS_AS(visit(late, c), InputError);
  }
}

TEST_CASE("averages take evenly spaced samples", "[schedule]") {
  Series series;
  const auto add = [&](Real t) {
    series["time"].values.push_back(t);
    series["dt"].values.push_back(0.01);
    series["row"].values.insert(series["row"].values.end(), {t, -t});
  };
  for (int k = 0; k < 10; ++k) add(k);
  for (int k = 0; k <= 40; ++k) add(10 + k * 0.25);
  series["time"].rows = series["dt"].rows = series["row"].rows = 51;
  series["row"].width = 2;
  const Series all = even_rows(series, EvenSamples(Schedule(0.25)));  // as if it had never changed
  CHECK(all.at("time").values.size() == 51);
  Checkpoint c;
  c.t = 10;
  c.step = 10;
  c.reals = {{"last", {10}}, {"last_interval", {1}}, {"last_longest_interval", {1}}};
  Schedule schedule(0.25);
  visit(schedule, c);
  const Series even = even_rows(series, EvenSamples(schedule));
  REQUIRE(even.at("time").rows == 21);
  for (int k = 0; k <= 20; ++k) {
    CHECK(even.at("time").values[k] == k);
    CHECK(even.at("row").values[2 * k + 1] == -k);
  }
}

TEST_CASE("averages weight rows by time where steps are longer than the interval", "[schedule]") {
  // The state 1 lasts for 0.2, in 20 short steps, then the state 0 for one long step.
  Series series;
  const auto add = [&](Real t, Real dt, Real value) {
    series["time"].values.push_back(t);
    series["dt"].values.push_back(dt);
    series["value"].values.push_back(value);
  };
  Real t = 0;
  add(t, 0, 0);
  for (int k = 0; k < 100; ++k) {
    for (int j = 1; j <= 20; ++j) add(t += 0.01, 0.01, 1);
    const Real step = 0.8 + 0.1 * std::sin(k);
    add(t += step, step, 0);
  }
  for (auto& [name, column] : series) column.rows = column.values.size();
  const Series even = even_rows(series, EvenSamples(Schedule(0.01)));
  const std::vector<Real>&time = even.at("time").values, &value = even.at("value").values;
  REQUIRE(time.size() == series["time"].rows);
  for (std::size_t k = 0; k < time.size(); ++k) CHECK(time[k] == Approx(t * k / (time.size() - 1)));
  const Real mean = std::accumulate(value.begin(), value.end(), 0.0) / static_cast<Real>(value.size());
  CHECK(mean == Approx(20 / t).epsilon(0.02));
  CHECK(even.at("dt").values.back() > 0.7);
}

}  // namespace pliant::test::schedule_test
