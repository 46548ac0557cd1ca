#include <pliant/scenarios/channel/push_schedule.h>

#include <algorithm>
#include <cmath>

#include <pliant/base/errors.h>

namespace pliant {
namespace {

/// At least one; a quotient within rounding of a whole number is rounded to it.
std::int64_t up(Real a) { return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(a * (1 - 1e-12)))); }

}  // namespace

PushSchedule::PushSchedule(const PushOptions& p, Real longest_dt) : stroke_(p.stroke) {
  constexpr Real countable = 1e15;
  const Real duration = p.stroke / p.speed;
  if (!(duration / longest_dt < countable) || !(p.pause / longest_dt < countable) ||
      !(p.stroke / p.frame_travel < countable) ||
      !(p.retract_speed == 0 || p.stroke / p.retract_speed / longest_dt < countable))
    throw InputError(
        "a push takes {:g} s, which is too many steps of at most {:.3g} s; use a shorter "
        "-stroke, a higher -plunger_speed or a longer -dt",
        duration, longest_dt);
  frames_ = std::max<std::int64_t>(1, std::lround(p.stroke / p.frame_travel));
  steps_of_frame_ = up(duration / static_cast<Real>(frames_) / longest_dt);
  dt_ = duration / static_cast<Real>(steps_of_push());
  retract_steps_ = p.retract_speed > 0 ? up(p.stroke / p.retract_speed / dt_) : 0;
  rest_steps_ = static_cast<std::int64_t>(std::llround(p.pause / dt_));
}

PushPhase PushSchedule::phase_at(std::int64_t step) const {
  const std::int64_t after = step % period() - steps_of_push();
  if (after < 0) return PushPhase::push;
  if (after == 0) return PushPhase::hold;
  return after <= retract_steps_ ? PushPhase::retract : PushPhase::rest;
}

std::int64_t PushSchedule::phase_begin(std::int64_t step) const {
  const std::int64_t begin = step - step % period();
  switch (phase_at(step)) {
    case PushPhase::push:
      return begin;
    case PushPhase::hold:
      return begin + steps_of_push();
    case PushPhase::retract:
      return begin + steps_of_push() + 1;
    case PushPhase::rest:
      return begin + steps_of_push() + 1 + retract_steps_;
  }
  return begin;
}

Real PushSchedule::travel_at(std::int64_t step) const {
  const auto part = [&](std::int64_t of) {
    return static_cast<Real>(step - phase_begin(step)) / static_cast<Real>(of);
  };
  switch (phase_at(step)) {
    case PushPhase::push:
      return stroke_ * part(steps_of_push());
    case PushPhase::hold:
      return stroke_;
    case PushPhase::retract:
      return stroke_ * (1 - part(retract_steps_));
    case PushPhase::rest:
      return 0;
  }
  return 0;
}

Real PushSchedule::velocity_at(std::int64_t step) const {
  switch (phase_at(step)) {
    case PushPhase::push:
      return stroke_ / (static_cast<Real>(steps_of_push()) * dt_);
    case PushPhase::retract:
      return -stroke_ / (static_cast<Real>(retract_steps_) * dt_);
    default:
      return 0;
  }
}

}  // namespace pliant
