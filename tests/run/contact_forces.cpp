// Forces of contacts in frames: elastic forces, friction and damping. Cases with the tag work on any number of ranks.
#include <petscsys.h>

#include <catch2/catch.hpp>

#include <array>
#include <memory>
#include <vector>

#include <pliant/run/frame_data.h>
#include <pliant/run/simulation.h>
#include <pliant/ts/verlet.h>

#include "support/disks.h"
#include "support/rows.h"
#include "support/smooth_surfaces.h"

namespace pliant::test::contact_forces_test {

namespace {

using pliant::Vec;  // PETSc has one, too

constexpr Real zeta = 0.3;

/// Particles of a model with friction, gravity and drag.
template <int D>
std::unique_ptr<Simulation<D>> simulation(ModelKind kind, const Configuration<D>& c, ModelParameters p,
                                          const Ranks& ranks = Ranks(), const Box<D>& box = {}) {
  p.zeta = zeta;
  const Vec<D> gravity = Vec<D>::LinSpaced(0.2, -1);
  auto s = std::make_unique<Simulation<D>>(
      c.topology, ParticleSystem<D>({}, c.walls, make_force_field<D>(kind, p, gravity), 0.05, ranks, box),
      Sorting::never);
  s->set_integrator(std::make_unique<FixedStepVerlet>(2e-4));
  if (kind == ModelKind::disk) {
    Random random(7);
    const auto n = static_cast<std::size_t>(c.topology.particles()) * rotations<D>;
    start(*s, c, std::vector<Real>(n), random_numbers(random, n, 3));
    s->particles().accepted(s->state().t, s->state().x().data(), s->state().v().data(), 0);
  } else {
    s->place(c.x);
    const Topology& own = s->topology();
    for (Index m = 0; m < own.owned(); ++m)
      std::copy_n(c.v.data() + static_cast<std::size_t>(c.topology.offset[own.id[m]]) * D,
                  static_cast<std::size_t>(own.points_of(m)) * D,
                  s->state().v().data() + static_cast<std::size_t>(own.offset[m]) * D);
  }
  return s;
}

template <int D>
Vec<D> row(const Strided<Real>& values, std::size_t k) {
  return point<D>(values[k], 0);
}

/// The contacts of a frame, with gravity and drag, carry all forces between particles. Returns the number of contacts
/// with friction, of pairs and at walls.
template <int D>
std::array<Index, 2> check_balance(Simulation<D>& s) {
  const FrameData<D> data(s.particles(), s.state());
  const StateView<D> view = s.view();
  const Topology& t = view.topology;
  const auto sum_on_particles = [&](const std::vector<Real>& f) {
    std::vector<Vec<D>> sums(static_cast<std::size_t>(t.owned()), Vec<D>::Zero());
    for (Index m = 0; m < t.owned(); ++m)
      for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i)
        sums[static_cast<std::size_t>(t.id[m])] += point<D>(f.data(), i);
    return sums;
  };
  std::vector<Real> f(static_cast<std::size_t>(t.points()) * (D + rotations<D>));
  s.particles().field().forces(view, f.data());
  std::vector<Vec<D>> rest = sum_on_particles(f);
  Real size = 0;
  for (const Vec<D>& force : rest) size = std::max(size, force.norm());
  for (const char* term : {"gravity", "drag"}) {
    s.particles().field().force_of({term}, view, f.data());
    const std::vector<Vec<D>> sums = sum_on_particles(f);
    REQUIRE(sums[0] != Vec<D>::Zero());
    for (std::size_t m = 0; m < rest.size(); ++m) rest[m] -= sums[m];
  }
  std::array<Index, 2> rubbing{};
  for (const bool wall : {false, true}) {
    const FrameContacts& contacts = wall ? data.frame.wall_contacts : data.frame.contacts;
    for (std::size_t k = 0; k < contacts.count; ++k) {
      const Vec<D> force = row<D>(contacts.force, k);
      size = std::max(size, force.norm());
      rest[static_cast<std::size_t>(contacts.particles[k][0])] -= force;
      if (!wall) rest[static_cast<std::size_t>(contacts.particles[k][1])] += force;  // Newton's third law
      if (contacts.friction.data != nullptr && row<D>(contacts.friction, k).norm() > 1e-6)
        ++rubbing[static_cast<std::size_t>(wall)];
    }
  }
  for (const Vec<D>& difference : rest) CHECK(difference.norm() < 1e-12 * size);
  return rubbing;
}

}  // namespace

TEMPLATE_TEST_CASE_SIG("contacts carry the friction of points", "", ((int D), D), 2, 3) {
  for (const Friction friction : {Friction::whole, Friction::tangential})
    for (const std::uint64_t seed : {1, 2, 3}) {
      Random random(seed);
      CHECK(check_balance(
                *simulation<D>(ModelKind::sp, soft_cluster<D>(random), {.mu = 0.7, .friction = friction}))[0] > 5);
    }
}

TEMPLATE_TEST_CASE_SIG("contacts carry friction and damping with history", "", ((int D), D), 2, 3) {
  for (const ContactLaw law : {ContactLaw::harmonic, ContactLaw::hertz})
    for (const std::uint64_t seed : {4, 5}) {
      Random random(seed);
      const auto s = simulation<D>(ModelKind::disk, soft_rows<D>(random, 4, 3),
                                   {.epsilon = 1000, .epsilon_wall = 2000, .law = law});
      for (int k = 0; k < 3; ++k) {
        s->advance(0.01);
        const auto [pairs, walls] = check_balance(*s);
        CHECK(pairs > 5);
        CHECK(walls > 2);
      }
    }
}

TEST_CASE("contacts of polygons carry their elastic forces and their friction") {
  for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    INFO("seed " << seed);
    for (const FrictionPoint where : {FrictionPoint::contact, FrictionPoint::vertex})
      for (const EdgeForce edges : {EdgeForce::single, EdgeForce::twofold})
        for (const Friction friction : {Friction::whole, Friction::tangential}) {
          Random random(seed);
          CHECK(check_balance(*simulation<2>(
                    ModelKind::smooth, crowd_of_polygons(random, smooth_width),
                    {.edge_force = edges, .mu = 0.7, .friction_point = where, .friction = friction}))[0] >= 4);
        }
    Random random(seed);
    CHECK(check_balance(*simulation<2>(ModelKind::rough, crowd_of_polygons(random, 0.5), {.mu = 0.7}))[0] >= 4);
    check_balance(*simulation<2>(ModelKind::smooth, polygon_rows(random, 3, 3), {.mu = 0.7}));
  }
}

TEST_CASE("contacts of closed surfaces carry their elastic forces and their friction") {
  for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    INFO("seed " << seed);
    for (const Friction friction : {Friction::whole, Friction::tangential}) {
      Random random(seed);
      CHECK(check_balance(*simulation<3>(ModelKind::smooth, pressed_surfaces(random),
                                         {.mu = 0.7, .friction = friction}))[0] >= 1);
    }
    Random random(seed);
    CHECK(check_balance(*simulation<3>(ModelKind::rough, pressed_surfaces(random, 0.5), {.mu = 0.7}))[0] >= 1);
  }
}

TEST_CASE("friction of two disks by hand") {
  // Overlap 0.1, the lower disk at rest. The upper one moves along the surface and does not part.
  Configuration<2> c;
  c.add_soft(1, {0, 0});
  c.add_soft(1, {0, 0.9});
  c.v = {0, 0, 2, 0};
  const ModelParameters p{.epsilon = 100, .mu = 0.7};
  const auto soft = simulation<2>(ModelKind::sp, c, p);
  const FrameData<2> data(soft->particles(), soft->state());
  REQUIRE(data.frame.contacts.count == 1);
  CHECK(row<2>(data.frame.contacts.force, 0)[0] == Approx(0.7 * 2));  // on the lower one
  CHECK(row<2>(data.frame.contacts.force, 0)[1] == Approx(-10));
  CHECK(row<2>(data.frame.contacts.friction, 0)[0] == Approx(0.7 * 2));
  CHECK(row<2>(data.frame.contacts.friction, 0)[1] == Approx(0).margin(1e-14));

  // Without a spring yet, the dashpot pulls: γ_t q̇ with γ_t = γ_n/2, γ_n = 2 ζ √(m_r V''), q̇ = v (R_i + R_j)/d; the
  // force has the factor (R_i + R_j)/d, too. At most μ N.
  const auto disk = [&](Real v, Real mu) {
    c.v[2] = v;
    auto s = std::make_unique<Simulation<2>>(
        c.topology,
        ParticleSystem<2>({}, {},
                          make_force_field<2>(ModelKind::disk,
                                              {.epsilon = 100, .disk = {.mu_disk = mu, .mu_disk_dynamic = mu}}, {0, 0}),
                          0.05, Ranks()),
        Sorting::never);
    start(*s, c, {0, 0}, {0, 0});
    s->particles().accepted(0, s->state().x().data(), s->state().v().data(), 0);
    const FrameData<2> of(s->particles(), s->state());
    REQUIRE(of.frame.contacts.count == 1);
    return std::pair(row<2>(of.frame.contacts.force, 0), row<2>(of.frame.contacts.friction, 0));
  };
  const Real gamma = damping_for(ContactLaw::harmonic, 0.5) * std::sqrt(pi / 8 * 100);
  const auto [slow, dashpot] = disk(0.01, 10);
  CHECK(slow[0] == Approx(gamma * 0.01 / square(0.9)));
  CHECK(slow[1] == Approx(-10));
  CHECK(dashpot[0] == Approx(slow[0]));
  CHECK(dashpot[1] == Approx(0).margin(1e-13));
  CHECK(disk(100, 0.3).first[0] == Approx(0.3 * 10));
}

TEST_CASE("frames and contact forces change no contact history") {
  Random random(3);
  const Configuration<2> c = soft_rows<2>(random, 5, 4);
  const ModelParameters p{.epsilon = 1000, .epsilon_wall = 2000};
  const auto plain = simulation<2>(ModelKind::disk, c, p), watched = simulation<2>(ModelKind::disk, c, p);
  for (int k = 0; k < 20; ++k) {
    plain->advance(2e-3);
    const FrameData<2> data(watched->particles(), watched->state());
    REQUIRE(data.frame.contacts.friction.data != nullptr);
    watched->advance(2e-3);
  }
  CHECK(Snapshot<2>(*plain) == Snapshot<2>(*watched));
  for (const char* term : {"disk_contact", "disk_wall_contact"}) {
    CHECK(plain->particles().history().of(term).contacts().keys ==
          watched->particles().history().of(term).contacts().keys);
    CHECK(plain->particles().history().of(term).contacts().values ==
          watched->particles().history().of(term).contacts().values);
  }
}

TEST_CASE("contact forces on any number of ranks", "[ranks]") {
  using Row = std::array<Real, 8>;  // particles, position, force, friction
  const auto rows = [](Simulation<2>& s) {
    const FrameData<2> data(s.particles(), s.state());
    const FrameContacts& c = data.frame.contacts;
    std::vector<Row> own;
    for (std::size_t k = 0; k < c.count; ++k) {
      Row& r = own.emplace_back(Row{static_cast<Real>(c.particles[k][0]), static_cast<Real>(c.particles[k][1])});
      std::copy_n(c.position[k], 2, &r[2]);
      std::copy_n(c.force[k], 2, &r[4]);
      if (c.friction.data != nullptr) std::copy_n(c.friction[k], 2, &r[6]);
    }
    std::vector<Row> all = s.ranks().all_gather(own);
    std::sort(all.begin(), all.end());
    return all;
  };
  const auto require_same = [&](ModelKind kind, const Configuration<2>& c, const ModelParameters& p, Real time,
                                const Box<2>& box = {}) {
    const auto alone = simulation<2>(kind, c, p, Ranks(), box),
               shared = simulation<2>(kind, c, p, Ranks(PETSC_COMM_WORLD), box);
    if (time > 0)
      for (Simulation<2>* s : {alone.get(), shared.get()}) s->advance(time);
    const std::vector<Row> expected = rows(*alone);
    REQUIRE(std::any_of(expected.begin(), expected.end(), [](const Row& r) { return r[6] != 0; }));
    const std::vector<Row> found = rows(*shared);
    REQUIRE(found.size() == expected.size());
    Real largest = 0, difference = 0;
    for (std::size_t k = 0; k < found.size(); ++k)
      for (std::size_t n = 0; n < found[k].size(); ++n) {
        largest = std::max(largest, std::abs(expected[k][n]));
        difference = std::max(difference, std::abs(found[k][n] - expected[k][n]));
      }
    CHECK(difference < 1e-10 * largest);  // of the same pairs, summed in another order
  };
  Random random(5);
  const Configuration<2> disks = soft_rows<2>(random, 5, 4), polygons = crowd_of_polygons(random, smooth_width);
  require_same(ModelKind::disk, disks, {.epsilon = 1000, .epsilon_wall = 2000}, 0.01);
  require_same(ModelKind::sp, disks, {.epsilon = 1000, .mu = 0.7}, 0);
  for (const FrictionPoint where : {FrictionPoint::contact, FrictionPoint::vertex})
    require_same(ModelKind::smooth, polygons, {.mu = 0.7, .friction_point = where}, 0);
}

}  // namespace pliant::test::contact_forces_test
