// State of a simulation: positions, velocities and the time.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <pliant/base/large_pages.h>
#include <pliant/base/types.h>
#include <pliant/geometry/box.h>

namespace pliant {

/// Numbers per point among the coordinates of a system: first the positions of all points, then the angles, if
/// particles rotate.
struct Coordinates {
  int positions, angles = 0;
  int all() const { return positions + angles; }
};

/// x and v of one length: dim · points numbers each (x0 y0 [z0] x1 …), and behind them angles and spins where particles
/// rotate.
class State {
 public:
  State() = default;
  State(Index points, int dim) { resize(static_cast<std::size_t>(points) * dim); }

  /// The same time and step with other points: arrays of one length.
  void assign(std::span<const Real> x, std::span<const Real> v) {
    resize(x.size());
    x_.assign(x.begin(), x.end());
    v_.assign(v.begin(), v.end());
  }

  Real t = 0;             ///< time in t0
  std::int64_t step = 0;  ///< accepted steps so far; a fixed step's time is t = step · dt

  std::size_t size() const { return v_.size(); }  ///< length of x
  std::span<Real> x() { return {x_.data(), size()}; }
  std::span<Real> v() { return v_; }
  std::span<const Real> x() const { return {x_.data(), size()}; }
  std::span<const Real> v() const { return v_; }

  /// Swaps the arrays with the given ones, which may be longer: saves an integrator a copy.
  void swap_x(std::vector<Real>& next) { x_.swap(next); }

  /// [particles] by how many lengths of the periodic box each was wrapped into it: x + lengths is where it would be
  /// otherwise. Empty: none was.
  std::vector<Image> images;
  std::vector<Real> extra;  ///< unknowns of a first-order system on this rank, in addition to the coordinates

 private:
  void resize(std::size_t n) {
    for (auto* values : {&x_, &v_}) resize_large(*values, n);
  }

  std::vector<Real> x_, v_;
};

}  // namespace pliant
