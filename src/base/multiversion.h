// Functions compiled for several instruction sets; the loader selects the best set that the machine has.
#pragma once
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

namespace pliant::simd {

/// Whether functions marked PLIANT_MULTIVERSION run on vectors of four numbers here. Without them they are correct, but
/// slower than plain loops.
inline bool fast() {
#if defined(__AVX2__)
  return true;
#elif PLIANT_HAS_VERSIONS
  static const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return avx2;
#else
  return false;
#endif
}

}  // namespace pliant::simd

// Functions called by such a function must be inlined.
#define PLIANT_INLINE [[gnu::always_inline]] inline
/// The same for a lambda, after its parameters.
#define PLIANT_INLINE_LAMBDA __attribute__((always_inline))
