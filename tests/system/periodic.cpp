// Periodic boxes against open systems with copies of the particles in all neighbouring cells, and what must not depend
// on where particles are written down. Run on one rank with all tests of the folder, on several by those with the tag.
#include <omp.h>
#include <petscsys.h>

#include <algorithm>
#include <catch2/catch.hpp>

#include <pliant/system/minimum.h>
#include <pliant/system/neighbour_drag.h>
#include <pliant/system/point_drag.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

#include "support/problems.h"
#include "support/twins.h"

using namespace pliant;
using namespace pliant::test;

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

template <int D>
void append(Configuration<D>& to, const Configuration<D>& from, const pliant::Vec<D>& shift) {
  const Topology& t = from.topology;
  for (Index m = 0; m < t.particles(); ++m) {
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

/// The cell first, if it is wanted, and its copies all around, as far as any can reach.
template <int D>
Configuration<D> copies(const Cell<D>& cell, bool with_middle) {
  Configuration<D> all;
  all.walls = cell.c.walls;
  if (with_middle) append<D>(all, cell.c, pliant::Vec<D>::Zero());
  Image most{};
  for (int k = 0; k < D; ++k) {
    if (!cell.box.periodic(k)) continue;
    Real low = infinite, high = -infinite;
    for (Index i = 0; i < cell.c.topology.points(); ++i) {
      low = std::min(low, cell.c.position(i)[k]);
      high = std::max(high, cell.c.position(i)[k]);
    }
    most[k] = static_cast<std::int64_t>((high - low + 2) / cell.box.length()[k]) + 1;
  }
  Image n;
  for (n[0] = -most[0]; n[0] <= most[0]; ++n[0])
    for (n[1] = -most[1]; n[1] <= most[1]; ++n[1])
      for (n[2] = -most[2]; n[2] <= most[2]; ++n[2])
        if (n != Image{}) append<D>(all, cell.c, cell.box.shift(n));
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

/// Of the first particles of an open system.
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

/// The same particles shared out, m-th to rank m modulo ranks; forces put together.
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
    compare(from_box(cell, ranks, true), expected, false);  // the gravity of those put back is another
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
