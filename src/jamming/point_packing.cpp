#include <pliant/jamming/point_packing.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace pliant {
namespace {

constexpr Real skin = 0.3;

/// As std::nearbyint for |a| < 2⁵¹, which is a call of a function.
Real nearest_integer(Real a) {
  constexpr Real without_fraction = 3 * static_cast<Real>(std::int64_t{1} << 51);
  return (a + without_fraction) - without_fraction;
}

/// visit(law) for the laws of soft particles.
template <class Visit>
auto with_soft_law(ContactLaw law, Visit&& visit) {
  return with_law<HertzOverlap, LinearOverlap, HarmonicOverlap>(law, visit);
}

}  // namespace

template <int D>
bool PointPacking<D>::suits(const ParticleSystem<D>& system) {
  constexpr Index most = D == 2 ? 2000 : 100;
  const Topology& t = system.topology();
  if (t.owned_points() != t.owned() || t.owned() > most || t.owned() == 0 || system.ranks().several()) return false;
  if (system.box().tilted() || system.box().flow().flows() || system.walls().size() > 0) return false;
  for (int k = 0; k < D; ++k)
    if (!system.box().periodic(k)) return false;
  return std::all_of(t.active.begin(), t.active.begin() + t.owned(), [](auto active) { return active != 0; });
}

template <int D>
PointPacking<D>::PointPacking(const ParticleSystem<D>& system, const PairContactLaw& law, std::optional<Real> pressure)
    : law_(law), pressure_(pressure), box_(system.box()) {
  const Topology& t = system.topology();
  numbers_ = static_cast<std::size_t>(t.owned()) * D;
  for (Index m = 0; m < t.owned(); ++m) {
    radius_.push_back(t.diameter[m] / 2);
    widest_ = std::max(widest_, t.diameter[m]);
  }
  factor_ = std::sqrt(static_cast<Real>(t.owned()) / 2);  // as of systems of any kind, see potential.cpp
}

template <int D>
Real PointPacking<D>::scale(const Real* y) const {
  if (!pressure_) return 1;
  const Real log_length = y[numbers_] / factor_;
  if (!(std::abs(log_length) < 3))
    throw NumericalError("the box has changed its length by a factor of {:.3g}; is the pressure right?",
                         std::exp(log_length));
  return std::exp(log_length);
}

template <int D>
Real PointPacking<D>::pressure() const {
  return -virial_ / (D * box_.volume());
}

template <int D>
Real PointPacking<D>::mean_overlap() const {
  return virial_ < 0 ? std::clamp(2 * energy_ / -virial_, 0.0, 0.02) : 0;
}

template <int D>
void PointPacking<D>::place(const Real* y, Real* x) const {
  const Real s = scale(y);
  for (std::size_t k = 0; k < numbers_; ++k) x[k] = y[k] + (s - 1) * (y[k] - box_.origin()[static_cast<int>(k % D)]);
}

template <int D>
bool PointPacking<D>::holds(const Real* y, Real scale) const {
  if (reference_.empty()) return false;
  const Real shrunk = widest_ * std::max(Real(0), 1 / scale - 1 / listed_scale_),
             most = (skin / listed_scale_ - shrunk) / 2;
  Real moved = 0;
  for (Index i = 0; i < static_cast<Index>(radius_.size()); ++i)
    moved = std::max(moved, (point<D>(y, i) - point<D>(reference_.data(), i)).squaredNorm());
  return most > 0 && moved < square(most);
}

template <int D>
void PointPacking<D>::find_pairs(const Real* y, Real scale) {
  reference_.assign(y, y + numbers_);
  listed_scale_ = scale;
  pairs_.clear();
  const Real reach = (widest_ + skin) / scale;
  const bool nearest = box_.length().minCoeff() > 2 * reach;
  Image most{};
  for (int k = 0; k < D; ++k) most[k] = nearest ? 0 : static_cast<std::int64_t>(reach / box_.length()[k]) + 1;
  const auto n = static_cast<Index>(radius_.size());
  const Vec<D> length = box_.length(), inverse = length.cwiseInverse();
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j <= i; ++j) {
      const Vec<D> r = point<D>(y, i) - point<D>(y, j);
      Vec<D> near;
      for (int k = 0; k < D; ++k) near[k] = nearest_integer(r[k] * inverse[k]);
      const Real range = radius_[i] + radius_[j], limit = square((range + skin) / scale);
      const auto add = [&](const Vec<D>& image) {
        const Vec<D> shift = image.cwiseProduct(length);
        if ((r - shift).squaredNorm() < limit) pairs_.push_back({i, j, range, shift});
      };
      if (nearest) {
        if (j < i) add(near);
        continue;
      }
      Image image{};
      for (image[0] = -most[0]; image[0] <= most[0]; ++image[0])
        for (image[1] = -most[1]; image[1] <= most[1]; ++image[1])
          for (image[2] = -most[2]; image[2] <= most[2]; ++image[2]) {
            // Of the two images of a point on its opposite sides, one.
            if (i == j && image <= Image{}) continue;
            Vec<D> other = near;
            for (int k = 0; k < D; ++k) other[k] += static_cast<Real>(image[k]);
            add(other);
          }
    }
}

template <int D>
template <class Law>
void PointPacking<D>::evaluate(const Real* y, Real scale, Real* f) {
  std::fill_n(f, numbers_, 0);
  Real energy = 0, virial = 0;
  const Real square_scale = square(scale);
  for (const Pair& p : pairs_) {
    const Vec<D> r = point<D>(y, p.i) - point<D>(y, p.j) - p.shift;
    const Real d2 = square_scale * r.squaredNorm();
    if (d2 >= square(p.range) || d2 == 0) continue;
    const Real d = std::sqrt(d2), push = Law::push(law_.epsilon, p.range, d);
    energy += Law{law_.epsilon, p.range}.value(d);
    virial -= push * d2;
    const Vec<D> force = push * square_scale * r;
    point<D>(f, p.i) += force;
    point<D>(f, p.j) -= force;
  }
  energy_ = energy;
  virial_ = virial;
}

template <int D>
Real PointPacking<D>::operator()(const Real* y, Real* f) {
  const Real s = scale(y);
  if (!holds(y, s)) find_pairs(y, s);
  with_soft_law(law_.contact, [&]<class Law>(Law) { evaluate<Law>(y, s, f); });
  if (!pressure_) return energy_;
  const Real work = *pressure_ * box_.volume() * std::pow(s, D);
  f[numbers_] = -(virial_ + D * work) / factor_;
  return energy_ + work;
}

/// By the pairs of the list, since touching pairs change too often.
template <int D>
void PointPacking<D>::find_order() {
  std::vector<std::array<Index, 2>> below;
  for (const Pair& p : pairs_) below.push_back({p.i, p.j});
  order_ = order_with_few_blocks(static_cast<Index>(radius_.size()), below);
}

template <int D>
bool PointPacking<D>::factorise(const Real* y) {
  constexpr Real floor = 1e-3;
  const Real s = scale(y), smaller = 1 - mean_overlap();
  if (!holds(y, s)) find_pairs(y, s);
  if (order_.empty()) find_order();
  own_.assign(radius_.size(), Mat<D>::Zero());
  by_box_.assign(pressure_ ? radius_.size() : 0, Vec<D>::Zero());
  Real box = pressure_ ? D * (D - 1) * *pressure_ * box_.volume() * std::pow(s, D) : 0, largest = 0;
  entries_.clear();
  with_soft_law(law_.contact, [&]<class Law>(Law) {
    for (const Pair& p : pairs_) {
      const Vec<D> r = s * (point<D>(y, p.i) - point<D>(y, p.j) - p.shift);
      const Real d = r.norm(), stiffness = Law{law_.epsilon, p.range}.curvature(d * smaller);
      if (d == 0 || stiffness == 0) continue;
      box += stiffness * square(d);
      if (p.i == p.j) continue;
      const Mat<D> block = square(s) * stiffness / square(d) * r * r.transpose();
      const auto [column, row] = std::minmax({order_[p.i], order_[p.j]});
      own_[row] += block;
      own_[column] += block;
      entries_.push_back({row, column, -block});
      if (!pressure_) continue;
      by_box_[order_[p.i]] += s * stiffness / factor_ * r;
      by_box_[order_[p.j]] -= s * stiffness / factor_ * r;
    }
  });
  box /= square(factor_);
  for (const Mat<D>& block : own_) largest = std::max(largest, block.diagonal().maxCoeff());
  for (Mat<D>& block : own_) block.diagonal().array() += floor * largest;
  return factors_.factorise(own_, entries_, by_box_, box + floor * largest);
}

template class PointPacking<2>;
template class PointPacking<3>;

}  // namespace pliant
