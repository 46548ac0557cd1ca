#include <pliant/run/schedule.h>

#include <algorithm>

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

void Schedule::load(const Checkpoint& c, const std::string& name) {
  const Real last = c.real(name, c.step == 0 ? -1 : 0, c.t);
  if (last < 0) return;  // not yet
  done(last);
  if (last < c.t && due(c.t))
    c.refuse("{} = {}, but by the time {} another one was due at {}", name, last, c.t, time_of(next_));
}

}  // namespace pliant
