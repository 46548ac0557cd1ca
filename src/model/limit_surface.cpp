#include <pliant/model/limit_surface.h>

namespace pliant {

LimitSurface::Point LimitSurface::exact(Real s) {
  if (s <= 0) return {1, 0, 0.25};
  if (s >= 1) return {0, most_torque, 1};
  const Real e = (1 - s) / s;  // v/(Rω)
  if (e == 1) return {8 / (3 * pi), 8 / (9 * pi), 0};
  const Real e2 = e * e, k = e < 1 ? e : 1 / e, elliptic_k = std::comp_ellint_1(k), elliptic_e = std::comp_ellint_2(k);
  if (e < 1)
    return {4 / (3 * pi * e) * ((e2 + 1) * elliptic_e + (e2 - 1) * elliptic_k),
            4 / (9 * pi) * ((4 - 2 * e2) * elliptic_e + (e2 - 1) * elliptic_k), 0};
  return {4 / (3 * pi) * ((e2 + 1) * elliptic_e - (e2 - 1) * elliptic_k),
          4 / (9 * pi) * e * ((4 - 2 * e2) * elliptic_e + (2 * e2 - 5 + 3 / e2) * elliptic_k), 0};
}

LimitSurface::LimitSurface() {
  cubic_.reserve(cells);
  const auto node = [](int k) {
    const Real s = Real(k) / cells;
    const Point p = exact(s);
    return std::array{(1 - s) * p.force + s * p.torque, (p.torque - p.force) / cells};  // h and its slope per cell
  };
  for (int k = 0; k < cells; ++k) {
    const auto [h0, m0] = node(k);
    const auto [h1, m1] = node(k + 1);
    cubic_.push_back({h0, m0, 3 * (h1 - h0) - 2 * m0 - m1, 2 * (h0 - h1) + m0 + m1});
  }
}

LimitSurface::Nearest LimitSurface::nearest(Real force, Real torque, Real guess) const {
  // Newton's method for the slip along which the point is off the curve, within bounds.
  Real low = 0, high = 1, s = guess;
  Point p = at(s);
  for (int k = 0; k < 60; ++k) {
    const Real over = (force - p.force) * s - (torque - p.torque) * (1 - s),
               slope = (force - p.force) + (torque - p.torque) + p.bend * (square(s) + square(1 - s));
    (over > 0 ? high : low) = s;
    Real next = slope > 0 ? s - over / slope : -1;
    if (!(next >= low && next <= high)) next = (low + high) / 2;
    const Real change = next - s;
    if (std::abs(change) < 5e-4) {  // what is left is of its square
      p.force -= s * p.bend * change;
      p.torque += (1 - s) * p.bend * change;
      s = next;
      break;
    }
    s = next;
    p = at(s);
  }
  const bool outside = (force - p.force) * (1 - s) + (torque - p.torque) * s > 0;
  return outside ? Nearest{p.force, p.torque, s, true} : Nearest{force, torque, s, false};
}

const LimitSurface& limit_surface() {
  static const LimitSurface surface;
  return surface;
}

}  // namespace pliant
