#include <pliant/scenarios/packings/protocol.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include <pliant/base/console.h>
#include <pliant/base/rng.h>
#include <pliant/catalogue/parameter_values.h>
#include <pliant/io/summary.h>
#include <pliant/jamming/backbone.h>
#include <pliant/jamming/modes.h>
#include <pliant/jamming/saddle.h>
#include <pliant/jamming/trust_region.h>
#include <pliant/model/contact_laws.h>
#include <pliant/model/polygon.h>
#include <pliant/scenarios/packings/measures.h>
#include <pliant/scenarios/packings/steps.h>
#include <pliant/setup/streams.h>

namespace pliant {
namespace {

/// Modes whose displacements are in frames: all of a large packing would fill a disk.
constexpr Index most_drawn = 20;

template <int D>
std::unique_ptr<Simulation<D>> make_simulation(const PackingOptions& p, const Ranks& ranks) {
  if (ranks.several())
    throw InputError(
        "packings at equilibrium are made on one rank, not on {}: start the program without mpiexec, and give -threads",
        ranks.size());
  auto [all, particles] = particles_in_box<D>(p, ranks);
  return std::make_unique<Simulation<D>>(std::move(all), std::move(particles), Sorting::at_start);
}

/// Pushes apart the disks (spheres) that hold the particles, if contacts of the particles could not: deformable
/// particles that cross, and droplets that have swallowed others. Errors: InputError if overlaps, over the contact
/// distance, remain that are larger than `most`.
template <int D>
void push_disks_apart(const Topology& particles, const Box<D>& box, Real most, std::vector<Real>& centres) {
  Topology disks;
  disks.dim = D;
  for (Index m = 0; m < particles.particles(); ++m) disks.add_soft(2 * outer_radius(particles, m), 1);
  constexpr std::string_view shapes = D == 2 ? "disks" : "spheres";
  ParticleSystem<D> system(
      std::move(disks), {},
      make_force_field<D>(ModelKind::sp, ParameterValues{{Role::contact_energy, 1.0}, {Role::wall_energy, 1.0}}), 0.3,
      Ranks(), box);
  MinimiserOptions options;
  options.force_tolerance = 1e-6;
  options.energy_per_particle = 1e-12;
  minimise<D>(system, centres, options);
  system.field().for_each_contact(system.view(centres.data(), nullptr), [&](const Contact<D>& c) {
    if (c.overlap > most)
      throw InputError(
          "the {} around particles {} and {} overlap by {:.2g} of their contact distance at the start; begin with a "
          "lower fraction (-fraction)",
          shapes, system.topology().id[c.first], system.topology().id[c.second], c.overlap);
  });
}

}  // namespace

template <int D>
PackingProtocol<D>::PackingProtocol(const PackingOptions& p, const Ranks& ranks)
    : Protocol<D>(make_simulation<D>(p, ranks)), p_(p) {
  if (p.minimiser == Minimiser::newton) check_trust_region_options();
}

template <int D>
std::unique_ptr<Integrator> PackingProtocol<D>::make_integrator(Real) {
  return std::make_unique<PackingSteps>(p_.minimiser_name(), [this](State& s) -> std::optional<std::int64_t> {
    const std::int64_t evaluations = evaluations_;
    const std::vector<Real> places(s.x().begin(), s.x().end());
    const std::vector<Image> images = s.images;
    const Box<D> box = this->particles().box();
    const Minimum<D> minimum = minimum_;
    const Energies energies = energies_;
    try {
      make_next();
    } catch (const Interrupted&) {
      std::ranges::copy(places, s.x().begin());
      s.images = images;
      this->particles().set_box(box);
      this->particles().rebuild(places.data());
      minimum_ = minimum;
      energies_ = energies;
      evaluations_ = evaluations;
      undo();
      return {};
    }
    add_work(box, minimum);
    return evaluations_ - evaluations;
  });
}

template <int D>
std::vector<Real> PackingProtocol<D>::start() {
  const Topology& all = this->simulation().all();
  const Box<D>& box = this->particles().box();
  const auto seed = static_cast<std::uint64_t>(p_.seed);
  std::vector<Real> centres;
  for (std::uint64_t k = 0; k < static_cast<std::uint64_t>(all.particles()) * D; ++k)
    centres.push_back(box.length()[k % D] * rng::uniform(seed, stream::placement, k));
  // Deformable particles might cross where their disks overlap; droplets may overlap by less than a radius.
  if (all.deformable()) push_disks_apart(all, box, 0.1, centres);
  if (p_.model.particles() == ModelKind::bubble) push_disks_apart(all, box, 0.5, centres);
  std::vector<Real> x(static_cast<std::size_t>(all.points()) * D);
  place_at_random_angles(all, centres.data(), seed, x.data());
  return x;
}

template <int D>
void PackingProtocol<D>::deform(const Mat<D>& f) {
  const Vec<D> origin = this->particles().box().origin();
  const Topology& t = this->topology();
  this->particles().set_box(this->particles().box().deformed(f));
  for (Index m = 0; m < t.owned(); ++m) {
    const Vec<D> centre = mean_of_points<D>(x().data(), t, m), by = (f - Mat<D>::Identity()) * (centre - origin);
    for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i) point<D>(x().data(), i) += by;
  }
}

template <int D>
Real PackingProtocol<D>::energy_now() {
  return this->particles().field().energy(this->particles().view(x().data(), nullptr));
}

/// The work V ∫ σ_xy dγ − ∫ p dV between two packings, by the trapezoidal rule. The step from the random start has the
/// pressure at its end: until the first minimum the box is at rest, after it the pressure is constant.
template <int D>
void PackingProtocol<D>::add_work(const Box<D>& box_before, const Minimum<D>& before) {
  const Box<D>& box = this->particles().box();
  const auto shear = [](const Box<D>& b) { return b.tilt()[0] / b.length()[1]; };
  const auto torque = [](const Box<D>& b, const Minimum<D>& m) { return b.volume() * m.stress.stress(0, 1); };
  const Real after = minimum_.stress.pressure(), first = this->state().step > 0 ? before.stress.pressure() : after;
  energies_.work += (torque(box_before, before) + torque(box, minimum_)) / 2 * (shear(box) - shear(box_before)) -
                    (first + after) / 2 * (box.volume() - box_before.volume());
}

template <int D>
MinimiserOptions PackingProtocol<D>::minimiser() {
  MinimiserOptions options;
  options.minimiser = p_.minimiser;
  options.max_iterations = p_.max_iterations;
  interrupted_ = false;
  if (quick() && p_.model.in_catalogue() && p_.model.particles() == ModelKind::sp)
    options.contacts = {p_.model.value(Role::contact_energy), contact_law(p_.model.choice(Role::contact_law))};
  if (this->attached())
    options.stop = [this] {
      interrupted_ = this->run().stop_requested();
      return interrupted_;
    };
  return options;
}

template <int D>
Real PackingProtocol<D>::tolerance(Real pressure) const {
  constexpr Real for_derivatives = 1e-12;
  const Real usual = p_.force_tolerance * pressure;
  return derivatives() ? std::min(usual, for_derivatives) : usual;
}

template <int D>
void PackingProtocol<D>::minimise_energy(Real pressure_of_path) {
  // The pressure, which the tolerance refers to, is the result.
  constexpr Real first = 1e-6, least = 1e-14;
  MinimiserOptions options = minimiser();
  const Real before = energy_now();
  for (options.force_tolerance = tolerance(first);;) {
    if (!run_minimiser(options, tolerance(pressure_of_path))) break;
    const Real needed = tolerance(minimum_.stress.pressure());
    if (minimum_.apart || !(minimum_.max_force > needed) || needed < least) break;
    options.force_tolerance = needed;
  }
  energies_.relaxed += before - minimum_.energy;
  finish();
}

template <int D>
void PackingProtocol<D>::minimise_enthalpy(Real pressure) {
  MinimiserOptions options = minimiser();
  options.pressure = pressure;
  options.force_tolerance = tolerance(pressure);
  const Real before = energy_now(), volume = this->particles().box().volume();
  run_minimiser(options, 0);
  energies_.relaxed += before - minimum_.energy + pressure * (volume - this->particles().box().volume());
  finish();
}

template <int D>
bool PackingProtocol<D>::run_minimiser(const MinimiserOptions& options, Real coarse_tolerance) {
  // A configuration with symmetries may need several steps, each of which breaks one.
  constexpr int most_saddles = 20;
  const bool creeps = D == 2 && p_.model.deformable() && p_.model.value(Role::bending) == 0;
  const auto relax = [&](const MinimiserOptions& o) {
    minimum_ = minimise<D>(this->particles(), x(), o);
    if (interrupted_) throw Interrupted();
    evaluations_ += minimum_.evaluations;
  };
  for (int saddles = 0;; ++saddles) {
    relax(options);
    const bool coarse = !minimum_.converged && coarse_tolerance > options.force_tolerance;
    if (coarse) {
      MinimiserOptions again = options;
      again.force_tolerance = coarse_tolerance;
      const std::int64_t iterations = minimum_.iterations;
      relax(again);
      minimum_.iterations += iterations;
    }
    if (!minimum_.converged)
      throw NumericalError("packing {} has not converged: {}; raise {}", this->state().step + 1, minimum_.reason,
                           minimum_.rounded
                               ? "-force_tolerance"
                               : fmt::format("-max_iterations or -force_tolerance{}, or make steps smaller",
                                             creeps ? fmt::format(", give the polygons bending stiffness ({}, now 0)",
                                                                  p_.model.option(Role::bending))
                                                    : ""));
    find_network();
    if (coarse || minimum_.apart) return !coarse;
    // Particles that push each other though nothing holds them are at a saddle point, for example chains in a crystal.
    const bool held = network_.backbone > 0;
    if (held && !derivatives()) return true;
    // Within a coarse tolerance particles may also push each other apart, with contact forces that do not balance.
    constexpr Real unbalanced = 0.1;
    if (!held && !(minimum_.max_force < unbalanced * network_.typical_force)) return true;
    const std::span<const Index> none, rattlers = network_.rattlers;
    if (!leave_saddle<D>(this->particles(), x(), held ? rattlers : none)) return true;
    if (saddles == most_saddles)
      throw NumericalError(
          "packing {}: {} minimisations in a row have ended at saddle points of the energy; use another -seed or "
          "-fraction",
          this->state().step + 1, most_saddles + 1);
  }
}

/// Measures the packing, and makes the lists as a restart makes them.
template <int D>
void PackingProtocol<D>::finish() {
  check_crossings<D>(this->particles(), x().data(), "at the minimum",
                     {.contacts = D == 2 ? "begin with a lower fraction (-fraction) or pressure"
                                         : fmt::format("begin with a lower fraction (-fraction) or pressure, raise {}",
                                                       p_.model.option(Role::contact_energy)),
                      .shape = "raise the stiffness of the particles' shape",
                      .self_crossing = ""});
  const Real attraction = p_.model.value(Role::attraction);
  check_overlaps<D>(
      this->particles(), x().data(),
      fmt::format(
          "{}begin with a lower fraction (-fraction) or pressure",
          attraction > 0 ? fmt::format("lower {}, now {:g}, or ", p_.model.option(Role::attraction), attraction) : ""));
  analyse();
  this->particles().wrap(this->state());
  this->particles().rebuild(x().data());
  minimum_.stress = stress_of(this->particles(), x().data());
}

template <int D>
void PackingProtocol<D>::find_network() {
  network_ = contact_network<D>(this->particles(), x(), p_.contact_threshold);
}

/// Of the network.
template <int D>
void PackingProtocol<D>::analyse() {
  if (p_.moduli) moduli_ = backbone_moduli<D>(this->particles(), x(), network_);
  if (p_.modes > 0) find_modes();
}

template <int D>
void PackingProtocol<D>::ready() {
  const std::int64_t iterations = minimum_.iterations;
  if (this->state().step > 0 || minimum_.converged) find_network();  // not of the random start
  analyse();
  minimum_ = measure_at<D>(this->particles(), x());
  minimum_.iterations = iterations;
  if (this->state().step == 0) energies_.start = minimum_.energy;
}

template <int D>
void PackingProtocol<D>::find_modes() {
  const std::vector<Real> amplitudes = p_.mode_amplitudes();
  zero_modes_ = 0;
  for (std::vector<Real>* values : {&frequencies_, &participation_, &mode_energies_, &mode_contact_energies_})
    values->clear();
  const auto points = static_cast<std::size_t>(this->topology().owned_points()),
             width = static_cast<std::size_t>(std::min(p_.modes, most_drawn)) * D;
  mode_displacements_.assign(points * width, 0);
  if (network_.backbone > 0) {
    const Backbone<D> backbone(this->particles(), network_.rattlers);
    const Index most = network_.backbone * (p_.model.deformable() ? p_.shape.vertices : 1) * D;
    const Modes found =
        pliant::modes<D>(this->particles(), x(), {.lowest = std::min(p_.modes, most), .pre_stress = p_.pre_stress});
    frequencies_ = found.frequencies();
    participation_ = found.participation;
    zero_modes_ = found.zero;
    const Real at_rest = energies_along<D>(this->particles(), x(), {}, std::array{Real(0)})[0].total;
    for (Index k = 0; k < found.vectors.cols() && (k < most_drawn || !amplitudes.empty()); ++k) {
      const std::vector<Real> mode = mode_displacements(this->particles(), found, k);
      for (std::size_t i = 0; k < most_drawn && i < points; ++i)
        std::copy_n(&mode[i * D], D, &mode_displacements_[i * width + static_cast<std::size_t>(k) * D]);
      for (const PackingEnergy& one : energies_along<D>(this->particles(), x(), mode, amplitudes)) {
        mode_energies_.push_back(one.total - at_rest);
        mode_contact_energies_.push_back(one.contacts);
      }
    }
  }
  const auto fill = [&](std::vector<Real>& values, std::size_t of_mode) {
    values.resize(static_cast<std::size_t>(p_.modes) * of_mode, std::numeric_limits<Real>::quiet_NaN());
  };
  for (std::vector<Real>* values : {&frequencies_, &participation_}) fill(*values, 1);
  for (std::vector<Real>* values : {&mode_energies_, &mode_contact_energies_}) fill(*values, amplitudes.size());
}

template <int D>
Real PackingProtocol<D>::fraction() const {
  return packing_fraction(this->particles(), this->state().x().data());
}

template <int D>
Real PackingProtocol<D>::rim_fraction() const {
  return pliant::rim_fraction(this->particles(), this->state().x().data(), p_.model.particles());
}

template <int D>
std::vector<SeriesValue> PackingProtocol<D>::sample() {
  const State& s = this->state();
  std::vector<SeriesValue> row{{"time", s.t},
                               {"fraction", fraction()},
                               {"pressure", minimum_.stress.pressure()},
                               {"stress", upper_triangle<D>(minimum_.stress.stress)},
                               {"energy", minimum_.energy},
                               {"work", energies_.work},
                               {"dissipated", dissipated()},
                               {"relaxed", energies_.relaxed},
                               {"max_force", minimum_.max_force},
                               {"iterations", static_cast<Real>(minimum_.iterations)},
                               {"volume", this->particles().box().volume()},
                               {"contacts", static_cast<Real>(network_.contacts)},
                               {"touching_pairs", static_cast<Real>(network_.touching())},
                               {"backbone", static_cast<Real>(network_.backbone)},
                               {"rattlers", static_cast<Real>(network_.rattlers.size())},
                               {"coordination", network_.coordination()}};
  if (p_.model.deformable()) row.emplace_back("rim_fraction", rim_fraction());
  if (p_.moduli) {
    std::vector<Real> rows;
    const typename Moduli<D>::Voigt stiffness = moduli_.voigt();
    for (const Real c : stiffness.template reshaped<Eigen::RowMajor>()) rows.push_back(c);
    row.emplace_back("bulk_modulus", moduli_.bulk());
    row.emplace_back("shear_modulus", moduli_.shear());
    row.emplace_back("shear_modulus_xy", moduli_.simple_shear(0, 1));
    row.emplace_back("stiffness", rows);
  }
  if (p_.modes > 0) {
    row.emplace_back("frequencies", frequencies_);
    row.emplace_back("participation", participation_);
    row.emplace_back("zero_modes", static_cast<Real>(zero_modes_));
    if (p_.mode_amplitude) {
      row.emplace_back("mode_energies", mode_energies_);
      row.emplace_back("mode_contact_energies", mode_contact_energies_);
    }
  }
  measure(row);
  return row;
}

template <int D>
void PackingProtocol<D>::visit(Archive& a) {
  ParticleSystem<D>& particles = this->particles();
  std::vector<Real> length(particles.box().length().begin(), particles.box().length().end()),
      tilt(particles.box().tilt().begin(), particles.box().tilt().end());
  a.array("box_length", length, D, std::numeric_limits<Real>::min());
  a.array("box_tilt", tilt, tilts<D>);
  a.number("minimisations", evaluations_);
  a.newer("iterations", minimum_.iterations);
  a.number("start_energy", energies_.start);
  a.number("work_of_box", energies_.work);
  a.number("relaxed_energy", energies_.relaxed);
  if (a.reads()) {
    Tilt<D> tilts_of_box;
    std::copy(tilt.begin(), tilt.end(), tilts_of_box.begin());
    particles.set_box(Box<D>(particles.box().origin(), Eigen::Map<const Vec<D>>(length.data()), tilts_of_box));
  }
  visit_more(a);
}

template <int D>
void PackingProtocol<D>::conclude(nlohmann::ordered_json& s) {
  s["fraction"] = fraction();
  if (p_.model.deformable()) s["rim_fraction"] = rim_fraction();
  s["pressure"] = minimum_.stress.pressure();
  s["stress"] = upper_triangle<D>(minimum_.stress.stress);
  s["energy"] = minimum_.energy;
  s["work"] = energies_.work;
  s["dissipated"] = dissipated();
  s["relaxed"] = energies_.relaxed;
  s["max_force"] = minimum_.max_force;
  s["contacts"] = network_.contacts;
  if (const auto free = p_.free_coordinates()) s["isostatic_contacts"] = network_.isostatic(*free);
  s["touching_pairs"] = network_.touching();
  s["backbone"] = network_.backbone;
  s["rattlers"] = network_.rattlers.size();
  s["coordination"] = network_.coordination();
  if (p_.moduli) {
    s["bulk_modulus"] = moduli_.bulk();
    s["shear_modulus"] = moduli_.shear();
  }
  if (p_.modes > 0) s["zero_modes"] = zero_modes_;
  conclude_more(s);
}

template <int D>
void PackingProtocol<D>::write_axes(RunWriter& writer) const {
  if (p_.mode_amplitude) writer.write_axis("mode_amplitude", p_.mode_amplitudes());
}

template <int D>
void PackingProtocol<D>::report(const Series&, nlohmann::ordered_json& s) {
  say("fraction {:.6g} at the pressure {:.4g} eps/sigma_avg^{}; {} contacts{}, rattlers: {} of {} particles\n",
      Real(s["fraction"]), Real(s["pressure"]), D, network_.contacts,
      s.contains("isostatic_contacts") ? fmt::format(" (isostatic: {})", Index(s["isostatic_contacts"])) : "",
      network_.rattlers.size(), p_.particles);
}

template <int D>
std::string PackingProtocol<D>::progress() const {
  return fmt::format("fraction {:.5f}  p {:.3g}", fraction(), minimum_.stress.pressure());
}

template <int D>
std::string PackingProtocol<D>::unread_options_advice() const {
  return p_.minimiser == Minimiser::newton ? ""
                                           : "of PETSc's solvers only TAO minimises (-tao_...), with -minimiser newton";
}

template class PackingProtocol<2>;
template class PackingProtocol<3>;

}  // namespace pliant
