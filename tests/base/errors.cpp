#include <pliant/base/errors.h>
#include <pliant/base/ranks.h>

#include <catch2/catch.hpp>
#include <limits>
#include <memory>
#include <new>
#include <stdexcept>
#include <vector>

// Sanitizers end the program where an allocation fails.
#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define PLIANT_SANITIZED
#endif
#elif defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define PLIANT_SANITIZED
#endif

namespace pliant::test::errors_test {
namespace {

template <class Body>
Error error_of(Body&& body) {
  try {
    body();
  } catch (...) {
    return error_in_flight();
  }
  throw std::logic_error("no exception");
}

}  // namespace

#ifndef PLIANT_SANITIZED
TEST_CASE("an allocation that fails is an error with its size and the memory in use") {
  constexpr std::size_t most = std::numeric_limits<std::ptrdiff_t>::max() / 2;
  const Error error = error_of([] { std::vector<char> memory(most); });
  CHECK(error.code() == ExitCode::out_of_memory);
  const std::string message = error.what();
  CHECK_THAT(message, Catch::Matchers::StartsWith("out of memory: 4.61e+09 GB could not be allocated while "));
  CHECK_THAT(message, Catch::Matchers::Contains("MB were in use; free memory on this machine"));
}
#endif

TEST_CASE("an allocation that others refuse is an error without its size") {
  CHECK_THAT(error_of([] { throw std::bad_alloc(); }).what(),
             Catch::Matchers::StartsWith("out of memory: an array could not be allocated"));
}

TEST_CASE("other exceptions keep their code, or are internal") {
  const Error input = error_of([] { throw InputError("-n {}: too few", 3); });
  CHECK(input.code() == ExitCode::bad_input);
  CHECK(input.what() == std::string("-n 3: too few"));
  const Error internal = error_of([] { throw std::logic_error("a mistake"); });
  CHECK(internal.code() == ExitCode::numerical_failure);
  CHECK(internal.what() == std::string("internal: a mistake"));
  CHECK(error_of([] { throw 7; }).code() == ExitCode::numerical_failure);
}

}  // namespace pliant::test::errors_test
