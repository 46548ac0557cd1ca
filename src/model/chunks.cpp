#include <pliant/model/chunks.h>

#include <omp.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <exception>

namespace pliant {
namespace {

constexpr Index most_shares = 64;
struct alignas(64) Taken {
  std::atomic<Index> count = 0;
};

}  // namespace

void for_each_chunk(Index chunks, const std::function<void(Index)>& visit) {
  if (chunks == 1) return visit(0);
  Index failed = chunks;
  std::exception_ptr error;
  const auto attempt = [&](Index c) {
    try {
      visit(c);
    } catch (...) {
#pragma omp critical
      if (c < failed) {
        failed = c;
        error = std::current_exception();
      }
    }
  };
  // Each thread starts with the same share in every step, whose data are in its caches, and then helps the other
  // threads.
  std::array<Taken, most_shares> taken;
#pragma omp parallel
  {
    const Index shares = std::min<Index>(omp_get_num_threads(), most_shares);
    for (Index k = 0; k < shares; ++k) {
      const Index share = (omp_get_thread_num() + k) % shares, first = chunks * share / shares,
                  last = chunks * (share + 1) / shares;
      for (Index c = first + taken[share].count++; c < last; c = first + taken[share].count++) attempt(c);
    }
  }
  if (error) std::rethrow_exception(error);
}

}  // namespace pliant
