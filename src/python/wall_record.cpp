#include <pliant/python/wall_record.h>

#include <cmath>
#include <limits>

namespace pliant::python {
namespace {

nlohmann::json number_json(Real value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}
Real number_from(const nlohmann::json& value) {
  return value.is_null() ? std::numeric_limits<Real>::infinity() : value.get<Real>();
}

WallParts parts_of(const nlohmann::json& from) {
  const auto real = [](const nlohmann::json& of, std::size_t k) { return number_from(of.at(k)); };
  const auto place = [&](const nlohmann::json& of, std::size_t k) { return Vec<2>(real(of, k), real(of, k + 1)); };
  WallParts parts;
  for (const nlohmann::json& s : from.at("segments"))
    parts.segments.push_back({place(s, 0), place(s, 2), real(s, 4), real(s, 5), real(s, 6)});
  const auto segment = [&](const nlohmann::json& of, std::size_t at) {
    const auto k = of.at(at).get<Index>();
    if (k < 0 || k >= parts.next()) throw InputError("a wall has no segment {}", k);
    return k;
  };
  for (const nlohmann::json& lip : from.at("lips")) parts.lips.push_back({place(lip, 0), segment(lip, 2)});
  for (const nlohmann::json& j : from.at("joints"))
    parts.joints.push_back({place(j, 0), segment(j, 2), segment(j, 3), j.at(4).get<bool>()});
  return parts;
}

template <int D>
Solid<D> solid_of(const nlohmann::json& from) {
  return {numbers_from<D>(from.at("place")), numbers_from<D>(from.at("along")), numbers_from<D>(from.at("out")),
          from.at("opening").get<Real>()};
}

template <int D>
nlohmann::json to_json(const Motion<D>& m) {
  nlohmann::json all{{"velocity", numbers_json<D>(m.velocity)},
                     {"amplitude", numbers_json<D>(m.amplitude)},
                     {"frequency", m.frequency},
                     {"phase", m.phase},
                     {"pivot", numbers_json<D>(m.pivot)},
                     {"since", m.since}};
  if constexpr (D == 2)
    all["spin"] = m.spin;
  else
    all["spin"] = numbers_json<D>(m.spin);
  return all;
}

template <int D>
Motion<D> motion_from(const nlohmann::json& from) {
  Motion<D> m;
  m.velocity = numbers_from<D>(from.at("velocity"));
  m.amplitude = numbers_from<D>(from.at("amplitude"));
  m.frequency = from.at("frequency").get<Real>();
  m.phase = from.at("phase").get<Real>();
  m.pivot = numbers_from<D>(from.at("pivot"));
  m.since = from.at("since").get<Real>();
  if constexpr (D == 2)
    m.spin = from.at("spin").get<Real>();
  else
    m.spin = numbers_from<D>(from.at("spin"));
  return m;
}

template <int D>
nlohmann::json to_json(const Pose<D>& pose) {
  nlohmann::json turn = nlohmann::json::array();
  for (const Real value : pose.turn.reshaped()) turn.push_back(value);
  return {{"turn", turn}, {"shift", numbers_json<D>(pose.shift)}, {"turned", pose.turned}};
}

template <int D>
Pose<D> pose_from(const nlohmann::json& from) {
  Pose<D> pose;
  for (int k = 0; k < D * D; ++k) pose.turn(k % D, k / D) = from.at("turn").at(static_cast<std::size_t>(k)).get<Real>();
  pose.shift = numbers_from<D>(from.at("shift"));
  pose.turned = from.at("turned").get<bool>();
  return pose;
}

}  // namespace

template <int D>
nlohmann::json numbers_json(const Vec<D>& values) {
  nlohmann::json all = nlohmann::json::array();
  for (const Real value : values) all.push_back(number_json(value));
  return all;
}
template nlohmann::json numbers_json<2>(const Vec<2>&);
template nlohmann::json numbers_json<3>(const Vec<3>&);

template <int D>
Vec<D> numbers_from(const nlohmann::json& values) {
  Vec<D> v;
  for (int k = 0; k < D; ++k) v[k] = number_from(values.at(static_cast<std::size_t>(k)));
  return v;
}
template Vec<2> numbers_from<2>(const nlohmann::json&);
template Vec<3> numbers_from<3>(const nlohmann::json&);

nlohmann::json to_json(const WallParts& parts) {
  nlohmann::json segments = nlohmann::json::array(), lips = nlohmann::json::array(), joints = nlohmann::json::array();
  for (const WallSegment& s : parts.segments)
    segments.push_back(
        {s.origin[0], s.origin[1], s.direction[0], s.direction[1], number_json(s.length), s.radius, s.weight});
  for (const Lip& lip : parts.lips) lips.push_back({lip.place[0], lip.place[1], lip.wall});
  for (const Joint& j : parts.joints) joints.push_back({j.place[0], j.place[1], j.wall, j.before, j.convex});
  return {{"segments", segments}, {"lips", lips}, {"joints", joints}};
}

template <int D>
nlohmann::json to_json(const Solid<D>& solid) {
  return {{"place", numbers_json<D>(solid.place)},
          {"along", numbers_json<D>(solid.along)},
          {"out", numbers_json<D>(solid.out)},
          {"opening", solid.opening}};
}
template nlohmann::json to_json(const Solid<2>&);
template nlohmann::json to_json(const Solid<3>&);

template <int D>
nlohmann::json WallRecord<D>::json(const Walls<D>& walls) const {
  nlohmann::json all = bodies_;
  for (Index b = 0; b < walls.bodies(); ++b) {
    const auto k = static_cast<std::size_t>(b);
    all[k]["start"] = to_json(starts_[k]);
    all[k]["motion"] = to_json(walls.motion(b));
  }
  return {{"bodies", all}, {"moved", moved_}};
}

template <int D>
Walls<D> WallRecord<D>::read(const nlohmann::json& from) {
  Walls<D> walls;
  *this = {};
  from.at("moved").get_to(moved_);
  for (nlohmann::json body : from.at("bodies")) {
    const Motion<D> motion = motion_from<D>(body.at("motion"));
    const Pose<D> start = pose_from<D>(body.at("start"));
    Motion<D> first = motion;
    if (moved_) first = {.velocity = Vec<D>::Ones(), .since = motion.since};
    const Index b = body.contains("segments") ? walls.add(parts_of(body), first, start)
                                              : walls.add(solid_of<D>(body), first, start);
    if (moved_) walls.set_motion(b, motion);
    for (const char* name : {"start", "motion"}) body.erase(name);
    bodies_.push_back(std::move(body));
    starts_.push_back(start);
  }
  return walls;
}

template class WallRecord<2>;
template class WallRecord<3>;

}  // namespace pliant::python
