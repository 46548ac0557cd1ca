// What moves: positions, velocities, accelerations and the time, in arrays that a PETSc Vec can wrap without a copy.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

/// One array y = [x; v] of 2 · dim · points numbers (x0 y0 [z0] x1 …), so that the first-order system of a PETSc TS and
/// the second-order one of velocity Verlet share their memory.
class State {
 public:
  State() = default;
  State(Index points, int dim) : y_(2 * static_cast<std::size_t>(points) * dim), a_(y_.size() / 2) {}

  /// The same time and step with other points: x, v, a of one length.
  void assign(std::span<const Real> x, std::span<const Real> v, std::span<const Real> a) {
    y_.assign(x.begin(), x.end());
    y_.insert(y_.end(), v.begin(), v.end());
    a_.assign(a.begin(), a.end());
  }

  Real t = 0;             ///< time in t0
  std::int64_t step = 0;  ///< accepted steps so far; a fixed step's time is t = step · dt

  std::size_t size() const { return a_.size(); }  ///< length of x
  std::span<Real> x() { return {y_.data(), size()}; }
  std::span<Real> v() { return {y_.data() + size(), size()}; }
  std::span<Real> a() { return a_; }  ///< acceleration that the fixed-step path carries from step to step
  std::span<Real> y() { return y_; }
  std::span<const Real> x() const { return {y_.data(), size()}; }
  std::span<const Real> v() const { return {y_.data() + size(), size()}; }
  std::span<const Real> a() const { return a_; }
  std::span<const Real> y() const { return y_; }

 private:
  std::vector<Real> y_, a_;
};

}  // namespace pliant
