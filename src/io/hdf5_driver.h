// HDF5 over a JournaledFile: a virtual file driver.
#pragma once

#include <cstdint>

#include <pliant/io/journaled_file.h>

namespace pliant::hdf5 {

/// Files that are opened with this property list (hid_t), under any name, are `file`; it must outlive them. HDF5 does
/// not see failed writes: commit() reports them. Space in the file is never used twice.
void use_journaled_file(std::int64_t access, JournaledFile& file);

/// Where HDF5 sees the end of such a file (hid_t) that is open.
std::uint64_t allocated_end(std::int64_t id);

}  // namespace pliant::hdf5
