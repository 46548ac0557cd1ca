// Walls as JSON, from which a restart makes the same walls, to the last bit.
#pragma once

#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include <pliant/geometry/walls.h>

namespace pliant::python {

/// Numbers of any size: JSON has no infinity, which is null.
template <int D>
nlohmann::json numbers_json(const Vec<D>& values);
template <int D>
Vec<D> numbers_from(const nlohmann::json& values);

/// The parts of a body, in its frame.
nlohmann::json to_json(const WallParts& parts);
template <int D>
nlohmann::json to_json(const Solid<D>& solid);

/// How the bodies of walls have come to where they are.
template <int D>
class WallRecord {
 public:
  WallRecord() = default;
  /// bodies: the parts of each body of `walls`, which are as they were added.
  WallRecord(nlohmann::json bodies, const Walls<D>& walls)
      : bodies_(std::move(bodies)), starts_(static_cast<std::size_t>(walls.bodies())), moved_(walls.move()) {}

  /// To be called before walls.set_motion(body, …) for this time.
  void moves(const Walls<D>& walls, Index body, Real t) {
    starts_[static_cast<std::size_t>(body)] = walls.pose(body, t);
    moved_ = true;
  }
  nlohmann::json json(const Walls<D>& walls) const;
  /// The walls that json() describes, of which this becomes the record. Errors: nlohmann::json::exception, InputError.
  Walls<D> read(const nlohmann::json& from);

 private:
  nlohmann::json bodies_ = nlohmann::json::array();
  std::vector<Pose<D>> starts_;  ///< places of the bodies when their motions began
  bool moved_ = false;           ///< a body: walls that once moved are never treated as resting walls
};

extern template class WallRecord<2>;
extern template class WallRecord<3>;

}  // namespace pliant::python
