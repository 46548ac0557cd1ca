// The space that particles live in: open, or periodic in any of its directions.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include <pliant/base/errors.h>
#include <pliant/base/types.h>

namespace pliant {

/// A number of box lengths in each direction; 0 in those that are open, or that there are not.
using Image = std::array<std::int64_t, 3>;

/// origin[k] ≤ r[k] < origin[k] + length[k], and so on periodically; a direction whose length is infinite is open.
/// Positions may lie anywhere: r and its images r + shift(n) are the same place.
template <int D>
class Box {
 public:
  static constexpr Real infinite = std::numeric_limits<Real>::infinity();

  /// Open.
  Box() = default;
  /// Errors: InputError for a length that is not positive, or an origin that is not finite.
  Box(const Vec<D>& origin, const Vec<D>& length) : origin_(origin), length_(length) {
    for (int k = 0; k < D; ++k) {
      if (!(length[k] > 0))
        throw InputError("length {} of the box is {}; it must be positive, or infinite in an open direction", k,
                         length[k]);
      if (!std::isfinite(origin[k])) throw InputError("origin {} of the box is {}; it must be finite", k, origin[k]);
      open_ = open_ && !periodic(k);
    }
  }

  const Vec<D>& origin() const { return origin_; }
  const Vec<D>& length() const { return length_; }
  bool periodic(int k) const { return std::isfinite(length_[k]); }
  /// In all directions.
  bool open() const { return open_; }
  /// Infinite where a direction is open.
  Real volume() const { return length_.prod(); }

  /// From a place to its image n.
  Vec<D> shift(const Image& n) const {
    Vec<D> by = Vec<D>::Zero();
    for (int k = 0; k < D; ++k)
      if (periodic(k)) by[k] = static_cast<Real>(n[k]) * length_[k];
    return by;
  }
  /// The image of the box that contains r: r − shift(image_of(r)) is in the box, up to rounding. Not defined for
  /// coordinates that are not finite.
  Image image_of(const Vec<D>& r) const {
    return in_lengths(r - origin_, [](Real a) { return std::floor(a); });
  }
  Vec<D> wrap(const Vec<D>& r) const { return r - shift(image_of(r)); }
  /// The shortest of the vectors r + shift(n).
  Vec<D> nearest_image(const Vec<D>& r) const {
    return r - shift(in_lengths(r, [](Real a) { return std::nearbyint(a); }));
  }

 private:
  template <class Round>
  Image in_lengths(const Vec<D>& r, Round&& round) const {
    constexpr Real most = 9e15;  // beyond, numbers of box lengths are not exact
    Image n{};
    for (int k = 0; k < D; ++k) {
      const Real lengths = periodic(k) ? round(r[k] / length_[k]) : 0;
      if (std::abs(lengths) < most) n[k] = static_cast<std::int64_t>(lengths);
    }
    return n;
  }

  Vec<D> origin_ = Vec<D>::Zero(), length_ = Vec<D>::Constant(infinite);
  bool open_ = true;
};

}  // namespace pliant
