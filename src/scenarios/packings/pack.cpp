#include <pliant/scenarios/packings/pack.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <pliant/run/archive.h>
#include <pliant/run/memory.h>
#include <pliant/scenarios/packings/make.h>
#include <pliant/scenarios/packings/scenarios.h>

namespace pliant {

template <int D>
PackProtocol<D>::PackProtocol(const PackOptions& p, const Ranks& ranks, bool quick)
    : PackingProtocol<D>(p, ranks), p_(p), pressures_(p.pressures()), quick_(quick) {}

template <int D>
std::string PackProtocol<D>::title() const {
  return "pack: " + p_.path_text();
}

template <int D>
Real PackProtocol<D>::steps() const {
  return p_.path == PackingPath::quench ? 1 : static_cast<Real>(pressures_.size());
}

template <int D>
Real PackProtocol<D>::last_time() const {
  constexpr Real most_fraction = 2;
  if (p_.path != PackingPath::compress) return steps();
  return std::max(Real(2), std::ceil((most_fraction - *p_.fraction) / p_.fraction_step));
}

template <int D>
std::string PackProtocol<D>::end_at_last_time() const {
  return p_.path == PackingPath::decompress ? "pressure" : "fraction";
}

template <int D>
void PackProtocol<D>::make_next() {
  const auto k = static_cast<std::size_t>(this->state().step);
  const Real pressure_of_path = p_.path == PackingPath::quench ? 0 : pressures_[0];
  if (k == 0) this->minimise_energy(pressure_of_path);
  if (p_.path == PackingPath::decompress) return this->minimise_enthalpy(pressures_[k]);
  if (p_.path == PackingPath::quench) return;
  const Real pressure = this->stress().pressure();
  if (k == 0) {
    if (pressure > p_.pressure)
      throw InputError(
          "-path compress with -fraction {:g}: the first packing has the pressure {:.4g}, above -pressure {:g}, so "
          "that there is nothing to compress; give a lower fraction or a higher pressure",
          *p_.fraction, pressure, p_.pressure);
    return;
  }
  if (pressure >= p_.pressure) {
    this->minimise_enthalpy(p_.pressure);
    at_pressure_ = true;
    return;
  }
  const Real before = *p_.fraction + static_cast<Real>(k - 1) * p_.fraction_step,
             factor = std::pow(before / (before + p_.fraction_step), Real(1) / D);
  this->deform(Mat<D>(factor * Mat<D>::Identity()));
  this->minimise_energy(pressure_of_path);
}

template <int D>
void PackProtocol<D>::visit_more(Archive& a) {
  a.flag("at_pressure", at_pressure_);
}

template class PackProtocol<2>;
template class PackProtocol<3>;

Scenario pack_scenario() {
  return packing_scenario<PackOptions>(
      "pack", "jammed packings in a periodic box",
      {"model", "dim", "n", "path", "fraction", "pressure", "force_tolerance", "seed", "output"},
      "The time of a run is the number of its packings.",
      []<int D>(const PackOptions& p, const Ranks& ranks, std::integral_constant<int, D>) {
        return std::make_unique<PackProtocol<D>>(p, ranks, true);
      });
}

}  // namespace pliant
