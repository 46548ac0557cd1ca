// Laws of contacts: energy V and its derivatives as functions of a distance d and a range δ. Terms and kernels combine
// a law with a stencil, which computes the distance.
#pragma once

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string_view>
#include <type_traits>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>

namespace pliant {

enum class ContactLaw { harmonic, hertz, barrier, spring, linear };

/// V(d) = ε/2 (1 − d/δ)² for d < δ, else 0 [H 2, 3, 9, 10]. C¹: V'' jumps from 0 to ε/δ² at touch. Finite at d = 0:
/// a force of ε/δ pushes a point onto the object that it touches.
/// Units: ε in ρgσ_avg^(D+1), lengths in σ_avg.
struct HarmonicOverlap {
  static constexpr ContactLaw kind = ContactLaw::harmonic;
  static constexpr Real stiffness = 1;  ///< largest V'' scale(δ)/ε
  static Real scale(Real delta) { return square(delta); }

  Real epsilon, delta;

  bool touches(Real d) const { return d < delta; }
  Real value(Real d) const { return touches(d) ? epsilon / 2 * square(1 - d / delta) : 0; }
  Real slope(Real d) const { return touches(d) ? -epsilon / delta * (1 - d / delta) : 0; }
  Real curvature(Real d) const { return touches(d) ? epsilon / square(delta) : 0; }

  /// −V'(d)/d for 0 < d < δ, of numbers or vectors of them.
  template <class T>
  PLIANT_INLINE static T push(Real epsilon, T delta, T d) {
    return epsilon * (delta - d) / (delta * delta * d);
  }
};

/// V(d) = 2/5 ε (1 − d/δ)^(5/2) for d < δ, else 0: elastic spheres that touch at one place [H. Hertz, J. reine angew.
/// Math. 92, 156 (1881)]; in the plane a convention of the field. With x = 1 − d/δ: −V'(d) = (ε/δ) x^(3/2), V''(d) =
/// 3/2 (ε/δ²) √x. C², with V'' = 0 at touch, where its slope is infinite; softer than the harmonic law up to an overlap
/// of 4/9. Finite at d = 0. Units: as for the harmonic law.
struct HertzOverlap {
  static constexpr ContactLaw kind = ContactLaw::hertz;
  static constexpr Real stiffness = 1.5;  ///< largest V'' scale(δ)/ε, at d = 0
  static Real scale(Real delta) { return square(delta); }

  Real epsilon, delta;

  bool touches(Real d) const { return d < delta; }
  Real value(Real d) const {
    if (!touches(d)) return 0;
    const Real x = 1 - d / delta;
    return 0.4 * epsilon * square(x) * std::sqrt(x);
  }
  Real slope(Real d) const {
    if (!touches(d)) return 0;
    const Real x = 1 - d / delta;
    return -epsilon / delta * x * std::sqrt(x);
  }
  Real curvature(Real d) const { return touches(d) ? 1.5 * epsilon / square(delta) * std::sqrt(1 - d / delta) : 0; }

  /// −V'(d)/d for 0 < d < δ, of numbers or vectors of them; not a number beyond.
  template <class T>
  PLIANT_INLINE static T push(Real epsilon, T delta, T d) {
    const T x = (delta - d) / delta;
    return epsilon * x * root(x) / (delta * d);
  }

 private:
  template <class T>
  PLIANT_INLINE static T root(T x) {
    if constexpr (std::is_arithmetic_v<T>) {
      return std::sqrt(x);
    } else {
      for (std::size_t k = 0; k < sizeof(T) / sizeof(Real); ++k) x[k] = std::sqrt(x[k]);
      return x;
    }
  }
};

/// Grows without bound as d → 0, so that no load presses a point through. With x = 1 − d/δ and c = 0.01:
///   V(d) = ε [c² ln(1 + x/c) − ln(1 − x)]/(1 + c) − ε x for 0 < d < δ, 0 beyond, ∞ at d = 0
///   −V'(d) = (ε/δ) x²/((x + c)(1 − x)),   V''(d) = (ε/δ²) [1/(1 − x)² − c²/(x + c)²]/(1 + c)
/// C²: V'' grows from 0 at touch, reaches 3/4 ε/δ² at an overlap x = c and follows the harmonic law from there on to
/// overlaps of some 0.1, beyond which it grows as 1/(1 − x)² = (δ/d)². Without c it is the logarithm of [T 2.7].
/// Units: as for the harmonic law.
struct BarrierOverlap {
  static constexpr ContactLaw kind = ContactLaw::barrier;
  static constexpr Real onset = 0.01;  ///< c
  /// V'' scale(δ)/ε at an overlap of 1/2; it has no largest value.
  static constexpr Real stiffness = (4 - square(onset / (0.5 + onset))) / (1 + onset);
  static constexpr Real stiff_distance = 0.5;  ///< d/δ there; V'' goes as the inverse square of d
  static Real scale(Real delta) { return square(delta); }

  Real epsilon, delta;

  bool touches(Real d) const { return d < delta; }
  Real value(Real d) const {
    if (!touches(d)) return 0;
    const Real x = 1 - d / delta;
    return epsilon * ((square(onset) * std::log1p(x / onset) - std::log(d / delta)) / (1 + onset) - x);
  }
  Real slope(Real d) const {
    if (!touches(d)) return 0;
    const Real x = 1 - d / delta;
    return -epsilon * square(x) / ((x + onset) * d);
  }
  Real curvature(Real d) const {
    if (!touches(d)) return 0;
    const Real x = 1 - d / delta;
    return epsilon * (1 / square(d) - square(onset / ((x + onset) * delta))) / (1 + onset);
  }

  /// −V'(d)/d for 0 < d < δ, of numbers or vectors of them.
  template <class T>
  PLIANT_INLINE static T push(Real epsilon, T delta, T d) {
    const T x = delta - d;
    return epsilon * x * x / (delta * (x + onset * delta) * d * d);
  }
};

/// V(d) = k/2 (δ − d)² for d < δ, else 0: the harmonic law with ε = k δ², a spring with equal stiffness for all
/// particle sizes, as of cylinders that touch along a line (up to a logarithm). k, in ρgσ_avg^(D−1), is the member
/// epsilon. C¹: V'' jumps from 0 to k at touch.
struct SpringOverlap {
  static constexpr ContactLaw kind = ContactLaw::spring;
  static constexpr Real stiffness = 1;
  static Real scale(Real) { return 1; }

  Real epsilon, delta;

  bool touches(Real d) const { return d < delta; }
  Real value(Real d) const { return touches(d) ? epsilon / 2 * square(delta - d) : 0; }
  Real slope(Real d) const { return touches(d) ? -epsilon * (delta - d) : 0; }
  Real curvature(Real d) const { return touches(d) ? epsilon : 0; }

  /// −V'(d)/d for 0 < d < δ, of numbers or vectors of them.
  template <class T>
  PLIANT_INLINE static T push(Real epsilon, T delta, T d) {
    return epsilon * (delta - d) / d;
  }
};

/// V(d) = ε δ/2 (1 − d/δ)² for d < δ, else 0: the harmonic law without the 1/δ of its force, −V'(d) = ε (1 − d/δ).
/// Pairs of all sizes feel the same force at the same relative overlap. ε is a force, in ρgσ_avg^D. C¹: V'' jumps from
/// 0 to ε/δ at touch.
struct LinearOverlap {
  static constexpr ContactLaw kind = ContactLaw::linear;
  static constexpr Real stiffness = 1;
  static Real scale(Real delta) { return delta; }

  Real epsilon, delta;

  bool touches(Real d) const { return d < delta; }
  Real value(Real d) const { return touches(d) ? epsilon * delta / 2 * square(1 - d / delta) : 0; }
  Real slope(Real d) const { return touches(d) ? -epsilon * (1 - d / delta) : 0; }
  Real curvature(Real d) const { return touches(d) ? epsilon / delta : 0; }

  /// −V'(d)/d for 0 < d < δ, of numbers or vectors of them.
  template <class T>
  PLIANT_INLINE static T push(Real epsilon, T delta, T d) {
    return epsilon * (delta - d) / (delta * d);
  }
};

/// visit(law) for the type of these that has the kind; its members have no values. std::logic_error if none has it.
template <class First, class... Others, class Visit>
decltype(auto) with_law(ContactLaw kind, Visit&& visit) {
  if constexpr (sizeof...(Others) > 0) {
    if (kind != First::kind) return with_law<Others...>(kind, visit);
  } else if (kind != First::kind) {
    throw std::logic_error("a contact law that this term does not have");
  }
  return visit(First{});
}
/// The same for all types above.
template <class Visit>
decltype(auto) with_law(ContactLaw kind, Visit&& visit) {
  return with_law<HarmonicOverlap, HertzOverlap, BarrierOverlap, SpringOverlap, LinearOverlap>(kind, visit);
}

/// One of the laws above, known at run time: for all but the loops that count for speed.
struct Overlap {
  ContactLaw kind;
  Real epsilon, delta;

  bool touches(Real d) const { return d < delta; }
  Real value(Real d) const;
  /// Here, because contacts with lips and with walls that move compute it in each step.
  Real slope(Real d) const {
    return with_law(kind, [&]<class Law>(Law) { return Law{epsilon, delta}.slope(d); });
  }
  Real curvature(Real d) const;
  static Real stiffness(ContactLaw kind);
  static Real scale(ContactLaw kind, Real delta);
};

}  // namespace pliant
