#include <pliant/jamming/enthalpy.h>

#include <algorithm>
#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/model/polygon.h>
#include <pliant/system/stress.h>

namespace pliant {

template <int D>
bool Enthalpy<D>::suits(const ParticleSystem<D>& system) {
  // The area couples all vertices of a polygon: with many the factors cost too much.
  constexpr Index most = D == 2 ? 20000 : 0, most_in_one = 100;
  const Topology& t = system.topology();
  for (Index m = 0; m < t.owned(); ++m)
    if (t.points_of(m) > most_in_one) return false;
  return t.deformable() && t.owned_points() <= most && !system.ranks().several() &&
         std::all_of(t.active.begin(), t.active.begin() + t.owned(), [](auto active) { return active != 0; });
}

template <int D>
Enthalpy<D>::Enthalpy(ParticleSystem<D>& system, Real pressure) : system_(system), pressure_(pressure) {
  const Topology& t = system.topology();
  volume_ = system.box().volume();
  origin_ = system.box().origin();
  // A crowded particle has contacts whose stiffness adds up to about ω² m, ω the frequency that limits the steps.
  // With this factor the stiffness of the box over the mass is about the same ω².
  factor_ = std::sqrt(static_cast<Real>(t.owned_points()) / 2);
  x_.resize(static_cast<std::size_t>(t.owned_points()) * D);
}

template <int D>
const std::vector<Real>& Enthalpy<D>::place(const Real* y) {
  const Real log_length = y[x_.size()] / factor_, f = std::exp(log_length - log_length_);
  if (!(std::abs(log_length) < 3))
    throw NumericalError("the box has changed its length by a factor of {:.3g}; is the pressure right?",
                         std::exp(log_length));
  if (f != 1) system_.deform(Mat<D>(f * Mat<D>::Identity()));
  log_length_ = log_length;
  const Real scale = std::exp(log_length);
  const Topology& t = system_.topology();
  for (Index m = 0; m < t.owned(); ++m) {
    const Vec<D> shift = (scale - 1) * (mean_of_points<D>(y, t, m) - origin_);
    for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i) point<D>(x_.data(), i) = point<D>(y, i) + shift;
  }
  return x_;
}

template <int D>
Real Enthalpy<D>::operator()(const Real* y, Real* f, bool with_energy) {
  const std::vector<Real>& x = place(y);
  StateView<D> s = system_.view(x.data(), nullptr);
  s.ghosts_feel = s.topology.deformable() && s.neighbours.chunks() == 1;
  Real energy = 0;
  if (with_energy)
    energy = system_.field().energy(s, forces(s));
  else
    system_.field().forces(s, forces(s));
  const Topology& t = system_.topology();
  on_particles_.resize(static_cast<std::size_t>(t.particles()) * D);
  for (Index m = 0; m < t.particles(); ++m)
    point<D>(on_particles_.data(), m) = t.points_of(m) * mean_of_points<D>(force_.data(), t, m);
  const Real scale = std::exp(log_length_),
             virial = s.ghosts_feel ? virial_of_centres<D>(s, on_particles_.data()) : virial_of_terms(s);
  for (Index m = 0; m < t.owned(); ++m) {
    const Vec<D> mean = point<D>(on_particles_.data(), m) / t.points_of(m);
    for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i)
      point<D>(f, i) = point<D>(force_.data(), i) + (scale - 1) * mean;
  }
  const Real volume = volume_ * std::pow(scale, D);
  f[x.size()] = -(virial + D * pressure_ * volume) / factor_;
  return energy + pressure_ * volume;
}

/// Space for the forces on all points, zero on ghosts.
template <int D>
Real* Enthalpy<D>::forces(const StateView<D>& s) {
  force_.resize(static_cast<std::size_t>(s.topology.points()) * D);
  std::fill(force_.begin() + static_cast<std::ptrdiff_t>(x_.size()), force_.end(), 0);
  return force_.data();
}

/// As virial_of_centres, without the forces on ghosts.
template <int D>
Real Enthalpy<D>::virial_of_terms(const StateView<D>& s) const {
  Real virial = 0;
  for (const TermVirial<D>& term : system_.field().virials(s)) virial += term.virial.trace();
  const Topology& t = s.topology;
  for (Index m = 0; m < t.owned(); ++m) {
    const Vec<D> centre = mean_of_points<D>(s.x, t, m);
    for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i)
      virial += point<D>(force_.data(), i).dot(s.position(i) - centre);  // shapes do not follow the box
  }
  return virial;
}

template <int D>
bool Enthalpy<D>::factorise(const Real* y) {
  const Stiffness<D> h(system_, place(y));
  // The strain of the box moves the centres, and leaves out the displacements relative to them.
  const Topology& t = system_.topology();
  Eigen::VectorXd relative(h.size()), by_box = Eigen::VectorXd::Zero(h.size());
  for (Index m = 0; m < t.owned(); ++m) {
    const Vec<D> centre = mean_of_points<D>(x_.data(), t, m);
    for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i)
      relative.template segment<D>(static_cast<Eigen::Index>(i) * D) = point<D>(x_.data(), i) - centre;
  }
  const StrainDerivatives<D>& strain = h.strain();
  Real box = D * (D - 1) * pressure_ * system_.box().volume();
  for (int a = 0; a < D; ++a) {
    by_box += strain.mixed.col(a * D + a);
    for (int b = 0; b < D; ++b) box += strain.affine(a * D + a, b * D + b);
  }
  const Eigen::VectorXd of_shapes = h.matrix() * relative;
  box += relative.dot(of_shapes - 2 * by_box);
  by_box -= of_shapes;
  by_box /= factor_;
  box /= square(factor_);

  const Real bound = h.bound();
  factors_.emplace(h);
  for (Real shift = 1e-9 * bound; shift < bound; shift *= 100)
    if (factors_->factorise(shift, by_box, box)) return true;
  return false;
}

template class Enthalpy<2>;
template class Enthalpy<3>;

}  // namespace pliant
