// A model on several chunks: the chunks' lists, and their sums, which equal the sums of a plain loop over all pairs,
// for any number of threads.
#include <omp.h>
#include <catch2/catch.hpp>

#include <pliant/catalogue/catalogue.h>
#include <pliant/model/drag.h>
#include <pliant/model/fused_terms.h>
#include <pliant/model/gravity.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/wall_contact.h>

#include "support/model_parameters.h"
#include "support/rows.h"

namespace pliant::test::chunks_test {

namespace {

constexpr Real skin = 0.05;
const ModelParameters all_on{
    .epsilon = 1e3, .epsilon_wall = 2e3, .k_a = 20, .k_l = 3, .k_b = 0.2, .mu = 0.7, .zeta = 0.3};

/// With all parts that the printed model lacks.
const ModelParameters as_run{.epsilon = 1e3,
                             .epsilon_wall = 2e3,
                             .wall_diameter = 0.05,
                             .k_a = 20,
                             .k_l = 3,
                             .k_b = 0.2,
                             .area_energy = AreaEnergy::relative,
                             .bending_edges = EdgeVectors::full,
                             .edge_force = EdgeForce::twofold,
                             .mu = 0.7,
                             .zeta = 0.3,
                             .friction = Friction::tangential,
                             .drag = DragLaw::per_mass};

/// Number of threads until the end of the scope.
class Threads {
 public:
  explicit Threads(int count) { omp_set_num_threads(count); }
  ~Threads() { omp_set_num_threads(before_); }

 private:
  int before_ = omp_get_max_threads();
};

/// Particles with ids in another order than their places, a few of them inactive.
template <int D>
Configuration<D> with_ids(Random& random, Configuration<D> c) {
  c.topology.id = random_order(random, c.topology.particles());
  for (int k = 0; k < 5; ++k) c.topology.deactivate(random.below(c.topology.particles()));
  return c;
}

Configuration<2> disks(Random& random) { return with_ids<2>(random, soft_rows<2>(random, 75, 70)); }
Configuration<2> polygons(Random& random) { return with_ids<2>(random, polygon_rows(random, 26, 26)); }
Configuration<3> spheres(Random& random) { return with_ids<3>(random, soft_rows<3>(random, 23, 23)); }

template <int D>
Neighbours<D> lists_of(const Configuration<D>& c, ModelKind kind) {
  Neighbours<D> lists(needs_of<D>(kind), skin);
  lists.rebuild(c.topology, c.walls, c.x.data());
  return lists;
}

/// The lists, each pair once, by comparing all pairs, without chunks.
template <int D>
Neighbours<D> brute_force(const Configuration<D>& c, ModelKind kind) {
  const NeighbourNeeds needs = needs_of<D>(kind);
  Neighbours<D> all(needs, skin);
  const Topology& t = c.topology;
  for (Index i = 0; i < t.points(); ++i) {
    if (t.active[t.particle[i]] == 0) continue;
    const Vec<D> r = c.position(i);
    for (Index s = 0; s < static_cast<Index>(c.walls.parts().size()); ++s)
      if (c.walls.distance(r, s, 0) < t.diameter[i] / 2 + skin) all.walls.pairs.push_back({i, s});
    if constexpr (D == 2) {
      if (needs.lips)
        for (Index l = 0; l < 2; ++l)
          if (segment_foot(c.walls.lips()[l].place, r, c.position(t.next[i])).d2 < square(t.diameter[i] / 2 + skin))
            all.lips.pairs.push_back({l, i});
    }
    for (Index j = 0; j < t.points(); ++j) {
      if (t.particle[i] == t.particle[j] || t.active[t.particle[j]] == 0) continue;
      const Real reach = (t.diameter[i] + t.diameter[j]) / 2 + skin;
      if (needs.point_pairs && j < i && (c.position(j) - r).squaredNorm() < square(reach))
        all.point_pairs.pairs.push_back({i, j});
      if constexpr (D == 2) {
        if (needs.vertex_edges && (c.position(j) - r).squaredNorm() < 9 &&  // edges are shorter than that
            segment_foot(c.position(j), r, c.position(t.next[i])).d2 <
                square(vertex_edge_reach(needs.edges, t.diameter[j], t.diameter[i]) + skin))
          all.vertex_edges.pairs.push_back({j, i});
      }
    }
  }
  return all;
}

/// The pair, with the larger point first if the order does not matter.
Pair ordered(const Pair& p, bool symmetric) { return symmetric && p.first < p.second ? Pair{p.second, p.first} : p; }

/// Every pair is inside one chunk, or across the border of two; there by the rule for who comes first.
template <int D>
void check_pairs(const Neighbours<D>& lists, const PairList& list, std::vector<Pair> expected, const Topology& t,
                 bool points, Edges edges = Edges::wide) {
  struct Entry {
    Pair pair;
    Index chunk;
    bool across;
    auto operator<=>(const Entry&) const = default;
  };
  std::vector<Entry> entries;
  std::array<int, 4> wrong{};
  for (Index c = 0; c < lists.chunks(); ++c) {
    const Range own = lists.points(c);
    for (Index e = list.inside(c).first; e < list.inside(c).last; ++e) {
      wrong[0] += !own.contains(list[e].first) || !own.contains(list[e].second);
      entries.push_back({ordered(list[e], points), c, false});
    }
    for (Index e = list.across(c).first; e < list.across(c).last; ++e) {
      wrong[1] += own.contains(list[e].first) == own.contains(list[e].second);
      wrong[2] += points && !own.contains(list[e].first);
      entries.push_back({ordered(list[e], points), c, true});
    }
  }
  for (Index e = 0; e < list.size(); ++e)
    wrong[3] += list.reach[e] != vertex_edge_reach(edges, t.diameter[list[e].first], t.diameter[list[e].second]);
  CHECK(wrong == std::array<int, 4>{});
  CHECK(static_cast<Index>(entries.size()) == list.size());

  std::sort(entries.begin(), entries.end());
  std::vector<Pair> found;
  std::size_t across = 0, unmatched = 0;
  for (std::size_t k = 0; k < entries.size(); ++k) {
    found.push_back(entries[k].pair);
    if (!entries[k].across) continue;
    ++across;
    const bool twice = k + 1 < entries.size() && entries[k + 1].pair == entries[k].pair && entries[k + 1].across &&
                       entries[k + 1].chunk != entries[k].chunk;
    unmatched += !twice;
    ++k;
  }
  for (Pair& p : expected) p = ordered(p, points);
  std::sort(expected.begin(), expected.end());
  CHECK(unmatched == 0);
  CHECK(across > 20);
  CHECK(found.size() > 1000);
  CHECK(found == expected);
}

template <int D>
void check_lists(const Configuration<D>& c, ModelKind kind) {
  INFO(to_string(kind) << ", " << D << "D");
  const Neighbours<D> lists = lists_of(c, kind), all = brute_force(c, kind);
  REQUIRE(lists.chunks() >= 3);
  Index particles = 0, points = 0;
  for (Index k = 0; k < lists.chunks(); ++k) {
    CHECK(lists.particles(k).first == particles);
    CHECK(lists.points(k).first == points);
    CHECK(c.topology.offset[lists.particles(k).last] == lists.points(k).last);
    CHECK(lists.points(k).size() == Approx(c.topology.points() / lists.chunks()).margin(13));
    particles = lists.particles(k).last;
    points = lists.points(k).last;
  }
  CHECK(particles == c.topology.particles());
  const NeighbourNeeds needs = needs_of<D>(kind);
  if (needs.vertex_edges)
    check_pairs(lists, lists.vertex_edges, all.vertex_edges.pairs, c.topology, false, needs.edges);
  if (needs.point_pairs) check_pairs(lists, lists.point_pairs, all.point_pairs.pairs, c.topology, true);
  CHECK(lists.walls.pairs == all.walls.pairs);
  CHECK(lists.walls.size() > 20);
  CHECK(lists.lips.pairs == all.lips.pairs);
}

/// Block matrix times a vector.
template <int D>
struct ProductSink final : BlockSink<D> {
  const VectorXd& p;
  VectorXd product;
  explicit ProductSink(const VectorXd& vector) : p(vector), product(VectorXd::Zero(vector.size())) {}
  void add(Index i, Index j, const Mat<D>& block) override {
    product.template segment<D>(i * D) += block * p.template segment<D>(j * D);
  }
};

/// Results of a model for one configuration.
template <int D>
struct Results {
  VectorXd forces, energy_forces, hessian, damping, walls;
  Real energy = 0, power = 0;
  std::vector<std::pair<Index, Index>> contacts;  ///< particles, the lower first

  explicit Results(const StateView<D>& s) {
    forces = energy_forces = hessian = damping = VectorXd::Zero(s.topology.points() * D);
    walls = VectorXd::Zero(s.walls.size() * D);
  }
  void add(const Contact<D>& contact) {
    contacts.emplace_back(std::min(contact.first, contact.second), std::max(contact.first, contact.second));
  }
};

template <int D>
Results<D> by_model(const ForceField<D>& field, const StateView<D>& s, const VectorXd& p) {
  Results<D> r(s);
  field.forces(s, r.forces.data());
  r.energy = field.energy(s, r.energy_forces.data());
  r.power = field.power(s);
  field.for_each_contact(s, [&](const Contact<D>& contact) { r.add(contact); });
  ProductSink<D> hessian(p), damping(p);
  field.hessian(s, hessian);
  field.damping(s, damping);
  r.hessian = hessian.product;
  r.damping = damping.product;
  field.add_wall_forces(s, r.walls.data());
  return r;
}

template <class T, int D>
Index count(const StateView<D>& s) {
  using Kind = ElementKind<T::elements>;
  if constexpr (Kind::listed)
    return (s.neighbours.*Kind::list).size();
  else
    return T::elements == Elements::particles ? s.topology.particles() : s.topology.points();
}

/// Whether an element counts in sums: elements of inactive particles do not. Lists do not contain such elements.
template <class T, int D>
bool counts(const StateView<D>& s, Index e) {
  using Kind = ElementKind<T::elements>;
  if constexpr (Kind::listed)
    return true;
  else
    return s.topology.active[Kind::particle(s.topology, e)] != 0;
}

/// The same by loops over all elements; the lists of s hold every pair once. Forces are those on inactive points, too.
template <int D, class... Terms>
Results<D> by_loops(const StateView<D>& s, const VectorXd& p, const Terms&... terms) {
  Results<D> r(s);
  ProductSink<D> hessian(p), damping(p);
  const auto add = [&](const auto& term) {
    using T = std::decay_t<decltype(term)>;
    for (Index e = 0; e < count<T, D>(s); ++e) {
      if constexpr (EnergyTerm<T, D>) {
        Scatter<D, -1> forces{r.forces.data()}, energy_forces{r.energy_forces.data()};
        term.add_gradient(s, e, forces);
        term.add_gradient(s, e, energy_forces);
        if (!counts<T>(s, e)) continue;
        r.energy += term.energy(s, e);
        term.add_hessian(s, e, hessian);
      } else {
        Scatter<D, 1> forces{r.forces.data()};
        term.add_force(s, e, forces);
        if (!counts<T>(s, e)) continue;
        r.power += term.power(s, e);
        term.add_dforce_dv(s, e, damping);
      }
      if constexpr (ContactTerm<T, D>) {
        Contact<D> contact;
        if (term.contact(s, e, contact)) r.add(contact);
      }
      if constexpr (T::elements == Elements::walls)
        point<D>(r.walls.data(), s.walls.wall_of_part(s.neighbours.walls[e].second)) -= term.force(s, e);
      if constexpr (T::elements == Elements::lips)
        point<D>(r.walls.data(), s.walls.lips()[s.neighbours.lips[e].first].wall) -= term.force(s, e);
    }
  };
  (add(terms), ...);
  r.hessian = hessian.product;
  r.damping = damping.product;
  return r;
}

template <int D>
Results<D> by_loops(const StateView<D>& s, const VectorXd& p, ModelKind kind, const Vec<D>& gravity,
                    const ModelParameters& a) {
  const WallContact<D> wall{a.epsilon_wall, a.wall_diameter};
  const Gravity<D> weight{gravity};
  const Drag<D> drag{a.zeta, a.drag};
  const PairFriction<D> pair_friction{a.mu, a.friction};
  if (kind == ModelKind::sp)
    return by_loops(s, p, PairContact<D>{a.epsilon, "pair"}, pair_friction, wall, weight, drag);
  if constexpr (D == 2) {
    const Area area{a.k_a, a.area_energy};
    const Perimeter perimeter{a.k_l};
    const Bending bending{a.k_b, a.bending_edges};
    const LipContact lip{a.epsilon_wall, a.lip_edges, a.wall_diameter};
    if (kind == ModelKind::rough)
      return by_loops(s, p, area, perimeter, bending, PairContact<2>{a.epsilon, "contact"}, pair_friction,
                      EdgeContact{a.epsilon / 4, Edges::bare}, wall, lip, weight, drag);
    return by_loops(s, p, area, perimeter, bending, EdgeContact{a.epsilon, Edges::wide, true, a.edge_force},
                    EdgeFriction{a.mu, a.friction_point, a.friction}, wall, lip, weight, drag);
  }
  throw std::logic_error("no such model in 3D");
}

bool near(const VectorXd& a, const VectorXd& b) { return (a - b).norm() <= 1e-12 * b.norm(); }

template <int D>
void check_sums(Random& random, const Configuration<D>& c, ModelKind kind, const ModelParameters& a = all_on) {
  INFO(to_string(kind) << ", " << D << "D");
  const Vec<D> gravity = Vec<D>::LinSpaced(0.1, -1);
  const VectorXd p = random_direction(random, c.topology.points() * D);
  const Neighbours<D> lists = lists_of(c, kind), all = brute_force(c, kind);
  const StateView<D> s{c.x.data(), c.v.data(), c.topology, lists, c.walls},
      flat{c.x.data(), c.v.data(), c.topology, all, c.walls};
  const auto field = make_force_field<D>(kind, a, gravity);
  Results<D> model = by_model(*field, s, p), loops = by_loops(flat, p, kind, gravity, a);

  CHECK(near(model.forces, loops.forces));
  CHECK((model.forces - loops.forces).cwiseAbs().maxCoeff() < 1e-12 * loops.forces.cwiseAbs().maxCoeff());
  CHECK(near(model.energy_forces, loops.energy_forces));
  CHECK(model.energy == Approx(loops.energy).epsilon(1e-12));
  CHECK(field->energy(s) == model.energy);
  CHECK(model.power == Approx(loops.power).epsilon(1e-12));
  CHECK(near(model.hessian, loops.hessian));
  CHECK(near(model.damping, loops.damping));
  CHECK(near(model.walls, loops.walls));
  for (auto* r : {&model, &loops}) std::sort(r->contacts.begin(), r->contacts.end());
  CHECK(model.contacts.size() > 500);
  CHECK(model.contacts == loops.contacts);

  VectorXd accelerations(p.size()), expected = loops.forces, one(p.size()), sum = VectorXd::Zero(p.size());
  VectorXd dissipation = sum;
  field->accelerations(s, accelerations.data());
  for (Index i = 0; i < c.topology.points(); ++i) expected.segment<D>(i * D) *= c.topology.inverse_mass(i);
  CHECK(near(accelerations, expected));
  Real reported = 0;
  for (const TermReport& r : field->report(s)) {
    INFO(r.name);
    const Eigen::Map<const VectorXd> force(r.force.data(), p.size());
    CHECK(force.norm() > 0);
    field->force_of({r.name}, s, one.data());
    CHECK(one == force);
    sum += force;
    if (!r.is_energy) dissipation += force;
    reported += r.energy;
  }
  CHECK(near(sum, loops.forces));
  CHECK(dissipation.norm() > 0);
  field->dissipative_forces(s, one.data());
  CHECK(near(one, dissipation));
  CHECK(reported == Approx(loops.energy).epsilon(1e-12));
}

template <int D>
void check_momentum(const Configuration<D>& c, ModelKind kind, ModelParameters p = all_on) {
  INFO(to_string(kind) << ", " << D << "D");
  p.epsilon_wall = p.zeta = 0;
  const auto field = make_force_field<D>(kind, p, Vec<D>::Zero());
  const Neighbours<D> lists = lists_of(c, kind);
  std::vector<Real> f(c.x.size());
  field->forces({c.x.data(), c.v.data(), c.topology, lists, c.walls}, f.data());
  Vec<D> total = Vec<D>::Zero();
  Real magnitude = 0;
  for (Index i = 0; i < c.topology.points(); ++i) {
    total += point<D>(f.data(), i);
    magnitude += point<D>(f.data(), i).norm();
  }
  CHECK(magnitude > 1e3);
  CHECK(total.norm() < 1e-13 * magnitude);
}

/// All results that threads compute.
template <int D>
struct Computed {
  std::vector<Pair> point_pairs, vertex_edges, walls, lips;
  std::vector<Real> reach, edge_reach, forces, accelerations, energy_forces;
  Real energy = 0, power = 0;
  bool valid = false;
  bool operator==(const Computed&) const = default;
};

template <int D>
Computed<D> compute(const Configuration<D>& c, ModelKind kind) {
  const auto field = make_force_field<D>(kind, all_on, Vec<D>::LinSpaced(0.1, -1));
  const Neighbours<D> lists = lists_of(c, kind);
  const StateView<D> s{c.x.data(), c.v.data(), c.topology, lists, c.walls};
  Computed<D> r;
  r.point_pairs = lists.point_pairs.pairs;
  r.vertex_edges = lists.vertex_edges.pairs;
  r.walls = lists.walls.pairs;
  r.lips = lists.lips.pairs;
  r.reach = lists.point_pairs.reach;
  r.edge_reach = lists.vertex_edges.reach;
  r.forces.resize(c.x.size());
  r.accelerations = r.energy_forces = r.forces;
  field->forces(s, r.forces.data());
  field->accelerations(s, r.accelerations.data());
  r.energy = field->energy(s, r.energy_forces.data());
  r.power = field->power(s);
  r.valid = lists.valid(c.walls, c.x.data());
  return r;
}

template <int D>
void check_threads(const Configuration<D>& c, ModelKind kind) {
  INFO(to_string(kind) << ", " << D << "D");
  std::optional<Computed<D>> one;
  for (const int count : {1, 2, 3, 5}) {
    INFO(count << " threads");
    const Threads threads(count);
    Computed<D> result = compute(c, kind);
    CHECK(result.valid);
    if (!one)
      one = std::move(result);
    else
      CHECK((result == *one));
  }
}

}  // namespace

TEST_CASE("chunks list every pair once, or on both sides of a border") {
  Random random(1);
  check_lists(disks(random), ModelKind::sp);
  check_lists(spheres(random), ModelKind::sp);
  const Configuration<2> c = polygons(random);
  check_lists(c, ModelKind::rough);
  check_lists(c, ModelKind::smooth);
}

TEST_CASE("sums over chunks are the sums of plain loops over all pairs") {
  Random random(2);
  for (const ModelParameters& a : {all_on, as_run}) {
    check_sums(random, disks(random), ModelKind::sp, a);
    check_sums(random, spheres(random), ModelKind::sp, a);
    const Configuration<2> c = polygons(random);
    check_sums(random, c, ModelKind::rough, a);
    check_sums(random, c, ModelKind::smooth, a);
  }
}

TEST_CASE("forces across the borders of chunks conserve momentum") {
  Random random(3);
  check_momentum(disks(random), ModelKind::sp);
  check_momentum(spheres(random), ModelKind::sp);
  const Configuration<2> c = polygons(random);
  check_momentum(c, ModelKind::rough);
  for (const ModelParameters& p : {all_on, as_run}) check_momentum(c, ModelKind::smooth, p);
}

TEST_CASE("the number of threads changes no bit") {
  Random random(4);
  check_threads(disks(random), ModelKind::sp);
  check_threads(spheres(random), ModelKind::sp);
  const Configuration<2> c = polygons(random);
  check_threads(c, ModelKind::rough);
  check_threads(c, ModelKind::smooth);
}

TEST_CASE("one point that moves too far in any chunk makes the lists stale") {
  Random random(5);
  const Configuration<2> c = disks(random);
  const Neighbours<2> lists = lists_of(c, ModelKind::sp);
  const Threads threads(2);
  for (Index k = 0; k < lists.chunks(); ++k) {
    std::vector<Real> x = c.x;
    const Index i = lists.points(k).last - 1;
    x[2 * i] += 0.499 * skin;
    CHECK(lists.valid(c.walls, x.data()));
    x[2 * i] += 0.002 * skin;
    CHECK(!lists.valid(c.walls, x.data()));
    x[2 * i] = std::numeric_limits<Real>::quiet_NaN();
    CHECK(!lists.valid(c.walls, x.data()));
  }
}

}  // namespace pliant::test::chunks_test
