#include <pliant/run/memory.h>

#include <fmt/format.h>
#include <mpi.h>
#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <limits>

#include <pliant/base/errors.h>
#include <pliant/base/types.h>

namespace pliant {
namespace {

constexpr Real unlimited = std::numeric_limits<Real>::infinity();

/// The number that follows `key` in a file of lines "key number …", or the first word of the file; infinite without
/// one.
Real number_in(const char* file, const std::string& key = {}) {
  std::ifstream in(file);
  std::string word;
  while (!key.empty() && in >> word && word != key) {
  }
  Real value = 0;
  return in >> value ? value : unlimited;
}

int ranks_of_this_machine(const Ranks& ranks) {
  if (!ranks.several()) return 1;
  MPI_Comm here = MPI_COMM_NULL;
  MPI_Comm_split_type(ranks.comm(), MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &here);
  int size = 1;
  MPI_Comm_size(here, &size);
  MPI_Comm_free(&here);
  return size;
}

}  // namespace

Real least_memory(const RunSize& size) {
  // Measured: the growth of the largest resident size from small runs to larger ones, rounded down.
  constexpr Real per_particle = 250, per_coordinate = 90;
  return per_particle * static_cast<Real>(size.particles) + per_coordinate * size.dim * static_cast<Real>(size.points);
}

Real available_memory() {
  Real available = 1024 * number_in("/proc/meminfo", "MemAvailable:");
  const Real group = number_in("/sys/fs/cgroup/memory.max"), used = number_in("/sys/fs/cgroup/memory.current");
  if (group < unlimited && used < unlimited) available = std::min(available, std::max(group - used, 0.0));
  rlimit limit{};
  constexpr Real kilo = 1024;
  if (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY)
    available = std::min(
        available, std::max(static_cast<Real>(limit.rlim_cur) - kilo * number_in("/proc/self/status", "VmSize:"), 0.0));
  return available;
}

void check_memory(const RunSize& size, const std::string& options, const Ranks& ranks) {
  constexpr std::int64_t most = std::numeric_limits<Index>::max();
  if (size.points > most / (2 * size.dim))
    throw InputError("{}: the system has {} points, and the limit is {}; use fewer", options, size.points,
                     most / (2 * size.dim));
  constexpr Real giga = 1e9;
  const int here = ranks_of_this_machine(ranks);
  const Real needed = least_memory(size) * here, available = ranks.min(available_memory());
  if (needed > available)
    throw InputError(
        "{}: the run needs {:.3g} GB of memory or more{}, and {:.3g} GB are available; use fewer particles", options,
        needed / giga, here > 1 ? fmt::format(" on {} ranks of this machine", here) : "", available / giga);
}

}  // namespace pliant
