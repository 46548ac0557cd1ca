// Messages between ranks. Run on one rank with all tests of the folder, on several by those with the tag.
#include <petscsys.h>
#include <catch2/catch.hpp>

#include <pliant/base/ranks.h>

namespace pliant::test::ranks_test {

namespace {

struct Record {
  int from;
  Real value;
  bool operator==(const Record&) const = default;
};

}  // namespace

TEST_CASE("sums and extremes over ranks", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  const int n = ranks.size(), r = ranks.rank();
  CHECK(ranks.several() == (n > 1));
  CHECK(ranks.root() == (r == 0));
  CHECK(ranks.sum(Real(r + 1)) == n * (n + 1) / 2);
  CHECK(ranks.sum(std::int64_t(1) << 40) == std::int64_t(n) << 40);
  std::vector<Real> values{1, Real(r), -Real(r)};
  ranks.sum(values);
  CHECK(values == std::vector<Real>{Real(n), n * (n - 1) / 2.0, -n * (n - 1) / 2.0});
  values = {Real(r), -Real(r), 0.5};
  ranks.max(values);
  CHECK(values == std::vector<Real>{Real(n - 1), 0, 0.5});
  CHECK(ranks.max(r) == n - 1);
  CHECK(ranks.max(-1.5 - r) == -1.5);
  CHECK(ranks.min(-1.5 - r) == -1.5 - (n - 1));
  CHECK(ranks.any(r == n - 1));
  CHECK(!ranks.any(false));
  CHECK(ranks.all(true));
  CHECK(!ranks.all(r != n - 1));
  CHECK(ranks.meet(std::chrono::seconds(20)));
}

TEST_CASE("gathers come in the order of the ranks, with parts of any length", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  const int n = ranks.size(), r = ranks.rank();
  // The first rank has nothing.
  std::vector<Record> mine, all;
  for (int k = 0; k < r; ++k) mine.push_back({r, 10.0 * r + k});
  for (int from = 0; from < n; ++from)
    for (int k = 0; k < from; ++k) all.push_back({from, 10.0 * from + k});
  CHECK(ranks.all_gather(mine) == all);
  CHECK(ranks.gather(mine) == (ranks.root() ? all : std::vector<Record>{}));
  CHECK(ranks.all_gather(std::vector<Record>{}).empty());
}

TEST_CASE("broadcasts from any rank", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  const int r = ranks.rank();
  for (int from = 0; from < ranks.size(); ++from) {
    CHECK(ranks.broadcast(Record{r, 0.5 * r}, from) == Record{from, 0.5 * from});
    std::vector<int> values(2 * r + 1, r);  // a different length on each rank
    ranks.broadcast(values, from);
    CHECK(values == std::vector<int>(2 * from + 1, from));
  }
  CHECK(ranks.broadcast(r) == 0);
}

TEST_CASE("an exchange delivers every part, in the order of the senders", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  const int n = ranks.size(), r = ranks.rank();
  // |sender − receiver| + 1 records, none from the last rank.
  const auto part = [&](int from, int to) {
    std::vector<Record> records;
    if (from < n - 1 || n == 1)
      for (int k = 0; k <= std::abs(from - to); ++k) records.push_back({from, 100.0 * to + k});
    return records;
  };
  std::vector<std::vector<Record>> parts(n);
  for (int to = 0; to < n; ++to) parts[to] = part(r, to);
  std::vector<Record> expected;
  std::vector<int> counts;
  for (int from = 0; from < n; ++from) {
    const std::vector<Record> records = part(from, r);
    expected.insert(expected.end(), records.begin(), records.end());
    counts.push_back(static_cast<int>(records.size()));
  }
  std::vector<int> received;
  CHECK(ranks.exchange(parts, &received) == expected);
  CHECK(received == counts);
  CHECK(ranks.exchange(std::vector<std::vector<int>>(n), &received).empty());
  CHECK(received == std::vector<int>(n, 0));
}

TEST_CASE("an error on one rank is everybody's, with its code and text", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  const int last = ranks.size() - 1;
  const auto what = [&](auto&& body) -> std::pair<ExitCode, std::string> {
    try {
      ranks.together(body);
    } catch (const Error& e) {
      return {e.code(), e.what()};
    }
    return {ExitCode::done, ""};
  };
  CHECK(what([] {}) == std::pair(ExitCode::done, std::string()));
  CHECK(what([&] {
          if (ranks.rank() == last) throw OutputError("rank {} cannot write", last);
        }) == std::pair(ExitCode::output_failure, fmt::format("rank {} cannot write", last)));
  // Several: the first rank's.
  CHECK(what([&] { throw InputError("rank {}", ranks.rank()); }) ==
        std::pair(ExitCode::bad_input, std::string("rank 0")));
  CHECK(what([&] {
          if (ranks.rank() == last) throw NumericalError("{}", "");
        }) == std::pair(ExitCode::numerical_failure, std::string()));
  if (ranks.several())
    CHECK(what([&] {
            if (ranks.rank() == last) throw std::runtime_error("other");
          }) == std::pair(ExitCode::numerical_failure, std::string("internal: other")));
  CHECK(ranks.sum(1.0) == ranks.size());  // all are still in step
}

TEST_CASE("ranks that do not come are not waited for", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  if (!ranks.several()) return;
  // On a copy, so that the barrier that the last rank owes is its own.
  MPI_Comm copy;
  MPI_Comm_dup(ranks.comm(), &copy);
  const Ranks others(copy);
  const bool late = ranks.rank() == ranks.size() - 1;
  bool met = false;
  if (!late) met = others.meet(std::chrono::milliseconds(50));
  CHECK(!met);
  CHECK(ranks.all(true));
  if (late) CHECK(others.meet(std::chrono::seconds(20)));
  ranks.sum(1.0);
}

}  // namespace pliant::test::ranks_test
