// Steady shear of a packing at a finite rate, with drag.
#pragma once

#include <string>
#include <vector>

#include <pliant/run/energy_audit.h>
#include <pliant/run/protocol.h>
#include <pliant/scenarios/packings/options.h>

namespace pliant {

/// Particles in a periodic box that is sheared at a constant rate: at time t its tilt is rate · t times its height, and
/// images have the velocities of Lees and Edwards, J. Phys. C 5, 1921 (1972). Drag acts on the velocity relative to the
/// flow v = rate (y − y0) x̂, at each vertex of a polygon. The start is a packing, which pack.h makes, with the
/// velocities of the flow.
template <int D>
class SteadyShear final : public Protocol<D> {
 public:
  /// p must outlive it.
  SteadyShear(const ShearOptions& p, const Ranks& ranks);

  std::string title() const override;
  std::string model() const override { return p_.model.name; }
  Real last_time() const override { return *p_.strain / *p_.rate; }
  std::string end_at_last_time() const override { return "strain"; }
  Real first_dt() const override { return dt_; }
  Real critical_step() const override { return critical_step_; }
  std::unique_ptr<Integrator> make_integrator(Real dt) override;
  RunGeometry geometry() const override { return {"periodic", {}, {}}; }
  /// Warns of a fixed step in which the strain grows too much.
  void check() const override;

  std::vector<Real> start() override;
  void started() override;
  void ready() override;
  bool follow() override;
  std::vector<SeriesValue> sample() override;
  bool measures_stress() const override { return true; }
  std::string progress() const override;
  std::map<std::string, Real> frame_attributes() const override {
    return {{"strain", strain()}, {"edge_shortened_by", static_cast<Real>(shortened_)}};
  }
  void visit(Archive& archive) override;
  std::optional<EnergyBudget> energy_budget() override { return budget(measure()); }
  void conclude(nlohmann::ordered_json& summary) override;
  void report(const Series& series, nlohmann::ordered_json& summary) override;

 private:
  /// Sums over the particles of all ranks at the present time.
  struct Measured {
    Mat<D> stress = Mat<D>::Zero();   ///< the part that the energy terms cause
    Mat<D> kinetic = Mat<D>::Zero();  ///< kinetic part of the stress
    Real energy = 0, kinetic_energy = 0, drag_power = 0;
    Vec<D> momentum = Vec<D>::Zero();
    Real fastest = 0;  ///< largest speed relative to the flow, of disks and spheres over their radius
    Real shear_stress() const { return stress(0, 1) + kinetic(0, 1); }
    Real pressure() const { return -(stress + kinetic).trace() / D; }
  };
  std::vector<FastestRates> motions() const;
  /// The box of the packing, with edges of these lengths, is sheared from now on.
  void shear_box(const std::vector<Real>& length);
  Measured measure();
  /// Records particles that pass through each other. Errors: NumericalError for a particle that moves by more than its
  /// radius in a step.
  void look_at_particles(const Measured& now);
  /// Steps between values of the integrals of work and heat. A contact oscillates in more than 30 standard steps of
  /// Verlet, but in a few steps of a method with error control.
  std::int64_t stride() const { return p_.integrator == ShearIntegrator::verlet ? 8 : 1; }
  /// A value of the integrals of work and heat.
  void integrate(const Measured& now);
  EnergyBudget budget(const Measured& now);
  Real strain() const { return *p_.rate * this->state().t; }
  Real volume() const { return this->particles().box().volume(); }

  const ShearOptions& p_;
  Real dt_ = 0, critical_step_ = 0;
  CriticalStep critical_;
  Box<D> box_;                  ///< of the packing, without shear
  std::int64_t shortened_ = 0;  ///< edge 1 of the sheared box, by edges 0
  bool measured_ = false;       ///< the energy at the start is known
  Real start_energy_ = 0, largest_kinetic_ = 0;
  Real pair_overlap_ = 0;  ///< largest overlap up to now of particles that pass through each other, else 0
  SampledIntegral work_, heat_;
};

extern template class SteadyShear<2>;
extern template class SteadyShear<3>;

}  // namespace pliant
