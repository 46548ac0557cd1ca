// The scenario `shear`: simple shear of a packing, in quasistatic steps or at a finite rate.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <pliant/run/archive.h>
#include <pliant/scenarios/packings/make.h>
#include <pliant/scenarios/packings/pack.h>
#include <pliant/scenarios/packings/scenarios.h>
#include <pliant/scenarios/packings/steady_shear.h>

namespace pliant {
namespace {

template <int D>
class QuasistaticShear final : public PackProtocol<D> {
 public:
  QuasistaticShear(const ShearOptions& p, const Ranks& ranks) : PackProtocol<D>(p, ranks, false), p_(p) {}

  std::string title() const override {
    const std::string cycles = p_.cycles > 0 ? fmt::format("{} times to ±", p_.cycles) : "to ";
    return fmt::format("shear: {}; then by steps of {:g} {}the strain {:g} at constant {}", p_.path_text(),
                       p_.strain_step, cycles, *p_.strain, p_.control == ShearControl::volume ? "volume" : "pressure");
  }
  Real last_time() const override {
    return this->steps() + static_cast<Real>(p_.cycles > 0 ? 4 * p_.cycles * steps_to_end() : steps_to_end());
  }
  std::string end_at_last_time() const override { return p_.cycles > 0 ? "cycles" : "strain"; }

 protected:
  void make_next() override {
    const auto sheared = this->state().step - static_cast<std::int64_t>(this->steps());
    if (sheared < 0) return PackProtocol<D>::make_next();
    Mat<D> f = Mat<D>::Identity();
    f(0, 1) = strain_after(sheared + 1) - strain_;
    strain_ += f(0, 1);
    this->deform(f);
    if (p_.control == ShearControl::volume)
      this->minimise_energy(p_.path == PackingPath::quench ? 0 : p_.pressure);
    else
      this->minimise_enthalpy(p_.pressure);
  }
  void undo() override {
    strain_ = strain_after(std::max<std::int64_t>(this->state().step - static_cast<std::int64_t>(this->steps()), 0));
  }
  void visit_more(Archive& a) override {
    PackProtocol<D>::visit_more(a);
    a.number("strain", strain_, -*p_.strain, *p_.strain);
    Real amplitude = p_.cycles > 0 ? *p_.strain : 0;
    a.newer("strain_of_cycles", amplitude);
    if (const Real now = p_.cycles > 0 ? *p_.strain : 0; amplitude != now)
      throw InputError(
          "-strain {:g} with -cycles {}: the run was started with cycles of {:g} (0: none); leave both as "
          "they were, or raise -cycles",
          *p_.strain, p_.cycles, amplitude);
  }
  void measure(std::vector<SeriesValue>& row) override {
    row.emplace_back("strain", strain_);
    row.emplace_back("shear_stress", this->stress().stress(0, 1));
  }
  void conclude_more(nlohmann::ordered_json& s) override {
    s["strain"] = strain_;
    s["shear_stress"] = this->stress().stress(0, 1);
  }

 private:
  /// From no strain to the largest.
  std::int64_t steps_to_end() const {
    return static_cast<std::int64_t>(std::ceil(*p_.strain / p_.strain_step * (1 - 1e-9)));
  }
  /// A number of steps after the preparation.
  Real strain_after(std::int64_t step) const {
    const std::int64_t end = steps_to_end(), in_cycle = p_.cycles > 0 ? step % (4 * end) : step,
                       from_zero = in_cycle <= end       ? in_cycle
                                   : in_cycle <= 3 * end ? 2 * end - in_cycle
                                                         : in_cycle - 4 * end;
    const Real strain = static_cast<Real>(from_zero) * p_.strain_step;
    return std::clamp(strain, -*p_.strain, *p_.strain);
  }

  const ShearOptions& p_;
  Real strain_ = 0;
};

}  // namespace

Scenario shear_scenario() {
  const std::string drag = ShearOptions().model.table().with(Role::drag)[0]->name;
  return packing_scenario<ShearOptions>(
      "shear", "simple shear of a jammed packing, quasistatic or at a finite rate",
      {"model", "dim", "n", "pressure", "strain", "strain_step", "control", "shear_rate", drag, "seed", "output"},
      "The time of a run is the number of its packings; with -shear_rate its unit is t0 = sigma_avg^(1+d/2) "
      "(rho/eps)^(1/2).",
      []<int D>(const ShearOptions& p, const Ranks& ranks,
                std::integral_constant<int, D>) -> std::unique_ptr<Protocol<D>> {
        if (p.rate) return std::make_unique<SteadyShear<D>>(p, ranks);
        return std::make_unique<QuasistaticShear<D>>(p, ranks);
      });
}

}  // namespace pliant
