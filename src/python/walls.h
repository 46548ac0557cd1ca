// Walls and containers that Python builds.
#pragma once

#include <pybind11/numpy.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <variant>
#include <vector>

#include <pliant/geometry/box.h>
#include <pliant/geometry/container.h>
#include <pliant/python/simulation.h>

namespace pliant::python {

template <int D>
Vec<D> vector_of(const std::vector<Real>& numbers, std::string_view name) {
  if (numbers.size() != D)
    throw InputError("{} has {} numbers; give {}, one for each direction", name, numbers.size(), D);
  Vec<D> r;
  for (int k = 0; k < D; ++k) r[k] = numbers[static_cast<std::size_t>(k)];
  if (!r.allFinite()) throw InputError("{} has a number that is not finite", name);
  return r;
}

/// Errors: InputError.
template <int D>
Box<D> box_of(const std::vector<Real>& origin, const std::vector<Real>& lengths) {
  if (lengths.size() != D) throw InputError("the box has {} lengths; give {}", lengths.size(), D);
  Vec<D> length;
  std::copy(lengths.begin(), lengths.end(), length.begin());
  return Box<D>(vector_of<D>(origin, "the origin of the box"), length);
}

/// since: the time from which on it counts.
template <int D>
Motion<D> motion_of(const MotionArguments& arguments, Real since);

/// Walls in 2D or 3D.
class AnyWalls {
 public:
  explicit AnyWalls(int dim);
  int dim() const { return walls_.index() == 0 ? 2 : 3; }
  template <int D>
  const Walls<D>& get() const {
    return std::get<D - 2>(walls_);
  }

  // Each adds a body and returns its number. Errors: InputError for a body that lies on another one with the same
  // motion, as particles would feel both.
  /// Segments between consecutive points [n, 2]; in 3D the meridian (ρ, z) of a surface of revolution.
  Index polyline(const Array& points, const MotionArguments& motion);
  Index polygon(const Array& corners, const MotionArguments& motion);
  Index disk(const std::vector<Real>& centre, Real radius, const MotionArguments& motion);
  Index half_space(const std::vector<Real>& point, const std::vector<Real>& normal, const MotionArguments& motion);
  Index container(const Container& container);
  Index bodies() const;
  /// The parts of each body, for a WallRecord.
  nlohmann::json parts() const;

 private:
  Index add(const WallParts& parts, const MotionArguments& motion);
  struct Body {
    WallParts parts;  ///< empty for a solid
    nlohmann::json record;
    MotionArguments motion;
  };
  void check_coincidence(const Body& next) const;
  std::variant<Walls<2>, Walls<3>> walls_;
  std::vector<Body> bodies_;
};

}  // namespace pliant::python
