// Periodic boxes against open systems with copies of the particles in all neighbouring cells, and results that must
// not depend on the image in which a particle is stored. Run on one rank with all tests of the folder, on several by
// those with the tag.
#include <omp.h>
#include <petscsys.h>

#include <algorithm>
#include <catch2/catch.hpp>

#include <pliant/system/fire.h>
#include <pliant/system/neighbour_drag.h>
#include <pliant/system/overdamped.h>
#include <pliant/system/point_drag.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

#include "support/model_parameters.h"
#include "support/problems.h"
#include "support/twins.h"

namespace pliant::test::periodic_test {

namespace {

constexpr Real infinite = Box<2>::infinite;

/// A configuration in a box.
template <int D>
struct Cell {
  Configuration<D> c;
  Box<D> box;
  ModelKind kind;
  ModelParameters p = parameters;
};

/// Particles that have their first point, once it is shifted, between low and high.
template <int D>
void append(Configuration<D>& to, const Configuration<D>& from, const pliant::Vec<D>& shift,
            const pliant::Vec<D>& low = pliant::Vec<D>::Constant(-infinite),
            const pliant::Vec<D>& high = pliant::Vec<D>::Constant(infinite)) {
  const Topology& t = from.topology;
  for (Index m = 0; m < t.particles(); ++m) {
    const pliant::Vec<D> r = from.position(t.offset[m]) + shift;
    if (!((r - low).minCoeff() >= 0 && (high - r).minCoeff() >= 0)) continue;
    const Index first = t.offset[m], points = t.points_of(m);
    if (points == 1) {
      to.add_soft(t.sigma[m], from.position(first) + shift);
    } else if constexpr (D == 2) {
      Polygon vertices;
      for (Index i = first; i < first + points; ++i) vertices.push_back(from.position(i) + shift);
      to.add_polygon(vertices, t.diameter[first]);
    }
    const Index copy = to.topology.particles() - 1;
    to.topology.a0[copy] = t.a0[m];
    to.topology.l0[copy] = t.l0[m];
    to.topology.point_mass[copy] = t.point_mass[m];
    to.topology.inverse_point_mass[copy] = t.inverse_point_mass[m];
    std::copy_n(&from.v[static_cast<std::size_t>(first) * D], points * D,
                to.v.end() - static_cast<std::ptrdiff_t>(points) * D);
  }
}

/// The cell first, if requested, and its copies all around, as far as forces act.
template <int D>
Configuration<D> copies(const Cell<D>& cell, bool with_middle) {
  Configuration<D> all;
  all.walls = cell.c.walls;
  if (with_middle) append<D>(all, cell.c, pliant::Vec<D>::Zero());
  constexpr Real reach = 3;  // of particles that touch, and a rest of them
  pliant::Vec<D> low = pliant::Vec<D>::Constant(infinite), high = -low;
  for (Index i = 0; i < cell.c.topology.points(); ++i) {
    low = low.cwiseMin(cell.c.position(i));
    high = high.cwiseMax(cell.c.position(i));
  }
  low.array() -= reach;
  high.array() += reach;
  Image most{};
  for (int k = 0; k < D; ++k)
    if (cell.box.periodic(k)) most[k] = static_cast<std::int64_t>((high - low)[k] / cell.box.length()[k]) + 1;
  for (int k = D - 1; k > 0; --k)  // the tilt moves images along the directions before it
    if (cell.box.periodic(k))
      for (int l = 0; l < k && cell.box.tilted(); ++l)
        most[l] += static_cast<std::int64_t>(std::abs(cell.box.edge(k)[l]) * most[k] / cell.box.length()[l]) + 1;
  Image n;
  for (n[0] = -most[0]; n[0] <= most[0]; ++n[0])
    for (n[1] = -most[1]; n[1] <= most[1]; ++n[1])
      for (n[2] = -most[2]; n[2] <= most[2]; ++n[2])
        if (n != Image{}) append<D>(all, cell.c, cell.box.shift(n), low, high);
  return all;
}

template <int D>
ParticleSystem<D> system_of(const Cell<D>& cell, const Ranks& ranks = Ranks(),
                            const pliant::Vec<D>& gravity = pliant::Vec<D>::LinSpaced(0.1, -1)) {
  return system_of<D>(cell.c, cell.kind, ranks, cell.p, cell.box, gravity);
}

template <int D>
struct Result {
  VectorXd force;  ///< [points of the cell · D], dissipation too
  VectorXd elastic;
  Real energy, power;
  Index contacts = 0;
};

/// For the first particles of an open system.
template <int D>
Result<D> look(ParticleSystem<D>& system, const std::vector<Real>& x, const std::vector<Real>& v, std::size_t n) {
  const StateView<D> s = system.view(x.data(), v.data());
  VectorXd f(s.topology.points() * D), g(f.size());
  system.field().forces(s, f.data());
  Result<D> result{f.head(static_cast<Index>(n)), {}, system.field().energy(s, g.data()), system.field().power(s)};
  result.elastic = g.head(static_cast<Index>(n));
  system.field().for_each_contact(s, [&](const Contact<D>&) { ++result.contacts; });
  return result;
}

/// Per cell of the crystal: interactions of the middle with copies count half.
template <int D>
Result<D> from_copies(const Cell<D>& cell) {
  const std::size_t n = cell.c.x.size();
  const auto open = [&](const Configuration<D>& c) {
    auto system = system_of<D>(c, cell.kind, Ranks(), cell.p);
    return look<D>(system, c.x, c.v, std::min(n, c.x.size()));
  };
  Result<D> all = open(copies(cell, true));
  const Result<D> around = open(copies(cell, false)), alone = open(cell.c);
  all.energy = (all.energy - around.energy + alone.energy) / 2;
  all.power = (all.power - around.power + alone.power) / 2;
  all.contacts = (all.contacts - around.contacts + alone.contacts) / 2;
  return all;
}

/// The same particles distributed, particle m to rank m modulo ranks; forces gathered.
template <int D>
Result<D> from_box(const Cell<D>& cell, const Ranks& ranks, bool sorted = false) {
  auto system = system_of(cell, ranks);
  const Topology& all = cell.c.topology;
  std::vector<Index> mine;
  for (Index m = ranks.rank(); m < all.particles(); m += ranks.size()) mine.push_back(m);
  system.take(all.select(mine));
  State state;
  std::vector<Real> x, v;
  for (const Index m : mine)
    for (Index k = all.offset[m] * D; k < all.offset[m + 1] * D; ++k) {
      x.push_back(cell.c.x[k]);
      v.push_back(cell.c.v[k]);
    }
  state.assign(x, v);
  if (sorted) system.sort(state);
  x.assign(state.x().begin(), state.x().end());
  v.assign(state.v().begin(), state.v().end());
  const Result<D> own = look<D>(system, x, v, x.size());
  Result<D> result{VectorXd::Zero(static_cast<Index>(cell.c.x.size())),
                   VectorXd::Zero(static_cast<Index>(cell.c.x.size())), ranks.sum(own.energy), ranks.sum(own.power),
                   static_cast<Index>(ranks.sum(std::int64_t{own.contacts}))};
  const Topology& t = system.topology();
  for (Index m = 0; m < t.owned(); ++m)
    for (Index k = 0; k < t.points_of(m) * D; ++k) {
      result.force[all.offset[t.id[m]] * D + k] = own.force[t.offset[m] * D + k];
      result.elastic[all.offset[t.id[m]] * D + k] = own.elastic[t.offset[m] * D + k];
    }
  ranks.sum(std::span<Real>(result.force.data(), static_cast<std::size_t>(result.force.size())));
  ranks.sum(std::span<Real>(result.elastic.data(), static_cast<std::size_t>(result.elastic.size())));
  return result;
}

template <int D>
void compare(const Result<D>& a, const Result<D>& b, bool energy = true) {
  const Real scale = 1 + b.force.template lpNorm<Eigen::Infinity>();
  CHECK((a.force - b.force).template lpNorm<Eigen::Infinity>() < 1e-11 * scale);
  CHECK((a.elastic - b.elastic).template lpNorm<Eigen::Infinity>() < 1e-11 * scale);
  CHECK(a.power == Approx(b.power).epsilon(1e-10));
  CHECK(a.contacts == b.contacts);
  if (energy) CHECK(a.energy == Approx(b.energy).epsilon(1e-10));
}

template <int D>
void shift_particle(Configuration<D>& c, Index m, const pliant::Vec<D>& by) {
  for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i) point<D>(c.x.data(), i) += by;
}

template <int D>
void move_by_lengths(Random& random, Cell<D>& cell) {
  for (Index m = 0; m < cell.c.topology.particles(); ++m)
    shift_particle<D>(cell.c, m, cell.box.shift({random.below(7) - 3, random.below(7) - 3, random.below(7) - 3}));
}

/// Loose droplets, so that none is within another.
template <int D>
Configuration<D> droplet_rows(Random& random, Index columns, Index rows) {
  Configuration<D> c;
  for (Index k = 0; k < columns * rows; ++k) {
    pliant::Vec<D> r = pliant::Vec<D>::Zero();
    r[0] = 1.95 * (k % columns + 0.5) + random(-0.05, 0.05);
    r[D - 1] = 1.95 * (k / columns + 0.5) + random(-0.05, 0.05);
    c.add_droplet(random(0.9, 1.1), r);
  }
  c.random_velocities(random);
  return c;
}

/// Without walls.
template <int D>
Configuration<D> free(const Configuration<D>& c) {
  Configuration<D> copy;
  append<D>(copy, c, pliant::Vec<D>::Zero());
  return copy;
}

/// Calls check(cell) for all models in boxes that are periodic in one direction or more, large and tiny ones, in which
/// particles touch themselves.
template <class Check>
void for_all_cells(Random& random, Check&& check) {
  const auto in_boxes = [&]<int D>(const Configuration<D>& c, const pliant::Vec<D>& origin, ModelKind kind,
                                   const std::vector<pliant::Vec<D>>& lengths, const ModelParameters& p = parameters) {
    for (const pliant::Vec<D>& length : lengths) {
      INFO(to_string(kind) << ", box " << length.transpose());
      check(Cell<D>{free(c), Box<D>(origin, length), kind, p});
      if (!length.allFinite()) continue;
      Tilt<D> tilt;
      for (Real& t : tilt) t = random(-0.7, 0.7) * length[0];
      INFO("tilt " << tilt[0]);
      check(Cell<D>{free(c), Box<D>(origin, length, tilt), kind, p});
    }
  };
  const std::vector<pliant::Vec<2>> tiny{{1.1, 0.9}, {0.45, infinite}, {infinite, 0.7}};
  in_boxes(soft_rows<2>(random, 4, 5), pliant::Vec<2>(-1.9, 0), ModelKind::sp,
           {{3.8, 4.75}, {3.8, infinite}, {infinite, 4.75}});
  in_boxes(soft_cluster<2>(random, 2), pliant::Vec<2>(0, 0), ModelKind::sp, tiny);
  in_boxes(soft_rows<3>(random, 4, 1), pliant::Vec<3>(-1.9, -1.9, 0), ModelKind::sp,
           {{3.8, 3.8, 0.95}, {3.8, infinite, infinite}, {3.8, 3.8, infinite}});
  for (const ModelKind kind : {ModelKind::rough, ModelKind::smooth}) {
    in_boxes(polygon_rows(random, 3, 4), pliant::Vec<2>(-1.575, 0), kind,
             {{3.15, 4.2}, {3.15, infinite}, {infinite, 4.2}});
    Configuration<2> one;
    one.add_polygon(irregular_polygon(random, 9, 0.5), 0.2);
    one.random_velocities(random);
    in_boxes(one, pliant::Vec<2>(0, 0), kind, {{1.1, 0.95}, {0.9, infinite}, {infinite, 0.4}});
  }
  ModelParameters barrier = parameters;
  barrier.law = ContactLaw::barrier;
  in_boxes(polygon_rows(random, 3, 3), pliant::Vec<2>(-1.575, 0), ModelKind::smooth, {{3.3, 3.3}}, barrier);
  in_boxes(droplet_rows<2>(random, 3, 4), pliant::Vec<2>(0, 0), ModelKind::bubble, {{5.85, 7.8}, {5.85, infinite}});
  in_boxes(droplet_rows<2>(random, 1, 1), pliant::Vec<2>(0, 0), ModelKind::bubble, {{1.9, 2.3}});
  in_boxes(droplet_rows<3>(random, 3, 2), pliant::Vec<3>(0, 0, 0), ModelKind::bubble, {{5.85, 2.1, 3.9}});
}

}  // namespace

TEST_CASE("a periodic box is a crystal of copies", "[ranks][periodic]") {
  Random random(1);
  const Ranks ranks(PETSC_COMM_WORLD);
  Index contacts = 0;
  for_all_cells(random, [&]<int D>(const Cell<D>& cell) {
    const Result<D> expected = from_copies(cell);
    CHECK(expected.force.norm() > 1);
    contacts += expected.contacts;
    compare(from_box(cell, ranks), expected);
    compare(from_box(cell, ranks, true), expected, false);  // the weight of wrapped particles has another energy
  });
  CHECK(contacts > 300);
}

TEST_CASE("forces in a box do not depend on where particles are written down", "[ranks][periodic]") {
  Random random(2);
  const Ranks ranks(PETSC_COMM_WORLD);
  for_all_cells(random, [&]<int D>(Cell<D> cell) {
    const Result<D> before = from_box(cell, ranks);
    move_by_lengths(random, cell);
    compare(from_box(cell, ranks), before, false);
    for (Index m = 0; m < cell.c.topology.particles(); ++m)
      shift_particle<D>(cell.c, m, pliant::Vec<D>::LinSpaced(17.3, -5.1));
    compare(from_box(cell, ranks), before, false);
    compare(from_box(cell, ranks, true), before, false);
  });
}

namespace {

/// Where particles would be without a box, by id.
template <int D>
std::vector<Real> unwrapped(const ParticleSystem<D>& system, const State& s) {
  const Topology& t = system.topology();
  std::vector<Real> x(s.size());
  std::vector<Index> offset(t.owned() + 1, 0);
  for (Index m = 0; m < t.owned(); ++m) offset[t.id[m] + 1] = t.points_of(m);
  for (std::size_t m = 1; m < offset.size(); ++m) offset[m] += offset[m - 1];
  for (Index m = 0; m < t.owned(); ++m) {
    const pliant::Vec<D> shift = s.images.empty() ? pliant::Vec<D>::Zero() : system.box().shift(s.images[m]);
    for (Index k = 0; k < t.points_of(m); ++k)
      point<D>(x.data(), offset[t.id[m]] + k) = point<D>(s.x().data(), t.offset[m] + k) + shift;
  }
  return x;
}

Real largest_difference(const std::vector<Real>& a, const std::vector<Real>& b) {
  REQUIRE(a.size() == b.size());
  Real most = 0;
  for (std::size_t k = 0; k < a.size(); ++k) most = std::max(most, std::abs(a[k] - b[k]));
  return most;
}

template <int D>
State state_of(const Configuration<D>& c) {
  State s;
  s.assign(c.x, c.v);
  return s;
}

/// Σ m v.
template <int D>
pliant::Vec<D> momentum(const Topology& t, const State& s) {
  pliant::Vec<D> sum = pliant::Vec<D>::Zero();
  for (Index i = 0; i < t.owned_points(); ++i) sum += t.mass(i) * point<D>(s.v().data(), i);
  return sum;
}

template <int D>
Real total_energy(ParticleSystem<D>& system, const State& s) {
  Real sum = system.field().energy(system.view(s.x().data(), s.v().data()));
  const Topology& t = system.topology();
  for (Index i = 0; i < t.owned_points(); ++i) sum += t.mass(i) / 2 * point<D>(s.v().data(), i).squaredNorm();
  return sum;
}

/// Sorts every `period` steps, with the predictions of the integrator.
template <int D>
StepObserver sorted_every(ParticleSystem<D>& system, Integrator& integrator, int period) {
  return [&system, &integrator, period](State& s) {
    if (s.step % period != 0) return AfterStep::proceed;
    std::vector<Real> carried(integrator.carried().begin(), integrator.carried().end());
    const Migration migration = system.sort(s);
    if (integrator.carries()) {
      migration.move_points(carried, D);
      integrator.set_carried(carried);
    }
    return AfterStep::reordered;
  };
}

/// Without weight, drag and friction.
template <int D>
ParticleSystem<D> isolated(const Cell<D>& cell, Real mu = 0) {
  ModelParameters p = cell.p;
  p.mu = mu;
  p.zeta = 0;
  return system_of<D>(cell.c, cell.kind, Ranks(), p, cell.box, pliant::Vec<D>::Zero());
}

Cell<2> gas(Random& random) { return {free(soft_rows<2>(random, 4, 4)), Box<2>({0, 0}, {4.6, 4.6}), ModelKind::sp}; }

}  // namespace

TEST_CASE("the virial is the derivative of the energy by the strain of particles and box", "[ranks][periodic]") {
  Random random(11);
  const Ranks ranks(PETSC_COMM_WORLD);
  Real largest = 0;
  for_all_cells(random, [&]<int D>(const Cell<D>& cell) {
    if (!cell.box.length().allFinite()) return;
    const auto report = [&](const pliant::Mat<D>& f) {
      Cell<D> strained{free(cell.c), cell.box.deformed(f), cell.kind, cell.p};
      for (Index i = 0; i < cell.c.topology.points(); ++i)
        point<D>(strained.c.x.data(), i) = cell.box.origin() + f * (cell.c.position(i) - cell.box.origin());
      auto system = system_of(strained, ranks, pliant::Vec<D>(pliant::Vec<D>::Zero()));
      std::vector<Index> mine;
      for (Index m = ranks.rank(); m < cell.c.topology.particles(); m += ranks.size()) mine.push_back(m);
      system.take(cell.c.topology.select(mine));
      std::vector<Real> x, v;
      for (const Index m : mine)
        for (Index k = cell.c.topology.offset[m] * D; k < cell.c.topology.offset[m + 1] * D; ++k) {
          x.push_back(strained.c.x[k]);
          v.push_back(0);
        }
      const StateView<D> s = system.view(x.data(), v.data());
      return std::pair(system.field().report(s), system.field().virials(s));
    };
    const auto [terms, virials] = report(pliant::Mat<D>::Identity());
    constexpr Real step = 1e-6;
    for (const auto& [name, local] : virials) {
      pliant::Mat<D> virial = local;
      ranks.sum(std::span<Real>(virial.data(), D * D));
      INFO("term " << name);
      const Real size = 1 + virial.norm();
      largest = std::max(largest, virial.norm());
      CHECK((virial - virial.transpose()).norm() < 1e-10 * size);
      for (int a = 0; a < D; ++a)
        for (int b = a; b < D; ++b) {
          pliant::Mat<D> f = pliant::Mat<D>::Identity();
          const auto energy = [&, n = &name](Real e) {
            f(a, b) += e;
            const auto strained = report(f);
            f(a, b) -= e;
            for (const TermReport& term : strained.first)
              if (term.name == *n) return ranks.sum(term.energy);
            return Real(0);
          };
          CHECK(virial(a, b) == Approx((energy(step) - energy(-step)) / (2 * step)).margin(3e-8 * size).epsilon(1e-7));
        }
    }
  });
  CHECK(largest > 10);
}

TEST_CASE("a periodic gas conserves momentum and energy", "[periodic]") {
  Random random(3);
  const auto check = [&]<int D>(Cell<D> cell, Real dt) {
    INFO(to_string(cell.kind) << ", " << D << "D");
    for (Real& v : cell.c.v) v *= 3;
    for (const Real mu : {0.0, 0.3}) {
      auto system = isolated(cell, mu);
      State s = state_of(cell.c);
      const pliant::Vec<D> before = momentum<D>(system.topology(), s);
      const Real energy = total_energy(system, s);
      FixedStepVerlet verlet(dt);
      verlet.run(system, s, 1500 * dt, true, sorted_every(system, verlet, 100));
      CHECK((momentum<D>(system.topology(), s) - before).norm() < 1e-10);
      CHECK(before.norm() > 0.1);
      if (mu == 0)
        CHECK(total_energy(system, s) == Approx(energy).epsilon(2e-3));
      else
        CHECK(total_energy(system, s) < 0.98 * energy);
      Index crossed = 0;
      for (const Image& n : s.images) crossed += n != Image{} ? 1 : 0;
      CHECK(crossed > 0);
    }
  };
  check(gas(random), 2e-3);
  check(Cell<3>{free(soft_rows<3>(random, 4, 1)), Box<3>({0, 0, 0}, {3.8, 3.9, 1.4}), ModelKind::sp}, 2e-3);
  check(Cell<2>{free(polygon_rows(random, 3, 3)), Box<2>({0, 0}, {3.3, 3.4}), ModelKind::rough}, 4e-4);
  check(Cell<2>{free(polygon_rows(random, 3, 3)), Box<2>({0, 0}, {3.3, 3.4}), ModelKind::smooth}, 4e-4);
}

TEST_CASE("a run in a box is the same where particles are wrapped and where they are not", "[periodic]") {
  Random random(4);
  const auto check = [&]<int D>(Cell<D> cell, Integrator& one, Integrator& other, Real t_end) {
    INFO(to_string(cell.kind) << ", " << one.name());
    for (Real& v : cell.c.v) v = 2 * v + 3;  // far across the borders
    auto still = isolated(cell, 0.1), sorted = isolated(cell, 0.1);
    State a = state_of(cell.c), b = a;
    sorted.sort(b);
    CHECK(largest_difference(unwrapped(sorted, b), cell.c.x) < 1e-12);
    one.run(still, a, t_end, true, {});
    other.run(sorted, b, t_end, true, sorted_every(sorted, other, 25));
    CHECK(one.statistics().steps == other.statistics().steps);
    const std::vector<Real> x = unwrapped(still, a), y = unwrapped(sorted, b);
    CHECK(largest_difference(x, y) < 1e-8);
    CHECK(largest_difference(x, cell.c.x) > 1);
    CHECK(largest_difference({b.x().begin(), b.x().end()}, y) > 1);
    for (Index m = 0; m < sorted.topology().owned(); ++m) {
      const pliant::Vec<D> centre = mean_of_points<D>(b.x().data(), sorted.topology(), m) - cell.box.origin();
      CHECK((centre.minCoeff() > -0.5 && (centre - cell.box.length()).maxCoeff() < 0.5));
    }
  };
  {
    FixedStepVerlet one(1e-3), other(1e-3);
    check(gas(random), one, other, 0.5);
  }
  {
    FixedStepVerlet one(4e-4), other(4e-4);
    check(Cell<2>{free(polygon_rows(random, 3, 3)), Box<2>({0, 0}, {3.3, 3.4}), ModelKind::rough}, one, other, 0.4);
  }
  const PetscOptionScope scope("-ts_type rk -ts_adapt_type none");
  TsIntegrator one({.dt = 2e-3}), other({.dt = 2e-3});
  check(gas(random), one, other, 0.5);
}

TEST_CASE("a run in a box on ranks is the same run", "[ranks][periodic]") {
  Random random(5);
  const auto check = [&]<int D>(Configuration<D> c, ModelKind kind, const Box<D>& box, Real dt) {
    INFO(to_string(kind) << ", " << D << "D");
    c.walls = {};
    for (Real& v : c.v) v = 2 * v + 2;
    Twins<D> twins(c, kind, box);
    twins.sort();
    FixedStepVerlet one(dt), many(dt);
    one.run(twins.whole, twins.whole_state, 300 * dt, true, {});
    many.run(twins.shared, twins.state, 300 * dt, true, [&](State& s) {
      if (s.step % 37 != 0) return AfterStep::proceed;
      twins.sort(many);
      return AfterStep::reordered;
    });
    // Where they would be without a box.
    std::vector<Real> x(twins.state.x().begin(), twins.state.x().end());
    const Topology& t = twins.shared.topology();
    for (Index m = 0; m < t.owned(); ++m)
      for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i) point<D>(x.data(), i) += box.shift(twins.state.images[m]);
    CHECK(twins.difference(x, twins.whole_state.x()) < 1e-9);
    CHECK(twins.difference(twins.state.v(), twins.whole_state.v()) < 1e-8);
    CHECK(twins.difference(x, c.x) > 0.2);
    CHECK(twins.whole.neighbours().rebuilds() >= 3);
  };
  check(soft_rows<2>(random, 10, 10), ModelKind::sp, Box<2>({0, 0}, {9.5, 9.5}), 1e-3);
  check(soft_rows<3>(random, 5, 4), ModelKind::sp, Box<3>({0, 0, 0}, {4.75, infinite, 3.8}), 1e-3);
  check(polygon_rows(random, 5, 5), ModelKind::smooth, Box<2>({0, 0}, {5.25, 5.25}), 3e-4);
  check(polygon_rows(random, 5, 5), ModelKind::rough, Box<2>({0, 0}, {5.25, infinite}), 3e-4);
}

TEST_CASE("forces across the borders do not depend on the number of threads", "[periodic]") {
  Random random(6);
  const Cell<2> cell{free(soft_rows<2>(random, 70, 70)), Box<2>({-33.25, 0}, {66.5, 66.5}), ModelKind::sp};
  auto system = system_of(cell);
  const auto evaluate = [&](int threads) {
    const int before = omp_get_max_threads();
    omp_set_num_threads(threads);
    system.rebuild(cell.c.x.data());
    Result<2> result = look<2>(system, cell.c.x, cell.c.v, cell.c.x.size());
    omp_set_num_threads(before);
    return result;
  };
  const Result<2> one = evaluate(1), three = evaluate(3);
  REQUIRE(system.neighbours().chunks() > 2);
  CHECK(system.topology().ghosts > 250);
  CHECK(system.topology().ghosts < 400);
  CHECK(one.force == three.force);
  CHECK(one.energy == three.energy);
  compare(one, from_copies(cell));
}

TEST_CASE("a channel that is periodic along its walls flows as fast as its drag allows", "[periodic]") {
  // m dv/dt = m g − ζ v for each particle; forces between particles and with walls cancel along the channel.
  Random random(7);
  const Real floor = -0.4, lid = 3, zeta = 0.8, g = 1.5;
  for (const ModelKind kind : {ModelKind::sp, ModelKind::rough}) {
    Configuration<2> c = free(kind == ModelKind::sp ? soft_rows<2>(random, 4, 3) : polygon_rows(random, 3, 2));
    Real total = 0;
    for (Index i = 0; i < c.topology.points(); ++i) total += c.topology.mass(i);
    for (Index m = 0; m < c.topology.particles(); ++m) {  // all of one mass, so that all have one terminal velocity
      const Real mass = total / c.topology.particles() / c.topology.points_of(m);
      c.topology.point_mass[m] = mass;
      c.topology.inverse_point_mass[m] = 1 / mass;
    }
    constexpr Real far = 1e6;
    c.walls =
        Walls<2>({WallSegment::between({-far, floor}, {far, floor}), WallSegment::between({-far, lid}, {far, lid})});
    ModelParameters p = parameters;
    p.zeta = zeta;
    p.mu = 0.3;
    auto system = system_of<2>(c, kind, Ranks(), p, Box<2>({0, 0}, {4, infinite}), {g, 0});
    State s = state_of(c);
    FixedStepVerlet verlet(kind == ModelKind::sp ? 2e-3 : 5e-4);
    const pliant::Vec<2> start = momentum<2>(system.topology(), s);
    const Real t = kind == ModelKind::sp ? 10 : 2, rate = zeta * c.topology.particles() / total,
               end = g / rate + (start[0] / total - g / rate) * std::exp(-rate * t);
    verlet.run(system, s, t, true, sorted_every(system, verlet, 200));
    const pliant::Vec<2> mean = momentum<2>(system.topology(), s) / total;
    CHECK(mean[0] == Approx(end).epsilon(1e-3));
    for (Index i = 0; i < system.topology().owned_points(); ++i)
      CHECK((point<2>(s.x().data(), i)[1] > floor && point<2>(s.x().data(), i)[1] < lid));
  }
}

TEST_CASE("a box refuses walls that its images do not share", "[periodic]") {
  const auto make = [](std::vector<WallSegment> walls, const Box<2>& box) {
    Configuration<2> c;
    c.add_soft(1, {0, 1});
    c.walls = Walls<2>(std::move(walls));
    return system_of<2>(c, ModelKind::sp, Ranks(), parameters, box);
  };
  const Box<2> box({0, 0}, {4, infinite});
  CHECK_NOTHROW(make({WallSegment::between({-1e5, 0}, {1e5, 0})}, box));
  CHECK_NOTHROW(make({WallSegment::between({0, 0}, {4, 0})}, {}));
  CHECK_THROWS_WITH(make({WallSegment::between({0, 0}, {4, 0})}, box), Catch::Contains("wall 0"));
  CHECK_THROWS_WITH(make({WallSegment::between({-1e5, 0}, {1e5, 1})}, box), Catch::Contains("wall 0"));
  CHECK_THROWS_WITH(make({WallSegment::between({-1e5, 0}, {1e5, 0})}, Box<2>({0, 0}, {4, 4})),
                    Catch::Contains("periodic in direction 1"));
  Configuration<3> c;
  c.add_soft(1, {0, 0, 1});
  const auto make_3d = [&](const Walls<3>& walls, const Box<3>& in) {
    c.walls = walls;
    return system_of<3>(c, ModelKind::sp, Ranks(), parameters, in);
  };
  const Walls<3> plane({WallSegment::ray({0, 0}, {1, 0})}), tube({WallSegment::between({3, -1e5}, {3, 1e5})});
  CHECK_NOTHROW(make_3d(plane, Box<3>({0, 0, 0}, {4, 4, infinite})));
  CHECK_THROWS_AS(make_3d(plane, Box<3>({0, 0, 0}, {4, 4, 4})), InputError);
  CHECK_NOTHROW(make_3d(tube, Box<3>({0, 0, 0}, {infinite, infinite, 4})));
  CHECK_THROWS_AS(make_3d(tube, Box<3>({0, 0, 0}, {4, infinite, infinite})), InputError);
  const Walls<3> behind(std::vector{Solid<3>::half_space({0, 0, 0}, {0, 0, 1})});
  CHECK_NOTHROW(make_3d(behind, Box<3>({0, 0, 0}, {4, 4, infinite})));
  CHECK_THROWS_AS(make_3d(behind, Box<3>({0, 0, 0}, {infinite, infinite, 4})), InputError);
}

TEST_CASE("energy is minimised in a box", "[periodic]") {
  Random random(10);
  for (const Real length : {4.6, 3.6}) {  // loose, and pressed together
    const Cell<2> cell{free(soft_rows<2>(random, 4, 4)), Box<2>({0, 0}, {length, length}), ModelKind::sp};
    auto system = isolated(cell);
    std::vector<Real> x = cell.c.x;
    const Real mass = 1;
    FireOptions options;
    options.dt_max = 0.1;
    options.force_tolerance = 1e-6;
    const FireResult result = fire(
        x, std::span(&mass, 1),
        [&](const Real* r, Real* f) { return system.field().energy(system.view(r, nullptr), f); }, options);
    CHECK(result.converged);
    CHECK((result.energy > 0.1) == (length < 4));
    CHECK(result.energy < system.field().energy(system.view(cell.c.x.data(), nullptr)));
  }
}

TEST_CASE("motion without inertia in a box", "[periodic]") {
  const PetscOptionScope scope("-ts_type rk -ts_adapt_type none");
  Random random(8);
  SECTION("points") {
    const Cell<2> cell = gas(random);
    OverdampedSystem<2> system(system_of(cell), std::make_unique<PointDrag<2>>(2.0));
    std::vector<Real> v(cell.c.x.size());
    system.rate(0, cell.c.x.data(), v.data());
    const Result<2> expected = from_copies(cell);
    for (std::size_t k = 0; k < v.size(); ++k) CHECK(v[k] == Approx(expected.elastic[k] / 2).margin(1e-10));
  }
  SECTION("droplets") {
    // B v = F/b, where each neighbour within range counts, images too.
    for (const pliant::Vec<2>& length : {pliant::Vec<2>(5.85, 5.85), pliant::Vec<2>(1.96, 5.85)}) {
      const bool tiny = length[0] < 2;
      const Cell<2> cell{droplet_rows<2>(random, tiny ? 1 : 3, 3), Box<2>({0, 0}, length), ModelKind::bubble};
      constexpr Real beyond = 0.1, b = 1.5;
      NeighbourDragOptions options{.b = b};
      REQUIRE(options.beyond_contact == beyond);
      OverdampedSystem<2> system(system_of(cell), std::make_unique<NeighbourDrag<2>>(options));
      std::vector<Real> v(cell.c.x.size());
      system.rate(0, cell.c.x.data(), v.data());
      const Index n = cell.c.topology.points();
      const VectorXd force = from_copies(cell).elastic;
      Index neighbours = 0;
      for (Index i = 0; i < n; ++i) {
        pliant::Vec<2> sum = point<2>(v.data(), i);
        for (Index j = 0; j < n; ++j)
          for (const Index k : {-1, 0, 1})
            for (const Index l : {-1, 0, 1}) {
              if (j == i && k == 0 && l == 0) continue;
              const pliant::Vec<2> r = cell.c.position(j) + cell.box.shift({k, l, 0}) - cell.c.position(i);
              if (r.norm() >= (cell.c.topology.diameter[i] + cell.c.topology.diameter[j]) / 2 + beyond) continue;
              sum += point<2>(v.data(), i) - point<2>(v.data(), j);
              ++neighbours;
            }
        CHECK((sum - point<2>(force.data(), i) / b).norm() < 1e-10);
      }
      CHECK(neighbours > 2 * n);
      const StateView<2> s = system.particles().view(cell.c.x.data(), v.data());
      CHECK(system.mobility().power(s) == Approx(force.dot(Eigen::Map<const VectorXd>(v.data(), 2 * n))));
    }
  }
}

TEST_CASE("lists in a box come out the same when they are built again from where they were built", "[periodic]") {
  Random random(9);
  const auto check = [&](const Cell<2>& cell, Real dt) {
    auto system = isolated(cell, 0.1), again = isolated(cell, 0.1);
    State s = state_of(cell.c);
    for (Real& v : s.v()) v = 2 * v + 1;
    FixedStepVerlet verlet(dt), other(dt);
    verlet.run(system, s, 120 * dt, true, sorted_every(system, verlet, 50));
    // As a restart does it.
    again.take(system.topology().select([&] {
      std::vector<Index> all(system.topology().owned());
      for (Index m = 0; m < system.topology().owned(); ++m) all[m] = m;
      return all;
    }()));
    again.rebuild(system.neighbours().reference().data());
    State t = s;
    other.set_carried(verlet.carried());
    verlet.run(system, s, 200 * dt, false, {});
    other.run(again, t, 200 * dt, false, {});
    CHECK(system.neighbours().rebuilds() > 4);
    CHECK(std::ranges::equal(s.x(), t.x()));
    CHECK(std::ranges::equal(s.v(), t.v()));
  };
  check(gas(random), 1e-3);
  check(Cell<2>{free(polygon_rows(random, 3, 3)), Box<2>({0, 0}, {3.3, 3.4}), ModelKind::rough}, 4e-4);
}

}  // namespace pliant::test::periodic_test
