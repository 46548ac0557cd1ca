// States to test the model on: polygons and soft particles in contact in every way that the terms distinguish.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include <pliant/catalogue/catalogue.h>
#include <pliant/geometry/hopper.h>
#include <pliant/model/polygon.h>

#include "model_parameters.h"
#include "random.h"
#include "taylor.h"

namespace pliant::test {

using Polygon = std::vector<Vec<2>>;  // vertices, counter-clockwise

/// All data of a StateView. Lists are made valid for the positions of each view.
template <int D>
class Configuration {
 public:
  Topology topology;
  Walls<D> walls;
  std::vector<Real> x, v;

  Configuration() { topology.dim = D; }

  StateView<D> view() { return view(x.data()); }
  StateView<D> view(const Real* at) {
    neighbours_->ensure(topology, walls, at);
    return {at, v.data(), topology, *neighbours_, walls};
  }
  Vec<D> position(Index i) const { return point<D>(x.data(), i); }
  VectorXd positions() const { return Eigen::Map<const VectorXd>(x.data(), x.size()); }

  void add_soft(Real sigma, const Vec<D>& centre) {
    topology.add_soft(sigma, pi / 4 * square(sigma));
    append(centre);
  }
  /// Rest area and rest lengths differ from the actual ones, so that all shape terms are active.
  void add_polygon(const Polygon& vertices, Real delta) {
    const Index n = static_cast<Index>(vertices.size());
    topology.add_polygon(n, 1, 1, delta, 1);
    for (const Vec<2>& r : vertices) append(r);
    const Index m = topology.particles() - 1;
    const Real area = polygon_area(x.data(), topology, m);
    topology.a0[m] = 0.9 * area;
    topology.l0[m] = 0.85 * polygon_perimeter(x.data(), topology, m) / n;
    topology.point_mass[m] = area / n;
    topology.inverse_point_mass[m] = n / area;
  }
  /// A droplet, with the mass ρ R³ according to its weight.
  void add_droplet(Real radius, const Vec<D>& centre) {
    topology.add_soft(2 * radius, radius * square(radius));
    append(centre);
  }
  /// Lists for contacts with bare edges, which rough particles have.
  Configuration with_bare_edges() && {
    NeighbourNeeds needs = everything;
    needs.edges = Edges::bare;
    neighbours_ = std::make_unique<Neighbours<D>>(needs, list_skin);
    return std::move(*this);
  }
  void random_velocities(Random& random) {
    for (Real& a : v) a = random(-1, 1);
  }

 private:
  template <class R>
  void append(const R& r) {
    for (int k = 0; k < r.size(); ++k) x.push_back(r[k]);
    v.resize(x.size());
    neighbours_->invalidate();
  }

  static constexpr NeighbourNeeds everything{true, D == 2, true, true, 0.1, Edges::wide, D == 3, D == 3};
  static constexpr Real list_skin = 0.02;
  // Behind a pointer so that a view survives a move of the configuration.
  std::unique_ptr<Neighbours<D>> neighbours_ = std::make_unique<Neighbours<D>>(everything, list_skin);
};

/// The lists that a model needs.
template <int D>
NeighbourNeeds needs_of(ModelKind kind, const ModelParameters& p = {}) {
  return make_force_field<D>(kind, p, Vec<D>::Zero())->needs();
}

/// A model of a few terms, mostly of one.
template <int D, class... Term>
std::unique_ptr<ForceField<D>> alone(Term... term) {
  return std::make_unique<Model<D, Term...>>(std::move(term)...);
}

/// Blocks gathered into a dense matrix.
template <int D>
struct DenseSink final : BlockSink<D> {
  MatrixXd matrix;
  explicit DenseSink(Index points) : matrix(MatrixXd::Zero(points * D, points * D)) {}
  void add(Index i, Index j, const Mat<D>& block) override { matrix.template block<D, D>(i * D, j * D) += block; }
};

/// The energy of a model as a function of the positions. parts: see Functional.
template <int D>
Functional functional(const ForceField<D>& field, Configuration<D>& c, Real parts = 0) {
  return {[&](const VectorXd& x) { return field.energy(c.view(x.data())); },
          [&](const VectorXd& x) {
            VectorXd f(x.size());
            field.energy(c.view(x.data()), f.data());
            return VectorXd(-f);
          },
          [&](const VectorXd& x) {
            DenseSink<D> sink(c.topology.points());
            field.hessian(c.view(x.data()), sink);
            return sink.matrix;
          },
          parts};
}

// ---- polygons ----

inline Vec<2> at_angle(Real angle) { return {std::cos(angle), std::sin(angle)}; }
/// Quarter turn to the left.
inline Vec<2> left_of(const Vec<2>& u) { return {-u[1], u[0]}; }
/// Outward normal of edge i of a counter-clockwise polygon.
inline Vec<2> outward(const Polygon& polygon, std::size_t i) {
  return -left_of((polygon[(i + 1) % polygon.size()] - polygon[i]).normalized());
}

inline Polygon regular_polygon(int n, Real radius, const Vec<2>& centre = Vec<2>::Zero(), Real phase = 0) {
  Polygon vertices;
  for (int k = 0; k < n; ++k) vertices.push_back(centre + radius * at_angle(phase + 2 * pi * k / n));
  return vertices;
}

/// Star-shaped polygon with uneven edges and, at this spread of radii, mostly concave.
inline Polygon irregular_polygon(Random& random, int n, Real radius, const Vec<2>& centre = Vec<2>::Zero()) {
  Polygon vertices;
  for (int k = 0; k < n; ++k)
    vertices.push_back(centre + radius * random(0.6, 1.2) * at_angle(2 * pi * (k + random(-0.3, 0.3)) / n));
  return vertices;
}

/// Slim rhombus whose first vertex is `tip` and which stretches from there along u.
inline Polygon wedge(const Vec<2>& tip, const Vec<2>& u) {
  const Vec<2> w = left_of(u);
  return {tip, tip + 0.35 * u - 0.2 * w, tip + 0.6 * u, tip + 0.35 * u + 0.2 * w};
}

/// Hexagon about 1 wide with one notch, at vertex 3, whose walls open by about 125°; randomly distorted and turned.
inline constexpr std::size_t notch_vertex = 3;
inline Polygon notched_polygon(Random& random) {
  Polygon vertices{{0, 0}, {1, 0}, {1, 0.5}, {0.62, 0.62}, {0.5, 1}, {0, 1}};
  const Eigen::Rotation2D<Real> turn(random(0, 2 * pi));
  const Vec<2> shift(random(-2, 2), random(-2, 2));
  for (Vec<2>& r : vertices) r = turn * (r + Vec<2>(random(-0.04, 0.04), random(-0.04, 0.04))) + shift;
  return vertices;
}

/// Where the tip of a wedge meets the outline of a notched polygon. The last four lie on a boundary between regions,
/// where the Hessian of the contact energy jumps.
enum class Place { edge, corner, notch, edge_onset, corner_onset, edge_end, notch_edge_end };
inline constexpr std::array interior_places{Place::edge, Place::corner, Place::notch};
inline constexpr std::array boundary_places{Place::edge_onset, Place::corner_onset, Place::edge_end,
                                            Place::notch_edge_end};

inline constexpr Real smooth_width = 0.1;  // δ of touching polygons

inline Configuration<2> touching_polygons(Random& random, Place place, Real delta = smooth_width) {
  const Polygon a = notched_polygon(random);
  const std::size_t n = a.size();
  const Real h = random(0.3, 0.85) * delta;
  const bool in_notch = place == Place::notch || place == Place::notch_edge_end;
  std::size_t k = notch_vertex;  // the vertex where edges k−1 and k meet
  while (!in_notch && k == notch_vertex) k = random.below(static_cast<Index>(n));
  const Vec<2> before = outward(a, (k + n - 1) % n), after = outward(a, k);
  const Real mix = random(0.2, 0.8);
  Vec<2> tip = a[k], away = after;
  switch (place) {
    case Place::edge:
    case Place::edge_onset: {
      away = after;
      const Real t = random(0.3, 0.7);
      tip = a[k] + t * (a[(k + 1) % n] - a[k]) + (place == Place::edge ? h : delta) * away;
      break;
    }
    case Place::corner:
    case Place::corner_onset:
      away = (mix * before + (1 - mix) * after).normalized();
      tip = a[k] + (place == Place::corner ? h : delta) * away;
      break;
    case Place::notch:
      away = (before + after).normalized();
      tip = a[k] + random(0.3, 0.5) * delta * before + random(0.3, 0.5) * delta * after;
      break;
    case Place::edge_end:
    case Place::notch_edge_end:
      away = before;
      tip = a[k] + h * before;
      if (in_notch) away = (before + after).normalized();
      break;
  }
  Configuration<2> c;
  c.add_polygon(a, delta);
  c.add_polygon(wedge(tip, away), delta);
  c.random_velocities(random);
  return c;
}

/// The same with bare edges and the same range of the contact: half the diameter of a vertex.
inline Configuration<2> touching_bare_polygons(Random& random, Place place) {
  Configuration<2> c = touching_polygons(random, place);
  for (Real& delta : c.topology.diameter) delta *= 2;
  return std::move(c).with_bare_edges();
}

/// Particles of very different shape and size, each pressed against an earlier one.
inline Configuration<2> crowd_of_polygons(Random& random, Real delta) {
  Configuration<2> c = touching_polygons(random, Place::edge, delta);
  for (const Place place : interior_places) {
    // Pairs at a distance from each other: the common part is the assembly.
    const Configuration<2> other = touching_polygons(random, place, delta);
    const Vec<2> shift(8 + 6 * static_cast<Real>(place), random(-1, 1));
    for (Index m = 0; m < other.topology.particles(); ++m) {
      Polygon vertices;
      for (Index i = other.topology.offset[m]; i < other.topology.offset[m + 1]; ++i)
        vertices.push_back(other.position(i) + shift);
      c.add_polygon(vertices, delta);
    }
  }
  c.random_velocities(random);
  return c;
}

// ---- soft particles ----

/// A pair of soft particles at exactly the distance of touch.
template <int D>
Configuration<D> touching_soft(Random& random) {
  Configuration<D> c;
  const Real a = random(0.5, 1.5), b = random(0.5, 1.5);
  c.add_soft(a, Vec<D>::Zero());
  c.add_soft(b, (a + b) / 2 * random.template unit<D>());
  return c;
}

/// n soft particles of diameters 0.5 … 1.5, each overlapping an earlier one by 5 … 40 %.
template <int D>
Configuration<D> soft_cluster(Random& random, Index n = 8) {
  Configuration<D> c;
  c.add_soft(1, Vec<D>::Zero());
  while (c.topology.particles() < n) {
    const Index j = random.below(c.topology.particles());
    const Real sigma = random(0.5, 1.5);
    const Real reach = (sigma + c.topology.sigma[j]) / 2;
    c.add_soft(sigma, c.position(j) + random(0.6, 0.95) * reach * random.unit<D>());
  }
  c.random_velocities(random);
  return c;
}

// ---- walls ----

/// Where a point meets the right-hand wall of a hopper. The last three are boundaries.
enum class WallPlace { slope, upright, corner, end, onset, end_onset, end_side };
inline constexpr std::array interior_wall_places{WallPlace::slope, WallPlace::upright, WallPlace::corner,
                                                 WallPlace::end};
inline constexpr std::array boundary_wall_places{WallPlace::onset, WallPlace::end_onset, WallPlace::end_side};

inline Hopper test_hopper(Real angle) { return {.wall_distance = 10, .orifice = 3, .angle = angle}; }

/// A point of the meridian plane at `place`, for a contact of range `reach`; `away` becomes the direction from the wall
/// to it.
inline Vec<2> wall_point(Random& random, const Hopper& hopper, WallPlace place, Real reach, Vec<2>& away) {
  const Vec<2> lip(hopper.orifice / 2, 0), corner(hopper.wall_distance / 2, hopper.slope_height());
  const Vec<2> along = (corner - lip).normalized(), up = left_of(along), inward(-1, 0);
  const Real h = random(0.3, 0.85) * reach;
  switch (place) {
    case WallPlace::slope:
      away = up;
      return lip + random(0.3, 0.7) * (corner - lip) + h * away;
    case WallPlace::onset:
      away = up;
      return lip + random(0.3, 0.7) * (corner - lip) + reach * away;
    case WallPlace::upright:
      away = inward;
      return corner + Vec<2>(-h, random(2, 4));
    case WallPlace::corner: {
      // Nearer than the reach to both walls, with both feet inside them.
      away = (up + inward).normalized();
      return corner + random(0.6, 0.8) * reach * away;
    }
    case WallPlace::end:  // anywhere in the half plane beyond the lip
      away = Eigen::Rotation2D<Real>(random(-1.3, 1.3)) * -along;
      return lip + h * away;
    case WallPlace::end_onset:
      away = (up - along).normalized();
      return lip + reach * away;
    case WallPlace::end_side:
      away = up;
      return lip + h * away;
  }
  return lip;
}

/// A soft particle at the wall of a hopper; in 3D at a random azimuth.
template <int D>
Configuration<D> soft_at_wall(Random& random, Real angle, WallPlace place) {
  Configuration<D> c;
  const Hopper hopper = test_hopper(angle);
  c.walls = hopper.walls<D>();
  const Real sigma = random(0.6, 1.4);
  Vec<2> away;
  const Vec<2> p = wall_point(random, hopper, place, sigma / 2, away);
  if constexpr (D == 2) {
    c.add_soft(sigma, p);
  } else {
    const Vec<2> e = at_angle(random(0, 2 * pi));
    c.add_soft(sigma, Vec<3>(p[0] * e[0], p[0] * e[1], p[1]));
  }
  c.random_velocities(random);
  return c;
}

/// A polygon whose tip meets the wall of a hopper.
inline Configuration<2> polygon_at_wall(Random& random, Real angle, WallPlace place, Real delta) {
  Configuration<2> c;
  const Hopper hopper = test_hopper(angle);
  c.walls = hopper.walls<2>();
  Vec<2> away;
  const Vec<2> p = wall_point(random, hopper, place, delta / 2, away);
  c.add_polygon(wedge(p, away), delta);
  c.random_velocities(random);
  return c;
}

/// How the right-hand lip of a hopper meets the outline of a polygon in front of it. The last three are boundaries.
enum class LipPlace { edge, corner, notch, edge_onset, corner_onset, edge_end };
inline constexpr std::array interior_lip_places{LipPlace::edge, LipPlace::corner, LipPlace::notch};
inline constexpr std::array boundary_lip_places{LipPlace::edge_onset, LipPlace::corner_onset, LipPlace::edge_end};

/// The polygon lies on the far side of the lip, seen from the wall, so that the wall's end is nearest.
inline Configuration<2> polygon_at_lip(Random& random, Real angle, LipPlace place, Real delta) {
  const Hopper hopper = test_hopper(angle);
  const Vec<2> lip(hopper.orifice / 2, 0);
  const Vec<2> along = (Vec<2>(hopper.wall_distance / 2, hopper.slope_height()) - lip).normalized();
  Polygon a = notched_polygon(random);
  const std::size_t n = a.size(), k = place == LipPlace::notch ? notch_vertex : 1;
  const Vec<2> before = outward(a, k - 1), after = outward(a, k);
  const Real reach = delta / 2, h = random(0.3, 0.85) * reach, t = random(0.3, 0.7), mix = random(0.2, 0.8);
  Vec<2> q = a[k], normal = after;
  switch (place) {
    case LipPlace::edge:
      q = a[k] + t * (a[(k + 1) % n] - a[k]) + h * normal;
      break;
    case LipPlace::edge_onset:
      q = a[k] + t * (a[(k + 1) % n] - a[k]) + reach * normal;
      break;
    case LipPlace::corner:
      normal = (mix * before + (1 - mix) * after).normalized();
      q = a[k] + h * normal;
      break;
    case LipPlace::corner_onset:
      normal = (mix * before + (1 - mix) * after).normalized();
      q = a[k] + reach * normal;
      break;
    case LipPlace::notch:
      normal = (before + after).normalized();
      q = a[k] + random(0.3, 0.5) * reach * before + random(0.3, 0.5) * reach * after;
      break;
    case LipPlace::edge_end:
      q = a[k] + h * normal;
      break;
  }
  // Turn the polygon about q until the outward normal points up the wall, and put q on the lip.
  const Real turn = std::atan2(along[1], along[0]) - std::atan2(normal[1], normal[0]) + random(-0.15, 0.15);
  for (Vec<2>& r : a) r = lip + Eigen::Rotation2D<Real>(turn) * (r - q);
  Configuration<2> c;
  c.walls = hopper.walls<2>();
  c.add_polygon(a, delta);
  c.random_velocities(random);
  return c;
}

// ---- brute force ----

/// Distance of p to the closed outline of a polygon.
inline Real outline_distance(const Vec<2>& p, const Polygon& polygon) {
  Real least = std::numeric_limits<Real>::infinity();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec<2> a = polygon[i], b = polygon[(i + 1) % polygon.size()], u = b - a;
    least = std::min(least, (p - a).norm());
    if ((p - a).dot(u) > 0 && (p - b).dot(u) < 0)
      least = std::min(least, std::abs(u[0] * (p - a)[1] - u[1] * (p - a)[0]) / u.norm());
  }
  return least;
}

/// Vertices of particle m.
inline Polygon vertices_of(const Configuration<2>& c, Index m) {
  Polygon vertices;
  for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i) vertices.push_back(c.position(i));
  return vertices;
}

}  // namespace pliant::test
