// Runs of frictional disks: stored spins and contacts.
#include <petscsys.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>

#include <pliant/run/scenario.h>

#include "support/frictional.h"
#include "support/silence.h"

namespace pliant::test::stored_rotation_test {

namespace {

struct Parameters : RunOptions {
  Real dt = 1e-3, t_end = 0.1;
  void bind(Options& o) {
    o.group("Disks");
    o.bind("dt", dt, {.help = "step", .min = 1e-9, .on_restart = OnRestart::fixed});
    o.bind("t_end", t_end, {.help = "end of the run", .min = 0});
    bind_output(o);
  }
};

Configuration<2> pile() {
  Random random(1);
  Configuration<2> c = soft_rows<2>(random, 8, 8);
  c.walls = Walls<2>({WallSegment::between({-8, 0}, {8, 0})});
  return c;
}

std::unique_ptr<Simulation<2>> make_simulation(const Ranks& ranks) {
  constexpr Real epsilon = 1000;
  constexpr SurfaceFriction rough{.mu_static = 0.3, .mu_dynamic = 0.2, .damping = 0.1};
  return simulation_of<2>(pile(), Sorting::regularly, ranks, nullptr, PairContact<2>{epsilon, "pair"},
                          TangentialSpring{400, 0.4, epsilon}, WallContact<2>{epsilon}, WallSpring{400, 0.4, epsilon},
                          SpinDrag<2>{0.01}, disk_pairs(epsilon, rough), DiskWallContact{epsilon, rough},
                          BaseFriction{.gravity = 1, .mu_static = 0.3, .mu_dynamic = 0.2, .epsilon = 100});
}

class Disks final : public Protocol<2> {
 public:
  Disks(const Parameters& p, const Ranks& ranks) : Protocol<2>(make_simulation(ranks)), p_(p) {}
  std::string title() const override { return "frictional disks"; }
  std::string model() const override { return "disks"; }
  Real last_time() const override { return p_.t_end; }
  Real first_dt() const override { return p_.dt; }
  std::unique_ptr<Integrator> make_integrator(Real dt) override { return std::make_unique<FixedStepVerlet>(dt); }
  RunGeometry geometry() const override { return {"floor", {-8, 0, 8, 0}, {{"W", 16}}}; }
  std::vector<Real> start() override { return pile().x; }
  void started() override {
    for (Index m = 0; m < topology().owned(); ++m) {
      point<2>(state().v().data(), m) = pliant::Vec<2>(0.5, -1);
      simulation().spins()[static_cast<std::size_t>(m)] = topology().id[m] % 5 - 2;
    }
    simulation().changed();
  }
  std::vector<SeriesValue> sample() override { return {{"time", state().t}}; }

 private:
  const Parameters& p_;
};

/// A folder for all ranks, which is removed in the end.
struct Folder {
  Ranks ranks{PETSC_COMM_WORLD};
  std::string path;
  explicit Folder(const std::string& name)
      : path((std::filesystem::temp_directory_path() /
              fmt::format("pliant-{}-{}", name, ranks.broadcast(static_cast<int>(::getpid()))))
                 .string()) {}
  ~Folder() {
    ranks.sum(1.0);
    if (ranks.root()) std::filesystem::remove_all(path);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ExitCode run(const std::vector<std::string>& arguments) const {
    const Silence silence;
    return option_scenario<Parameters, Disks>("disks", "").run(arguments, ranks);
  }
  Checkpoint newest() const { return read_checkpoint(find_checkpoints(path).files.front()); }
};

/// An array of a checkpoint, by id.
std::vector<Real> by_id(const Checkpoint& c, const std::string& name) {
  const auto& ids = c.integers.at("id");
  const auto& values = c.reals.at(name);
  const std::size_t width = values.size() / ids.size();
  std::vector<Real> sorted(values.size());
  for (std::size_t k = 0; k < ids.size(); ++k)
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(k * width), width,
                sorted.begin() + ids[k] * static_cast<std::ptrdiff_t>(width));
  return sorted;
}

}  // namespace

TEST_CASE("a run with spins and contacts is continued bit for bit", "[ranks]") {
  const Folder whole("whole"), parts("parts");
  CHECK(whole.run({"-output", whole.path, "-t_end", "0.3", "-frame_interval", "0.1"}) == ExitCode::done);
  CHECK(parts.run({"-output", parts.path, "-t_end", "0.15", "-frame_interval", "0.1"}) == ExitCode::done);
  const Checkpoint middle = parts.newest();
  CHECK(middle.step == 150);
  CHECK(middle.integers.at("contacts_of_tangential").size() > 50);
  CHECK(middle.integers.at("contacts_of_wall_tangential").size() >= 4);
  CHECK(parts.run({"-restart", parts.path, "-t_end", "0.3"}) == ExitCode::done);
  const Checkpoint a = whole.newest(), b = parts.newest();
  REQUIRE(a.step == 300);
  REQUIRE(b.step == 300);
  for (const char* name : {"x", "v", "angle", "spin", "carried", "carried_spin"}) {
    INFO(name);
    const std::vector<Real> one = by_id(a, name), two = by_id(b, name), before = by_id(middle, name);
    CHECK(one != before);
    CHECK(one.size() == two.size());
    Real most = 0;
    for (std::size_t k = 0; k < one.size(); ++k) most = std::max(most, std::abs(one[k] - two[k]));
    CHECK(most <= (whole.ranks.several() ? 1e-8 : 0));
  }
  for (const std::string term :
       {"tangential", "wall_tangential", "disk_contact", "disk_wall_contact", "base_friction"}) {
    INFO(term);
    CHECK(a.integers.at("contacts_of_" + term).size() == b.integers.at("contacts_of_" + term).size());
    if (whole.ranks.several()) continue;
    CHECK(a.integers.at("contacts_of_" + term) == b.integers.at("contacts_of_" + term));
    CHECK(a.reals.at("history_of_" + term) == b.reals.at("history_of_" + term));
    CHECK(a.reals.at("history_of_" + term) != middle.reals.at("history_of_" + term));
  }
  for (const std::string heat : {"heat_of_disk_contact", "heat_of_disk_wall_contact", "heat_of_base_friction"}) {
    INFO(heat);
    const auto sum = [&](const Checkpoint& c) {
      return std::accumulate(c.reals.at(heat).begin(), c.reals.at(heat).end(), 0.0);
    };
    CHECK(sum(middle) > 0);
    CHECK(sum(a) > 1.01 * sum(middle));
    CHECK(sum(a) == Approx(sum(b)).epsilon(1e-8));
    if (!whole.ranks.several()) CHECK(a.reals.at(heat) == b.reals.at(heat));
  }
  whole.ranks.on_root([&] {
    const auto file = hdf5::File::open_read(whole.path + "/run.h5");
    const auto frame = file.open_group("frames").open_group("000003");
    const std::vector<Real> angles = frame.read<Real>("angles"), spins = frame.read<Real>("spins");
    CHECK(angles == by_id(a, "angle"));
    CHECK(spins == by_id(a, "spin"));
  });
}

TEST_CASE("a damaged history is refused") {
  const Folder folder("damaged");
  CHECK(folder.run({"-output", folder.path, "-t_end", "0.05"}) == ExitCode::done);
  const Checkpoint good = folder.newest();
  const Topology all = pile().topology;
  const auto load = [&](const Checkpoint& c) {
    const auto s = make_simulation(Ranks());
    const StoredParticles stored(c, all, 2, Ranks());
    s->take(stored.ids());
    stored.load_history(s->particles());
    return s->particles().history().of("tangential").contacts();
  };
  const std::string pairs = "contacts_of_tangential", walls = "contacts_of_wall_tangential";
  CHECK(2 * load(good).keys.size() == good.integers.at(pairs).size());
  CHECK(load(good).values == good.reals.at("history_of_tangential"));
  const auto refused = [&](auto&& damage, const std::string& message) {
    Checkpoint bad = good;
    damage(bad);
    CHECK_THROWS_WITH(load(bad), Catch::Contains(message) && Catch::Contains("checkpoint-"));
  };
  refused([&](Checkpoint& c) { c.integers["history_format"] = {2}; }, "history_format = 2 instead of 1");
  refused([&](Checkpoint& c) { c.integers.erase(pairs); }, pairs);
  refused([&](Checkpoint& c) { c.integers[pairs].pop_back(); }, "values instead of");
  refused([&](Checkpoint& c) { c.integers[pairs][1] = 64; }, "64");
  refused([&](Checkpoint& c) { std::swap(c.integers[pairs][0], c.integers[pairs][1]); }, "the lower id first");
  refused([&](Checkpoint& c) { std::copy_n(c.integers[pairs].begin(), 2, c.integers[pairs].begin() + 2); },
          "is there twice");
  refused([&](Checkpoint& c) { c.integers[walls][1] = 1; }, "is not a contact of 64 particles and 1 surfaces");
  refused([&](Checkpoint& c) { c.reals["history_of_tangential"].pop_back(); }, "values instead of");
  refused([&](Checkpoint& c) { c.reals["history_of_tangential"][0] = std::nan(""); }, "not finite");
}

}  // namespace pliant::test::stored_rotation_test
