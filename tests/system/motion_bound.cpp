// The bound of the motion that neighbour lists, narrowed lists and checks of outlines share.
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include <pliant/system/motion_bound.h>

#include "support/problems.h"
#include "support/twins.h"

namespace pliant::test::motion_bound_test {

namespace {

constexpr Real unknown = std::numeric_limits<Real>::infinity();
constexpr auto lists = MotionSince::list_rebuild, narrowing = MotionSince::narrowing,
               outlines = MotionSince::outline_check;

}  // namespace

TEST_CASE("reported motion adds up from each event on, at evaluations") {
  MotionBound motion(2);
  for (const MotionSince event : {lists, narrowing, outlines}) CHECK(motion.since(event) == unknown);
  motion.restart(lists);
  motion.report(3);
  CHECK(motion.since(lists) == 0);
  motion.report(1);
  motion.evaluate();
  CHECK(motion.since(lists) == Approx(4 * std::sqrt(2.0)));
  CHECK(motion.since(outlines) == unknown);
  motion.restart(outlines, 0.5);
  motion.report(2);
  motion.evaluate();
  CHECK(motion.since(lists) == Approx(6 * std::sqrt(2.0)));
  CHECK(motion.since(outlines) == Approx(0.5 + 2 * std::sqrt(2.0)));
  motion.lose(outlines);
  CHECK(motion.since(outlines) == unknown);
  CHECK(motion.since(lists) == Approx(6 * std::sqrt(2.0)));
}

TEST_CASE("motion that is not reported has no bound") {
  MotionBound motion(3);
  const auto start = [&] {
    for (const MotionSince event : {lists, narrowing, outlines}) motion.restart(event);
  };
  start();
  motion.evaluate();
  for (const MotionSince event : {lists, narrowing, outlines}) CHECK(motion.since(event) == unknown);
  start();
  motion.report(unknown);
  motion.report(1);
  motion.evaluate();
  CHECK(motion.since(lists) == unknown);
  start();
  motion.report(std::numeric_limits<Real>::quiet_NaN());
  motion.evaluate();
  CHECK_FALSE(motion.since(lists) <= 1e300);
  // Reports from before the points were lost do not count.
  start();
  motion.report(5);
  motion.lose();
  for (const MotionSince event : {lists, narrowing, outlines}) CHECK(motion.since(event) == unknown);
  start();
  motion.report(1);
  motion.evaluate();
  CHECK(motion.since(narrowing) == Approx(std::sqrt(3.0)));
}

TEST_CASE("no point goes farther than the bound of the motion") {
  Random random(3);
  MotionBound motion(3);
  motion.restart(lists);
  motion.restart(outlines);
  pliant::Vec<3> x(0, 0, 0), checked = x;
  for (int step = 0; step < 200; ++step) {
    if (step % 60 == 59) {
      checked = x;
      motion.restart(outlines);
    }
    for (int part = 0; part < 2; ++part) {
      const pliant::Vec<3> by(random(-1, 1), random(-1, 1), random(-1, 1));
      x += by;
      motion.report(by.cwiseAbs().maxCoeff());
    }
    motion.evaluate();
    CHECK(x.norm() <= motion.since(lists));
    CHECK((x - checked).norm() <= motion.since(outlines));
  }
  // Along a diagonal it is the distance.
  motion.restart(narrowing);
  motion.report(2);
  motion.evaluate();
  CHECK(motion.since(narrowing) == Approx(pliant::Vec<3>(2, -2, 2).norm()));
}

TEST_CASE("particles that a system takes get lists of their own, whatever motion is reported") {
  Random random(8);
  const Configuration<2> c = soft_rows<2>(random, 6, 6);
  ParticleSystem<2> system = system_of<2>(c, ModelKind::sp);
  std::vector<Real> a(c.x.size()), b(c.x.size());
  const auto evaluate = [&](std::vector<Real>& to) {
    system.moved_by(0);
    system.acceleration(0, c.x.data(), c.v.data(), to.data());
  };
  evaluate(a);
  evaluate(a);
  const std::int64_t rebuilds = system.neighbours().rebuilds();
  CHECK(rebuilds == 1);
  system.take(c.topology);
  evaluate(b);
  CHECK(system.neighbours().rebuilds() == rebuilds + 1);
  CHECK(a == b);
}

TEST_CASE("the bound of a system's motion holds for outlines between views") {
  Random random(9);
  Configuration<2> c = soft_rows<2>(random, 4, 4);
  ParticleSystem<2> system = system_of<2>(c, ModelKind::sp);
  std::vector<Real> a(c.x.size());
  system.acceleration(0, c.x.data(), c.v.data(), a.data());
  CHECK(system.motion().since(outlines) == unknown);
  system.outlines_checked(0.25);
  system.moved_by(0.5);
  CHECK(system.motion().since(outlines) == 0.25);
  for (Real& x : c.x) x += 0.5;
  system.acceleration(0, c.x.data(), c.v.data(), a.data());
  CHECK(system.motion().since(outlines) == Approx(0.25 + std::sqrt(0.5)));
  system.last_view(c.x.data(), c.v.data(), 0);  // where the points are known to be
  CHECK(system.motion().since(outlines) == Approx(0.25 + std::sqrt(0.5)));
  system.view(c.x.data(), c.v.data());
  CHECK(system.motion().since(outlines) == unknown);
}

}  // namespace pliant::test::motion_bound_test
