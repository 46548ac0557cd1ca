// Large pages of memory, with which going through large arrays needs fewer address translations.
#pragma once

#include <cstddef>
#include <vector>

namespace pliant {

/// Asks the operating system for large pages behind this memory, which should not have been written to yet. Does
/// nothing for small arrays, and where there are no such pages.
void advise_large_pages(const void* memory, std::size_t bytes);

/// values.resize(n), on large pages.
template <class T>
void resize_large(std::vector<T>& values, std::size_t n) {
  if (n > values.capacity()) {
    values.reserve(n);
    advise_large_pages(values.data(), n * sizeof(T));
  }
  values.resize(n);
}

}  // namespace pliant
