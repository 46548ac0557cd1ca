// The space that particles live in: open, or periodic in any of its directions.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include <pliant/base/errors.h>
#include <pliant/base/types.h>

namespace pliant {

/// A number of box edges in each direction; 0 in those that are open, or that there are not.
using Image = std::array<std::int64_t, 3>;

/// Number of tilt factors of a box: xy in 2D; xy, xz and yz in 3D.
template <int D>
inline constexpr int tilts = D*(D - 1) / 2;
template <int D>
using Tilt = std::array<Real, tilts<D>>;

/// Flow along x that grows with y, v = rate (y − y0) x̂: simple shear at a finite rate.
template <int D>
struct ShearFlow {
  Real rate = 0, y0 = 0;  ///< in 1/t0 and σ_avg
  bool flows() const { return rate != 0; }
  Vec<D> at(const Vec<D>& r) const {
    Vec<D> v = Vec<D>::Zero();
    v[0] = rate * (r[1] - y0);
    return v;
  }
};

/// A lattice of images: r and r + shift(n) are the same place, where shift(n) = Σ_k n_k edge(k). Edges are (Lx, 0, 0),
/// (xy, Ly, 0) and (xz, yz, Lz), as in LAMMPS. A direction whose length is infinite is open. Positions may lie
/// anywhere. The cell of the lattice into which wrap() moves places is the upright one, origin[k] ≤ r[k] < origin[k] +
/// length[k], also in a tilted box: rows of such cells are offset against each other by the tilt.
template <int D>
class Box {
 public:
  static constexpr Real infinite = std::numeric_limits<Real>::infinity();

  /// Open.
  Box() = default;
  /// Errors: InputError for a length that is not positive, an origin or a tilt that is not finite, or a tilt between
  /// directions that are not both periodic.
  Box(const Vec<D>& origin, const Vec<D>& length, const Tilt<D>& tilt = {})
      : origin_(origin), length_(length), tilt_(tilt) {
    for (int k = 0; k < D; ++k) {
      if (!(length[k] > 0))
        throw InputError("length {} of the box is {}; it must be positive, or infinite in an open direction", k,
                         length[k]);
      if (!std::isfinite(origin[k])) throw InputError("origin {} of the box is {}; it must be finite", k, origin[k]);
      open_ = open_ && !periodic(k);
      for (int l = 0; l < k; ++l) {
        const Real t = tilt[place(l, k)];
        if (!std::isfinite(t)) throw InputError("tilt {}{} of the box is {}; it must be finite", l, k, t);
        if (t != 0 && !(periodic(k) && periodic(l)))
          throw InputError("the box has the tilt {} between directions {} and {}, which are not both periodic", t, l,
                           k);
      }
    }
  }

  const Vec<D>& origin() const { return origin_; }
  const Vec<D>& length() const { return length_; }
  const Tilt<D>& tilt() const { return tilt_; }
  bool tilted() const { return tilt_ != Tilt<D>{}; }
  bool periodic(int k) const { return std::isfinite(length_[k]); }
  /// In all directions.
  bool open() const { return open_; }
  /// Area in 2D; infinite where a direction is open.
  Real volume() const { return length_.prod(); }

  /// Edge k of a periodic direction.
  Vec<D> edge(int k) const {
    Vec<D> e = Vec<D>::Zero();
    for (int l = 0; l < k; ++l) e[l] = tilt_[place(l, k)];
    e[k] = length_[k];
    return e;
  }
  /// From a place to its image n.
  Vec<D> shift(const Image& n) const {
    Vec<D> by = Vec<D>::Zero();
    for (int k = 0; k < D; ++k)
      if (n[k] != 0 && periodic(k)) by += static_cast<Real>(n[k]) * edge(k);
    return by;
  }
  /// Velocity of image n relative to its place: in a box that flows, edges move relative to each other (Lees and
  /// Edwards).
  Vec<D> shift_velocity(const Image& n) const {
    Vec<D> v = Vec<D>::Zero();
    if (flow_.flows()) v[0] = flow_.rate * shift(n)[1];
    return v;
  }
  /// The flow that all images of a place follow.
  const ShearFlow<D>& flow() const { return flow_; }

  /// The image of the cell that contains r: r − shift(image_of(r)) is in the cell, up to rounding. Not defined for
  /// coordinates that are not finite.
  Image image_of(const Vec<D>& r) const {
    return in_edges(r - origin_, [](Real a) { return std::floor(a); });
  }
  Vec<D> wrap(const Vec<D>& r) const { return r - shift(image_of(r)); }
  /// The image r + shift(n) in the upright cell around 0: the shortest one if the box is not tilted.
  Vec<D> nearest_image(const Vec<D>& r) const {
    return r - shift(in_edges(r, [](Real a) { return std::nearbyint(a); }));
  }

  /// The box after r → origin + F (r − origin) of all places. Errors: InputError if an open box is deformed, or F is
  /// not upper triangular with positive diagonal elements.
  Box deformed(const Mat<D>& f) const {
    Box box(*this);
    for (int k = 0; k < D; ++k) {
      if (!periodic(k) || !(f(k, k) > 0))
        throw InputError("direction {} of the box is stretched by {}; it must be periodic, the factor positive", k,
                         f(k, k));
      for (int l = 0; l < k; ++l)
        if (f(k, l) != 0)
          throw InputError("a box keeps its first edge along x: turn the deformation, element {}{}", k, l);
    }
    for (int k = 0; k < D; ++k) {
      const Vec<D> e = f * edge(k);
      box.length_[k] = e[k];
      for (int l = 0; l < k; ++l) box.tilt_[place(l, k)] = e[l];
    }
    return box;
  }

  /// The box after simple shear by `strain`, in a flow of this rate, in which edge 1 is shortened by a number of edges
  /// 0: the same lattice with a smaller tilt. Errors: InputError for a box that is open in a direction.
  Box sheared(Real strain, Real rate, std::int64_t shortened_by) const {
    Mat<D> f = Mat<D>::Identity();
    f(0, 1) = strain;
    Box box = deformed(f);
    box.tilt_[0] -= static_cast<Real>(shortened_by) * length_[0];
    box.flow_ = {rate, origin_[1]};
    return box;
  }

 private:
  /// Place of the tilt of edge k along direction l < k.
  static constexpr int place(int l, int k) { return k * (k - 1) / 2 + l; }

  template <class Round>
  Image in_edges(Vec<D> r, Round&& round) const {
    constexpr Real most = 9e15;  // beyond, numbers of edges are not exact
    Image n{};
    for (int k = D - 1; k >= 0; --k) {
      if (!periodic(k)) continue;
      const Real edges = round(r[k] / length_[k]);
      if (!(std::abs(edges) < most)) continue;
      n[k] = static_cast<std::int64_t>(edges);
      if (n[k] != 0)
        for (int l = 0; l < k; ++l) r[l] -= edges * tilt_[place(l, k)];
    }
    return n;
  }

  Vec<D> origin_ = Vec<D>::Zero(), length_ = Vec<D>::Constant(infinite);
  Tilt<D> tilt_{};  ///< xy, xz, yz
  ShearFlow<D> flow_;
  bool open_ = true;
};

}  // namespace pliant
