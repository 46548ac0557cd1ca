// A term that depends on time: the inertial force in a box that vibrates up and down.
#pragma once

#include <cmath>

#include <pliant/model/term.h>

struct Vibration {
  pliant::Real amplitude, frequency;
  pliant::Real height(pliant::Real t) const { return amplitude * std::sin(omega() * t); }
  pliant::Real acceleration(pliant::Real t) const { return -pliant::square(omega()) * height(t); }

 private:
  pliant::Real omega() const { return 2 * pliant::pi * frequency; }
};

/// U = Σ m a(t) y in the frame in which the box rests, a the acceleration of its floor: weights become m (1 + a). That
/// is exact. Elements: points.
struct Inertia {
  using View = pliant::StateView<2>;
  using Real = pliant::Real;
  using Index = pliant::Index;
  Vibration floor;

  static constexpr pliant::Elements elements = pliant::Elements::points;
  static std::string_view name() { return "inertia"; }
  bool enabled(const View&) const { return floor.amplitude > 0; }
  Real energy(const View& s, Index i) const { return weight(s, i) * s.position(i)[1]; }
  template <class G>
  void add_gradient(const View& s, Index i, G& gradient) const {
    gradient.add(i, pliant::Vec<2>(0, weight(s, i)));
  }
  void add_hessian(const View&, Index, pliant::BlockSink<2>&) const {}
  Real max_rate(const pliant::Topology&) const { return 0; }

 private:
  Real weight(const View& s, Index i) const { return s.topology.mass(i) * floor.acceleration(s.t); }
};

/// Its forces with one sine for all points of a chunk: the plain loop takes one for each, which is most of a step.
struct InertiaKernel {
  static constexpr bool fast() { return true; }
  static void add_forces(const pliant::StateView<2>& s, pliant::Index chunk, pliant::Real* f, const Inertia& inertia) {
    const pliant::Real a = inertia.floor.acceleration(s.t);
    const pliant::Range own = s.neighbours.points(chunk);
    for (pliant::Index i = own.first; i < own.last; ++i) f[2 * i + 1] -= s.topology.mass(i) * a;
  }
};
