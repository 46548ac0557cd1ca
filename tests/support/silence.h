// Hides the output of runs in tests.
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>

namespace pliant::test {

/// Discards standard output and error.
class Silence {
 public:
  Silence() {
    std::fflush(stdout);
    const int nowhere = ::open("/dev/null", O_WRONLY);
    for (const int stream : {1, 2}) {
      saved_[stream] = ::dup(stream);
      ::dup2(nowhere, stream);
    }
    ::close(nowhere);
  }
  ~Silence() {
    std::fflush(stdout);
    for (const int stream : {1, 2}) {
      ::dup2(saved_[stream], stream);
      ::close(saved_[stream]);
    }
  }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;

 private:
  int saved_[3];
};

}  // namespace pliant::test
