// CRC-32 as in gzip, stored with the datasets of run.h5 and with checkpoints.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace pliant {

/// Checksum of bytes with the checksum `before` followed by `bytes`.
std::uint32_t crc32_of(std::span<const std::byte> bytes, std::uint32_t before = 0);
/// Checksum of bytes with the checksum `first` followed by `size` bytes with the checksum `second`.
std::uint32_t crc32_joined(std::uint32_t first, std::uint32_t second, std::uint64_t size);

}  // namespace pliant
