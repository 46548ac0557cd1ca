#include <fcntl.h>
#include <pliant/base/errors.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <new>
#include <string_view>

#if defined(__SANITIZE_ADDRESS__)
#define PLIANT_OWN_ALLOCATION 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define PLIANT_OWN_ALLOCATION 0
#endif
#endif
#ifndef PLIANT_OWN_ALLOCATION
#define PLIANT_OWN_ALLOCATION 1
#endif

namespace pliant {
namespace {

/// Bytes of the last allocation that failed, on any thread; 0 where that is not known.
std::atomic<std::size_t> refused = 0;

std::string size_text(double bytes) {
  constexpr std::array<std::string_view, 4> units{"B", "kB", "MB", "GB"};
  constexpr double step = 1000;
  std::size_t unit = 0;
  for (; bytes >= step && unit + 1 < units.size(); ++unit) bytes /= step;
  return fmt::format("{:.3g} {}", bytes, units[unit]);
}

/// Memory of this process in bytes; 0 if the system does not report it. Allocates nothing.
double resident_memory() {
  std::array<char, 128> text{};
  const int file = ::open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
  const ssize_t length = file < 0 ? 0 : ::read(file, text.data(), text.size() - 1);
  if (file >= 0) ::close(file);
  char* resident = nullptr;
  if (length <= 0) return 0;
  (void)std::strtoll(text.data(), &resident, 10);  // the first number is the size of the address space
  return static_cast<double>(std::strtoll(resident, nullptr, 10)) * static_cast<double>(::sysconf(_SC_PAGESIZE));
}

}  // namespace

MemoryError::MemoryError(const std::string& allocation)
    : Error(ExitCode::out_of_memory,
            fmt::format("out of memory: {} while {} were in use; free memory on this machine, or use fewer particles, "
                        "ranks or threads on it",
                        allocation, size_text(resident_memory()))) {}

Error error_in_flight() {
  try {
    throw;
  } catch (const Error& error) {
    return error;
  } catch (const std::bad_alloc&) {
    const std::size_t bytes = refused.exchange(0);
    return MemoryError((bytes > 0 ? size_text(static_cast<double>(bytes)) : "an array") + " could not be allocated");
  } catch (const std::exception& error) {
    return {ExitCode::numerical_failure, fmt::format("internal: {}", error.what())};
  } catch (...) {
    return {ExitCode::numerical_failure, "internal: an exception of an unknown type"};
  }
}

}  // namespace pliant

#if PLIANT_OWN_ALLOCATION
// The standard operators, with the size in the message, which std::bad_alloc lacks.

void* operator new(std::size_t size) {
  for (;;) {
    if (void* const memory = std::malloc(size > 0 ? size : 1)) return memory;
    const std::new_handler handler = std::get_new_handler();
    if (handler == nullptr) {
      pliant::refused = size;
      throw std::bad_alloc();
    }
    handler();
  }
}

void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
#endif
