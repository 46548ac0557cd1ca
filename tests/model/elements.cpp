// The table of element kinds: the lists that follow from the terms of a model, and whether elements consist of the
// points on which their terms act.
#include <catch2/catch.hpp>
#include <set>

#include <pliant/model/area.h>
#include <pliant/model/bending.h>
#include <pliant/model/depletion.h>
#include <pliant/model/drag.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/edge_friction.h>
#include <pliant/model/gravity.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/pair_contact.h>
#include <pliant/model/pair_friction.h>
#include <pliant/model/perimeter.h>
#include <pliant/model/simplex_friction.h>
#include <pliant/model/wall_contact.h>
#include <pliant/model/wall_depletion.h>
#include <pliant/model/wall_repulsion.h>

#include "support/model_parameters.h"
#include "support/rows.h"
#include "support/smooth_surfaces.h"

namespace pliant::test::elements_test {

namespace {

/// A user-defined term: a vertex is pushed away from the middle of an edge, from some way beyond contact on.
struct MiddleForce {
  Real k;
  static constexpr Real beyond = 0.25;

  static constexpr Elements elements = Elements::vertex_edges;
  static std::string_view name() { return "middle"; }
  static bool enabled(const StateView<2>&) { return true; }
  static Real range() { return beyond; }
  Real energy(const StateView<2>& s, Index e) const {
    const auto [p, a] = s.neighbours.vertex_edges[e];
    return energy_of(s, p, a);
  }
  template <class G>
  void add_gradient(const StateView<2>& s, Index e, G& grad) const {
    const auto [p, a] = s.neighbours.vertex_edges[e];
    add_gradient_of(s, p, a, grad);
  }
  void add_hessian(const StateView<2>&, Index, BlockSink<2>&) const {}
  static Real max_rate(const Topology&) { return 0; }

  Real energy_of(const StateView<2>& s, Index p, Index a) const {
    return k / 3 * std::pow(std::max(Real(0), 1 - arm(s, p, a).norm() / reach(s, p, a)), 3);
  }
  template <class G>
  void add_gradient_of(const StateView<2>& s, Index p, Index a, G& grad) const {
    const pliant::Vec<2> w = arm(s, p, a);
    const Real r = reach(s, p, a), x = std::max(Real(0), 1 - w.norm() / r);
    const pliant::Vec<2> pull = -k * x * x / r * w.normalized();
    grad.add(p, pull);
    grad.add(a, pliant::Vec<2>(-pull / 2));
    grad.add(s.topology.next[a], pliant::Vec<2>(-pull / 2));
  }

 private:
  static pliant::Vec<2> arm(const StateView<2>& s, Index p, Index a) {
    return s.position(p) - (s.position(a) + s.position(s.topology.next[a])) / 2;
  }
  static Real reach(const StateView<2>& s, Index p, Index a) {
    return (s.topology.diameter[p] + s.topology.diameter[a]) / 2 + beyond;
  }
};

/// A term over elements of any kind.
template <Elements E, int D>
struct AnyTerm {
  static constexpr Elements elements = E;
  static std::string_view name() { return "any"; }
  static bool enabled(const StateView<D>&) { return true; }
  static Real energy(const StateView<D>&, Index) { return 0; }
  template <class G>
  static void add_gradient(const StateView<D>&, Index, G&) {}
  static void add_hessian(const StateView<D>&, Index, BlockSink<D>&) {}
  static Real max_rate(const Topology&) { return 0; }
};
template <Elements E, int D>
constexpr bool can_be = EnergyTerm<AnyTerm<E, D>, D>;

// A kind that is not in the table, or has no elements in these dimensions, does not compile.
static_assert(can_be<Elements::points, 2> && can_be<Elements::point_pairs, 3> && can_be<Elements::vertex_edges, 2>);
static_assert(!can_be<Elements::vertex_edges, 3> && can_be<Elements::lips, 3>);
static_assert(can_be<Elements::vertex_faces, 3> && can_be<Elements::edge_pairs, 3>);
static_assert(!can_be<Elements::vertex_faces, 2> && !can_be<Elements::edge_pairs, 2>);
static_assert(!can_be<static_cast<Elements>(element_kinds), 2>);

/// The points with a non-zero entry, and the pairs of different points with a block.
struct Recorder {
  std::set<Index> points;
  template <class V>
  void add(Index i, const V& vector) {
    if (vector.norm() > 0) points.insert(i);
  }
};
template <int D>
struct BlockRecorder final : BlockSink<D> {
  std::set<std::pair<Index, Index>> pairs;
  void add(Index i, Index j, const Mat<D>& block) override {
    if (i != j && block.norm() > 0) pairs.emplace(i, j);
  }
};

/// Whether elements act on points of their stencil and couple no others, and whether one acts on all of them.
template <int D, class T>
void check_stencil(const T& term, Configuration<D> c, std::set<std::string>& names) {
  using Kind = ElementKind<T::elements>;
  INFO(term.name() << ", " << D << "D");
  names.emplace(term.name());
  const StateView<D> s = c.view();
  REQUIRE(s.neighbours.chunks() == 1);
  const Topology& t = s.topology;
  const Range elements = Kind::inside(s.neighbours, 0);
  int whole = 0, outside = 0, uncoupled = 0;
  for (Index e = elements.first; e < elements.last; ++e) {
    std::set<Index> stencil;
    if constexpr (Kind::listed) {
      for (const Index i : Kind::stencil(t, (s.neighbours.*Kind::list)[e])) stencil.insert(i);
    } else {
      for (const Index i : Kind::stencil(t, e)) stencil.insert(i);
    }
    Recorder acts;
    BlockRecorder<D> couples;
    if constexpr (EnergyTerm<T, D>) {
      term.add_gradient(s, e, acts);
      term.add_hessian(s, e, couples);
    } else {
      term.add_force(s, e, acts);
      term.add_dforce_dv(s, e, couples);
    }
    whole += acts.points == stencil;
    for (const Index i : acts.points) outside += stencil.count(i) == 0;
    for (const auto& [i, j] : couples.pairs)
      uncoupled += stencil.count(i) == 0 || stencil.count(j) == 0 || Kind::couples == Couples::nothing ||
                   (Kind::couples == Couples::particle && t.particle[i] != t.particle[j]);
  }
  CHECK(whole > 0);
  CHECK(outside == 0);
  CHECK(uncoupled == 0);
}

template <int D>
Configuration<D> droplets_at_wall() {
  Random random(3);
  Configuration<D> c;
  c.walls = Walls<D>(std::vector{Solid<D>::half_space(Vec<D>::Zero(), Vec<D>::Unit(0))});
  c.add_droplet(1, 0.98 * Vec<D>::Unit(0));
  c.add_droplet(1.1, 3.05 * Vec<D>::Unit(0));
  c.random_velocities(random);
  return c;
}

}  // namespace

TEST_CASE("the lists of a model follow from its terms") {
  struct Row {
    ModelKind kind;
    ModelParameters p;
    NeighbourNeeds lists;
  };
  const NeighbourNeeds soft{.point_pairs = true, .walls = true},
      rough{.point_pairs = true, .vertex_edges = true, .walls = true, .lips = true, .edges = Edges::bare},
      smooth{.vertex_edges = true, .walls = true, .lips = true};
  NeighbourNeeds vertices = rough;
  vertices.vertex_edges = false;
  const std::vector<Row> table{
      {ModelKind::sp, {}, soft},
      {ModelKind::sp, {.law = ContactLaw::hertz, .mu = 1, .zeta = 1}, soft},
      {ModelKind::rough, {}, rough},
      {ModelKind::rough, {.k_a = 1, .k_l = 1, .k_b = 1, .mu = 1, .lip_edges = false}, rough},
      {ModelKind::rough, {.rough_edges = false}, vertices},
      {ModelKind::smooth, {}, smooth},
      {ModelKind::smooth, {.law = ContactLaw::hertz, .mu = 1, .lip_edges = false}, smooth},
      {ModelKind::smooth, {.law = ContactLaw::barrier}, smooth},
      {ModelKind::shape, {.k_a = 1, .k_l = 1, .k_b = 1, .zeta = 1}, {}},
      {ModelKind::bubble, {.a_s = 0.07}, {.point_pairs = true, .walls = true, .beyond_contact = 0.14}}};
  for (const Row& row : table) {
    INFO(to_string(row.kind));
    CHECK(needs_of<2>(row.kind, row.p) == row.lists);
    if (row.kind == ModelKind::sp || row.kind == ModelKind::bubble) CHECK(needs_of<3>(row.kind, row.p) == row.lists);
  }
  CHECK(alone<2>()->needs() == NeighbourNeeds{});
  CHECK(needs_of<3>(ModelKind::rough) ==
        NeighbourNeeds{.point_pairs = true, .walls = true, .lips = true, .edges = Edges::bare, .vertex_faces = true});
  CHECK(needs_of<3>(ModelKind::rough, {.rough_edges = false}) ==
        NeighbourNeeds{.point_pairs = true, .walls = true, .lips = true, .edges = Edges::bare});
  CHECK(needs_of<3>(ModelKind::smooth) ==
        NeighbourNeeds{.walls = true, .lips = true, .vertex_faces = true, .edge_pairs = true});
}

TEST_CASE("terms of one model have the same edges") {
  const EdgeContact bare{1, Edges::bare};
  CHECK(alone<2>(bare, EdgeFriction{0})->needs() == NeighbourNeeds{.vertex_edges = true, .edges = Edges::bare});
  CHECK_THROWS_AS(alone<2>(bare, EdgeFriction{1})->needs(), std::logic_error);
  CHECK_THROWS_AS(alone<2>(MiddleForce{1}, bare)->needs(), std::logic_error);
  CHECK(alone<2>(EdgeContact{1}, MiddleForce{1})->needs() ==
        NeighbourNeeds{.vertex_edges = true, .beyond_contact = MiddleForce::beyond});
}

TEST_CASE("a term that is added to a model gets its list, and its forces are those of all pairs") {
  Random random(1);
  const Configuration<2> c = polygon_rows(random, 20, 20);
  const MiddleForce term{3};
  const auto field = alone<2>(Area{1}, term);
  Neighbours<2> lists(field->needs(), 0.05);
  lists.rebuild(c.topology, c.walls, c.x.data());
  REQUIRE(lists.chunks() == 2);
  CHECK(lists.vertex_edges.across(0).size() > 100);
  const StateView<2> s{c.x.data(), c.v.data(), c.topology, lists, c.walls};
  VectorXd expected = VectorXd::Zero(static_cast<Index>(c.x.size())), forces = expected;
  Real energy = 0;
  Scatter<2, -1> sum{expected.data()};
  for (Index a = 0; a < c.topology.points(); ++a)
    for (Index p = 0; p < c.topology.points(); ++p) {
      if ((s.position(a) - s.position(p)).squaredNorm() > 4) continue;  // edges and ranges are shorter than 1
      if (c.topology.particle[a] == c.topology.particle[p]) continue;
      energy += term.energy_of(s, p, a);
      term.add_gradient_of(s, p, a, sum);
    }
  field->force_of({"middle"}, s, forces.data());
  CHECK(expected.norm() > 1);
  CHECK((forces - expected).norm() < 1e-12 * expected.norm());
  const auto reports = field->report(s);
  CHECK(reports.back().energy == Approx(energy).epsilon(1e-12));
}

TEST_CASE("elements act on the points of their stencils, and couple no others") {
  Random random(2);
  std::set<std::string> names;
  const auto crowd = [&] { return crowd_of_polygons(random, smooth_width); };
  const auto tip = [&] { return touching_polygons(random, Place::edge); };
  check_stencil<2>(Area{1}, crowd(), names);
  check_stencil<2>(Perimeter{1}, crowd(), names);
  check_stencil<2>(Bending{1}, crowd(), names);
  check_stencil<2>(Gravity<2>{{0, -1}}, crowd(), names);
  check_stencil<2>(Drag<2>{1}, crowd(), names);
  check_stencil<2>(EdgeContact{1}, tip(), names);
  check_stencil<2>(EdgeContact{1, Edges::bare}, touching_bare_polygons(random, Place::edge), names);
  check_stencil<2>(EdgeContact{.epsilon = 1, .law = ContactLaw::barrier}, tip(), names);
  check_stencil<2>(EdgeFriction{1}, tip(), names);
  check_stencil<2>(LipContact{1}, polygon_at_lip(random, 60, LipPlace::edge, smooth_width), names);
  const auto check_soft = [&]<int D>(Configuration<D> cluster) {
    check_stencil<D>(PairContact<D>{1, "pair"}, soft_cluster<D>(random), names);
    check_stencil<D>(PairFriction<D>{1}, std::move(cluster), names);
    check_stencil<D>(WallContact<D>{1}, soft_at_wall<D>(random, 60, WallPlace::slope), names);
    check_stencil<D>(BubbleContact<D>{{1}}, droplets_at_wall<D>(), names);
    check_stencil<D>(Depletion<D>{{{1, 0.05}}, {1}}, droplets_at_wall<D>(), names);
    check_stencil<D>(WallRepulsion<D>{{1}}, droplets_at_wall<D>(), names);
    check_stencil<D>(WallDepletion<D>{{1, 0.05}}, droplets_at_wall<D>(), names);
  };
  check_soft(soft_cluster<2>(random));
  check_soft(soft_cluster<3>(random));
  check_stencil<3>(VertexFaceContact{1}, pressed_surfaces(random), names);
  check_stencil<3>(EdgePairContact{1, 0.3}, pressed_surfaces(random), names);
  check_stencil<3>(SimplexFriction<Elements::vertex_faces>{1}, pressed_surfaces(random), names);
  check_stencil<3>(SimplexFriction<Elements::edge_pairs>{1}, pressed_surfaces(random), names);

  // All terms of the catalogue are included.
  const ModelParameters all_on{.k_a = 1, .k_l = 1, .k_b = 1, .mu = 1, .zeta = 1};
  const auto check_names = [&](ModelKind kind, Configuration<2> c) {
    for (const TermReport& term : make_force_field<2>(kind, all_on, {0, -1})->report(c.view())) {
      INFO(to_string(kind) << ": " << term.name);
      CHECK(names.count(term.name) == 1);
    }
  };
  check_names(ModelKind::sp, soft_at_wall<2>(random, 60, WallPlace::slope));
  check_names(ModelKind::rough, polygon_at_lip(random, 60, LipPlace::edge, 0.3).with_bare_edges());
  check_names(ModelKind::smooth, polygon_at_lip(random, 60, LipPlace::edge, smooth_width));
  check_names(ModelKind::bubble, droplets_at_wall<2>());
}

}  // namespace pliant::test::elements_test
