#include <pliant/geometry/walls.h>

#include <numeric>

namespace pliant {
namespace {

/// Infinite along each axis that the direction is not perpendicular to.
Vec<2> far_end(const WallSegment& s) {
  Vec<2> end = s.origin;
  for (int k = 0; k < 2; ++k)
    if (s.direction[k] != 0) end[k] = std::copysign(s.length, s.direction[k]);
  return end;
}

Box2 box_of(const WallSegment& s) {
  const Vec<2> end = s.length < std::numeric_limits<Real>::infinity() ? s.end() : far_end(s);
  const Vec<2> radius = Vec<2>::Constant(s.radius);
  return {s.origin.cwiseMin(end) - radius, s.origin.cwiseMax(end) + radius};
}

/// Largest distance from p, in the frame of the body, to a point of the segment without its radius: the radius does not
/// move when the segment turns about one of its points.
template <int D>
Real reach(const WallSegment& s, const Vec<D>& p) {
  if (!std::isfinite(s.length)) return s.length;
  const auto distance = [&](const Vec<2>& end) {
    if constexpr (D == 2)
      return (end - p).norm();
    else
      return std::hypot(end[0] + std::hypot(p[0], p[1]), end[1] - p[2]);
  };
  return std::max(distance(s.origin), distance(s.end()));
}

/// Segments that are joined without concave corners, numbered in their order: the surface of each segment. An outline
/// with a single concave corner, on both sides of which a particle touches it, is cut at its sharpest corner.
std::vector<Index> number_surfaces(const WallParts& walls) {
  const auto straightness = [&](const Joint& joint) {
    return walls.segments[joint.before].direction.dot(walls.segments[joint.wall].direction);
  };
  std::vector<Index> root(walls.segments.size());
  const auto find = [&](Index k) {
    while (root[k] != k) k = root[k] = root[root[k]];
    return k;
  };
  const auto join = [&](const std::vector<bool>& cut) {
    std::iota(root.begin(), root.end(), 0);
    for (std::size_t n = 0; n < walls.joints.size(); ++n) {
      if (!walls.joints[n].convex || cut[n]) continue;
      const Index a = find(walls.joints[n].before), b = find(walls.joints[n].wall);
      root[std::max(a, b)] = std::min(a, b);
    }
  };
  std::vector<bool> cut(walls.joints.size());
  join(cut);
  std::vector<bool> both(walls.segments.size());  // per root: whether its ends meet
  bool any = false;
  for (const Joint& joint : walls.joints)
    if (!joint.convex && find(joint.before) == find(joint.wall)) any = both[find(joint.wall)] = true;
  if (any) {
    std::vector<Index> sharpest(walls.segments.size(), -1);
    for (std::size_t n = 0; n < walls.joints.size(); ++n) {
      const Joint& joint = walls.joints[n];
      Index& best = sharpest[find(joint.wall)];
      if (joint.convex && both[find(joint.wall)] &&
          (best < 0 || straightness(joint) < straightness(walls.joints[best])))
        best = static_cast<Index>(n);
    }
    for (const Index n : sharpest)
      if (n >= 0) cut[n] = true;
    join(cut);
  }
  std::vector<Index> surface;
  Index surfaces = 0;
  for (Index k = 0; k < walls.next(); ++k) surface.push_back(find(k) == k ? surfaces++ : surface[find(k)]);
  return surface;
}

}  // namespace

template <int D>
Index Walls<D>::add(const WallParts& walls, const Motion<D>& motion, const Pose<D>& pose, Index material) {
  const Index first = segments_, count = walls.next(), first_wall = size();
  // Segments come before all joints.
  const auto shift = [&](Index part) { return part < first ? part : part + count; };
  for (Body& other : bodies_)
    for (Index& part : other.parts) part = shift(part);
  parts_.insert(parts_.begin() + first, walls.segments.begin(), walls.segments.end());
  segments_ += count;
  std::vector<Index> numbers(count);
  std::iota(numbers.begin(), numbers.end(), first_wall);
  part_wall_.insert(part_wall_.begin() + first, numbers.begin(), numbers.end());
  part_body_.insert(part_body_.begin() + first, count, bodies());
  wall_body_.resize(first_wall + count, bodies());

  Body body{pose, motion, material, {}, {}, {}, {}, Vec<D>::Zero(), 0};
  for (Index k = 0; k < count; ++k) body.parts.push_back(first + k);
  before_.resize(segments_, -1);
  after_.resize(segments_, -1);
  auto joints_end = static_cast<Index>(parts_.size());  // before solids
  for (const Joint& joint : walls.joints) {
    part_wall_.insert(part_wall_.begin() + joints_end, first_wall + joint.wall);
    part_body_.insert(part_body_.begin() + joints_end, bodies());
    body.parts.push_back(joints_end++);
    parts_.push_back({.origin = joint.place, .direction = {1, 0}, .length = 0, .weight = -1});
    before_[first + joint.wall] = first + joint.before;
    after_[first + joint.before] = first + joint.wall;
  }
  first_solid_ = static_cast<Index>(parts_.size());
  plain_ = plain_ && walls.joints.empty() &&
           std::all_of(walls.segments.begin(), walls.segments.end(),
                       [](const WallSegment& s) { return s.radius == 0 && s.weight == 1; });

  const std::vector<Index> surface = number_surfaces(walls);
  for (const Index k : surface) wall_surface_.push_back(surfaces_ + k);
  if (count > 0) surfaces_ += *std::max_element(surface.begin(), surface.end()) + 1;

  for (const Lip& lip : walls.lips) {
    if (D == 3 && !(lip.place[0] > 0)) continue;
    body.lips.push_back(static_cast<Index>(lips_.size()));
    lips_.push_back({lip.place, first_wall + lip.wall});
  }
  std::vector<Box2> boxes;
  for (const Index part : body.parts) boxes.push_back(box_of(parts_[part]));
  body.part_tree = BoxTree(boxes);
  boxes.clear();
  for (const Index l : body.lips) boxes.push_back({lips_[l].place, lips_[l].place});
  body.lip_tree = BoxTree(boxes);
  bodies_.push_back(std::move(body));
  place(bodies_.back());
  return bodies() - 1;
}

template <int D>
Index Walls<D>::add(const Solid<D>& solid, const Motion<D>& motion, const Pose<D>& pose, Index material) {
  part_wall_.push_back(size());
  part_body_.push_back(bodies());
  wall_surface_.push_back(surfaces_++);
  wall_body_.push_back(bodies());
  solids_.push_back(solid);
  bodies_.push_back({pose, motion, material, {}, {}, {}, {}, solid.place, std::numeric_limits<Real>::infinity()});
  place(bodies_.back());
  return bodies() - 1;
}

template <int D>
void Walls<D>::set_motion(Index body, const Motion<D>& motion) {
  Body& b = bodies_[body];
  b.start = b.at(motion.since);
  b.motion = motion;
  b.placed = {};
  place(b);
}

/// Bounds that follow from the motion.
template <int D>
void Walls<D>::place(Body& body) {
  still_ = still_ && body.motion.rests() && !body.start.turned && body.start.shift == Vec<D>::Zero();
  if (!body.motion.turns() || body.parts.empty()) return;
  const Vec<D> pivot = body.start.back(body.motion.pivot);
  body.lever = 0;
  if constexpr (D == 3) {  // a figure of revolution does not change by a turn about its axis
    const Vec<3> axis = body.start.turned ? Vec<3>(body.start.turn.transpose() * body.motion.spin) : body.motion.spin;
    if (axis[0] == 0 && axis[1] == 0 && pivot[0] == 0 && pivot[1] == 0) return;
  }
  for (const Index part : body.parts) body.lever = std::max(body.lever, reach<D>(parts_[part], pivot));
}

template <int D>
bool Walls<D>::has_foot(const Vec<2>& p, Index part) const {
  const auto along = [&](Index s) { return (p - parts_[s].origin).dot(parts_[s].direction); };
  const Real here = along(part);
  if (here >= parts_[part].length && after_[part] >= 0) return false;
  if (here > 0 || before_[part] < 0) return true;
  return along(before_[part]) >= parts_[before_[part]].length;
}

template <int D>
void Walls<D>::nearest(const Vec<D>& r, Index part, Real t, Real& d, Vec<D>& n) const {
  if (is_solid(part)) {
    const WallFoot<D> at = foot(r, part, t);
    d = at.d;
    n = at.n;
    return;
  }
  const Pose<D> pose = pose_of(part, t);
  const Vec<D> b = pose.back(r);
  const Vec<2> p = meridian(b);
  const Vec<2> q = offset(seen(p, parts_[part]), parts_[part]);
  d = q.norm();
  n = pose.direction(lift(b, p, direction<2>(q, d), parts_[part]));
  d -= parts_[part].radius;
}

template Index Walls<2>::add(const WallParts&, const Motion<2>&, const Pose<2>&, Index);
template Index Walls<3>::add(const WallParts&, const Motion<3>&, const Pose<3>&, Index);
template Index Walls<2>::add(const Solid<2>&, const Motion<2>&, const Pose<2>&, Index);
template Index Walls<3>::add(const Solid<3>&, const Motion<3>&, const Pose<3>&, Index);
template void Walls<2>::set_motion(Index, const Motion<2>&);
template void Walls<3>::set_motion(Index, const Motion<3>&);
template bool Walls<2>::has_foot(const Vec<2>&, Index) const;
template bool Walls<3>::has_foot(const Vec<2>&, Index) const;
template void Walls<2>::nearest(const Vec<2>&, Index, Real, Real&, Vec<2>&) const;
template void Walls<3>::nearest(const Vec<3>&, Index, Real, Real&, Vec<3>&) const;

}  // namespace pliant
