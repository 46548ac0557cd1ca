// Changes a checkpoint as someone would who edits it: with a checksum that fits.
#pragma once

#include <fmt/format.h>
#include <zlib.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <pliant/io/hdf5.h>

namespace pliant::test {

/// The head of a checkpoint of these bytes behind it [docs/reference/file-format.md].
inline std::string checkpoint_head(const std::string& image) {
  const auto crc = ::crc32_z(0, reinterpret_cast<const unsigned char*>(image.data()), image.size());
  std::string head =
      fmt::format("pliant checkpoint, format 2; {} bytes from byte 512 on with the CRC-32 {:08x}\n", image.size(), crc);
  head.resize(512, '\0');
  return head;
}

inline void seal_checkpoint(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}}, image = bytes.substr(512);
  std::ofstream(path, std::ios::binary) << checkpoint_head(image) << image;
}

/// change(group) gets the group /state.
template <class Change>
void edit_checkpoint(const std::filesystem::path& path, Change&& change) {
  {
    auto file = hdf5::File::open_write(path);
    auto state = file.open_group("state");
    change(state);
    file.close();
  }
  seal_checkpoint(path);
}

}  // namespace pliant::test
