// The run folder: frames, samples, checkpoints; restart; the end.
#include <tuple>
#include <utility>

#include <pliant/python/simulated.h>
#include <pliant/run/folder.h>
#include <pliant/run/stored_sizes.h>

namespace pliant::python {
namespace {

constexpr const char *sizes_prefix = "particle_", *description_entry = "simulation";

}  // namespace

template <int D>
void Simulated<D>::open_output(const std::string& folder, const OutputIntervals& intervals) {
  const EngineUse use(EngineUse::Kind::access);
  check_open();
  take_changes();
  intervals.check();
  output_ = std::make_unique<RunOutput<D>>(folder, intervals, topology_by_id(), settings_->model.name,
                                           settings_->options, *simulation_, *audit_);
  write_checkpoint(false);  // a killed program always leaves one
}

template <int D>
void Simulated<D>::write_frame() {
  write([&] { output_->write_frame(*simulation_); });
}

template <int D>
void Simulated<D>::write_sample() {
  write([&] { output_->write_sample(*simulation_, *audit_); });
}

template <int D>
void Simulated<D>::save() {
  write([&] {
    if (!failed_.empty())
      throw UsageError("this simulation has failed ({}); restart it from its last checkpoint", failed_);
    if (running_ != nullptr)
      output_->ask_save();
    else
      write_checkpoint(false);
  });
}

template <int D>
std::string Simulated<D>::description() const {
  check_open();
  nlohmann::json all{{"dim", D},
                     {"arguments", settings_->arguments()},
                     {"gravity", numbers_json<D>(weight_)},
                     {"walls", wall_record_.json(simulation_->particles().walls())},
                     {"box", nullptr}};
  if (!box_.open())
    all["box"] = {{"origin", numbers_json<D>(box_.origin())}, {"lengths", numbers_json<D>(box_.length())}};
  return all.dump();
}

template <int D>
void Simulated<D>::visit(Archive& a, MotionNumbers& n) {
  MotionArchive<D> motion(a, *simulation_, n);
  if (a.reads()) simulation_->particles().neighbours().set_skin(a.from().real("skin", 0));
  motion.particles();
  motion.numbers(Archive::any, {});
  a.flag("force_function", function_acts_);
  a.newer("called_functions", called_functions_, 0, 1);
  if (!a.reads() || a.from().integers.contains("audit_started")) audit_->visit(a);
  if (!a.reads() || a.from().reals.contains("function_power")) {
    Real power = function_power_.value_or(0);
    a.number("function_power", power);
    if (a.reads()) function_power_ = power;
  }
  output_->visit(a);
  motion.state();
  if (a.reads()) set_integrator(n.dt);
  motion.carried();
  motion.lists();
}

template <int D>
void Simulated<D>::write_checkpoint(bool changed) {
  settle();
  const Integrator& integrator = simulation_->integrator();
  const ParticleSystem<D>& particles = simulation_->particles();
  const IntegratorStatistics& now = integrator.statistics();
  MotionNumbers n{.changed = changed || fresh_,
                  .dt = integrator.next_dt(),
                  .last_dt = now.steps > 0  ? now.last_dt
                             : last_dt_ > 0 ? last_dt_
                                            : integrator.next_dt(),
                  .skin = particles.neighbours().skin(),
                  .evaluations = particles.use().evaluations,
                  .rebuilds_since_sort = particles.use().rebuilds,
                  .rebuilds = rebuilds_before_ + particles.neighbours().rebuilds(),
                  .taken = now};
  n.taken.steps = simulation_->state().step;
  n.taken.force_evaluations += before_.force_evaluations;
  output_->save(simulation_->state(), {{description_entry, description()}}, [&](Archive& a) {
    save_sizes(sizes_prefix, topology_by_id(), a.to());
    visit(a, n);
  });
}

template <int D>
Simulated<D>::Simulated(const Checkpoint& c, const nlohmann::json& from, const OutputIntervals& intervals,
                        FolderLock lock) {
  const auto& box = from.at("box");
  if (!box.is_null()) box_ = Box<D>(numbers_from<D>(box.at("origin")), numbers_from<D>(box.at("lengths")));
  weight_ = numbers_from<D>(from.at("gravity"));
  settings_ = std::make_unique<Settings>(from.at("arguments").get<std::vector<std::string>>());
  const Walls<D> walls = wall_record_.read(from.at("walls"));
  const Topology all = read_sizes(sizes_prefix, D, c);
  std::tie(simulation_, field_) = make_engine(all, walls);
  offset_ = all.offset;
  next_id_ = all.particles();
  for (Index k = 0; k < next_id_; ++k) ids_.push_back(k);
  stale_ = true;
  State& state = simulation_->state();
  state.t = c.t;
  state.step = c.step;
  const StoredParticles stored(c, simulation_->all(), D, Ranks());
  Archive archive(c, &stored);
  audit_.emplace(*simulation_);
  MotionNumbers n;
  n.taken.steps = c.step;
  called_functions_ = true;  // unless the checkpoint says otherwise, which one of an older version does not
  output_ = std::make_unique<RunOutput<D>>(std::move(lock), intervals, settings_->model.name);
  visit(archive, n);
  fresh_ = n.changed;
  before_.force_evaluations = n.taken.force_evaluations;
  last_dt_ = n.last_dt;
  rebuilds_before_ = n.rebuilds - simulation_->particles().neighbours().rebuilds();
  if constexpr (D == 2)
    if (deformable()) outlines_.start(simulation_->particles(), state);
  output_->go_on(c.file, all);
  simulation_->forget_all();
  follow_heat();
  audit_->start();
  judged_at_ = c.step;
  remember(*this);
}

template <int D>
void Simulated<D>::close() {
  if (running_ != nullptr) throw UsageError("a callback cannot close the simulation that runs; call stop()");
  if (simulation_ && output_) {
    const EngineUse use(EngineUse::Kind::access);
    take_changes();
    end_output();
  }
  simulation_.reset();
  field_ = nullptr;
  for (SharedArray& shared : arrays_) shared = {};
  forget(*this);
}

template <int D>
void Simulated<D>::end_output() {
  if (!simulation_) return;
  if (output_ && !output_->owned()) (void)output_.release();  // its destructor would remove the lock of the parent
  if (!output_) return;
  // Without the last sample and frame, which an uninterrupted run has not.
  if (failed_.empty()) write_checkpoint(false);
  const std::unique_ptr<RunOutput<D>> output = std::move(output_);
  settle();
  output->finish(settings_->options,
                 before_.force_evaluations + simulation_->integrator().statistics().force_evaluations, failed_,
                 *simulation_, *audit_);
}

template Simulated<2>::Simulated(const Checkpoint&, const nlohmann::json&, const OutputIntervals&, FolderLock);
template void Simulated<2>::open_output(const std::string&, const OutputIntervals&);
template void Simulated<2>::write_frame();
template void Simulated<2>::write_sample();
template void Simulated<2>::save();
template std::string Simulated<2>::description() const;
template void Simulated<2>::write_checkpoint(bool);
template void Simulated<2>::close();
template void Simulated<2>::end_output();
template Simulated<3>::Simulated(const Checkpoint&, const nlohmann::json&, const OutputIntervals&, FolderLock);
template void Simulated<3>::open_output(const std::string&, const OutputIntervals&);
template void Simulated<3>::write_frame();
template void Simulated<3>::write_sample();
template void Simulated<3>::save();
template std::string Simulated<3>::description() const;
template void Simulated<3>::write_checkpoint(bool);
template void Simulated<3>::close();
template void Simulated<3>::end_output();

}  // namespace pliant::python
