// A scenario of its own: rough particles fall into a box whose floor vibrates. run_program() gives it the command line,
// files, restarts and ranks of pliant:
//   own_scenario shaken_box -n 100 -amplitude 0.1 -output runs/box
#include <array>

#include <pliant/base/rng.h>
#include <pliant/model/fused_terms.h>
#include <pliant/run/scenario.h>
#include <pliant/setup/particles.h>
#include <pliant/ts/verlet.h>

#include "inertia.h"

namespace {
using namespace pliant;

struct Parameters : RunOptions {
  Index n = 60;
  Real e_c = 1e4, zeta = 0.3, t_end = 20;
  PolygonShape shape;
  Vibration floor{.amplitude = 0.1, .frequency = 1};
  std::optional<Real> dt;
  void bind(Options& o) {
    constexpr auto fixed = OnRestart::fixed;
    o.group("Box");
    o.bind("n", n, {.help = "number of particles", .min = 1, .max = 1e6, .on_restart = fixed});
    o.bind("seed", seed, {.help = "seed of sizes and angles", .min = 0, .on_restart = fixed});
    o.bind("e_c", e_c, {.help = "contact energy", .unit = "rho g sigma_avg^3", .min = 1, .on_restart = fixed});
    o.bind("shape_parameter", shape.shape_parameter, {.help = "0: regular polygon", .min = 0, .on_restart = fixed});
    o.bind("zeta", zeta, {.help = "drag in the box", .unit = "rho sigma_avg g t0", .min = 0, .on_restart = fixed});
    o.bind("amplitude", floor.amplitude, {.help = "of floor", .unit = "sigma_avg", .min = 0, .on_restart = fixed});
    o.bind("frequency", floor.frequency, {.help = "of floor", .unit = "1/t0", .min = 1e-9, .on_restart = fixed});
    o.bind("dt", dt, {.help = "step", .unit = "t0", .min = 1e-9, .automatic = "stable", .on_restart = fixed});
    o.bind("t_end", t_end,
           {.help = "end of the run", .unit = "t0", .min = 0, .max = 1e6, .extends = {"t_end", "LATER"}});
    bind_output(o);
  }

  static constexpr Real spacing = 1.5;  // distance of neighbouring initial places
  Index columns() const { return static_cast<Index>(std::ceil(std::sqrt(n))); }
  Real width() const { return spacing * columns(); }
};

std::unique_ptr<Simulation<2>> make_simulation(const Parameters& p, const Ranks& ranks) {
  using Shape = Fused<ShapeKernel, Area, Perimeter, Bending>;
  using Pairs = Fused<PairKernel, PairContact<2>, PairFriction<2>>;
  using Edge = Fused<EdgeKernel, EdgeContact, EdgeFriction>;
  using Outer = Fused<PointKernel, Gravity<2>, Drag<2>>;
  auto field = std::make_unique<Model<2, Shape, Pairs, Edge, WallContact<2>, Outer, Fused<InertiaKernel, Inertia>>>(
      Shape(Area{2e4}, Perimeter{10}, Bending{0.1}), Pairs({p.e_c, "contact"}, {0}),
      Edge({p.e_c / 4, Edges::bare}, {0}), WallContact<2>{1e4}, Outer({{0, -1}}, {p.zeta}),
      Fused<InertiaKernel, Inertia>({p.floor}));
  const pliant::Vec<2> left(0, 0), right(p.width(), 0), up(0, 1);
  Walls<2> walls({WallSegment::between(left, right), WallSegment::ray(left, up), WallSegment::ray(right, up)});
  return std::make_unique<Simulation<2>>(make_particles(ModelKind::rough, 2, draw_diameters({}, p.n, p.seed), p.shape),
                                         ParticleSystem<2>({}, std::move(walls), std::move(field), 0.1, ranks),
                                         Sorting::regularly);
}

/// All is seen from the box, frames too, and its walls rest: in the laboratory `floor` adds to every height. The
/// floor's velocity plays no part, as walls have neither friction nor damping; for the same reason it does not matter
/// that the side walls vibrate with it. Drag is relative to air that moves with the box.
class ShakenBox final : public Protocol<2> {
 public:
  ShakenBox(const Parameters& p, const Ranks& ranks) : Protocol<2>(make_simulation(p, ranks)), p_(p) {}
  std::string title() const override { return fmt::format("shaken box: {} particles", p_.n); }
  std::string model() const override { return "rough"; }
  Real last_time() const override { return p_.t_end; }
  Real critical_step() const override { return critical_.limit(); }
  Real first_dt() const override {
    return p_.dt.value_or(std::min(0.2 * critical_.one_contact(), 0.01 / p_.floor.frequency));
  }
  std::unique_ptr<Integrator> make_integrator(Real dt) override { return std::make_unique<FixedStepVerlet>(dt); }
  RunGeometry geometry() const override {
    const Real w = p_.width();
    return {"box", {0, 0, w, 0, 0, 0, 0, 2 * w, w, 0, w, 2 * w}, {{"W", w}}};
  }
  std::vector<Real> start() override {
    const Topology& all = simulation().all();
    std::vector<Real> x(2 * all.points());
    for (Index m = 0; m < p_.n; ++m) {
      const Real centre[] = {p_.spacing * (m % p_.columns() + 0.5), p_.spacing * (m / p_.columns() + 1)},
                 angle = 2 * pi * rng::uniform(p_.seed, 100, m);
      place_particle(all, m, centre, angle, x.data());
    }
    return x;
  }
  bool follow() override {
    for (std::size_t i = 1; i < state().x().size(); i += 2) highest_ = std::max(highest_, state().x()[i]);
    return false;
  }
  std::vector<SeriesValue> sample() override {
    std::array<Real, 3> sums{};  // mass, its moment, kinetic energy
    for (Index i = 0; i < topology().owned_points(); ++i) {
      const Real m = topology().mass(i);
      sums[0] += m;
      sums[1] += m * state().x()[2 * i + 1];
      sums[2] += m / 2 * point<2>(state().v().data(), i).squaredNorm();
    }
    ranks().sum(sums);
    return {{"time", state().t},
            {"dt", run().last_dt()},
            {"mean_height", sums[1] / sums[0]},
            {"kinetic_energy", sums[2]},
            {"floor", p_.floor.height(state().t)},
            {"highest", ranks().max(highest_)}};
  }
  void visit(Archive& a) override {
    highest_ = ranks().max(highest_);
    a.number("highest", highest_, 0);
  }

 private:
  const Parameters& p_;
  CriticalStep critical_ = particles().field().critical_step(simulation().all());
  Real highest_ = 0;  ///< a vertex has been so far
};

}  // namespace

int main(int argc, char** argv) {
  return run_program(argc, argv, {option_scenario<Parameters, ShakenBox>("shaken_box", "a box whose floor vibrates")});
}
