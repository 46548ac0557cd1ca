#include <pliant/jamming/potential.h>

#include <algorithm>
#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/model/polygon.h>
#include <pliant/system/stress.h>

namespace pliant {

template <int D>
bool Potential<D>::suits(const ParticleSystem<D>& system) {
  const Topology& t = system.topology();
  return t.owned_points() <= most_points && system.walls().size() == 0 && !system.ranks().several() &&
         !system.rotates_or_remembers() &&
         std::all_of(t.active.begin(), t.active.begin() + t.owned(), [](auto active) { return active != 0; });
}

template <int D>
bool Potential<D>::quick(const ParticleSystem<D>& system) {
  constexpr Index most_in_one = 100;  // the area couples all vertices of a polygon
  const Topology& t = system.topology();
  for (Index m = 0; m < t.owned(); ++m)
    if (t.points_of(m) > most_in_one) return false;
  return D == 2 && t.deformable() && suits(system);
}

template <int D>
Potential<D>::Potential(ParticleSystem<D>& system, std::optional<Real> pressure)
    : system_(system), pressure_(pressure) {
  const Topology& t = system.topology();
  volume_ = system.box().volume();
  origin_ = system.box().origin();
  // A crowded particle has contacts whose stiffness adds up to about ω² m, ω the frequency that limits the steps.
  // With this factor the stiffness of the box over the mass is about the same ω².
  factor_ = std::sqrt(static_cast<Real>(t.owned_points()) / 2);
  x_.resize(static_cast<std::size_t>(t.owned_points()) * D);
}

template <int D>
const std::vector<Real>& Potential<D>::place(const Real* y) {
  if (!pressure_) {
    x_.assign(y, y + x_.size());
    return x_;
  }
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
Real Potential<D>::operator()(const Real* y, Real* f, bool with_energy) {
  const std::vector<Real>& x = place(y);
  StateView<D> s = system_.view(x.data(), nullptr);
  s.ghosts_feel = pressure_ && s.topology.deformable() && s.neighbours.chunks() == 1;
  Real energy = 0;
  if (with_energy)
    energy = system_.field().energy(s, forces(s));
  else
    system_.field().forces(s, forces(s));
  if (!pressure_) {
    std::copy_n(force_.begin(), x_.size(), f);
    return energy;
  }
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
  f[x.size()] = -(virial + D * *pressure_ * volume) / factor_;
  return energy + *pressure_ * volume;
}

/// Space for the forces on all points, zero on ghosts.
template <int D>
Real* Potential<D>::forces(const StateView<D>& s) {
  force_.resize(static_cast<std::size_t>(s.topology.points()) * D);
  std::fill(force_.begin() + static_cast<std::ptrdiff_t>(x_.size()), force_.end(), 0);
  return force_.data();
}

/// As virial_of_centres, without the forces on ghosts.
template <int D>
Real Potential<D>::virial_of_terms(const StateView<D>& s) const {
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

/// The strain of the box moves the centres, and leaves out the displacements relative to them.
template <int D>
void Potential<D>::differentiate(const Real* y) {
  const Stiffness<D>& h = stiffness_.emplace(system_, place(y));
  if (!pressure_) return;
  const Topology& t = system_.topology();
  Eigen::VectorXd relative(h.size());
  for (Index m = 0; m < t.owned(); ++m) {
    const Vec<D> centre = mean_of_points<D>(x_.data(), t, m);
    for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i)
      relative.template segment<D>(static_cast<Eigen::Index>(i) * D) = point<D>(x_.data(), i) - centre;
  }
  const StrainDerivatives<D>& strain = h.strain();
  by_box_.setZero(h.size());
  // D² p V, and the first derivative of U by the logarithm, which is −D p V at equilibrium.
  box_ = D * (D - 1) * *pressure_ * system_.box().volume();
  for (int a = 0; a < D; ++a) {
    by_box_ += strain.mixed.col(a * D + a);
    for (int b = 0; b < D; ++b) box_ += strain.affine(a * D + a, b * D + b);
  }
  const Eigen::VectorXd of_shapes = h.matrix() * relative;
  box_ += relative.dot(of_shapes - 2 * by_box_);
  by_box_ -= of_shapes;
  by_box_ /= factor_;
  box_ /= square(factor_);
}

template <int D>
bool Potential<D>::factorise(const Real* y) {
  differentiate(y);
  const Real bound = stiffness_->bound();
  least_shift_ = 1e-9 * bound;
  factors_.emplace(*stiffness_);
  for (Real shift = least_shift_; shift < bound; shift *= 100)
    if (factors_->factorise(shift, by_box_, box_)) return true;
  return false;
}

template <int D>
void Potential<D>::fill(::Mat matrix) const {
  const auto h = stiffness_->matrix();
  std::vector<PetscInt> start = {0}, column;
  std::vector<Real> values;
  const PetscInt n = stiffness_->size();
  for (PetscInt row = 0; row < n; ++row) {
    const PetscInt first = h.outerIndexPtr()[row], end = h.outerIndexPtr()[row + 1];
    column.insert(column.end(), h.innerIndexPtr() + first, h.innerIndexPtr() + end);
    values.insert(values.end(), h.valuePtr() + first, h.valuePtr() + end);
    values[std::find(column.begin() + start.back(), column.end(), row) - column.begin()] += least_shift_;
    if (pressure_) {
      column.push_back(n);
      values.push_back(by_box_[row]);
    }
    start.push_back(static_cast<PetscInt>(column.size()));
  }
  if (pressure_) {
    for (PetscInt k = 0; k < n; ++k) column.push_back(k);
    column.push_back(n);
    values.insert(values.end(), by_box_.begin(), by_box_.end());
    values.push_back(box_);
    start.push_back(static_cast<PetscInt>(column.size()));
  }
  petsc_check(MatSeqAIJSetPreallocationCSR(matrix, start.data(), column.data(), values.data()));
}

template class Potential<2>;
template class Potential<3>;

}  // namespace pliant
