// Checkpoints of a run.
#include <algorithm>
#include <iterator>
#include <limits>
#include <span>
#include <utility>

#include <pliant/base/log.h>
#include <pliant/run/archive.h>
#include <pliant/run/run.h>

namespace pliant {

/// Numbers of a run in a checkpoint.
struct RunNumbers {
  bool changed = false;  ///< by the protocol after the last step: the integrator restarts
  bool ended = false;
  Real dt = 0, last_dt = 0, first_dt = 0, skin = 0, cpu_seconds = 0;
  std::int64_t samples = 0, frames = 0, events = 0;
  std::int64_t evaluations = 0, rebuilds_since_sort = 0, rebuilds = 0;
  IntegratorStatistics taken;
};

namespace {

/// 0 if there are none: limits matter only when a checkpoint is read, and Simulation::all() is empty during the run.
Real largest(const std::vector<Real>& values) {
  return values.empty() ? 0 : *std::max_element(values.begin(), values.end());
}

/// Positions and angles, or velocities and spins: `own` is written, set(values) takes those that were read.
template <int D, class Set>
void visit_coordinates(Archive& a, const ParticleSystem<D>& particles, const std::string& name,
                       const std::string& of_angles, std::span<const Real> own, Real most, Set&& set) {
  const int angles = particles.coordinates().angles;
  const auto positions = static_cast<std::size_t>(particles.topology().owned_points()) * D;
  const std::size_t first = std::min(own.size(), positions);  // or nothing
  std::vector<Real> values;
  const auto append = [&](std::span<const Real> more) { values.insert(values.end(), more.begin(), more.end()); };
  a.points(name, own.first(first), most, append);
  if (angles > 0) a.rotations(of_angles, own.subspan(first), angles, append);
  if (a.reads()) set(std::move(values));
}

/// Places that a periodic box has brought particles back from.
template <int D>
void visit_images(Archive& a, const ParticleSystem<D>& particles, State& s) {
  if (particles.box().open()) return;
  if (a.reads()) {
    s.images = a.particles().images("images");
    return;
  }
  std::vector<std::int64_t> images;
  for (const Image& image : s.images) images.insert(images.end(), image.begin(), image.end());
  images.resize(3 * static_cast<std::size_t>(particles.topology().owned()));
  a.to().add_parts("images", std::move(images));
}

/// Places of the particles, and whether they are active.
template <int D>
void visit_particles(Archive& a, Simulation<D>& simulation) {
  ParticleSystem<D>& particles = simulation.particles();
  if (a.reads())
    simulation.take(a.particles().ids());
  else
    save_particles(particles.topology(), a.to());
  const auto& now = particles.topology().active;
  std::vector<std::uint8_t> active(now.begin(), now.begin() + particles.topology().owned());
  a.per_particle("active", active, 0, 1);
  if (!a.reads()) return;
  for (std::size_t m = 0; m < active.size(); ++m)
    if (active[m] == 0) particles.deactivate(static_cast<Index>(m));
}

/// Quantities that are integrated with the positions of an overdamped system, and its last velocities.
template <int D>
void visit_overdamped(Archive& a, OverdampedSystem<D>* system, State& s, bool root) {
  std::vector<Real> extra = s.extra;
  if (!a.reads() || system != nullptr) a.array("extra", extra, system != nullptr ? system->quantities().size() : 0);
  if (a.reads() && root) s.extra = std::move(extra);
  const bool remembers = system != nullptr && system->mobility().remembers();
  // None before the first evaluation.
  if (a.reads() && (system == nullptr || (a.from().length("last_velocity") == 0 && !(remembers && a.from().step > 0))))
    return;
  a.points("last_velocity", remembers ? std::span<const Real>(system->last()) : std::span<const Real>(), Archive::any,
           [&](std::span<const Real> last) {
             system->set_last({last.begin(), last.end()});
           });
}

}  // namespace

template <int D>
RunNumbers Run<D>::numbers(bool changed) {
  const ParticleSystem<D>& particles = simulation().particles();
  return {.changed = changed,
          .ended = ended() && !stopped(),
          .dt = integrator().next_dt(),
          .last_dt = last_dt(),
          .first_dt = first_dt_,
          .skin = particles.neighbours().skin(),
          .cpu_seconds = total_cpu(),
          .samples = static_cast<std::int64_t>(writer_->samples()),
          .frames = static_cast<std::int64_t>(writer_->frames()),
          .events = static_cast<std::int64_t>(writer_->events()),
          .evaluations = particles.use().evaluations,
          .rebuilds_since_sort = particles.use().rebuilds,
          .rebuilds = list_rebuilds(),
          .taken = statistics()};
}

template <int D>
void Run<D>::visit_numbers(Archive& a, RunNumbers& n) {
  constexpr Real smallest = std::numeric_limits<Real>::min();
  const Real longest = std::max(dt_, protocol_->last_time()), widest = largest(simulation().all().diameter);
  const std::optional<Real> fixed = protocol_->fixed_skin();
  sampling_.visit(a, "last_sample_at");
  framing_.visit(a, "last_frame_at");
  a.flag("changed", n.changed);
  a.flag("ended", n.ended);
  a.number("dt", n.dt, smallest, longest);
  a.number("last_dt", n.last_dt, smallest, longest);
  a.number("first_dt", n.first_dt, smallest, longest);
  a.number("samples", n.samples, sampling_.done_at(0) ? 1 : 0);
  a.number("frames", n.frames, framing_.done_at(0) ? 1 : 0);
  a.number("events", n.events);
  a.number("skin", n.skin, fixed.value_or(smallest),
           fixed.value_or(std::max(simulation().particles().neighbours().skin(), widest)));
  a.number("list_rebuilds", n.rebuilds);
  a.number("list_rebuilds_since_sort", n.rebuilds_since_sort, 0, n.rebuilds);
  a.number("evaluations_since_sort", n.evaluations);
  a.number("rejected_steps", n.taken.rejected);
  a.number("steps_above_tolerance", n.taken.above_tolerance, 0, n.taken.steps);
  a.number("force_evaluations", n.taken.force_evaluations, n.taken.steps);
  a.number("jacobian_evaluations", n.taken.jacobian_evaluations);
  a.number("linear_iterations", n.taken.linear_iterations);
  a.number("cpu_seconds", n.cpu_seconds, 0);
}

/// The lists of the stopped run: the order of their sums is part of the state.
template <int D>
void Run<D>::visit_lists(Archive& a, Real skin) {
  ParticleSystem<D>& particles = simulation().particles();
  Neighbours<D>& neighbours = particles.neighbours();
  const State& s = state();
  typename Neighbours<D>::History now;
  // Invalid lists will be rebuilt. Ranks whose particles have just left have no lists.
  if (!a.reads() && ranks_.all(s.size() == 0 || neighbours.valid(particles.walls(), s.x().data(), s.t)))
    now = neighbours.history(particles.topology());
  a.number("list_time", now.time, 0, a.t());
  if (!a.reads()) return save_lists(std::move(now.reference), now.relisted, now.places, a.to());
  const auto [reference, relisted, places] = a.particles().lists(skin / 2 * (1 + 1e-9));
  neighbours.set_skin(skin);
  if (!reference.empty()) {
    if (particles.has_ghosts())
      particles.rebuild(a.particles().own_points(reference).data(), now.time);
    else
      neighbours.replay(particles.topology(), particles.walls(), {reference, relisted, places, now.time});
  }
}

/// All quantities of a checkpoint, to write or to read them. Values are checked before use.
template <int D>
void Run<D>::visit(Archive& a, RunNumbers& n) {
  State& s = state();
  ParticleSystem<D>& particles = simulation().particles();
  OverdampedSystem<D>* const overdamped = simulation().overdamped();
  visit_particles(a, simulation());
  visit_numbers(a, n);
  // A particle that moves by some diameters in a step has gone through others.
  const Real fastest = 10 * largest(simulation().all().sigma) / n.dt;
  std::vector<Real> x;
  visit_coordinates(a, particles, "x", "angle", s.x(), StoredParticles::far,
                    [&](std::vector<Real> places) { x = std::move(places); });
  visit_coordinates(a, particles, "v", "spin", s.v(), overdamped == nullptr ? fastest : Archive::any,
                    [&](std::vector<Real> v) { s.assign(std::move(x), std::move(v)); });
  if (a.reads())
    a.particles().load_history(particles);
  else
    save_history(particles.history(), particles.topology(), a.to());
  visit_images(a, particles, s);
  visit_overdamped(a, overdamped, s, ranks_.root());
  if (a.reads()) protocol_->placed();
  protocol_->visit(a);
  if (EnergyAudit<D>* const audit = protocol_->audit()) audit->visit(a);
  if (a.reads()) simulation().set_integrator(protocol_->make_integrator(n.dt));
  Integrator& method = simulation().integrator();
  const bool carries = method.carries() && !n.changed;
  if (carries || !a.reads())
    visit_coordinates(a, particles, "carried", "carried_spin",
                      carries && !a.reads() ? method.carried() : std::span<const Real>(), fastest,
                      [&](std::vector<Real> carried) {
                        method.set_carried(std::move(carried));
                        simulation().restored();
                      });
  visit_lists(a, n.skin);
}

template <int D>
void Run<D>::save(bool changed) {
  const LogScope log(LogEvent::checkpoint);
  protocol_->record_events();
  RunNumbers n = numbers(changed);
  ranks_.on_root([&] {
    writer_->flush();
    checkpoints_->begin(state().t, state().step);
  });
  SharedCheckpoint c(checkpoints_ ? &*checkpoints_ : nullptr, ranks_);
  Archive archive(c);
  visit(archive, n);
  c.add_text("scenario", scenario_);  // read by make_run()
  c.add_text("options", options_.json().dump());
  ranks_.on_root([&] { checkpoints_->finish(); });
}

template <int D>
void Run<D>::load(const Checkpoint& c) {
  state().t = c.t;
  state().step = c.step;
  const StoredParticles stored(c, simulation().all(), D, ranks_);
  Archive archive(c, &stored);
  RunNumbers n;
  n.taken.steps = c.step;
  visit(archive, n);
  dt_ = n.dt;
  last_dt_ = n.last_dt;
  first_dt_ = n.first_dt;
  restored_samples_ = static_cast<std::uint64_t>(n.samples);
  restored_frames_ = static_cast<std::uint64_t>(n.frames);
  restored_events_ = static_cast<std::uint64_t>(n.events);
  before_ = n.taken;
  cpu_before_ = n.cpu_seconds;
  had_ended_ = n.ended;
  ParticleSystem<D>& particles = simulation().particles();
  particles.set_use({n.evaluations, n.rebuilds_since_sort});
  rebuilds_before_ = n.rebuilds - particles.neighbours().rebuilds();
  restarted_from_ = c.file;
  branched_ = p_.branches(options_) && std::filesystem::path(c.file).parent_path() != std::filesystem::path(p_.output);
}

template RunNumbers Run<2>::numbers(bool);
template RunNumbers Run<3>::numbers(bool);
template void Run<2>::visit_numbers(Archive&, RunNumbers&);
template void Run<3>::visit_numbers(Archive&, RunNumbers&);
template void Run<2>::visit_lists(Archive&, Real);
template void Run<3>::visit_lists(Archive&, Real);
template void Run<2>::visit(Archive&, RunNumbers&);
template void Run<3>::visit(Archive&, RunNumbers&);
template void Run<2>::save(bool);
template void Run<3>::save(bool);
template void Run<2>::load(const Checkpoint&);
template void Run<3>::load(const Checkpoint&);

}  // namespace pliant
