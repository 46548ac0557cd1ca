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

const LimitSurface& limit_surface() {
  static const LimitSurface surface;
  return surface;
}

}  // namespace pliant
