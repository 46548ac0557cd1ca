// HDF5 over a JournaledFile: a virtual file driver.
#pragma once

#include <cstdint>

#include <pliant/io/journaled_file.h>

namespace pliant::hdf5 {

/// Makes files that are opened with this property list (hid_t) be `file`, whatever their name; it must stay until they
/// are closed. HDF5 sees no failed write: commit() tells. Space in the file is never used twice.
void use_journaled_file(std::int64_t access, JournaledFile& file);

/// Where HDF5 sees the end of such a file (hid_t) that is open.
std::uint64_t allocated_end(std::int64_t id);

}  // namespace pliant::hdf5
