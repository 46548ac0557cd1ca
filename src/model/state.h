// What moves: positions, velocities and the time.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <pliant/base/large_pages.h>
#include <pliant/base/types.h>

namespace pliant {

/// x, v, predicted of one length: dim · points numbers each (x0 y0 [z0] x1 …).
class State {
 public:
  State() = default;
  State(Index points, int dim) { resize(static_cast<std::size_t>(points) * dim); }

  /// The same time and step with other points: arrays of one length.
  void assign(std::span<const Real> x, std::span<const Real> v, std::span<const Real> predicted) {
    resize(x.size());
    x_.assign(x.begin(), x.end());
    v_.assign(v.begin(), v.end());
    predicted_.assign(predicted.begin(), predicted.end());
  }

  Real t = 0;             ///< time in t0
  std::int64_t step = 0;  ///< accepted steps so far; a fixed step's time is t = step · dt

  std::size_t size() const { return v_.size(); }  ///< length of x
  std::span<Real> x() { return {x_.data(), size()}; }
  std::span<Real> v() { return v_; }
  std::span<Real> predicted() { return {predicted_.data(), size()}; }  ///< velocities that FixedStepVerlet foresees
  std::span<const Real> x() const { return {x_.data(), size()}; }
  std::span<const Real> v() const { return v_; }
  std::span<const Real> predicted() const { return {predicted_.data(), size()}; }

  /// Take numbers that may be more, and leave the old ones there: save an integrator copies.
  void swap_x(std::vector<Real>& next) { x_.swap(next); }
  void swap_predicted(std::vector<Real>& next) { predicted_.swap(next); }

 private:
  void resize(std::size_t n) {
    for (auto* values : {&x_, &v_, &predicted_}) resize_large(*values, n);
  }

  std::vector<Real> x_, v_, predicted_;
};

}  // namespace pliant
