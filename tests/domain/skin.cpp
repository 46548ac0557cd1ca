// The width of the lists' margin.
#include <catch2/catch.hpp>

#include <pliant/domain/skin.h>

namespace pliant::test::skin_test {

TEST_CASE("a skin that costs least stays, others move towards it", "[skin]") {
  const int dim = GENERATE(2, 3);
  const Real rebuild = dim == 2 ? 60 : 150, skin = 0.3, width = 1, pairs = 6;
  CAPTURE(dim);
  // d/ds [P ((w + s)/(w + skin))^dim + R skin/(k s)] = 0 at s = skin.
  const Real interval = rebuild * (width + skin) / (pairs * dim * skin);
  const auto after = [&](Real factor) {
    return best_skin(skin, {std::llround(1e6 * interval * factor), 1000000}, dim, pairs, width);
  };
  CHECK(after(1) == Approx(skin).epsilon(0.02));
  CHECK(after(1.3) < 0.95 * skin);  // rebuilt seldom: fewer pairs are worth more
  CHECK(after(0.7) > 1.05 * skin);
  // In bounds.
  CHECK(after(1e6) == Approx(0.6 * skin).epsilon(1e-12));
  CHECK(after(1e-6) > 1.6 * skin);
  CHECK(after(1e-6) <= 1.7 * skin);
}

TEST_CASE("from any start the skin settles where lists cost least", "[skin]") {
  const int dim = GENERATE(2, 3);
  const Real start = GENERATE(0.02, 0.2, 0.9);
  CAPTURE(dim, start);
  const Real width = 1, speed = 40, bare_pairs = 3, rebuild = dim == 2 ? 60 : 150;
  const auto pairs = [&](Real s) { return bare_pairs * std::pow(width + s, dim); };
  Real least = 0.01;  // the skin of least cost, by comparing all
  const auto cost = [&](Real s) { return pairs(s) + rebuild / (speed * s); };
  for (Real s = least; s < width; s += 1e-4)
    if (cost(s) < cost(least)) least = s;
  Real skin = start;
  for (int k = 0; k < 40; ++k)
    skin = best_skin(skin, {std::llround(1e6 * speed * skin), 1000000}, dim, pairs(skin), width);
  CHECK(skin == Approx(least).epsilon(0.03));
}

TEST_CASE("lists that were never rebuilt count as rebuilt once; no skin is wider than the particles", "[skin]") {
  CHECK(best_skin(0.3, {50, 0}, 2, 6, 1) == best_skin(0.3, {50, 1}, 2, 6, 1));
  CHECK(best_skin(0.9, {1, 1000}, 2, 6, 1) < 1);
  CHECK(best_skin(0.9, {1, 1000}, 2, 6, 1) > 0.9);
}

}  // namespace pliant::test::skin_test
