// Random numbers as a pure function of (seed, stream, counter): no state, hence independent of threads, ranks and
// order.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include <pliant/base/types.h>

namespace pliant::rng {

using Counter = std::array<std::uint32_t, 4>;
using Key = std::array<std::uint32_t, 2>;

/// Philox4x32-10: ten rounds of a 128-bit bijection chosen by the key.
/// Source: Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC'11 (2011), section 3.3.
constexpr Counter philox4x32(Counter c, Key k) {
  constexpr std::uint64_t multiplier0 = 0xD2511F53, multiplier1 = 0xCD9E8D57;
  constexpr std::uint32_t weyl0 = 0x9E3779B9, weyl1 = 0xBB67AE85;  // golden ratio, sqrt(3) − 1
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t p0 = multiplier0 * c[0], p1 = multiplier1 * c[2];
    c = {static_cast<std::uint32_t>(p1 >> 32) ^ c[1] ^ k[0], static_cast<std::uint32_t>(p1),
         static_cast<std::uint32_t>(p0 >> 32) ^ c[3] ^ k[1], static_cast<std::uint32_t>(p0)};
    k = {k[0] + weyl0, k[1] + weyl1};
  }
  return c;
}

/// Two independent numbers, uniform in [0, 1) with 53 bits each.
/// @param seed    of the run
/// @param stream  purpose of the numbers (a use, a particle): streams of a seed are independent
/// @param counter index within the stream
constexpr std::array<Real, 2> uniform2(std::uint64_t seed, std::uint64_t stream, std::uint64_t counter) {
  const auto low = [](std::uint64_t a) { return static_cast<std::uint32_t>(a); };
  const auto high = [](std::uint64_t a) { return static_cast<std::uint32_t>(a >> 32); };
  const Counter r = philox4x32({low(counter), high(counter), low(stream), high(stream)}, {low(seed), high(seed)});
  const auto unit = [](std::uint32_t hi, std::uint32_t lo) {
    return static_cast<Real>(((static_cast<std::uint64_t>(hi) << 32) | lo) >> 11) * 0x1p-53;
  };
  return {unit(r[0], r[1]), unit(r[2], r[3])};
}

/// One number, uniform in [0, 1): the first of `uniform2`.
constexpr Real uniform(std::uint64_t seed, std::uint64_t stream, std::uint64_t counter) {
  return uniform2(seed, stream, counter)[0];
}

/// Two independent standard normal numbers (Box–Muller). They are made from the numbers that `uniform2` gives for the
/// same arguments: use different streams where both are needed.
inline std::array<Real, 2> normal2(std::uint64_t seed, std::uint64_t stream, std::uint64_t counter) {
  const auto [u, w] = uniform2(seed, stream, counter);
  const Real radius = std::sqrt(-2 * std::log(1 - u));  // 1 − u is in (0, 1]
  return {radius * std::cos(2 * pi * w), radius * std::sin(2 * pi * w)};
}

/// One standard normal number: the first of `normal2`.
inline Real normal(std::uint64_t seed, std::uint64_t stream, std::uint64_t counter) {
  return normal2(seed, stream, counter)[0];
}

}  // namespace pliant::rng
