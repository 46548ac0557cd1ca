// The scenario `shear`: quasistatic simple shear of a packing.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <pliant/run/archive.h>
#include <pliant/scenarios/packings/make.h>
#include <pliant/scenarios/packings/pack.h>
#include <pliant/scenarios/packings/scenarios.h>

namespace pliant {
namespace {

template <int D>
class ShearProtocol final : public PackProtocol<D> {
 public:
  ShearProtocol(const ShearOptions& p, const Ranks& ranks) : PackProtocol<D>(p, ranks), p_(p) {}

  std::string title() const override {
    return fmt::format("shear: {}; then by steps of {:g} to the strain {:g} at constant {}", this->path_text(),
                       p_.strain_step, p_.strain, p_.control == ShearControl::volume ? "volume" : "pressure");
  }
  Real last_time() const override { return this->steps() + std::ceil(p_.strain / p_.strain_step * (1 - 1e-9)); }
  std::string end_at_last_time() const override { return "strain"; }

 protected:
  void make_next() override {
    const Real sheared = static_cast<Real>(this->state().step) - this->steps();
    if (sheared < 0) return PackProtocol<D>::make_next();
    Mat<D> f = Mat<D>::Identity();
    f(0, 1) = std::min((sheared + 1) * p_.strain_step, p_.strain) - strain_;
    strain_ += f(0, 1);
    this->deform(f);
    if (p_.control == ShearControl::volume)
      this->minimise_energy();
    else
      this->minimise_enthalpy(p_.pressure);
  }
  void visit_more(Archive& a) override {
    PackProtocol<D>::visit_more(a);
    a.number("strain", strain_, 0, p_.strain);
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
  const ShearOptions& p_;
  Real strain_ = 0;
};

}  // namespace

Scenario shear_scenario() {
  return packing_scenario<ShearOptions, ShearProtocol>(
      "shear", "quasistatic simple shear of a jammed packing",
      {"model", "dim", "n", "pressure", "strain", "strain_step", "control", "seed", "output"});
}

}  // namespace pliant
