// Streams of random numbers: one per use, so that no two uses share numbers.
#pragma once

#include <cstdint>

namespace pliant::stream {

inline constexpr std::uint64_t size_order = 1, sizes = 2, placement = 3, orientation = 4, reinsertion = 5,
                               lateral_velocity = 6;

}  // namespace pliant::stream
