// Common parts of droplet runs.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <pliant/run/passage_watch.h>
#include <pliant/run/protocol.h>
#include <pliant/run/simulation.h>
#include <pliant/scenarios/droplets/options.h>
#include <pliant/ts/ts_integrator.h>

namespace pliant {

/// Errors: InputError on several ranks.
void refuse_ranks(const std::string& scenario, const Ranks& ranks);

/// Most steps are as long as stability allows: a low order takes the fewest evaluations, a small error costs nothing.
inline const TsOptions droplet_integration{.rk_type = "3bs", .atol_x = 1e-8};

/// Initial state of a scenario.
struct DropletSetup {
  Topology droplets;
  Walls<2> walls;
  Vec<2> gravity = Vec<2>::Zero();
  bool walls_rub = false;  ///< NeighbourDragOptions::walls
  int walls_at_once = 1;   ///< that push a droplet along one line
  TsOptions integration = droplet_integration;
};

/// Droplets in the plane, without inertia, and their energy budget: the work that the walls have done on them and the
/// energy that drag and friction have dissipated are integrated with the positions. Walls that move must be without
/// friction. A run has one rank, because the viscous matrix is factorised as a whole.
class DropletProtocol : public Protocol<2> {
 public:
  std::string model() const final { return "bubble"; }
  Real first_dt() const final { return dt_; }
  Real critical_step() const final { return critical_step_; }
  Real safe_part() const final { return 0.5; }  // loads make droplets stiffer
  std::optional<Real> fixed_skin() const final { return p_.skin; }
  std::unique_ptr<Integrator> make_integrator(Real dt) final;
  void started() final;
  void ready() final;
  bool follow() final;
  std::vector<SeriesValue> sample() final;
  std::vector<Real> wall_segments() final { return drawn_walls(state().t); }
  void visit(Archive& archive) final;
  std::optional<EnergyBudget> energy_budget() final;
  void conclude(nlohmann::ordered_json& summary) final;
  void report(const Series& series, nlohmann::ordered_json& summary) final;

 protected:
  DropletProtocol(const DropletOptions& p, const Ranks& ranks, const DropletSetup& setup);

  // Further hooks of a droplet scenario.
  /// Walls as drawn at time t, before the start at 0: x1 y1 x2 y2 of each wall.
  virtual std::vector<Real> drawn_walls(Real t) const = 0;
  /// After every step, as Protocol::follow().
  virtual bool follow_stages() = 0;
  /// Columns that it adds to a sample.
  virtual void measure(std::vector<SeriesValue>& row) = 0;
  virtual void visit_more(Archive& archive) = 0;  ///< when it reads, it may put_walls()
  virtual void conclude_more(nlohmann::ordered_json& summary) = 0;

  // Services for scenarios. Droplets are never sorted; droplet m is at place m.
  const Topology& topology() const { return simulation().topology(); }
  Index droplets() const { return topology().particles(); }
  Real radius(Index m) const { return topology().diameter[m] / 2; }
  Vec<2> position(Index m) const { return point<2>(state().x().data(), m); }
  ParticleSystem<2>& particles() { return simulation().particles(); }
  /// The present configuration, with valid lists.
  StateView<2> view() { return particles().view(state().x().data(), state().v().data(), state().t); }
  /// Force on each wall [2 · walls].
  std::vector<Real> wall_forces();
  Real max_speed();  ///< largest speed of a droplet, now

  /// Changes that take energy out of the budget, or bring some in.
  void set_walls(const Walls<2>& walls);
  void deactivate(Index m);
  void put_walls(const Walls<2>& walls);  ///< without counting their work

 private:
  Real standard_dt() const;
  /// Errors: NumericalError for a droplet that has moved by more than its radius in the last step.
  void check_motion();
  Real energy();  ///< present energy, including the weight
  template <class Change>
  void outside_budget(Change&& change);
  Real integrated(std::size_t quantity) const { return state().extra.empty() ? 0 : state().extra[quantity]; }

  const DropletOptions& p_;
  TsOptions integration_;
  Real fastest_rate_;
  Real dt_;
  PassageWatch<2> passages_;
  std::vector<Real> before_;                                    ///< positions before the next step
  Real critical_step_ = std::numeric_limits<Real>::infinity();  ///< an estimate for light loads
  Real start_energy_ = 0, withdrawn_ = 0;                       ///< withdrawn: energy removed by changes of the state
  Real budget_error_ = 0;                                       ///< error of the energy budget at the last sample
};

}  // namespace pliant
