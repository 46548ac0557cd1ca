#include <pliant/io/crc32.h>
#include <zlib.h>

namespace pliant {

std::uint32_t crc32_of(std::span<const std::byte> bytes, std::uint32_t before) {
  // A null address would make zlib start a new checksum.
  if (bytes.empty()) return before;
  return static_cast<std::uint32_t>(crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::uint32_t crc32_joined(std::uint32_t first, std::uint32_t second, std::uint64_t size) {
  return static_cast<std::uint32_t>(crc32_combine(first, second, static_cast<z_off_t>(size)));
}

}  // namespace pliant
