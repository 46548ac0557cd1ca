// Exceptions must not leave a parallel region.
#pragma once

#include <exception>

namespace pliant {

/// Keeps one exception of the threads of a parallel region, for the thread that continues after the region.
class ParallelErrors {
 public:
  template <class Body>
  void catch_from(Body&& body) noexcept {
    try {
      body();
    } catch (...) {
#pragma omp critical(pliant_parallel_errors)
      if (!error_) error_ = std::current_exception();
    }
  }
  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  std::exception_ptr error_;
};

}  // namespace pliant
