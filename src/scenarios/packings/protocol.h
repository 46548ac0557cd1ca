// Common parts of runs of packings in a periodic box.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <pliant/jamming/contact_network.h>
#include <pliant/jamming/minimise.h>
#include <pliant/jamming/moduli.h>
#include <pliant/run/protocol.h>
#include <pliant/scenarios/packings/options.h>

namespace pliant {

/// A run whose step k makes packing k at a minimum of the energy or the enthalpy. The start are particles at random
/// places in a square or cubic box, which may overlap. A packing whose minimisation has not converged, or whose
/// outlines cross, ends the run with an error.
template <int D>
class PackingProtocol : public Protocol<D> {
  struct Interrupted {};

 public:
  /// Errors: InputError for several ranks.
  PackingProtocol(const PackingOptions& p, const Ranks& ranks);

  std::string model() const final { return p_.model.name; }
  std::string_view unit_of_time() const final { return "steps"; }
  bool counts_steps() const final { return true; }
  Real first_dt() const final { return 1; }
  std::unique_ptr<Integrator> make_integrator(Real dt) final;
  RunGeometry geometry() const final { return {"periodic", {}, {}}; }
  std::vector<Real> start() final;
  /// Measures the packing of the start or of a restart.
  void ready() final;
  std::vector<SeriesValue> sample() final;
  void visit(Archive& archive) final;
  void conclude(nlohmann::ordered_json& summary) final;
  void report(const Series& series, nlohmann::ordered_json& summary) final;
  bool measures_stress() const final { return true; }
  const std::vector<Real>* modes() const final { return p_.modes > 0 ? &mode_displacements_ : nullptr; }
  void write_axes(RunWriter& writer) const final;
  std::string progress() const final;
  std::string unread_options_advice() const final;

 protected:
  /// Makes the next packing, by the functions below, which throw Interrupted where the run is to stop.
  virtual void make_next() = 0;
  /// make_next() was interrupted: the state is as before, and so must be other data.
  virtual void undo() {}
  /// Whether few points are minimised by the faster method: see MinimiserOptions::contacts.
  virtual bool quick() const { return false; }
  virtual void visit_more(Archive& /*archive*/) {}
  virtual void measure(std::vector<SeriesValue>& /*row*/) {}
  virtual void conclude_more(nlohmann::ordered_json& /*summary*/) {}

  /// Deforms the box and moves the centres of the particles with it.
  void deform(const Mat<D>& f);
  /// A minimum of the energy in the present box. After the limit of iterations forces within the tolerance at
  /// `pressure_of_path` suffice, because polygons without bending stiffness creep: the energy of a rest shape grows
  /// with the fourth power of displacements.
  void minimise_energy(Real pressure_of_path = 0);
  void minimise_enthalpy(Real pressure);

  const BoxStress<D>& stress() const { return minimum_.stress; }
  Real fraction() const;  ///< packing_fraction()

 private:
  Real rim_fraction() const;
  void finish();
  void find_network();
  void analyse();
  void find_modes();
  /// False if only a second minimisation has converged, within a coarser tolerance.
  bool run_minimiser(const MinimiserOptions& options, Real coarse_tolerance);
  MinimiserOptions minimiser();
  /// Of the forces, in ε/σ_avg.
  Real tolerance(Real pressure) const;
  /// Whether second derivatives are measured.
  bool derivatives() const { return p_.moduli || p_.modes > 0; }
  std::span<Real> x() { return this->state().x(); }

  /// Since the start, in ε.
  struct Energies {
    Real start = 0;    ///< U of the particles at random places
    Real work = 0;     ///< work of the box on the particles
    Real relaxed = 0;  ///< removed by minimisations, of U or of U + p V
  };
  Real energy_now();
  void add_work(const Box<D>& box_before, const Minimum<D>& before);
  /// The work less the change of U: energy that the particles have lost.
  Real dissipated() const { return energies_.work - (minimum_.energy - energies_.start); }

  const PackingOptions& p_;
  Minimum<D> minimum_;
  Energies energies_;
  ContactNetwork<D> network_;
  Moduli<D> moduli_;
  std::vector<Real> frequencies_, participation_;            ///< [modes]
  std::vector<Real> mode_energies_, mode_contact_energies_;  ///< [modes · amplitudes]
  Index zero_modes_ = 0;
  std::vector<Real> mode_displacements_;  ///< [own points · lowest modes · D], 0 of rattlers
  std::int64_t evaluations_ = 0;
  bool interrupted_ = false;  ///< a stop request has ended the last minimisation
};

extern template class PackingProtocol<2>;
extern template class PackingProtocol<3>;

}  // namespace pliant
