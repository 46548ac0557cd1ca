// Speedup by threads and ranks: a stored run is continued in turns of some steps by one process, by its threads, by
// copies on all ranks at the same time, and by the ranks together. Turns follow each other within a second, so that
// changes of the machine's speed affect them equally.
//
//     mpiexec -n 2 pliant_speedup FOLDER STEPS CYCLES
//
// prints a line of JSON: for each way of running, the wall time of each cycle's turn in ns per point and step.
#include <fmt/format.h>
#include <omp.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <pliant/base/petsc.h>
#include <pliant/model/polygon.h>
#include <pliant/run/folder.h>
#include <pliant/run/simulation.h>
#include <pliant/run/stored_particles.h>
#include <pliant/scenarios/hopper/options.h>
#include <pliant/setup/particles.h>
#include <pliant/ts/verlet.h>

namespace pliant {
namespace {

constexpr int warm_up = 20;  // steps before each turn, until caches hold the system whose turn it is

/// A hopper's particles without the other work of a run; particles that have left are removed between turns.
template <int D>
class System {
 public:
  /// Each rank begins with an equal share, and gets those that lie together.
  System(const HopperOptions& p, const Checkpoint& c, const Ranks& ranks)
      : simulation_(
            make_particles(p.model.particles(), D,
                           draw_diameters(p.sizes, p.particles, static_cast<std::uint64_t>(p.seed)), p.shape),
            ParticleSystem<D>({}, p.hopper.walls<D>(), p.force_field<D>(-Vec<D>::Unit(D - 1)), p.first_skin(), ranks),
            Sorting::regularly),
        dt_(c.real("dt", 0)) {
    const StoredParticles stored(c, simulation_.all(), D, ranks);
    simulation_.take(stored.ids());
    simulation_.particles().tune_skin();
    simulation_.particles().neighbours().set_skin(c.real("skin", 0));
    simulation_.state().assign(stored.points("x"), stored.points("v"));
    simulation_.set_integrator(std::make_unique<FixedStepVerlet>(dt_));
    simulation_.sort();
  }

  /// Seconds of `steps` steps.
  double run(int steps) {
    const Topology& topology = simulation_.topology();
    const Real* x = simulation_.state().x().data();
    for (Index m = 0; m < topology.owned(); ++m)
      if (topology.active[m] && mean_of_points<D>(x, topology, m)[D - 1] < -3) simulation_.particles().deactivate(m);
    move(warm_up);
    const auto start = std::chrono::steady_clock::now();
    move(steps);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }

 private:
  void move(int steps) {
    const Real end = static_cast<Real>(simulation_.state().step + steps) * dt_;
    simulation_.advance(end, [&](State&) {
      if (!simulation_.particles().sort_due()) return AfterStep::proceed;
      simulation_.sort();
      return AfterStep::reordered;
    });
  }

  Simulation<D> simulation_;
  Real dt_;
};

/// Runs body on one rank, while the other ranks sleep.
template <class Body>
double alone(const Ranks& ranks, int on, Body&& body) {
  const double seconds = ranks.rank() == on ? body() : 0;
  ranks.meet(std::chrono::hours(1));
  return ranks.max(seconds);
}

template <int D>
void measure(const HopperOptions& p, const Checkpoint& checkpoint, const Ranks& ranks, int steps, int cycles) {
  System<D> own(p, checkpoint, Ranks()), shared(p, checkpoint, ranks);
  const double per = 1e9 / (static_cast<double>(checkpoint.reals.at("x").size()) / D * steps);
  const int workers = ranks.size();
  nlohmann::ordered_json result;
  for (int cycle = -1; cycle < cycles; ++cycle) {
    // The mean over the cores: they differ.
    double serial = 0;
    for (int rank = 0; rank < workers; ++rank) serial += alone(ranks, rank, [&] { return own.run(steps); }) / workers;
    const double threads = alone(ranks, 0, [&] {
      omp_set_num_threads(workers);
      const double seconds = own.run(steps);
      omp_set_num_threads(1);
      return seconds;
    });
    ranks.max(0);  // all at once
    const double copies = ranks.sum(own.run(steps)) / workers / workers;
    ranks.max(0);
    const double together = ranks.max(shared.run(steps));
    if (cycle < 0) continue;
    result["serial"].push_back(per * serial);
    result["threads"].push_back(per * threads);
    result["serial runs"].push_back(per * copies);
    result["ranks"].push_back(per * together);
  }
  if (ranks.root()) fmt::print("{}\n", result.dump());
}

void run(const std::vector<std::string>& arguments, const Ranks& ranks) {
  if (arguments.size() != 3) throw InputError("usage: mpiexec -n N pliant_speedup FOLDER STEPS CYCLES");
  HopperOptions p;
  Options options;
  p.bind(options);
  options.parse({"-restart", arguments[0]});
  Checkpoint checkpoint;
  FolderLock lock;
  make_run("hopper", p, options, ranks, lock, [&](std::optional<Checkpoint> stored) {
    p.resolve();
    checkpoint = std::move(stored.value());
  });
  omp_set_num_threads(1);
  const int steps = std::stoi(arguments[1]), cycles = std::stoi(arguments[2]);
  if (p.dim == 2)
    measure<2>(p, checkpoint, ranks, steps, cycles);
  else
    measure<3>(p, checkpoint, ranks, steps, cycles);
}

}  // namespace
}  // namespace pliant

int main(int argc, char** argv) {
  pliant::PetscSession petsc;
  try {
    pliant::run({argv + 1, argv + argc}, pliant::Ranks(PETSC_COMM_WORLD));
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "pliant_speedup: error: %s\n", error.what());
    MPI_Abort(PETSC_COMM_WORLD, 1);  // other ranks may be waiting
  }
}
