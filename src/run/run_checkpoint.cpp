// Checkpoints of a run.
#include <filesystem>
#include <limits>
#include <utility>

#include <pliant/base/log.h>
#include <pliant/run/archive.h>
#include <pliant/run/motion_archive.h>
#include <pliant/run/run.h>

namespace pliant {

/// Numbers of a run in a checkpoint.
struct RunNumbers {
  bool ended = false;
  Real first_dt = 0, cpu_seconds = 0;
  std::int64_t samples = 0, frames = 0, events = 0;
  MotionNumbers motion;
};

template <int D>
RunNumbers Run<D>::numbers(bool changed) {
  const ParticleSystem<D>& particles = simulation().particles();
  return {.ended = ended() && !stopped(),
          .first_dt = first_dt_,
          .cpu_seconds = total_cpu(),
          .samples = static_cast<std::int64_t>(writer_->samples()),
          .frames = static_cast<std::int64_t>(writer_->frames()),
          .events = static_cast<std::int64_t>(writer_->events()),
          .motion = {.changed = changed,
                     .dt = integrator().next_dt(),
                     .last_dt = last_dt(),
                     .skin = particles.neighbours().skin(),
                     .evaluations = particles.use().evaluations,
                     .rebuilds_since_sort = particles.use().rebuilds,
                     .rebuilds = list_rebuilds(),
                     .taken = statistics()}};
}

template <int D>
void Run<D>::visit_numbers(Archive& a, RunNumbers& n) {
  sampling_.visit(a, "last_sample_at");
  framing_.visit(a, "last_frame_at");
  a.flag("ended", n.ended);
  a.number("first_dt", n.first_dt, std::numeric_limits<Real>::min(), longest_dt());
  a.number("samples", n.samples, sampling_.done_at(0) ? 1 : 0);
  a.number("frames", n.frames, framing_.done_at(0) ? 1 : 0);
  a.number("events", n.events);
  a.number("cpu_seconds", n.cpu_seconds, 0);
}

/// All quantities of a checkpoint, to write or to read them. Values are checked before use.
template <int D>
void Run<D>::visit(Archive& a, RunNumbers& n) {
  MotionArchive<D> motion(a, simulation(), n.motion);
  motion.particles();
  visit_numbers(a, n);
  motion.numbers(longest_dt(), protocol_->fixed_skin());
  motion.state();
  if (a.reads()) protocol_->placed();
  protocol_->visit(a);
  if (EnergyAudit<D>* const audit = protocol_->audit()) audit->visit(a);
  if (a.reads()) simulation().set_integrator(protocol_->make_integrator(n.motion.dt));
  motion.carried();
  motion.lists();
}

template <int D>
void Run<D>::save(bool changed) {
  const LogScope log(LogEvent::checkpoint);
  protocol_->record_events();
  if (p_.member != nullptr) return;
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
  n.motion.taken.steps = c.step;
  visit(archive, n);
  dt_ = n.motion.dt;
  last_dt_ = n.motion.last_dt;
  first_dt_ = n.first_dt;
  restored_samples_ = static_cast<std::uint64_t>(n.samples);
  restored_frames_ = static_cast<std::uint64_t>(n.frames);
  restored_events_ = static_cast<std::uint64_t>(n.events);
  before_ = n.motion.taken;
  cpu_before_ = n.cpu_seconds;
  had_ended_ = n.ended;
  rebuilds_before_ = n.motion.rebuilds - simulation().particles().neighbours().rebuilds();
  restarted_from_ = c.file;
  branched_ = p_.branches(options_) && std::filesystem::path(c.file).parent_path() != std::filesystem::path(p_.output);
}

template RunNumbers Run<2>::numbers(bool);
template RunNumbers Run<3>::numbers(bool);
template void Run<2>::visit_numbers(Archive&, RunNumbers&);
template void Run<3>::visit_numbers(Archive&, RunNumbers&);
template void Run<2>::visit(Archive&, RunNumbers&);
template void Run<3>::visit(Archive&, RunNumbers&);
template void Run<2>::save(bool);
template void Run<3>::save(bool);
template void Run<2>::load(const Checkpoint&);
template void Run<3>::load(const Checkpoint&);

}  // namespace pliant
