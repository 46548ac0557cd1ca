// What moves: positions, velocities, accelerations and the time.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <pliant/base/large_pages.h>
#include <pliant/base/types.h>

namespace pliant {

/// x, v, a of one length: dim · points numbers each (x0 y0 [z0] x1 …).
class State {
 public:
  State() = default;
  State(Index points, int dim) { resize(static_cast<std::size_t>(points) * dim); }

  /// The same time and step with other points: x, v, a of one length.
  void assign(std::span<const Real> x, std::span<const Real> v, std::span<const Real> a) {
    resize(x.size());
    x_.assign(x.begin(), x.end());
    v_.assign(v.begin(), v.end());
    a_.assign(a.begin(), a.end());
  }

  Real t = 0;             ///< time in t0
  std::int64_t step = 0;  ///< accepted steps so far; a fixed step's time is t = step · dt

  std::size_t size() const { return a_.size(); }  ///< length of x
  std::span<Real> x() { return {x_.data(), size()}; }
  std::span<Real> v() { return v_; }
  std::span<Real> a() { return a_; }  ///< acceleration that the fixed-step path carries from step to step
  std::span<const Real> x() const { return {x_.data(), size()}; }
  std::span<const Real> v() const { return v_; }
  std::span<const Real> a() const { return a_; }

  /// Takes the positions in `next`, which may be longer, and leaves there the old ones: saves an integrator a copy.
  void swap_x(std::vector<Real>& next) { x_.swap(next); }

 private:
  void resize(std::size_t n) {
    for (auto* values : {&x_, &v_, &a_}) resize_large(*values, n);
  }

  std::vector<Real> x_, v_, a_;
};

}  // namespace pliant
