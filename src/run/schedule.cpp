#include <pliant/run/schedule.h>

#include <algorithm>
#include <limits>

namespace pliant {

void Schedule::done(Real t) {
  constexpr Real countable = 1e15;
  last_ = t;
  // The quotient is right to rounding; the rest decides by the same comparison as due(). Beyond counting, whatever the
  // interval, every step is due.
  const Real quotient = std::min(t / interval_, countable);
  next_ = std::max(next_, static_cast<std::int64_t>(quotient));
  if (quotient < countable)
    while (due(t)) ++next_;
}

void Schedule::save(CheckpointWriter& c, const std::string& name) const {
  c.add(name, last_);
  c.add(name + "_interval", interval_);
  c.add(name + "_longest_interval", longest_);
  c.add(name + "_interval_changed", changed_);
}

void Schedule::load(const Checkpoint& c, const std::string& name) {
  constexpr Real shortest = std::numeric_limits<Real>::denorm_min();
  const Real last = c.real(name, c.step == 0 ? -1 : 0, c.t),
             before = c.real_or(name + "_interval", interval_, shortest),
             longest = c.real_or(name + "_longest_interval", before, before);
  changed_ = before != interval_ || c.integer_or(name + "_interval_changed", 0, 0, 1) != 0;
  longest_ = std::max(interval_, longest);
  if (last < 0) return;  // not yet
  Schedule then(before);
  then.done(last);
  if (last < c.t && then.due(c.t))
    c.refuse("{} = {}, but by the time {} another one was due at {}", name, last, c.t, then.time_of(then.next_));
  done(before == interval_ ? last : c.t);  // where the interval is another, times before the checkpoint are past
  last_ = last;
}

bool EvenSamples::take(Real t) {
  if (all_) return true;
  if (!due_.due(t)) return false;
  due_.done(t);
  return true;
}

Series even_rows(const Series& series, EvenSamples even) {
  std::vector<std::uint64_t> rows;
  const std::vector<Real>& time = series.at("time").values;
  for (std::uint64_t row = 0; row < time.size(); ++row)
    if (even.take(time[row])) rows.push_back(row);
  if (rows.size() == time.size()) return series;
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
  return picked;
}

}  // namespace pliant
