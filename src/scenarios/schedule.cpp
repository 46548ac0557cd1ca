#include <pliant/scenarios/schedule.h>

#include <algorithm>

namespace pliant {

void Schedule::done(Real t) {
  last_ = t;
  next_ = std::max(next_, static_cast<std::int64_t>(t / interval_));
  while (due(t)) ++next_;
}

void Schedule::load(const Checkpoint& c, const std::string& name) {
  const Real last = c.real(name, 0, c.t);
  if (c.t / interval_ > 1e15) c.refuse("time = {} is beyond counting in intervals of {}", c.t, interval_);
  done(last);
  if (due(c.t)) c.refuse("{} = {}, but by the time {} another one was due at {}", name, last, c.t, time_of(next_));
}

}  // namespace pliant
