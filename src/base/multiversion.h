// Functions compiled for several instruction sets; the loader selects the best set that the machine has.
#pragma once

#include <stdexcept>

// Not with the thread sanitizer, which cannot start programs with resolvers, and not if a test defines
// PLIANT_ONE_VERSION.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__) && \
    !defined(PLIANT_ONE_VERSION)
#define PLIANT_HAS_VERSIONS 1
#define PLIANT_MULTIVERSION __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define PLIANT_HAS_VERSIONS 0
#define PLIANT_MULTIVERSION
#endif

// Functions called by such a function must be inlined.
#define PLIANT_INLINE [[gnu::always_inline]] inline
/// The same for a lambda, after its parameters.
#define PLIANT_INLINE_LAMBDA __attribute__((always_inline))

namespace pliant::simd {

/// Whether functions marked PLIANT_MULTIVERSION run on vectors of four numbers here. Without them they are correct, but
/// slower than plain loops.
inline bool fast() {
#if defined(__AVX2__)
  return true;
#elif PLIANT_HAS_VERSIONS
  static const bool wide = __builtin_cpu_supports("x86-64-v3");
  return wide;
#else
  return false;
#endif
}

#if PLIANT_HAS_VERSIONS
template <class Body>
[[gnu::target("arch=x86-64-v4")]] void run_v4(const Body& body) {
  body();
}
template <class Body>
[[gnu::target("arch=x86-64-v3")]] void run_v3(const Body& body) {
  body();
}
#endif

/// Runs body(), an inlined lambda, with the best instruction set of the machine, where fast(). Without versions for
/// other machines, for which vectors of four numbers take longer to compile than for both others.
template <class Body>
void run_fast(const Body& body) {
#if PLIANT_HAS_VERSIONS
  static const bool wider = __builtin_cpu_supports("x86-64-v4");
  if (wider) return run_v4(body);
  if (!fast()) throw std::logic_error("a kernel for vectors of four numbers was called on a machine without them");
  run_v3(body);
#else
  body();
#endif
}

}  // namespace pliant::simd
