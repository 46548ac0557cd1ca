// A run in a periodic box: its files, and a restart that is identical bit for bit.
#include <catch2/catch.hpp>

#include <algorithm>
#include <filesystem>
#include <map>

#include <pliant/catalogue/catalogue.h>
#include <pliant/run/scenario.h>
#include <pliant/ts/verlet.h>

#include "io/io_support.h"
#include "support/disks.h"
#include "support/model_parameters.h"
#include "support/silence.h"

namespace pliant::test::periodic_test {

namespace {

constexpr Index columns = 6;
constexpr Real length = 5.9;

struct GasOptions final : RunOptions {
  Real t_end = 1, dt = 2e-3;
  void bind(Options& o) {
    o.bind("dt", dt, {.help = "step", .unit = "t0", .min = 1e-9});
    o.bind("t_end", t_end, {.help = "end of the run", .unit = "t0", .min = 0});
    bind_output(o);
  }
};

/// Soft particles in a square that is periodic both ways, with friction; fast, so that they cross the box several
/// times.
class Gas final : public Protocol<2> {
 public:
  Gas(const GasOptions& p, const Ranks& ranks) : Protocol<2>(make(ranks)), p_(p) {}

  std::string title() const override { return "gas"; }
  std::string model() const override { return "sp"; }
  Real last_time() const override { return p_.t_end; }
  Real first_dt() const override { return p_.dt; }
  std::unique_ptr<Integrator> make_integrator(Real dt) override { return std::make_unique<FixedStepVerlet>(dt); }
  RunGeometry geometry() const override { return {"box", {}, {}}; }
  std::vector<Real> start() override {
    std::vector<Real> x;
    for (Index k = 0; k < columns * columns; ++k)
      for (const Index n : {k % columns, k / columns}) x.push_back((n + 0.5) * length / columns);
    return x;
  }
  void started() override {
    for (Index m = 0; m < topology().owned(); ++m)
      point<2>(state().v().data(), m) =
          pliant::Vec<2>(3 + std::sin(topology().id[m]), std::cos(1.7 * topology().id[m]));
  }
  std::vector<SeriesValue> sample() override {
    Real sum = 0;
    for (Index i = 0; i < topology().owned_points(); ++i)
      sum += topology().mass(i) / 2 * point<2>(state().v().data(), i).squaredNorm();
    return {{"time", state().t}, {"dt", run().last_dt()}, {"kinetic_energy", ranks().sum(sum)}};
  }

 private:
  static std::unique_ptr<Simulation<2>> make(const Ranks& ranks) {
    Topology t;
    for (Index k = 0; k < columns * columns; ++k) t.add_soft(0.9 + 0.05 * (k % 5), 1);
    return std::make_unique<Simulation<2>>(
        t,
        ParticleSystem<2>({}, {},
                          make_force_field<2>(ModelKind::sp, {.epsilon = 50, .mu = 0.1}, pliant::Vec<2>::Zero()), 0.1,
                          ranks, Box<2>({0, 0}, {length, length})),
        Sorting::regularly);
  }
  const GasOptions& p_;
};

void run(Arguments arguments) {
  const Silence silence;
  arguments.insert(arguments.end(), {"-frame_interval", "0.25", "-sample_interval", "0.1"});
  REQUIRE(option_scenario<GasOptions, Gas>("gas", "a gas").run(arguments, Ranks()) == ExitCode::done);
}

/// All numbers of all frames and samples.
std::map<std::string, std::vector<Real>> results(const std::filesystem::path& folder) {
  std::map<std::string, std::vector<Real>> all;
  const auto file = hdf5::File::open_read(folder / "run.h5");
  for (const std::string& n : file.open_group("/frames").links())
    for (const char* name :
         {"positions", "velocities", "images", "contacts/force", "contacts/particles", "xdmf/contact_particle"})
      all[n + "/" + name] = file.read<Real>("/frames/" + n + "/" + name);
  all["kinetic_energy"] = file.read<Real>("/series/kinetic_energy");
  return all;
}

}  // namespace

TEST_CASE("a run in a periodic box writes the box and how often particles have gone round it", "[periodic]") {
  const ScratchFolder scratch;
  const std::string folder = scratch / "run";
  run({"-output", folder, "-t_end", "1.5"});
  const auto file = hdf5::File::open_read(scratch / "run/run.h5");
  CHECK(file.read<Real>("/geometry/box") == std::vector<Real>{0, 0, length, length});
  const auto all = results(folder);
  const std::vector<Real>&x = all.at("000006/positions"), &images = all.at("000006/images"),
        &before = all.at("000005/positions"), &images_before = all.at("000005/images");
  CHECK(std::ranges::min(x) >= 0);
  CHECK(std::ranges::max(x) <= length);
  CHECK(std::ranges::max(images) >= 1);
  // No particle is faster than 6, for any position of the border.
  Real farthest = 0, wrapped = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    farthest = std::max(farthest, std::abs(x[k] + length * images[k] - before[k] - length * images_before[k]));
    wrapped = std::max(wrapped, std::abs(x[k] - before[k]));
  }
  CHECK(farthest < 1.5);
  CHECK(wrapped > 3);
  // Contacts are drawn at the first particle, as lines between centres would go through the box.
  const std::vector<Real>&pairs = all.at("000006/contacts/particles"), &first = all.at("000006/xdmf/contact_particle");
  REQUIRE(!first.empty());
  REQUIRE(pairs.size() == 2 * first.size());
  for (std::size_t k = 0; k < first.size(); ++k) CHECK(first[k] == pairs[2 * k]);
}

TEST_CASE("a restart in a periodic box is bit for bit", "[periodic]") {
  const ScratchFolder scratch;
  run({"-output", scratch / "whole", "-t_end", "1.5"});
  run({"-output", scratch / "parts", "-t_end", "0.7"});
  run({"-restart", scratch / "parts", "-t_end", "1.1"});
  run({"-restart", scratch / "parts", "-t_end", "1.5"});
  const auto whole = results(scratch / "whole"), parts = results(scratch / "parts");
  // Ends have extra frames and samples: compare the common ones.
  CHECK(whole.at("000002/positions") == parts.at("000002/positions"));
  const auto last = [](const auto& all, const std::string& name) {
    std::string newest;
    for (const auto& [key, values] : all)
      if (key.ends_with(name)) newest = std::max(newest, key);
    return all.at(newest);
  };
  for (const char* name : {"/positions", "/velocities", "/images", "/contacts/force"}) {
    INFO(name);
    CHECK(last(whole, name) == last(parts, name));
  }
  CHECK(std::ranges::max(last(whole, "/images")) >= 1);
  CHECK(whole.at("kinetic_energy").back() == parts.at("kinetic_energy").back());
}

TEST_CASE("springs between particles that rotate reach across the borders of a box", "[periodic]") {
  Random random(1);
  Configuration<2> c = soft_rows<2>(random, 5, 5);
  c.walls = {};
  for (Real& v : c.v) v = 2 * v + 2;
  const std::vector<Real> angles(25, 0), spins = random_numbers(random, 25, 3);
  const auto make = [&](const Configuration<2>& at, Real side, Sorting sorting) {
    auto s = std::make_unique<Simulation<2>>(
        at.topology,
        ParticleSystem<2>({}, {}, alone<2>(PairContact<2>{1000, "pair"}, TangentialSpring{400, 0.4, 1000}), 0.05,
                          Ranks(), Box<2>({0, 0}, {side, side})),
        sorting);
    s->set_integrator(std::make_unique<FixedStepVerlet>(1e-3));
    start(*s, at, angles, spins);
    return s;
  };
  // Where they would be without the box, and their spins, by id.
  const auto found = [](const Simulation<2>& s) {
    const State& state = s.state();
    const auto spin = s.particles().rotations_in(state.v());
    std::vector<Real> all(75);
    for (Index m = 0; m < 25; ++m) {
      const Index id = s.topology().id[m];
      const pliant::Vec<2> shift =
          state.images.empty() ? pliant::Vec<2>(0, 0) : s.particles().box().shift(state.images[m]);
      point<2>(all.data(), id) = point<2>(state.x().data(), m) + shift;
      all[50 + id] = spin[m];
    }
    return all;
  };
  const auto one = make(c, 4.75, Sorting::never);
  Configuration<2> moved = soft_rows<2>(random, 5, 5);
  moved.topology = c.topology;
  moved.x = c.x;
  moved.v = c.v;
  for (Index m = 0; m < 25; ++m)
    point<2>(moved.x.data(), m) += pliant::Vec<2>(4.75 * (m % 3 - 1), 4.75 * (m % 4) + 0.3);
  const auto other = make(moved, 4.75, Sorting::regularly);
  one->advance(0.3);
  other->advance(0.3, [&](State& state) {
    if (state.step % 30 != 0) return AfterStep::proceed;
    other->sort();
    return AfterStep::reordered;
  });
  const std::vector<Real> a = found(*one), b = found(*other);
  Real most = 0, turned = 0;
  for (Index m = 0; m < 25; ++m) {
    const pliant::Vec<2> by = point<2>(moved.x.data(), m) - point<2>(c.x.data(), m);
    most = std::max(most, (point<2>(b.data(), m) - point<2>(a.data(), m) - by).norm());
    most = std::max(most, std::abs(a[50 + m] - b[50 + m]));
    turned = std::max(turned, std::abs(a[50 + m] - spins[m]));
  }
  CHECK(most < 1e-8);
  CHECK(turned > 1);
  CHECK(other->particles().history().of("tangential").contacts().keys.size() > 20);
  // A pair that meets twice would have one spring.
  CHECK_THROWS_WITH(make(c, 2.2, Sorting::regularly), Catch::Contains("contacts with a history need at least"));
}

}  // namespace pliant::test::periodic_test
