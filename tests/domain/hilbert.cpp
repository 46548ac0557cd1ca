#include <catch2/catch.hpp>

#include <pliant/domain/hilbert.h>

#include <cstdlib>
#include <vector>

namespace pliant::test::hilbert_test {

namespace {

/// Follows the full curve: every cell has a different key, and the next key belongs to a neighbour.
template <int D>
void check_curve(int bits) {
  INFO(D << "D, " << bits << " bits");
  const std::uint32_t side = std::uint32_t(1) << bits;
  const std::uint64_t cells = std::uint64_t(1) << (D * bits);
  std::vector<std::array<std::uint32_t, D>> at(cells);
  std::vector<int> visits(cells);
  for (std::uint64_t c = 0; c < cells; ++c) {
    std::array<std::uint32_t, D> cell;
    for (int k = 0; k < D; ++k) cell[k] = (c >> (k * bits)) & (side - 1);
    const std::uint64_t key = hilbert_key<D>(cell, bits);
    REQUIRE(key < cells);
    at[key] = cell;
    ++visits[key];
  }
  CHECK(visits == std::vector<int>(cells, 1));
  std::uint64_t jumps = 0;
  for (std::uint64_t key = 1; key < cells; ++key) {
    int distance = 0;
    for (int k = 0; k < D; ++k) distance += std::abs(static_cast<int>(at[key][k]) - static_cast<int>(at[key - 1][k]));
    jumps += distance != 1;
  }
  CHECK(jumps == 0);
}

}  // namespace

TEST_CASE("the Hilbert curve visits every cell once, and neighbours one after the other") {
  for (int bits = 1; bits <= 5; ++bits) check_curve<2>(bits);
  for (int bits = 1; bits <= 4; ++bits) check_curve<3>(bits);
}

TEST_CASE("the cells of a coarse grid are runs of keys of a finer one") {
  for (std::uint32_t x = 0; x < 32; ++x)
    for (std::uint32_t y = 0; y < 32; ++y)
      // Halving the grid turns the curve by a diagonal: the quarters keep their order up to that.
      CHECK((hilbert_key<2>({x, y}, 5) >> 2 == hilbert_key<2>({x >> 1, y >> 1}, 4) ||
             hilbert_key<2>({x, y}, 5) >> 2 == hilbert_key<2>({y >> 1, x >> 1}, 4)));
}

}  // namespace pliant::test::hilbert_test
