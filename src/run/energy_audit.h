// Checks that the change of a run's energy is the work minus the heat.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <pliant/run/archive.h>
#include <pliant/run/simulation.h>

namespace pliant {

/// Energies since the start of a run, in its units: change = work − heat if energy is conserved.
struct EnergyBudget {
  Real work = 0;                 ///< of moving walls, and of particles moved to another place
  Real heat = 0;                 ///< dissipated
  Real change = 0;               ///< of kinetic and potential energy, the weight's included
  Real uncertainty = 0;          ///< standard error of work and heat, where these are sampled
  Real largest = 0;              ///< kinetic energy, at most; 0 without inertia
  Real energy = 0;               ///< at the end
  Real rounding = 0;             ///< energies below this come from rounded positions
  Real uncertainty_of_work = 0;  ///< the part of the work in `uncertainty`

  Real error() const { return change - work + heat; }
  /// Reference of the error: the largest of work, heat, change and kinetic energy, but no less than a small
  /// part of the energy itself and than `rounding`, so that a run without motion is not judged by its
  /// rounding.
  Real scale() const;
  Real relative_error() const { return scale() > 0 ? std::abs(error()) / scale() : 0; }
  /// The part of the relative error that sampling cannot explain; at least the gain of energy beyond the work.
  Real certain_error() const;

  nlohmann::ordered_json json() const;
  std::string text() const;  ///< a line for the end of a run
};

/// Errors: NumericalError if the energy error is so large that no result can be trusted.
void check_energy(const EnergyBudget& budget);

/// A warning for an energy error above 1 %; empty below.
std::string energy_warning(const EnergyBudget& budget);

/// ∫ value dt by the trapezoidal rule, with the standard error of the values between the times.
class SampledIntegral {
 public:
  void add(Real t, Real value);
  /// The value has jumped since the last call, at the same time.
  void jump(Real value) { before_ = last_ = {last_.first, value}; }
  Real last_time() const { return last_.first; }  ///< time of the last value
  Real value() const { return sum_; }
  /// As if neighbouring values were independent: an upper estimate. Unknown, infinite, below 8 values.
  Real error() const;
  /// Whether the error is below a part of the integral, which is not zero.
  bool accurate_to(Real part) const { return error() < part * sum_; }

  void visit(Archive& archive, const std::string& name);

 private:
  static constexpr std::int64_t fewest = 8;
  std::int64_t count_ = 0;
  Real sum_ = 0, squares_ = 0;
  std::pair<Real, Real> last_{}, before_{};  ///< time and value
};

/// Computes the energy budget of a simulation. Exact to the order of the method: the energy at both ends, announced
/// changes of the state (`outside`), the work of walls and the heat of contacts with history, both summed over all
/// steps. Drag and friction without history are evaluated at an interval of steps: their power costs as much as a
/// force. With velocity Verlet the power is f(x, p) · v, with f computed from the predicted velocities p: summed over
/// all steps this is exactly the loss of kinetic energy by these forces, at half steps. Without inertia work and heat
/// are those that the system integrates with its positions, "work" and "dissipated".
template <int D>
class EnergyAudit {
 public:
  explicit EnergyAudit(Simulation<D>& simulation) : simulation_(&simulation) {}
  /// Steps between two evaluations of the power of the heat: at first, and while the standard error of the heat is
  /// below `accurate`. Where few contacts dissipate, evaluations at long intervals miss collisions. At most 64 steps,
  /// or 8 of methods of PETSc.
  void sample_every(std::int64_t at_first, std::int64_t accurate) { strides_ = {at_first, accurate}; }
  /// The same particles, or others, in another simulation, between disturb() and settle(). The heat of contacts is
  /// there already.
  void move_to(Simulation<D>& simulation) { simulation_ = &simulation; }

  /// To be called before the first step of a process, with a complete state, new or restored. Collective, as all
  /// functions below.
  void start();
  /// To be called after an accepted step, before any other change of the state. outer: power of forces that do not
  /// belong to the model, at the start and at the end of the step; with inertia.
  void follow(const std::pair<Real, Real>& outer = {0, 0});
  /// Before the next step. changed: the state was changed since follow().
  void prepare(bool changed);
  /// change() moves, adds or removes these particles (ids), by other means than forces.
  template <class Change>
  void outside(std::span<const Index> ids, Change&& change) {
    if (!started_) return change();
    const Real before = energy_of(ids);
    change();
    brought_ += energy_of(ids) - before;
  }
  /// change() changes places or motions of walls.
  template <class Change>
  void outside(Change&& change) {
    if (!started_) return change();
    const Real before = energy();
    change();
    brought_ += energy() - before;
    power_ = wall_power(At::anywhere);
  }

  /// The part of the state that a change concerns: velocities alone, or more.
  enum class Change { velocities, all };
  /// To be called before the state, the particles, the coefficients or the walls change by other means than forces, as
  /// often as they do. All changes until settle() count as work; outside() is for a single one.
  void disturb(Change what = Change::all);
  /// The kinetic energy is new, also at the start: the power of the heat is evaluated often until it has settled.
  void kicked() { kicked_at_ = simulation_->state().step; }
  /// After such changes: before the next step, and before work or heat are asked for and stored.
  void settle();

  Real wall_work() const { return work_; }  ///< work of moving walls
  Real work() const;                        ///< of walls, outer forces, and changes from outside
  Real heat();                              ///< until now
  /// Heat of drag and of friction without history until now.
  Real sampled_heat() { return until_now().first.value(); }
  EnergyBudget budget();

  void visit(Archive& archive);

 private:
  bool due(std::int64_t step) const { return step % stride(step) == 0; }
  /// Shorter after a kick, whose heat drag may take up at once: an eighth of the steps since then.
  std::int64_t stride(std::int64_t step) const {
    constexpr Real accurate = 0.005;
    const std::int64_t longest = std::min(heat_.accurate_to(accurate) ? strides_.second : strides_.first,
                                          simulation_->integrator().carries() ? longest_stride : std::int64_t(8));
    if (kicked_at_ < 0 || step - kicked_at_ >= 8 * longest) return longest;
    std::int64_t stride = 1;
    while (16 * stride <= step - kicked_at_) stride *= 2;
    return std::min(stride, longest);
  }
  bool inertia() const { return simulation_->overdamped() == nullptr; }
  /// Without inertia.
  Real integrated(std::string_view name) const;
  /// Whether the state is that at the end of a step, where velocity Verlet has evaluated the forces.
  enum class At { end_of_step, anywhere };
  /// With valid lists.
  StateView<D> view(const Real* v, At at);
  Real rounding() const;
  Real contact_heat() const;
  Real kinetic_energy(const StateView<D>& s) const;
  Real kinetic_energy();
  Real potential_energy();
  Real energy();
  Real energy_of(std::span<const Index> ids);
  Real wall_power(At at);
  struct Rates {
    Real heat, kinetic_energy;  ///< power of the sampled heat
  };
  Rates rates(At at);
  void sample(At at);
  /// The integral of the sampled heat, and the largest kinetic energy. Copies, because the run may continue.
  std::pair<SampledIntegral, Real> until_now();

  Simulation<D>* simulation_;
  static constexpr std::int64_t longest_stride = 64;
  std::pair<std::int64_t, std::int64_t> strides_{longest_stride,
                                                 longest_stride};  ///< intervals that sample_every() sets
  std::int64_t kicked_at_ = -1;  ///< step after which disturb() and settle() have changed the kinetic energy last
  bool started_ = false;
  Real start_energy_ = 0, brought_ = 0, work_ = 0;
  Real power_ = 0, power_at_ = 0;  ///< of walls, at the end of the last step
  Real largest_ = 0;               ///< kinetic energy
  SampledIntegral heat_;           ///< heat of drag and of friction without history
  std::vector<Real> predicted_;    ///< velocities that the forces at the end of the next step see
  std::vector<Real> force_;        ///< of the sampled heat, in use while rates() computes it
  struct Energies {
    Real kinetic;
    std::optional<Real> potential;
  };
  std::optional<Energies> undisturbed_;  ///< before the changes that settle() will count
};

extern template class EnergyAudit<2>;
extern template class EnergyAudit<3>;

}  // namespace pliant
