// When which plunger moves, counted in steps.
#pragma once

#include <cstdint>

#include <pliant/base/types.h>

namespace pliant {

/// The schedule as given by the user.
struct PushOptions {
  Real stroke = 10.7;        ///< cm
  Real speed = 1.1;          ///< cm/s
  Real retract_speed = 0;    ///< cm/s; 0: at once
  Real pause = 0;            ///< s, after the retraction
  Real frame_travel = 0.11;  ///< cm between frames
};

enum class PushPhase {
  push,     ///< the plunger advances
  hold,     ///< the plunger rests at the end of its stroke, for one step
  retract,  ///< the plunger moves back
  rest      ///< all are in their places of rest
};

/// The plungers act in turn, each from its rest position over the stroke and back. Frames of a push are a whole number
/// of steps apart and include both ends of the stroke; therefore steps and the travel between frames are slightly
/// shorter or longer than requested. All quantities are functions of the step number.
class PushSchedule {
 public:
  /// longest_dt: no step is longer. Errors: InputError for more steps than can be counted.
  PushSchedule(const PushOptions& p, Real longest_dt);

  Real dt() const { return dt_; }
  std::int64_t frames() const { return frames_; }  ///< of a push, that at travel 0 aside
  Real frame_travel() const { return stroke_ / static_cast<Real>(frames_); }
  std::int64_t steps_of_push() const { return frames_ * steps_of_frame_; }
  /// Steps from the beginning of a push to the beginning of the next push.
  std::int64_t period() const { return steps_of_push() + 1 + retract_steps_ + rest_steps_; }
  /// The step at which the stroke of push p ends.
  std::int64_t end_of_push(std::int64_t p) const { return p * period() + steps_of_push(); }

  std::int64_t push_at(std::int64_t step) const { return step / period(); }
  PushPhase phase_at(std::int64_t step) const;
  /// The step at which that phase began.
  std::int64_t phase_begin(std::int64_t step) const;
  /// Distance of the plunger from its rest position.
  Real travel_at(std::int64_t step) const;
  /// Of the plunger, into the channel, in the phase after this step.
  Real velocity_at(std::int64_t step) const;
  /// Whether the stroke is under way or at its end.
  bool in_stroke(std::int64_t step) const { return step % period() <= steps_of_push(); }
  /// Whether a frame is due.
  bool frame_at(std::int64_t step) const { return in_stroke(step) && step % period() % steps_of_frame_ == 0; }

 private:
  Real stroke_, dt_;
  std::int64_t frames_, steps_of_frame_, retract_steps_, rest_steps_;
};

}  // namespace pliant
