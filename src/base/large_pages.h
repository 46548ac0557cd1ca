// Large pages of memory, with which going through large arrays needs fewer address translations.
#pragma once

#include <cstddef>
#include <vector>

namespace pliant {

/// Requests large pages from the operating system for this memory, which should not have been written to yet. No effect
/// on small arrays, and on systems without large pages.
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
