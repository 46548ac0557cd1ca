// The run folder, and the end.
#include <utility>

#include <pliant/python/simulated.h>

namespace pliant::python {

template <int D>
void Simulated<D>::open_output(const std::string& folder, std::optional<Real> frame_interval,
                               std::optional<Real> sample_interval) {
  const EngineUse use(EngineUse::Kind::access);
  check_open();
  take_changes();
  output_ = std::make_unique<RunOutput<D>>(folder, frame_interval, sample_interval, collect().topology,
                                           settings_->model.name, settings_->options, *simulation_);
}

template <int D>
void Simulated<D>::write_frame() {
  write([&] { output_->write_frame(*simulation_); });
}

template <int D>
void Simulated<D>::write_sample() {
  write([&] { output_->write_sample(*simulation_); });
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
  if (const std::unique_ptr<RunOutput<D>> output = std::move(output_))
    output->finish(settings_->options, force_evaluations_ + simulation_->integrator().statistics().force_evaluations,
                   failed_, *simulation_);
}

template void Simulated<2>::open_output(const std::string&, std::optional<Real>, std::optional<Real>);
template void Simulated<2>::write_frame();
template void Simulated<2>::write_sample();
template void Simulated<2>::close();
template void Simulated<2>::end_output();
template void Simulated<3>::open_output(const std::string&, std::optional<Real>, std::optional<Real>);
template void Simulated<3>::write_frame();
template void Simulated<3>::write_sample();
template void Simulated<3>::close();
template void Simulated<3>::end_output();

}  // namespace pliant::python
