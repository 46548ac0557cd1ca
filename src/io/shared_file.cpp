#include <pliant/base/errors.h>
#include <pliant/io/shared_file.h>

#include <algorithm>
#include <array>

namespace pliant {
namespace {

// MPI counts bytes in an int.
constexpr std::size_t most_at_once = std::size_t{1} << 30;

}  // namespace

SharedFile::SharedFile(const Ranks& ranks, const std::filesystem::path& path) : ranks_(ranks), name_(path.string()) {
  const int code = MPI_File_open(ranks.comm(), name_.c_str(), MPI_MODE_WRONLY, MPI_INFO_NULL, &file_);
  ranks.together([&] { check(code); });
}

SharedFile::~SharedFile() { MPI_File_close(&file_); }

void SharedFile::write(std::uint64_t address, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const int count = static_cast<int>(std::min(bytes.size(), most_at_once));
    MPI_Status status;
    check(MPI_File_write_at(file_, static_cast<MPI_Offset>(address), bytes.data(), count, MPI_BYTE, &status));
    int written = 0;
    MPI_Get_count(&status, MPI_BYTE, &written);
    // Some implementations end a write that a full disk has cut short without an error.
    if (written < count) check(MPI_ERR_NO_SPACE);
    address += static_cast<std::uint64_t>(count);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

void SharedFile::sync() {
  const int code = MPI_File_sync(file_);
  ranks_.together([&] { check(code); });
}

void SharedFile::check(int code) const {
  if (code == MPI_SUCCESS) return;
  std::array<char, MPI_MAX_ERROR_STRING> text{};
  int length = 0;
  MPI_Error_string(code, text.data(), &length);
  throw OutputError("cannot write {}: {}; check free space and permissions", name_,
                    std::string_view(text.data(), static_cast<std::size_t>(length)));
}

}  // namespace pliant
