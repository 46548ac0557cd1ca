// Work against precision: cost of integrators for a given error, on small problems. Each run prints
// one line of JSON. Serial; times are CPU seconds.
#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include <pliant/base/petsc.h>
#include <pliant/base/rng.h>
#include <pliant/catalogue/parameter_values.h>
#include <pliant/model/polygon.h>
#include <pliant/scenarios/hopper/options.h>
#include <pliant/system/neighbour_drag.h>
#include <pliant/system/overdamped.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

namespace pliant {
namespace {

enum class Control { step, tolerance };

struct Method {
  std::string name;
  std::string options;  ///< options of PETSc; empty: the plain loop of velocity Verlet
  Control control;
  TermGroup implicit = TermGroup::all;
};

const std::vector<Method> with_inertia = {
    {"verlet", "", Control::step},
    {"ts verlet", "-ts_type verlet", Control::step},
    {"controlled verlet", "-ts_type verlet -ts_adapt_type basic", Control::tolerance},
    {"rk 3bs", "-ts_type rk -ts_rk_type 3bs", Control::tolerance},
    {"rk 5dp", "-ts_type rk -ts_rk_type 5dp", Control::tolerance},
    {"rk 6vr", "-ts_type rk -ts_rk_type 6vr", Control::tolerance},
    {"erk 5", "-ts_type arkode -ts_arkode_type erk -ts_arkode_table dormand_prince", Control::tolerance},
    {"adams", "-ts_type cvode -ts_cvode_type adams", Control::tolerance},
    {"cvode bdf", "-ts_type cvode -ts_cvode_type bdf", Control::tolerance},
    {"bdf", "-ts_type bdf", Control::tolerance},
    {"rosw", "-ts_type rosw", Control::tolerance},
    {"alpha2", "-ts_type alpha2", Control::step},
};
/// For deformable particles: the shape energy alone.
const std::vector<Method> split = {
    {"imex", "-ts_type arkode -ts_arkode_type imex", Control::tolerance, TermGroup::shape},
    {"arkimex", "-ts_type arkimex", Control::tolerance, TermGroup::shape},
    {"mri", "-ts_type arkode -ts_arkode_type mri", Control::step, TermGroup::shape},
};
const std::vector<Method> without_inertia = {
    {"rk 4", "-ts_type rk -ts_rk_type 4", Control::step},
    {"rk 3bs", "-ts_type rk -ts_rk_type 3bs", Control::tolerance},
    {"rk 5dp", "-ts_type rk -ts_rk_type 5dp", Control::tolerance},
    {"adams", "-ts_type cvode -ts_cvode_type adams", Control::tolerance},
    {"cvode bdf", "-ts_type cvode -ts_cvode_type bdf", Control::tolerance},
};

/// Error control does not see the floor during free fall; the step must not jump over it.
const std::string longest_step = "-ts_adapt_dt_max 0.02";

/// Criterion for the runs of a problem.
enum class Judge {
  trajectory,  ///< rms distance of the points from where the reference has them in the end
  statistics   ///< mean energy of the second half of the run: trajectories are chaotic
};

template <class System>
struct Problem {
  std::string name;
  std::function<std::unique_ptr<System>()> make;  ///< with lists still to be built
  State start;
  Real t_end;
  Real step;                           ///< the default fixed step of a run; other steps are multiples of this step
  std::vector<Method> methods;         ///< the first one's CPU time is the unit
  std::string options{};               ///< of PETSc, for all methods
  std::optional<Real> energy_scale{};  ///< of the error of the energy, where it is conserved
  Judge judge = Judge::trajectory;
  Real tightest = 1e-12;  ///< tolerance of the reference
};

struct Effort {
  bool quick = false;
  int repetitions = 3;
  std::vector<std::string> problems{};  ///< none: all
};

/// Result of a run.
struct Outcome {
  State end;
  IntegratorStatistics cost{};
  Real cpu = 0;
  Real energy_error = 0;               ///< largest
  Real mean_energy = 0, contacts = 0;  ///< mean energy and contacts per particle in the second half
};

Real cpu_seconds() { return static_cast<Real>(std::clock()) / CLOCKS_PER_SEC; }

Real energy_of(ParticleSystem<2>& system, const State& s) {
  const Topology& topology = system.topology();
  Real kinetic = 0;
  for (Index i = 0; i < topology.points(); ++i)
    kinetic += topology.mass(i) / 2 * point<2>(s.v().data(), i).squaredNorm();
  return kinetic + system.field().energy(system.view(s.x().data(), s.v().data()));
}

Real contacts_of(ParticleSystem<2>& system, const State& s) {
  Real touching = 0;
  system.field().for_each_contact(system.view(s.x().data(), s.v().data()), [&](const Contact<2>&) { ++touching; });
  return 2 * touching / system.topology().particles();
}

void advance(ParticleSystem<2>& system, const Method& method, const TsOptions& options, State& s, Real t_end,
             const StepObserver& observer, IntegratorStatistics& cost) {
  std::unique_ptr<Integrator> integrator;
  if (method.options.empty())
    integrator = std::make_unique<FixedStepVerlet>(options.dt);
  else
    integrator = std::make_unique<TsIntegrator>(options);
  integrator->run(system, s, t_end, true, observer);
  cost = integrator->statistics();
}

void advance(OverdampedSystem<2>& system, const Method&, const TsOptions& options, State& s, Real t_end,
             const StepObserver& observer, IntegratorStatistics& cost) {
  TsIntegrator integrator(options);
  integrator.run(system, s, t_end, observer);
  cost = integrator.statistics();
}

/// One run. watched: with diagnostics that cost time. Errors: NumericalError where the run fails, or takes longer than
/// `limit`.
template <class System>
Outcome run(const Problem<System>& problem, const Method& method, Real value, Real limit, bool watched) {
  petsc_check(PetscOptionsClear(nullptr));
  petsc_check(PetscOptionsInsertString(nullptr, (method.options + " " + problem.options).c_str()));
  TsOptions options{.dt = problem.step, .implicit = method.implicit};
  if (method.control == Control::step)
    options.dt = value;
  else
    options.rtol = options.atol_x = options.atol_v = value;

  const std::unique_ptr<System> system = problem.make();
  Outcome result{.end = problem.start};
  Real begin = 0, start_energy = 0, sum_energy = 0, sum_contacts = 0;
  const Real start = problem.start.t, span = problem.t_end - start;
  const Real sampling = span / 400;
  Real next_sample = start + span / 2;
  int samples = 0;
  const auto observe = [&](State& s) {
    if (cpu_seconds() - begin > limit)
      throw NumericalError("stopped at {:.0f} % of the time after {:.2g} s of CPU", 100 * (s.t - start) / span, limit);
    if constexpr (std::is_same_v<System, ParticleSystem<2>>) {
      if (problem.energy_scale)
        result.energy_error =
            std::max(result.energy_error, std::abs(energy_of(*system, s) - start_energy) / *problem.energy_scale);
      if (problem.judge == Judge::statistics && s.t >= next_sample) {
        sum_energy += energy_of(*system, s);
        sum_contacts += contacts_of(*system, s);
        next_sample += sampling * std::ceil((s.t - next_sample) / sampling + 1e-9);
        ++samples;
      }
    }
    return AfterStep::proceed;
  };
  if constexpr (std::is_same_v<System, ParticleSystem<2>>)
    if (problem.energy_scale) start_energy = energy_of(*system, result.end);
  begin = cpu_seconds();
  advance(*system, method, options, result.end, problem.t_end, watched ? StepObserver(observe) : nullptr, result.cost);
  result.cpu = cpu_seconds() - begin;
  if (samples > 0) {
    result.mean_energy = sum_energy / samples;
    result.contacts = sum_contacts / samples;
  }
  return result;
}

template <class System>
Real error_of(const Problem<System>& problem, const Outcome& a, const Outcome& reference) {
  if (problem.judge == Judge::statistics) return std::abs(a.mean_energy / reference.mean_energy - 1);
  Real sum = 0;
  const std::size_t n = a.end.size();
  for (std::size_t k = 0; k < n; ++k) sum += square(a.end.x()[k] - reference.end.x()[k]);
  return std::sqrt(2 * sum / static_cast<Real>(n));
}

Real median(std::vector<Real> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

template <class System>
void study(const Problem<System>& problem, const Effort& effort) {
  const auto print = [&](const Method& method, Real value, bool standard, const nlohmann::ordered_json& found) {
    nlohmann::ordered_json row{{"problem", problem.name},
                               {"method", method.name},
                               {"options", method.options},
                               {"control", method.control == Control::step ? "dt" : "tolerance"},
                               {"value", value},
                               {"standard", standard},
                               {"repetitions", effort.repetitions}};
    row.update(found);
    fmt::print("{}\n", row.dump());
    std::fflush(stdout);
  };
  const auto results = [&](const Outcome& o, Real error) {
    nlohmann::ordered_json found{{"error", error}};
    if (problem.energy_scale) found["energy_error"] = o.energy_error;
    if (problem.judge == Judge::statistics) {
      found["mean_energy"] = o.mean_energy;
      found["contacts"] = o.contacts;
    }
    found.update({{"cpu", o.cpu},
                  {"evaluations", o.cost.force_evaluations},
                  {"steps", o.cost.steps},
                  {"rejected", o.cost.rejected},
                  {"jacobians", o.cost.jacobian_evaluations},
                  {"linear_iterations", o.cost.linear_iterations}});
    return found;
  };

  // Two references of different methods: their distance is the accuracy of the reference.
  const Method rk8{"reference", "-ts_type rk -ts_rk_type 8vr", Control::tolerance};
  const Method rk5{"reference", "-ts_type rk -ts_rk_type 5dp", Control::tolerance};
  const Real patience = 30;
  const auto reference_by = [&](const Method& method, Real tightest) {
    for (Real value = tightest; value < 1e-4; value *= 10) try {
        return std::pair(run(problem, method, value, patience, true), value);
      } catch (const NumericalError& failure) {
        print(method, value, false, {{"failure", failure.what()}});
      }
    throw NumericalError("{}: no reference", problem.name);
  };
  const Outcome reference = reference_by(rk8, problem.tightest).first;
  const auto [second, value_of_second] = reference_by(rk5, 10 * problem.tightest);
  print(rk5, value_of_second, false, results(second, error_of(problem, second, reference)));

  std::vector<Real> factors{32, 16, 8, 4, 2, 1, 0.5, 0.25, 0.125, 0.0625},
      tolerances{1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8};
  if (effort.quick) factors = {2, 1, 0.5}, tolerances = {1e-3, 1e-4};
  Real limit = patience;
  for (const Method& method : problem.methods) {
    const bool first = &method == &problem.methods.front(), steps = method.control == Control::step;
    int slow = 0;
    bool succeeded = false;
    for (const Real setting : steps ? factors : tolerances) {
      const Real value = steps ? setting * problem.step : setting;
      if (steps && value > problem.t_end - problem.start.t) continue;
      const bool standard = first && setting == 1;
      const Real begin = cpu_seconds();
      try {
        Outcome o = run(problem, method, value, limit, true);
        const Real error = error_of(problem, o, reference);
        // A measurement repeats short runs several times, and long runs once.
        const int runs = std::clamp(static_cast<int>(0.02 / std::max(o.cpu, 1e-6)), 1, 20);
        std::vector<Real> cpu;
        for (int i = 0; i < (o.cpu > 0.3 ? 1 : effort.repetitions); ++i) {
          Real sum = 0;
          for (int k = 0; k < runs; ++k) sum += run(problem, method, value, limit, false).cpu;
          cpu.push_back(sum / runs);
        }
        o.cpu = median(cpu);
        if (standard) limit = std::max(0.2, 10 * o.cpu);
        succeeded = true;
        print(method, value, standard, results(o, error));
      } catch (const Error& failure) {
        print(method, value, standard, {{"failure", failure.what()}});
        // A method that is too slow here is slower still at higher precision. (Very poor ones may be slow, too.)
        if (cpu_seconds() - begin > limit && (succeeded || ++slow == 2)) break;
      }
    }
  }
}

// ----------------------------------------------------------------------------------------------------------- problems

Real own_step(const ParticleSystem<2>& system) {
  const CriticalStep critical = system.field().critical_step(system.topology());
  return std::min({1e-3, 0.2 * critical.elastic, 0.5 * critical.damping});
}

/// A particle that falls from one σ_avg and bounces.
Problem<ParticleSystem<2>> bounce() {
  const ParameterValues parameters{{"e_c", 100.0}, {"e_w", 200.0}, {"k_a", 300.0}, {"k_l", 20.0}, {"k_b", 0.1}};
  const auto make = [=] {
    return std::make_unique<ParticleSystem<2>>(
        make_particles(ModelKind::rough, 2, {1.0}, {}), Walls<2>({WallSegment::between({-5, 0}, {5, 0})}),
        make_force_field<2>(ModelKind::rough, ParameterValues(parameters), {.gravity = {0, -1}}), 0.1);
  };
  const auto system = make();
  const Topology& topology = system->topology();
  State start(topology.points(), 2);
  const Real centre[] = {0, outer_radius(topology, 0) + 1};
  place_particle(topology, 0, centre, 0.1, start.x().data());
  std::vector<Method> methods = with_inertia;
  methods.insert(methods.end(), split.begin(), split.end());
  return {.name = "bounce",
          .make = make,
          .start = std::move(start),
          .t_end = 3.5,
          .step = own_step(*system),
          .methods = std::move(methods),
          .options = longest_step,
          .energy_scale = topology.a0[0]};
}

/// Particles packed in a hopper, or in a box as wide with `floor`, after `t` of motion; lists as the run has tuned
/// them.
Problem<ParticleSystem<2>> prepared(const std::string& name, const HopperOptions& o, bool floor, Real t, Real span) {
  const Real half = o.hopper.wall_distance / 2;
  const Walls<2> walls = floor ? Walls<2>({WallSegment::between({-half, 0}, {half, 0}),
                                           WallSegment::ray({-half, 0}, {0, 1}), WallSegment::ray({half, 0}, {0, 1})})
                               : o.hopper.walls<2>();
  const auto make = [=](const Topology& topology, Real skin) {
    return std::make_unique<ParticleSystem<2>>(topology, walls, o.force_field<2>({0, -1}), skin);
  };
  const auto system =
      make(make_particles(o.model.particles(), 2, draw_diameters(o.sizes, o.particles, 1), o.shape), o.first_skin());
  State s(system->topology().points(), 2);
  pack<2>(system->topology(), o.hopper, {*o.pack_fraction, o.pack_tolerance, 1}, s.x().data());
  system->tune_skin();
  system->sort(s);
  const Real step = own_step(*system);
  FixedStepVerlet(2 * step).run(*system, s, t, true, [&](State& now) {
    if (!system->sort_due()) return AfterStep::proceed;
    system->sort(now);
    return AfterStep::reordered;
  });
  s.step = 0;
  std::vector<Method> methods = with_inertia;
  if (o.model.particles() != ModelKind::sp) methods.insert(methods.end(), split.begin(), split.end());
  const Real start = s.t;
  return {
      .name = name,
      .make = [=, topology = system->topology(), skin = system->neighbours().skin()] { return make(topology, skin); },
      .start = std::move(s),
      .t_end = start + span,
      .step = step,
      .methods = std::move(methods),
      .options = longest_step};
}

/// Soft disks that fall into a box, with friction and drag.
Problem<ParticleSystem<2>> settling(bool quick, Judge judge) {
  HopperOptions o;
  o.model.name = "sp";
  o.particles = quick ? 50 : 200;
  o.model.set("e_sp", 1e4);
  for (const char* name : {"mu", "zeta"}) o.model.set(name, 0.3);
  o.wall_distance = quick ? 7 : 14;
  o.pack_fraction = 0.6;
  o.resolve();
  if (judge == Judge::trajectory) return prepared("settling", o, true, 3, 0.3);
  Problem<ParticleSystem<2>> p = prepared("settled", o, true, 0, quick ? 5 : 20);
  p.judge = judge;
  p.tightest = 1e-6;
  return p;
}

/// Deformable particles in dense flow out of a hopper, with drag and perhaps friction.
Problem<ParticleSystem<2>> flow(const std::string& name, bool quick, ModelKind model, bool friction) {
  HopperOptions o;
  o.model.name = to_string(model);
  o.particles = quick ? 20 : 60;
  o.model.set("mu", friction ? 10 * std::sqrt(10.0) : 0);
  o.model.set("zeta", std::sqrt(0.1));
  o.wall_distance = quick ? 5 : 8;
  o.hopper.orifice = 4;
  o.resolve();
  const bool smooth = model == ModelKind::smooth;
  Problem<ParticleSystem<2>> p = prepared(name, o, false, quick ? 0.3 : 1.5, quick ? 0.01 : smooth ? 0.05 : 0.1);
  p.tightest = 1e-10;  // each onset of friction is a jump, which a reference has to crawl up to
  return p;
}

/// Two dozen droplets between a floor and a ceiling that comes down.
Problem<OverdampedSystem<2>> droplets(bool quick) {
  constexpr Index columns = 6, rows = 4;
  constexpr Real distance = 2.1, width = columns * distance, height = rows * distance, speed = 0.01;
  Topology topology;
  State start(columns * rows, 2);
  for (Index i = 0; i < columns * rows; ++i) {
    const auto [along, up] = rng::uniform2(1, 0, i);
    const Real radius = 1 + 0.1 * (rng::uniform(1, 1, i) - 0.5);
    topology.add_soft(2 * radius, 1);
    point<2>(start.x().data(), i) =
        Vec<2>((i % columns + 0.5) * distance + 0.1 * (along - 0.5), (i / columns + 0.5) * distance + 0.1 * (up - 0.5));
  }
  Walls<2> walls(std::vector{Solid<2>::half_space({0, 0}, {0, 1}), Solid<2>::half_space({0, 0}, {1, 0}),
                             Solid<2>::half_space({width, 0}, {-1, 0})});
  walls.add(Solid<2>::half_space({0, height}, {0, -1}), {.velocity = {0, -speed}});
  constexpr Real skin = 0.3;
  return {.name = "droplets",
          .make =
              [=] {
                return std::make_unique<OverdampedSystem<2>>(
                    ParticleSystem<2>(topology, walls, make_force_field<2>(ModelKind::bubble, ParameterValues()), skin),
                    std::make_unique<NeighbourDrag<2>>(NeighbourDragOptions{}));
              },
          .start = std::move(start),
          .t_end = quick ? 20.0 : 100.0,
          .step = 0.1,
          .methods = without_inertia};
}

void run_all(const Effort& effort) {
  const auto wanted = [&](const char* name) {
    return effort.problems.empty() || std::count(effort.problems.begin(), effort.problems.end(), name) > 0;
  };
  const bool quick = effort.quick;
  if (wanted("bounce")) study(bounce(), effort);
  if (wanted("settling")) study(settling(quick, Judge::trajectory), effort);
  if (wanted("settled")) study(settling(quick, Judge::statistics), effort);
  if (wanted("rough")) study(flow("rough", quick, ModelKind::rough, true), effort);
  if (wanted("smooth")) study(flow("smooth", quick, ModelKind::smooth, true), effort);
  if (wanted("smooth-drag")) study(flow("smooth-drag", quick, ModelKind::smooth, false), effort);
  if (wanted("droplets")) study(droplets(quick), effort);
}

}  // namespace
}  // namespace pliant

int main(int argc, char** argv) {
  omp_set_num_threads(1);
  pliant::Effort effort;
  for (const std::string& word : std::vector<std::string>(argv + 1, argv + argc))
    if (word == "--quick")
      effort.quick = true, effort.repetitions = 1;
    else
      effort.problems.push_back(word);
  try {
    const pliant::PetscSession petsc;
    pliant::run_all(effort);
  } catch (const pliant::Error& error) {
    fmt::print(stderr, "pliant_work_precision: error: {}\n", error.what());
    return static_cast<int>(error.code());
  }
}
