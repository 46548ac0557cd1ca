// Place along a Hilbert curve: particles sorted by it are near in memory where they are near in space.
#pragma once

#include <array>
#include <cstdint>

#include <pliant/base/multiversion.h>

namespace pliant {

/// Key of a cell of a grid with 2^bits cells per side; D · bits ≤ 64. Neighbouring keys are neighbouring cells. By the
/// transpose of J. Skilling, AIP Conf. Proc. 707, 381 (2004): undo the curve's turns from the coarsest bit to the
/// finest, then read the bits of all axes in turn as one Gray code.
template <int D>
PLIANT_INLINE std::uint64_t hilbert_key(std::array<std::uint32_t, D> cell, int bits) {
  const std::uint32_t top = std::uint32_t(1) << (bits - 1);
  for (std::uint32_t bit = top; bit > 1; bit >>= 1) {
    const std::uint32_t below = bit - 1;
    for (int k = 0; k < D; ++k) {
      if ((cell[k] & bit) != 0) {
        cell[0] ^= below;
      } else {
        const std::uint32_t swapped = (cell[0] ^ cell[k]) & below;
        cell[0] ^= swapped;
        cell[k] ^= swapped;
      }
    }
  }
  for (int k = 1; k < D; ++k) cell[k] ^= cell[k - 1];
  std::uint32_t flips = 0;
  for (std::uint32_t bit = top; bit > 1; bit >>= 1)
    if ((cell[D - 1] & bit) != 0) flips ^= bit - 1;
  std::uint64_t key = 0;
  for (int b = bits - 1; b >= 0; --b)
    for (int k = 0; k < D; ++k) key = key << 1 | (((cell[k] ^ flips) >> b) & 1);
  return key;
}

}  // namespace pliant
