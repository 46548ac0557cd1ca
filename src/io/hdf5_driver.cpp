#include <hdf5.h>
#include <pliant/base/errors.h>
#include <pliant/io/hdf5_driver.h>

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <limits>
#include <new>
#include <span>
#include <stdexcept>

namespace pliant::hdf5 {
namespace {

struct Driver {
  H5FD_t head;  // HDF5's own; must come first
  JournaledFile* file;
  haddr_t allocated;
};

Driver& driver(H5FD_t* file) { return *reinterpret_cast<Driver*>(file); }
const Driver& driver(const H5FD_t* file) { return *reinterpret_cast<const Driver*>(file); }

H5FD_t* open_file(const char*, unsigned, hid_t access, haddr_t) {
  const auto* file = static_cast<JournaledFile* const*>(H5Pget_driver_info(access));
  auto* made = file == nullptr ? nullptr : new (std::nothrow) Driver{{}, *file, 0};
  return made == nullptr ? nullptr : &made->head;
}

herr_t close_file(H5FD_t* file) {
  delete &driver(file);
  return 0;
}

herr_t query(const H5FD_t*, unsigned long* flags) {
  *flags = H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
  return 0;
}

/// Only new space may be freed: the last commit refers to the rest.
herr_t free_space(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t address, hsize_t size) {
  Driver& d = driver(file);
  if (address + size == d.allocated && address >= d.file->committed()) d.allocated = address;
  return 0;
}

haddr_t allocated(const H5FD_t* file, H5FD_mem_t) { return driver(file).allocated; }

herr_t set_allocated(H5FD_t* file, H5FD_mem_t, haddr_t end) {
  driver(file).allocated = end;
  return 0;
}

haddr_t end_of_file(const H5FD_t* file, H5FD_mem_t) { return driver(file).file->end(); }

herr_t handle(H5FD_t* file, hid_t, void** found) {
  *found = &driver(file).allocated;
  return 0;
}

/// For the exception that is being handled; HDF5 learns whether memory was lacking.
herr_t failed() {
  try {
    throw;
  } catch (const std::bad_alloc&) {
    (void)H5Epush2(H5E_DEFAULT, __FILE__, __func__, __LINE__, H5E_ERR_CLS, H5E_RESOURCE, H5E_NOSPACE, "out of memory");
  } catch (...) {
  }
  return -1;
}

herr_t read(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t address, size_t size, void* to) {
  try {
    driver(file).file->read(address, std::span(static_cast<std::byte*>(to), size));
    return 0;
  } catch (...) {
    return failed();
  }
}

herr_t write(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t address, size_t size, const void* from) {
  try {
    driver(file).file->write(address, std::span(static_cast<const std::byte*>(from), size));
    return 0;
  } catch (...) {
    return failed();
  }
}

H5FD_class_t make_class() {
  H5FD_class_t c{};
  c.name = "pliant_journaled";
  c.maxaddr = static_cast<haddr_t>(std::numeric_limits<std::int64_t>::max());
  c.fc_degree = H5F_CLOSE_STRONG;
  c.fapl_size = sizeof(JournaledFile*);  // NOLINT(bugprone-sizeof-expression): the property holds a pointer
  c.open = open_file;
  c.close = close_file;
  c.query = query;
  c.free = free_space;
  c.get_eoa = allocated;
  c.set_eoa = set_allocated;
  c.get_eof = end_of_file;
  c.get_handle = handle;
  c.read = read;
  c.write = write;
  constexpr H5FD_mem_t lists[] = H5FD_FLMAP_DICHOTOMY;
  std::copy(std::begin(lists), std::end(lists), c.fl_map);
  return c;
}

}  // namespace

void use_journaled_file(std::int64_t access, JournaledFile& file) {
  static const H5FD_class_t functions = make_class();
  static const hid_t id = H5FDregister(&functions);
  JournaledFile* pointer = &file;
  if (id < 0 || H5Pset_driver(access, id, &pointer) < 0) throw std::logic_error("HDF5 takes no driver");
}

std::uint64_t allocated_end(std::int64_t id) {
  void* found = nullptr;
  if (H5Fget_vfd_handle(id, H5P_DEFAULT, &found) < 0) throw std::logic_error("HDF5 has lost its driver");
  return *static_cast<const haddr_t*>(found);
}

}  // namespace pliant::hdf5
