#include <pliant/run/motion_archive.h>

#include <algorithm>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace pliant {
namespace {

/// 0 if there are none: limits matter only when a checkpoint is read, and Simulation::all() is empty during the run.
Real largest_of(const std::vector<Real>& values) {
  return values.empty() ? 0 : *std::max_element(values.begin(), values.end());
}

}  // namespace

template <int D>
void MotionArchive<D>::particles() {
  ParticleSystem<D>& particles = simulation_.particles();
  if (a_.reads())
    simulation_.take(a_.particles().ids());
  else
    save_particles(particles.topology(), a_.to());
  const auto& now = particles.topology().active;
  std::vector<std::uint8_t> active(now.begin(), now.begin() + particles.topology().owned());
  a_.per_particle("active", active, 0, 1);
  if (!a_.reads()) return;
  for (std::size_t m = 0; m < active.size(); ++m)
    if (active[m] == 0) particles.deactivate(static_cast<Index>(m));
}

template <int D>
void MotionArchive<D>::numbers(Real longest, std::optional<Real> skin) {
  constexpr Real smallest = std::numeric_limits<Real>::min();
  const Real widest = std::max(simulation_.particles().neighbours().skin(), largest_of(simulation_.all().diameter));
  a_.flag("changed", n_.changed);
  a_.number("dt", n_.dt, smallest, longest);
  a_.number("last_dt", n_.last_dt, smallest, longest);
  a_.number("skin", n_.skin, skin.value_or(smallest), skin.value_or(widest));
  a_.number("list_rebuilds", n_.rebuilds);
  a_.number("list_rebuilds_since_sort", n_.rebuilds_since_sort, 0, n_.rebuilds);
  a_.number("evaluations_since_sort", n_.evaluations);
  a_.number("rejected_steps", n_.taken.rejected);
  a_.number("steps_above_tolerance", n_.taken.above_tolerance, 0, n_.taken.steps);
  a_.number("force_evaluations", n_.taken.force_evaluations, n_.taken.steps);
  a_.number("jacobian_evaluations", n_.taken.jacobian_evaluations);
  a_.number("linear_iterations", n_.taken.linear_iterations);
}

template <int D>
Real MotionArchive<D>::fastest() const {
  return 10 * largest_of(simulation_.all().sigma) / n_.dt;
}

template <int D>
template <class Set>
void MotionArchive<D>::coordinates(const std::string& name, const std::string& of_angles, std::span<const Real> own,
                                   Real most, Set&& set) {
  const ParticleSystem<D>& particles = simulation_.particles();
  const int angles = particles.coordinates().angles;
  const auto positions = static_cast<std::size_t>(particles.topology().owned_points()) * D;
  const std::size_t first = std::min(own.size(), positions);  // or nothing
  std::vector<Real> values;
  const auto append = [&](std::span<const Real> more) { values.insert(values.end(), more.begin(), more.end()); };
  a_.points(name, own.first(first), most, append);
  if (angles > 0) a_.rotations(of_angles, own.subspan(first), angles, append);
  if (a_.reads()) set(std::move(values));
}

template <int D>
void MotionArchive<D>::state() {
  State& s = simulation_.state();
  ParticleSystem<D>& particles = simulation_.particles();
  std::vector<Real> x;
  coordinates("x", "angle", s.x(), StoredParticles::far, [&](std::vector<Real> places) { x = std::move(places); });
  coordinates("v", "spin", s.v(), simulation_.overdamped() == nullptr ? fastest() : Archive::any,
              [&](std::vector<Real> v) { s.assign(std::move(x), std::move(v)); });
  if (a_.reads()) {
    a_.particles().load_history(particles);
    particles.set_accepted(s.x());
  } else {
    save_history(particles.history(), particles.topology(), a_.to());
  }
  images();
  overdamped();
}

/// Places that a periodic box has brought particles back from.
template <int D>
void MotionArchive<D>::images() {
  const ParticleSystem<D>& particles = simulation_.particles();
  State& s = simulation_.state();
  if (particles.box().open()) return;
  if (a_.reads()) {
    s.images = a_.particles().images("images");
    return;
  }
  std::vector<std::int64_t> images;
  for (const Image& image : s.images) images.insert(images.end(), image.begin(), image.end());
  images.resize(3 * static_cast<std::size_t>(particles.topology().owned()));
  a_.to().add_parts("images", std::move(images));
}

/// Quantities that are integrated with the positions of an overdamped system, and its last velocities.
template <int D>
void MotionArchive<D>::overdamped() {
  OverdampedSystem<D>* const system = simulation_.overdamped();
  State& s = simulation_.state();
  std::vector<Real> extra = s.extra;
  if (!a_.reads() || system != nullptr) a_.array("extra", extra, system != nullptr ? system->quantities().size() : 0);
  if (a_.reads() && simulation_.ranks().root()) s.extra = std::move(extra);
  const bool remembers = system != nullptr && system->mobility().remembers();
  // None before the first evaluation.
  if (a_.reads() &&
      (system == nullptr || (a_.from().length("last_velocity") == 0 && !(remembers && a_.from().step > 0))))
    return;
  a_.points("last_velocity", remembers ? std::span<const Real>(system->last()) : std::span<const Real>(), Archive::any,
            [&](std::span<const Real> last) {
              system->set_last({last.begin(), last.end()});
            });
}

template <int D>
void MotionArchive<D>::carried() {
  Integrator& method = simulation_.integrator();
  const bool carries = method.carries() && !n_.changed;
  if (!carries && a_.reads()) return;
  coordinates("carried", "carried_spin", carries && !a_.reads() ? method.carried() : std::span<const Real>(), fastest(),
              [&](std::vector<Real> carried) {
                method.set_carried(std::move(carried));
                simulation_.restored();
              });
}

template <int D>
void MotionArchive<D>::lists() {
  ParticleSystem<D>& particles = simulation_.particles();
  Neighbours<D>& neighbours = particles.neighbours();
  const State& s = simulation_.state();
  typename Neighbours<D>::History now;
  // Invalid lists will be rebuilt. Ranks whose particles have just left have no lists.
  if (!a_.reads() && simulation_.ranks().all(s.size() == 0 || neighbours.valid(particles.walls(), s.x().data(), s.t)))
    now = neighbours.history(particles.topology());
  a_.number("list_time", now.time, 0, a_.t());
  if (!a_.reads()) return save_lists(std::move(now.reference), now.relisted, now.places, a_.to());
  const ShearFlow<D>& flow = particles.box().flow();
  const auto [reference, relisted, places] =
      a_.particles().lists(n_.skin / 2 * (1 + 1e-9), flow.rate * (s.t - now.time), flow.y0);
  neighbours.set_skin(n_.skin);
  if (!reference.empty()) {
    if (particles.has_ghosts())
      particles.rebuild(a_.particles().own_points(reference).data(), now.time);
    else
      neighbours.replay(particles.topology(), particles.walls(), {reference, relisted, places, now.time});
  }
  particles.set_use({n_.evaluations, n_.rebuilds_since_sort});
}

template class MotionArchive<2>;
template class MotionArchive<3>;

}  // namespace pliant
