#include <pliant/base/rng.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

namespace pliant::test::rng_test {

TEST_CASE("Philox4x32-10 gives the known answers of its authors") {
  // Random123, kat_vectors: all bits zero, all bits one, digits of pi.
  CHECK(rng::philox4x32({0, 0, 0, 0}, {0, 0}) == rng::Counter{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8});
  constexpr std::uint32_t ones = 0xffffffff;
  CHECK(rng::philox4x32({ones, ones, ones, ones}, {ones, ones}) ==
        rng::Counter{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd});
  CHECK(rng::philox4x32({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}) ==
        rng::Counter{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1});
}

TEST_CASE("uniform numbers take the leading 53 bits of the generator") {
  const std::uint64_t bits = (std::uint64_t{0x6627e8d5} << 32 | 0xe169c58d) >> 11;
  CHECK(rng::uniform(0, 0, 0) == static_cast<Real>(bits) / 9007199254740992.0);
  // 32 high bits of each argument count too.
  const std::uint64_t high = std::uint64_t{1} << 40;
  std::vector<Real> values{rng::uniform(0, 0, 0),   rng::uniform(1, 0, 0),    rng::uniform(0, 1, 0),
                           rng::uniform(0, 0, 1),   rng::uniform(high, 0, 0), rng::uniform(0, high, 0),
                           rng::uniform(0, 0, high)};
  std::sort(values.begin(), values.end());
  CHECK(std::adjacent_find(values.begin(), values.end()) == values.end());
}

TEST_CASE("uniform numbers have the moments of the uniform distribution") {
  constexpr int n = 200000;
  Real sum = 0, squares = 0, pairs = 0, neighbours = 0, smallest = 1, largest = 0;
  for (int i = 0; i < n; ++i) {
    const auto [a, b] = rng::uniform2(7, 3, i);
    const Real other_stream = rng::uniform(7, 4, i);
    sum += a;
    squares += a * a;
    pairs += (a - 0.5) * (b - 0.5);
    neighbours += (a - 0.5) * (other_stream - 0.5);
    smallest = std::min(smallest, a);
    largest = std::max(largest, a);
  }
  // Five standard errors: 1/sqrt(12 n), 2/sqrt(45 n), 1/(12 sqrt(n)).
  CHECK(sum / n == Approx(0.5).margin(5 / std::sqrt(12.0 * n)));
  CHECK(squares / n == Approx(1 / 3.0).margin(5 * 2 / std::sqrt(45.0 * n)));
  CHECK(pairs / n == Approx(0).margin(5 / (12 * std::sqrt(n))));
  CHECK(neighbours / n == Approx(0).margin(5 / (12 * std::sqrt(n))));
  CHECK(smallest >= 0);
  CHECK(smallest < 1e-4);
  CHECK(largest < 1);
  CHECK(largest > 1 - 1e-4);
}

TEST_CASE("normal numbers have the moments of the standard normal distribution") {
  constexpr int n = 200000;
  Real m1 = 0, m2 = 0, m3 = 0, m4 = 0, pairs = 0;
  for (int i = 0; i < n; ++i) {
    const auto [a, b] = rng::normal2(11, 0, i);
    m1 += a;
    m2 += a * a;
    m3 += a * a * a;
    m4 += square(a * a);
    pairs += a * b;
  }
  // Five standard errors; variances of z, z², z³, z⁴ are 1, 2, 15, 96.
  CHECK(m1 / n == Approx(0).margin(5 / std::sqrt(n)));
  CHECK(m2 / n == Approx(1).margin(5 * std::sqrt(2.0 / n)));
  CHECK(m3 / n == Approx(0).margin(5 * std::sqrt(15.0 / n)));
  CHECK(m4 / n == Approx(3).margin(5 * std::sqrt(96.0 / n)));
  CHECK(pairs / n == Approx(0).margin(5 / std::sqrt(n)));
}

}  // namespace pliant::test::rng_test
