// Disks and spheres that rotate, with terms that only tests have.
#pragma once

#include <cmath>
#include <memory>
#include <string_view>
#include <vector>

#include <pliant/model/pair_contact.h>
#include <pliant/model/wall_contact.h>
#include <pliant/run/simulation.h>
#include <pliant/ts/verlet.h>

#include "support/rows.h"

namespace pliant::test {

template <int D>
Real norm2(const Rotation<D>& r) {
  if constexpr (D == 2)
    return r * r;
  else
    return r.squaredNorm();
}

/// U = Σ k/2 θ².
template <int D>
struct TorsionSpring {
  Real k;
  static constexpr Elements elements = Elements::points;
  static constexpr bool rotates = true;
  static std::string_view name() { return "torsion"; }
  bool enabled(const StateView<D>&) const { return k > 0; }
  Real energy(const StateView<D>& s, Index i) const { return k / 2 * norm2<D>(s.angle(i)); }
  template <class G>
  void add_gradient(const StateView<D>& s, Index i, G& grad) const {
    grad.add_torque(i, Rotation<D>(k * s.angle(i)));
  }
  Real max_rate(const Topology&) const { return 0; }
};

/// U = Σ_pairs k/2 (θ_i − θ_j)² (1 − r/δ)² where they touch.
template <int D>
struct TorsionBond {
  Real k;
  static constexpr Elements elements = Elements::point_pairs;
  static constexpr bool rotates = true;
  static std::string_view name() { return "bond"; }
  bool enabled(const StateView<D>&) const { return k > 0; }
  Real energy(const StateView<D>& s, Index e) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    return k / 2 * norm2<D>(s.angle(i) - s.angle(j)) * square(overlap(s, i, j));
  }
  template <class G>
  void add_gradient(const StateView<D>& s, Index e, G& grad) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    const Real w = overlap(s, i, j);
    if (w == 0) return;
    const pliant::Vec<D> r = s.position(i) - s.position(j);
    const Rotation<D> turn = s.angle(i) - s.angle(j);
    const pliant::Vec<D> pull = -k * norm2<D>(turn) * w / (reach(s, i, j) * r.norm()) * r;
    grad.add(i, pull);
    grad.add(j, -pull);
    grad.add_torque(i, Rotation<D>(k * square(w) * turn));
    grad.add_torque(j, Rotation<D>(-k * square(w) * turn));
  }
  Real max_rate(const Topology&) const { return 0; }

 private:
  static Real reach(const StateView<D>& s, Index i, Index j) {
    return (s.topology.diameter[i] + s.topology.diameter[j]) / 2;
  }
  static Real overlap(const StateView<D>& s, Index i, Index j) {
    return std::max(1 - (s.position(i) - s.position(j)).norm() / reach(s, i, j), 0.0);
  }
};

/// Torque −γ ω.
template <int D>
struct SpinDrag {
  Real gamma;
  static constexpr Elements elements = Elements::points;
  static constexpr bool rotates = true;
  static std::string_view name() { return "spin_drag"; }
  bool enabled(const StateView<D>&) const { return gamma > 0; }
  Real power(const StateView<D>& s, Index i) const { return gamma * norm2<D>(s.spin(i)); }
  template <class F>
  void add_force(const StateView<D>& s, Index i, F& force) const {
    force.add_torque(i, Rotation<D>(-gamma * s.spin(i)));
  }
  Real max_damping(const Topology&) const { return 0; }
};

/// Force −γ × the velocity of the surfaces of touching disks against each other, at a place between the centres.
template <int D>
struct SurfaceDashpot {
  Real gamma;
  static constexpr Elements elements = Elements::point_pairs;
  static constexpr bool rotates = true;
  static std::string_view name() { return "dashpot"; }
  bool enabled(const StateView<D>&) const { return gamma > 0; }
  Real power(const StateView<D>& s, Index e) const {
    const Place p(s, e);
    return p.touch ? gamma * p.slip.squaredNorm() : 0;
  }
  template <class F>
  void add_force(const StateView<D>& s, Index e, F& force) const {
    const Place p(s, e);
    if (!p.touch) return;
    const pliant::Vec<D> f = -gamma * p.slip;
    force.add(p.i, f);
    force.add(p.j, -f);
    force.add_torque(p.i, torque(p.lever_i, f));
    force.add_torque(p.j, torque(p.lever_j, pliant::Vec<D>(-f)));
  }
  Real max_damping(const Topology&) const { return 0; }

 private:
  struct Place {
    Index i, j;
    bool touch;
    pliant::Vec<D> lever_i, lever_j, slip;  // from the centres
    Place(const StateView<D>& s, Index e)
        : i(s.neighbours.point_pairs[e].first), j(s.neighbours.point_pairs[e].second) {
      const Real a = s.topology.diameter[i] / 2, b = s.topology.diameter[j] / 2;
      const pliant::Vec<D> r = s.position(i) - s.position(j);
      touch = r.norm() < a + b;
      lever_i = -a / (a + b) * r;
      lever_j = b / (a + b) * r;
      slip = s.velocity(i) + spin_velocity(s.spin(i), lever_i) - s.velocity(j) - spin_velocity(s.spin(j), lever_j);
    }
  };
};

/// A tangential spring with Coulomb's limit, as Cundall and Strack's, between touching disks of radii R that press on
/// each other with N = ε/δ (1 − r/δ). With the direction φ from j to i, i the lower id, q = (R_i + R_j) φ − R_i θ_i −
/// R_j θ_j grows as the surfaces slide along each other. The spring is ξ = q − q₀, its energy k/2 ξ², up to k |ξ| = μN.
/// Kept: q₀, which follows where ξ is beyond that, and the heat that made.
struct TangentialSpring {
  Real k, mu, epsilon;
  static constexpr Elements elements = Elements::point_pairs;
  static constexpr bool rotates = true;
  static constexpr int history = 2;
  static std::string_view name() { return "tangential"; }
  bool enabled(const StateView<2>&) const { return k > 0; }

  struct Touch {
    Index i, j;
    Real a, b, d, q, most;
    pliant::Vec<2> n;
    bool known;
    Real stretch, spring;  ///< ξ before and after the limit; 0 where the contact is new
  };
  bool find(const StateView<2>& s, Index e, std::span<const Real> past, Touch& c) const {
    const Pair pair = in_order(s.topology, s.neighbours.point_pairs[e]);
    c.i = pair.first, c.j = pair.second;
    c.a = s.topology.diameter[c.i] / 2, c.b = s.topology.diameter[c.j] / 2;
    const pliant::Vec<2> r = s.position(c.i) - s.position(c.j);
    c.d = r.norm();
    const Real reach = c.a + c.b;
    if (c.d >= reach) return false;
    c.n = r / c.d;
    c.q = reach * std::atan2(c.n[1], c.n[0]) - c.a * s.angle(c.i) - c.b * s.angle(c.j);
    c.most = mu * epsilon / reach * (1 - c.d / reach) / k;
    c.known = !past.empty();
    c.stretch = c.known ? std::remainder(c.q - past[0], 2 * pi * reach) : 0;  // φ jumps by 2π
    c.spring = std::clamp(c.stretch, -c.most, c.most);
    return true;
  }
  Real energy(const StateView<2>&, const Touch& c) const { return k / 2 * square(c.spring); }
  /// Power of sliding.
  Real power(const StateView<2>& s, const Touch& c) const {
    const pliant::Vec<2> t(-c.n[1], c.n[0]);
    const Real rate =
        (c.a + c.b) / c.d * t.dot(s.velocity(c.i) - s.velocity(c.j)) - c.a * s.spin(c.i) - c.b * s.spin(c.j);
    return std::abs(c.stretch) > std::abs(c.spring) ? std::max(k * c.spring * rate, 0.0) : 0;
  }
  template <class F>
  void add_force(const StateView<2>&, const Touch& c, F& force) const {
    const Real pull = k * c.spring;
    const pliant::Vec<2> t(-c.n[1], c.n[0]), f = -pull * (c.a + c.b) / c.d * t;
    force.add(c.i, f);
    force.add(c.j, -f);
    force.add_torque(c.i, pull * c.a);
    force.add_torque(c.j, pull * c.b);
  }
  void keep(const StateView<2>&, const Touch& c, std::span<const Real> past, Real* numbers, Real*) const {
    const bool slides = c.stretch != c.spring;
    numbers[0] = c.known && !slides ? past[0] : c.q - c.spring;
    numbers[1] = (c.known ? past[1] : 0) + k * std::abs(c.spring) * std::abs(c.stretch - c.spring);
  }
  Real max_rate(const Topology& t) const {
    return std::sqrt(12 * k / smallest_over_points(t, [&](Index i) { return t.mass(i); }));
  }
  Real max_damping(const Topology&) const { return 0; }
};

/// The same with straight walls: q = t·x − R θ, t along the wall.
struct WallSpring {
  Real k, mu, epsilon;
  static constexpr Elements elements = Elements::walls;
  static constexpr bool rotates = true;
  static constexpr int history = 2;
  static std::string_view name() { return "wall_tangential"; }
  bool enabled(const StateView<2>& s) const { return k > 0 && s.walls.size() > 0; }
  struct Touch {
    Index i;
    Real a, q;
    pliant::Vec<2> t;
    bool known;
    Real stretch, spring;
  };
  bool find(const StateView<2>& s, Index e, std::span<const Real> past, Touch& c) const {
    const auto [point, wall] = s.neighbours.walls[e];
    c.i = point;
    c.a = s.topology.diameter[point] / 2;
    Real d;
    pliant::Vec<2> n;
    s.walls.nearest(s.position(point), wall, s.t, d, n);
    if (d >= c.a) return false;
    c.t = {-n[1], n[0]};
    c.q = c.t.dot(s.position(point)) - c.a * s.angle(point);
    c.known = !past.empty();
    c.stretch = c.known ? c.q - past[0] : 0;
    const Real most = mu * epsilon / c.a * (1 - d / c.a) / k;
    c.spring = std::clamp(c.stretch, -most, most);
    return true;
  }
  Real energy(const StateView<2>&, const Touch& c) const { return k / 2 * square(c.spring); }
  Real power(const StateView<2>&, const Touch&) const { return 0; }
  template <class F>
  void add_force(const StateView<2>&, const Touch& c, F& force) const {
    const Real pull = k * c.spring;
    force.add(c.i, pliant::Vec<2>(-pull * c.t));
    force.add_torque(c.i, pull * c.a);
  }
  void keep(const StateView<2>&, const Touch& c, std::span<const Real> past, Real* numbers, Real*) const {
    const bool slides = c.stretch != c.spring;
    numbers[0] = c.known && !slides ? past[0] : c.q - c.spring;
    numbers[1] = (c.known ? past[1] : 0) + k * std::abs(c.spring) * std::abs(c.stretch - c.spring);
  }
  Real max_rate(const Topology&) const { return 0; }
  Real max_damping(const Topology&) const { return 0; }
};

/// Data of all particles of a simulation, by id, on every rank.
template <int D>
struct Snapshot {
  std::vector<Real> x, v, angles, spins;
  explicit Snapshot(const Simulation<D>& s) {
    const Topology& t = s.topology();
    const std::vector<Index> ids = s.ranks().all_gather(std::vector<Index>(t.id.begin(), t.id.begin() + t.owned()));
    const auto gather = [&](std::span<const Real> own, int width) {
      const std::vector<Real> all = s.ranks().all_gather(std::vector<Real>(own.begin(), own.end()));
      std::vector<Real> by_id(all.size());
      for (std::size_t k = 0; k < ids.size(); ++k)
        std::copy_n(all.begin() + static_cast<std::ptrdiff_t>(k) * width, width,
                    by_id.begin() + static_cast<std::ptrdiff_t>(ids[k]) * width);
      return by_id;
    };
    x = gather(s.particles().positions_in(s.state().x()), D);
    v = gather(s.particles().positions_in(s.state().v()), D);
    angles = gather(s.angles(), rotations<D>);
    spins = gather(s.spins(), rotations<D>);
  }
  bool operator==(const Snapshot&) const = default;
  Real difference(const Snapshot& other) const {
    Real most = 0;
    const auto compare = [&](const std::vector<Real>& a, const std::vector<Real>& b) {
      for (std::size_t k = 0; k < a.size(); ++k) most = std::max(most, std::abs(a[k] - b[k]));
    };
    compare(x, other.x), compare(v, other.v), compare(angles, other.angles), compare(spins, other.spins);
    return most;
  }
};

/// Turned and spinning by id; velocities of the configuration.
template <int D>
void start(Simulation<D>& s, const Configuration<D>& c, const std::vector<Real>& angles,
           const std::vector<Real>& spins) {
  s.place(c.x);
  const Topology& t = s.topology();
  for (Index m = 0; m < t.owned(); ++m) {
    for (int k = 0; k < D; ++k) s.state().v()[m * D + k] = c.v[t.id[m] * D + k];
    for (int k = 0; k < rotations<D>; ++k) {
      s.angles()[m * rotations<D> + k] = angles[t.id[m] * rotations<D> + k];
      s.spins()[m * rotations<D> + k] = spins[t.id[m] * rotations<D> + k];
    }
  }
}

inline std::vector<Real> random_numbers(Random& random, std::size_t n, Real most) {
  std::vector<Real> values(n);
  for (Real& a : values) a = random(-most, most);
  return values;
}

template <int D, class... Terms>
std::unique_ptr<Simulation<D>> simulation_of(const Configuration<D>& c, Sorting sorting, const Ranks& ranks,
                                             std::unique_ptr<Integrator> integrator, Terms... terms) {
  auto s = std::make_unique<Simulation<D>>(c.topology, ParticleSystem<D>({}, c.walls, alone<D>(terms...), 0.05, ranks),
                                           sorting);
  s->set_integrator(std::move(integrator));
  return s;
}

}  // namespace pliant::test
