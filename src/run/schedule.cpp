#include <pliant/run/schedule.h>

#include <algorithm>
#include <limits>

namespace pliant {

void Schedule::done(Real t) {
  constexpr Real countable = 1e15;
  last_ = t;
  // The quotient is right to rounding; the rest decides by the same comparison as due(). Beyond the range of the
  // counter every step is due, for any interval.
  const Real quotient = std::min(t / interval_, countable);
  next_ = std::max(next_, static_cast<std::int64_t>(quotient));
  if (quotient < countable)
    while (due(t)) ++next_;
}

void Schedule::visit(Archive& a, const std::string& name) {
  constexpr Real shortest = std::numeric_limits<Real>::denorm_min();
  Real last = last_, interval = interval_, longest = longest_;
  a.number(name, last, a.reads() && a.from().step > 0 ? 0 : -1, a.t());
  a.newer(name + "_interval", interval, shortest);
  if (a.reads()) longest = interval;
  a.newer(name + "_longest_interval", longest, interval);
  a.newer(name + "_interval_changed", changed_, 0, 1);
  if (!a.reads()) return;
  longest_ = std::max(interval_, longest);
  changed_ = changed_ || interval != interval_;
  if (last >= 0) restore(a.from(), name, last, interval);
}

/// last: when it was done last, by a schedule of this interval.
void Schedule::restore(const Checkpoint& from, const std::string& name, Real last, Real interval) {
  Schedule then(interval);
  then.done(last);
  if (last < from.t && then.due(from.t))
    from.refuse("{} = {}, but by the time {} another one was due at {}", name, last, from.t, then.time_of(then.next_));
  done(interval == interval_ ? last : from.t);  // where the interval is another, times before the checkpoint are past
  last_ = last;
}

bool EvenSamples::take(Real t) {
  if (all_) return true;
  if (!due_.due(t)) return false;
  due_.done(t);
  return true;
}

namespace {

/// Whether steps of various lengths, some longer than the interval of the samples, are the reason for its spacing.
bool follows_the_steps(const std::vector<Real>& time, const std::vector<Real>& dt, Real interval) {
  if (time.size() < 3) return false;
  const auto [least, most] = std::minmax_element(dt.begin() + 1, dt.end() - 1);
  return *most > interval * (1 + 1e-9) && *most > *least * (1 + 1e-9);
}

/// For times at equal distances, as many as the rows, the first row at or after each.
std::vector<std::uint64_t> rows_at_equal_distances(const std::vector<Real>& time, std::vector<Real>& at) {
  const auto n = static_cast<Real>(time.size() - 1);
  std::vector<std::uint64_t> rows;
  std::uint64_t row = 0;
  for (std::size_t k = 0; k < time.size(); ++k) {
    at.push_back(time.front() + (time.back() - time.front()) * static_cast<Real>(k) / n);
    while (row + 1 < time.size() && time[row] < at.back()) ++row;
    rows.push_back(row);
  }
  return rows;
}

}  // namespace

Series even_rows(const Series& series, EvenSamples even) {
  std::vector<std::uint64_t> rows;
  std::vector<Real> at;
  const std::vector<Real>& time = series.at("time").values;
  if (follows_the_steps(time, series.at("dt").values, even.interval())) {
    rows = rows_at_equal_distances(time, at);
  } else {
    for (std::uint64_t row = 0; row < time.size(); ++row)
      if (even.take(time[row])) rows.push_back(row);
    if (rows.size() == time.size()) return series;
  }
  Series picked;
  for (const auto& [name, column] : series) {
    SeriesColumn& to = picked[name];
    to.rows = rows.size();
    to.width = column.width;
    for (const std::uint64_t row : rows) {
      const auto from = column.values.begin() + static_cast<std::ptrdiff_t>(row * column.width);
      to.values.insert(to.values.end(), from, from + static_cast<std::ptrdiff_t>(column.width));
    }
  }
  if (!at.empty()) picked.at("time").values = std::move(at);
  return picked;
}

}  // namespace pliant
