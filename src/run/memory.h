// Whether the memory of the machine holds a run, before it is made.
#pragma once

#include <cstdint>
#include <string>

#include <pliant/base/ranks.h>

namespace pliant {

struct RunSize {
  std::int64_t particles = 0, points = 0;
  int dim = 2;
};

/// Bytes that a run of this size takes at the least, on each rank: every rank makes all particles at the start.
Real least_memory(const RunSize& size);

/// Bytes that this process can still get: the memory available in the system, and the limits of the process and of its
/// control group. Infinite where none is known.
Real available_memory();

/// options: names of the options that set the size, for messages. Errors: InputError if the ranks of this machine
/// together need more memory than available, or if there are more coordinates than can be numbered. Collective.
void check_memory(const RunSize& size, const std::string& options, const Ranks& ranks);

}  // namespace pliant
