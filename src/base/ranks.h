// The MPI ranks of a run: sums, gathers and exchanges of plain data. With one rank these functions copy.
#pragma once

#include <mpi.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/base/types.h>

namespace pliant {

/// All functions but rank(), size(), root() and comm() are collective: every rank must call them, in the same order.
/// MPI errors abort, as is MPI's default.
class Ranks {
 public:
  explicit Ranks(MPI_Comm comm = MPI_COMM_SELF) : comm_(comm) {
    if (comm == MPI_COMM_SELF) return;  // also before MPI is started
    MPI_Comm_rank(comm, &rank_);
    MPI_Comm_size(comm, &size_);
  }

  MPI_Comm comm() const { return comm_; }
  int rank() const { return rank_; }
  int size() const { return size_; }
  bool root() const { return rank_ == 0; }
  bool several() const { return size_ > 1; }

  void sum(std::span<Real> values) const { reduce(values.data(), values.size(), MPI_DOUBLE, MPI_SUM); }
  Real sum(Real value) const { return reduced(value, MPI_DOUBLE, MPI_SUM); }
  std::int64_t sum(std::int64_t value) const { return reduced(value, MPI_INT64_T, MPI_SUM); }
  void max(std::span<Real> values) const { reduce(values.data(), values.size(), MPI_DOUBLE, MPI_MAX); }
  Real max(Real value) const { return reduced(value, MPI_DOUBLE, MPI_MAX); }
  int max(int value) const { return reduced(value, MPI_INT, MPI_MAX); }
  Real min(Real value) const { return -max(-value); }
  bool any(bool value) const { return max(value ? 1 : 0) != 0; }
  bool all(bool value) const { return !any(!value); }

  /// Whether all ranks come here within a time.
  bool meet(std::chrono::milliseconds patience) const {
    if (!several()) return true;
    MPI_Request request;
    MPI_Ibarrier(comm_, &request);
    const auto until = std::chrono::steady_clock::now() + patience;
    for (int done = 0; std::chrono::steady_clock::now() < until;) {
      MPI_Test(&request, &done, MPI_STATUS_IGNORE);
      if (done != 0) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  }

  /// The value of rank `from`.
  template <class T>
  T broadcast(T value, int from = 0) const {
    static_assert(std::is_trivially_copyable_v<T>);
    if (several()) MPI_Bcast(&value, sizeof value, MPI_BYTE, from, comm_);
    return value;
  }
  template <class T>
  void broadcast(std::vector<T>& values, int from = 0) const {
    static_assert(std::is_trivially_copyable_v<T>);
    if (!several()) return;
    values.resize(broadcast(values.size(), from));
    MPI_Bcast(values.data(), bytes<T>(values.size()), MPI_BYTE, from, comm_);
  }

  /// The ranks' parts one after the other, on the root; empty elsewhere.
  template <class T>
  std::vector<T> gather(std::span<const T> part) const {
    static_assert(std::is_trivially_copyable_v<T>);
    if (!several()) return {part.begin(), part.end()};
    const int mine = bytes<T>(part.size());
    std::vector<int> count(root() ? size_ : 0), start(count.size());
    MPI_Gather(&mine, 1, MPI_INT, count.data(), 1, MPI_INT, 0, comm_);
    std::vector<T> all(place<T>(count, start));
    MPI_Gatherv(part.data(), mine, MPI_BYTE, all.data(), count.data(), start.data(), MPI_BYTE, 0, comm_);
    return all;
  }
  template <class T>
  std::vector<T> gather(const std::vector<T>& part) const {
    return gather(std::span<const T>(part));
  }

  template <class T>
  std::vector<T> gather(std::vector<T>&& part) const {
    return several() ? gather(std::span<const T>(part)) : std::move(part);
  }

  /// The ranks' parts one after the other, on every rank.
  template <class T>
  std::vector<T> all_gather(const std::vector<T>& part) const {
    static_assert(std::is_trivially_copyable_v<T>);
    if (!several()) return part;
    const int mine = bytes<T>(part.size());
    std::vector<int> count(size_), start(size_);
    MPI_Allgather(&mine, 1, MPI_INT, count.data(), 1, MPI_INT, comm_);
    std::vector<T> all(place<T>(count, start));
    MPI_Allgatherv(part.data(), mine, MPI_BYTE, all.data(), count.data(), start.data(), MPI_BYTE, comm_);
    return all;
  }

  /// The first count[0] values go to the root, the next count[1] to rank 1, and so on; the received values come in the
  /// order of the senders, `received` entries from each.
  template <class T>
  std::vector<T> exchange(std::vector<T>&& values, const std::vector<std::size_t>& count,
                          std::vector<int>* received = nullptr) const {
    static_assert(std::is_trivially_copyable_v<T>);
    if (!several()) {
      if (received != nullptr) received->assign(1, static_cast<int>(values.size()));
      return std::move(values);
    }
    std::vector<int> send_count(size_), send_start(size_), receive_count(size_), start(size_);
    for (int r = 0; r < size_; ++r) send_count[r] = bytes<T>(count[r]);
    place<T>(send_count, send_start);
    MPI_Alltoall(send_count.data(), 1, MPI_INT, receive_count.data(), 1, MPI_INT, comm_);
    std::vector<T> all(place<T>(receive_count, start));
    MPI_Alltoallv(values.data(), send_count.data(), send_start.data(), MPI_BYTE, all.data(), receive_count.data(),
                  start.data(), MPI_BYTE, comm_);
    if (received != nullptr) {
      received->resize(size_);
      for (int r = 0; r < size_; ++r) (*received)[r] = receive_count[r] / static_cast<int>(sizeof(T));
    }
    return all;
  }
  /// As above; parts[r] goes to rank r.
  template <class T>
  std::vector<T> exchange(const std::vector<std::vector<T>>& parts, std::vector<int>* received = nullptr) const {
    std::vector<T> packed;
    std::vector<std::size_t> count;
    for (const std::vector<T>& part : parts) {
      packed.insert(packed.end(), part.begin(), part.end());
      count.push_back(part.size());
    }
    return exchange(std::move(packed), count, received);
  }

  /// Runs body() on every rank that calls it; if it throws on any of them, all throw the error of the first of these.
  void together(const std::function<void()>& body) const;

  /// Runs body() on the root; its error is everybody's.
  void on_root(const std::function<void()>& body) const;

 private:
  template <class T>
  static int bytes(std::size_t count) {
    const std::size_t size = count * sizeof(T);
    if (size > static_cast<std::size_t>(std::numeric_limits<int>::max()))
      throw NumericalError("a message of {} bytes between ranks is beyond MPI's limit; use more ranks", size);
    return static_cast<int>(size);
  }
  /// Fills start from count, both in bytes; the sum in units of T.
  template <class T>
  static std::size_t place(const std::vector<int>& count, std::vector<int>& start) {
    std::size_t sum = 0;
    for (std::size_t r = 0; r < count.size(); ++r) {
      start[r] = bytes<char>(sum);
      sum += count[r];
    }
    bytes<char>(sum);
    return sum / sizeof(T);
  }
  template <class T>
  void reduce(T* values, std::size_t count, MPI_Datatype type, MPI_Op op) const {
    if (several()) MPI_Allreduce(MPI_IN_PLACE, values, static_cast<int>(count), type, op, comm_);
  }
  template <class T>
  T reduced(T value, MPI_Datatype type, MPI_Op op) const {
    reduce(&value, 1, type, op);
    return value;
  }

  MPI_Comm comm_;
  int rank_ = 0, size_ = 1;
};

}  // namespace pliant
