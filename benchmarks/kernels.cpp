// Cost of a force evaluation, a list rebuild and a Verlet step per point, in hoppers in dense flow, and of an
// iteration of FIRE in their packing. Times are CPU seconds per point (a soft particle or a vertex) in the
// column per_point.
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/model/fused_terms.h>
#include <pliant/model/polygon.h>
#include <pliant/scenarios/hopper/options.h>
#include <pliant/setup/reinsertion.h>
#include <pliant/system/particle_system.h>
#include <pliant/ts/verlet.h>

namespace pliant {
namespace {

/// A hopper, and the time of its flow before the measurement.
struct Case {
  std::string name;
  HopperOptions options;
  Real flow_time;  ///< in t0
};

std::vector<Case> cases() {
  const auto make = [](std::string name, ModelKind model, Index dim, Real flow_time, auto&&... set) {
    Case c{std::move(name), HopperOptions{}, flow_time};
    c.options.model.name = to_string(model);
    c.options.dim = dim;
    (set(c.options), ...);
    c.options.resolve();
    return c;
  };
  const auto soft = [](HopperOptions& o) { o.model.set("mu", 10 * std::sqrt(10.0)), o.hopper.orifice = 10; };
  const auto deformable = [=](HopperOptions& o) {
    soft(o);
    o.particles = 400, o.wall_distance = 25;
  };
  return {make("sp_2d", ModelKind::sp, 2, 15, soft), make("sp_3d", ModelKind::sp, 3, 8, soft),
          make("rough", ModelKind::rough, 2, 3, deformable),
          make("smooth", ModelKind::smooth, 2, 2, deformable, [](HopperOptions& o) {
            for (const char* name : {"e_c", "e_w"}) o.model.set(name, 1e3);
          })};
}

Real mean_diameter(const Topology& topology) {
  Real sum = 0;
  for (const Real d : topology.diameter) sum += d;
  return sum / topology.points();
}

template <int D>
class Flow {
 public:
  explicit Flow(const Case& c) : options_(c.options), flow_time_(c.flow_time), system_(make_system(sizes())) {}

  /// Names of the terms that are switched on.
  std::vector<std::string> terms() const {
    ParticleSystem<D> one = make_system({1});
    std::vector<Real> x(one.size()), v(one.size());
    const Real centre[3] = {0, 0, 0};
    place_particle(one.topology(), 0, centre, 0, x.data());
    std::vector<std::string> names;
    for (const TermReport& report : one.field().report(one.view(x.data(), v.data()))) names.push_back(report.name);
    return names;
  }

  /// Packs and flows at the first call; the same state at every call.
  const State& state() {
    if (!state_) prepare();
    return *state_;
  }
  StateView<D> view() { return system().view(state().x().data(), state().v().data()); }
  ParticleSystem<D>& system() {
    state();
    return system_;
  }
  const Topology& topology() const { return system_.topology(); }
  const HopperOptions& options() const { return options_; }

  Real critical_step() const { return system_.field().critical_step(system_.topology()).one_contact(); }

 private:
  std::vector<Real> sizes() const {
    return draw_diameters(options_.sizes, options_.particles, static_cast<std::uint64_t>(options_.seed));
  }

  ParticleSystem<D> make_system(const std::vector<Real>& diameters) const {
    Vec<D> down = Vec<D>::Zero();
    down[D - 1] = -1;
    return {make_particles(options_.model.particles(), D, diameters, options_.shape), options_.hopper.walls<D>(),
            options_.force_field<D>(down), options_.first_skin()};
  }

  void prepare() {
    const Topology& topology = system_.topology();
    State s(topology.points(), D);
    pack<D>(topology, options_.hopper, {*options_.pack_fraction, options_.pack_tolerance, 1}, s.x().data());
    system_.sort(s);
    FixedStepVerlet verlet(0.4 * critical_step());
    std::int64_t put_back = 0;
    verlet.run(system_, s, flow_time_, true, [&](State& now) {
      if (now.step % 200 != 0) return AfterStep::proceed;
      AfterStep after = AfterStep::proceed;
      for (Index m = 0; m < topology.particles(); ++m) {
        if (mean_of_points<D>(now.x().data(), topology, m)[D - 1] > -3) continue;
        reinsert<D>(Ranks(), topology, options_.hopper, system_.walls(),
                    options_.model.particles() == ModelKind::smooth, 1, {topology.id[m], 0, m, put_back++}, now);
        system_.relist(now.x().data(), m);
        after = AfterStep::changed;
      }
      return after;
    });
    system_.sort(s);
    state_ = std::move(s);
  }

  HopperOptions options_;
  Real flow_time_;
  ParticleSystem<D> system_;
  std::optional<State> state_;
};

template <int D>
void set_cost(benchmark::State& bench, Flow<D>& flow, int steps = 1) {
  bench.counters["per_point"] =
      benchmark::Counter(static_cast<double>(steps) * flow.system().topology().points(),
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

/// Registers "<case>/<kernel>", which times body(flow, view).
template <int D, class Body>
void time_kernel(const std::string& name, const std::shared_ptr<Flow<D>>& flow, Body body) {
  benchmark::RegisterBenchmark(name.c_str(), [flow, body](benchmark::State& bench) mutable {
    const StateView<D> view = flow->view();
    for (auto _ : bench) {
      body(*flow, view);
      benchmark::ClobberMemory();
    }
    set_cost(bench, *flow);
  });
}

template <int D>
void register_forces(const std::string& name, const std::shared_ptr<Flow<D>>& flow) {
  const auto out = std::make_shared<std::vector<Real>>();
  const auto force = [out](const StateView<D>& s) {
    out->resize(static_cast<std::size_t>(s.topology.points()) * D);
    return out->data();
  };
  // The plain element loops of each term, then the kernels that runs use instead of some of them.
  for (const std::string& term : flow->terms())
    time_kernel(name + "/force/" + term, flow,
                [=](Flow<D>& f, const StateView<D>& s) { f.system().field().force_of({term}, s, force(s)); });
  const auto time_fused = [&](const char* kernel, const auto& part) {
    time_kernel(name + "/kernel/" + kernel, flow,
                [=, field = std::make_shared<Model<D, std::decay_t<decltype(part)>>>(part)](
                    Flow<D>&, const StateView<D>& s) { field->forces(s, force(s)); });
  };
  const ModelChoice& p = flow->options().model;
  const Real epsilon = p.value(Role::contact_energy);
  if (flow->options().model.particles() != ModelKind::smooth)
    time_fused("contact+friction", Fused<PairKernel, PairContact<D>, PairFriction<D>>(
                                       PairContact<D>{epsilon, "contact"}, p.term(PairFriction<D>{})));
  time_fused("wall", Fused<WallKernel, WallContact<D>>(p.term(WallContact<D>{})));
  if constexpr (D == 2) {
    if (flow->options().model.particles() == ModelKind::smooth)
      time_fused("contact+friction",
                 Fused<EdgeKernel, EdgeContact, EdgeFriction>(p.term(EdgeContact{}), p.term(EdgeFriction{})));
    if (flow->options().model.particles() != ModelKind::sp)
      time_fused("area+perimeter+bending",
                 Fused<ShapeKernel, Area, Perimeter, Bending>(p.term(Area{}), p.term(Perimeter{}), p.term(Bending{})));
  }
  benchmark::RegisterBenchmark((name + "/force/all").c_str(), [=](benchmark::State& bench) {
    const StateView<D> s = flow->view();
    for (auto _ : bench) {
      flow->system().field().forces(s, force(s));
      benchmark::ClobberMemory();
    }
    set_cost(bench, *flow);
    const double points = s.topology.points();
    double touching = 0;
    flow->system().field().for_each_contact(s, [&](const Contact<D>&) { ++touching; });
    bench.counters["listed_per_point"] = static_cast<double>(s.neighbours.size()) / points;
    bench.counters["contacts_per_point"] = touching / points;
  });
}

template <int D>
void register_lists(const std::string& name, const std::shared_ptr<Flow<D>>& flow) {
  const NeighbourNeeds needs = flow->system().neighbours().needs();
  const Real skin = flow->options().first_skin();
  const auto cloud = [](const StateView<D>& s) {
    const Topology& t = s.topology;
    return PointCloud{s.x, t.diameter, t.particle, t.next, t.active};
  };
  const auto build = [=](const StateView<D>& s, CellGrid<D>& grid) {
    const PointCloud points = cloud(s);
    grid.build(s.x, points.diameter.data(), points.size(), mean_diameter(s.topology) + skin,
               [&](Index i) { return points.uses(i); });
  };
  const auto grid = std::make_shared<CellGrid<D>>();
  const auto pairs = std::make_shared<std::vector<Pair>>();

  time_kernel(name + "/list/check", flow,
              [](Flow<D>& f, const StateView<D>& s) { f.system().neighbours().ensure(s.topology, s.walls, s.x); });
  time_kernel(name + "/list/grid", flow, [=](Flow<D>&, const StateView<D>& s) { build(s, *grid); });
  // The searches use the grid of their first call.
  const auto search = [&](const char* what, auto find) {
    time_kernel(name + "/list/" + what, flow, [=, built = false](Flow<D>&, const StateView<D>& s) mutable {
      if (!built) build(s, *grid);
      built = true;
      pairs->clear();
      find(cloud(s), s.walls, [&](Index first, Index second, auto...) { pairs->push_back({first, second}); });
    });
  };
  if (needs.point_pairs)
    search("points", [=](const PointCloud& c, const Walls<D>&, auto found) {
      find_point_pairs<D>(c, *grid, skin, 0, c.size(), found);
    });
  if (needs.walls)
    search("walls", [=](const PointCloud& c, const Walls<D>& walls, auto found) {
      find_wall_pairs<D>(c, walls, 0, skin, 0, c.size(), found);
    });
  if constexpr (D == 2) {
    if (needs.vertex_edges)
      search("vertex_edges", [=](const PointCloud& c, const Walls<2>&, auto found) {
        find_vertex_edge_pairs(c, *grid, needs.edges, skin, *std::max_element(c.diameter.begin(), c.diameter.end()), 0,
                               c.size(), found);
      });
    if (needs.lips)
      search("lips", [=](const PointCloud& c, const Walls<2>& walls, auto found) {
        find_lip_pairs(c, walls, 0, skin, 0, c.size(), found);
      });
  }
  time_kernel(name + "/list/all", flow,
              [](Flow<D>& f, const StateView<D>& s) { f.system().neighbours().rebuild(s.topology, s.walls, s.x); });
}

/// Steps of the default length, from the prepared state on, with their list rebuilds.
template <int D>
void register_verlet(const std::string& name, const std::shared_ptr<Flow<D>>& flow) {
  benchmark::RegisterBenchmark((name + "/verlet_step").c_str(), [flow](benchmark::State& bench) {
    constexpr int steps = 2000;
    ParticleSystem<D>& system = flow->system();
    const Real dt = std::min(1e-3, 0.2 * flow->critical_step());
    const std::int64_t before = system.neighbours().rebuilds();
    for (auto _ : bench) {
      bench.PauseTiming();
      State s = flow->state();
      bench.ResumeTiming();
      FixedStepVerlet(dt).run(system, s, s.t + steps * dt, true, nullptr);
    }
    set_cost(bench, *flow, steps);
    const double taken = static_cast<double>(bench.iterations()) * steps;
    bench.counters["rebuilds_per_1000_steps"] =
        1000 * static_cast<double>(system.neighbours().rebuilds() - before) / taken;
  });
}

/// The packing that every run starts from; costs are per particle, also for polygons, whose outer disks are packed.
template <int D>
void register_fire(const std::string& name, const std::shared_ptr<Flow<D>>& flow) {
  benchmark::RegisterBenchmark((name + "/fire").c_str(), [flow](benchmark::State& bench) {
    const Topology& topology = flow->topology();
    const HopperOptions& o = flow->options();
    std::vector<Real> x(static_cast<std::size_t>(topology.points()) * D);
    double iterations = 0;
    for (auto _ : bench)
      iterations += static_cast<double>(
          pack<D>(topology, o.hopper, {*o.pack_fraction, o.pack_tolerance, 1}, x.data()).iterations);
    bench.counters["per_point"] = benchmark::Counter(iterations * topology.particles(),
                                                     benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
    bench.counters["fire_iterations"] = iterations / static_cast<double>(bench.iterations());
  });
}

template <int D>
void register_case(const Case& c) {
  const auto flow = std::make_shared<Flow<D>>(c);
  register_fire(c.name, flow);
  register_forces(c.name, flow);
  register_lists(c.name, flow);
  register_verlet(c.name, flow);
}

}  // namespace
}  // namespace pliant

int main(int argc, char** argv) {
  omp_set_num_threads(1);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  try {
    for (const pliant::Case& c : pliant::cases())
      if (c.options.dim == 2)
        pliant::register_case<2>(c);
      else
        pliant::register_case<3>(c);
    benchmark::RunSpecifiedBenchmarks();
  } catch (const pliant::Error& error) {
    fmt::print(stderr, "pliant_benchmarks: error: {}\n", error.what());
    return static_cast<int>(error.code());
  }
}
