#include <pliant/run/wall_contacts.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <utility>

#include <pliant/geometry/distance.h>
#include <pliant/geometry/solid.h>
#include <pliant/model/polygon.h>

namespace pliant {
namespace {

/// Empties the neighbour lists and, at the end of its life, restores them.
template <int D>
class EmptyLists {
 public:
  explicit EmptyLists(Neighbours<D>& neighbours) : lists_(neighbours), all_(std::move(lists_)) {
    for (const auto list : {&NeighbourLists::point_pairs, &NeighbourLists::vertex_edges, &NeighbourLists::vertex_faces,
                            &NeighbourLists::edge_pairs})
      clear(list);
    clear_walls();
  }
  ~EmptyLists() { lists_ = std::move(all_); }
  EmptyLists(const EmptyLists&) = delete;
  EmptyLists& operator=(const EmptyLists&) = delete;

  const NeighbourLists& all() const { return all_; }
  NeighbourLists& now() { return lists_; }
  void clear_walls() {
    for (const auto list : {&NeighbourLists::walls, &NeighbourLists::lips}) clear(list);
  }

 private:
  void clear(PairList NeighbourLists::*list) {
    (lists_.*list).clear();
    (lists_.*list).start.assign((all_.*list).start.size(), 0);
  }
  NeighbourLists& lists_;
  NeighbourLists all_;
};

/// A place where a point, or an edge, may touch.
template <int D>
struct Place {
  Index point, wall;
  Vec<D> position, normal;  ///< on the wall; towards the point
  Real d;
  Vec<D> force = Vec<D>::Zero(), friction = Vec<D>::Zero();  ///< friction: the part of the force that is not elastic

  void add(const Vec<D>& by_term, bool elastic) {
    force += by_term;
    if (!elastic) friction += by_term;
  }
};

template <int D>
class WallContactFinder {
 public:
  WallContactFinder(ParticleSystem<D>& system, const StateView<D>& view)
      : field_(system.field()),
        box_(system.box()),
        neighbours_(system.neighbours()),
        view_(view),
        topology_(view.topology),
        beyond_(neighbours_.needs().beyond_contact),
        walls_(view.walls) {
    // Removed entries keep their places in the list, because terms find contact histories by them.
    nowhere_ = walls_.part_count();
    walls_.add(Solid<D>::half_space(Vec<D>::Constant(-1e12), Vec<D>::Ones()));
    walls_.prepare(view.t);
  }

  std::vector<ContactRecord<D>> find() {
    EmptyLists<D> lists(neighbours_);
    find_places(lists.all().walls);
    if constexpr (D == 2) find_lips(lists.all().lips);
    if (places_.empty() && lips_.empty()) return {};
    add_forces(lists);
    if constexpr (D == 2) join_lips();
    std::vector<ContactRecord<D>> contacts;
    for (const auto* places : {&places_, &lips_})
      for (const Place<D>& p : *places)
        if (p.force != Vec<D>::Zero()) contacts.push_back(record(p));
    return contacts;
  }

 private:
  Real radius(Index point) const { return topology_.diameter[point] / 2; }

  /// The contact places of each point, one for each surface; `layer_` of list entries: the place of each entry.
  void find_places(const PairList& list) {
    layer_.assign(static_cast<std::size_t>(list.size()), 0);
    first_.assign(static_cast<std::size_t>(topology_.owned_points()) + 1, 0);
    std::vector<Index> entries(layer_.size());
    for (Index e = 0; e < list.size(); ++e) entries[static_cast<std::size_t>(e)] = e;
    std::stable_sort(entries.begin(), entries.end(), [&](Index a, Index b) { return list[a].first < list[b].first; });
    for (std::size_t from = 0, to = 0; from < entries.size(); from = to) {
      const Index point = list[entries[from]].first;
      while (to < entries.size() && list[entries[to]].first == point) ++to;
      find_places(list, std::span(entries).subspan(from, to - from));
      first_[static_cast<std::size_t>(point) + 1] = places_.size();
    }
    for (std::size_t i = 1; i < first_.size(); ++i) first_[i] = std::max(first_[i], first_[i - 1]);
  }

  /// For one point.
  void find_places(const PairList& list, std::span<const Index> entries) {
    const Index point = list[entries.front()].first;
    const Vec<D> r = view_.position(point);
    const std::size_t first = places_.size();
    std::vector<Place<D>> touching;
    for (const Index e : entries) {
      const Index part = list[e].second;
      Place<D> p{point, walls_.wall_of_part(part), Vec<D>::Zero(), Vec<D>::Zero(), 0};
      walls_.nearest(r, part, view_.t, p.d, p.normal);
      p.position = r - p.d * p.normal;
      touching.push_back(p);
      if (p.d < radius(point) + beyond_ && walls_.carries(r, part, view_.t)) places_.push_back(p);
    }
    const auto nearer = [](const Place<D>& a, const Place<D>& b) { return a.d < b.d; };
    if (places_.size() == first) {
      const auto& nearest = *std::min_element(touching.begin(), touching.end(), nearer);
      if (nearest.d < radius(point) + beyond_) places_.push_back(nearest);
    }
    // Parts that do not hold the foot add nothing, or subtract a part that two neighbours count twice.
    const auto own = std::span(places_).subspan(first);
    for (std::size_t k = 0; k < entries.size(); ++k) {
      std::size_t best = 0;
      Real least = std::numeric_limits<Real>::infinity();
      for (std::size_t q = 0; q < own.size(); ++q) {
        const Real far = own[q].wall == touching[k].wall ? -1 : (own[q].position - touching[k].position).norm();
        if (far < least) least = far, best = q;
      }
      layer_[static_cast<std::size_t>(entries[k])] = static_cast<Index>(best);
      layers_ = std::max(layers_, static_cast<Index>(best) + 1);
    }
  }

  /// For each particle and lip the nearest place of the outline.
  void find_lips(const PairList& list) requires(D == 2) {
    for (const Pair& pair : list) {
      const Index lip = pair.first, start = pair.second;
      const Vec<2> q = walls_.lip(lip, view_.t);
      const SegmentFoot foot = segment_foot(q, view_.position(start), view_.position(topology_.next[start]));
      const Real d = std::sqrt(foot.d2);
      if (d >= radius(start) + beyond_ || start >= topology_.owned_points()) continue;
      const Place<2> p{start, walls_.lips()[lip].wall, q, d > 0 ? Vec<2>(-foot.offset / d) : Vec<2>(Vec<2>::Zero()), d};
      const auto same = std::find_if(lips_.begin(), lips_.end(), [&](const Place<2>& other) {
        return topology_.particle[other.point] == topology_.particle[start] && other.position == q;
      });
      if (same == lips_.end())
        lips_.push_back(p);
      else if (d < same->d)
        *same = p;
    }
  }

  /// Terms that do not read walls give equal results for both lists: only differences count.
  void add_forces(EmptyLists<D>& lists) {
    const Neighbours<D> none(neighbours_.needs(), neighbours_.skin());
    const Topology nobody;
    StateView<D> view{view_.x,        view_.v,      topology_,   neighbours_,   walls_,     view_.t,
                      view_.prefetch, view_.angles, view_.spins, view_.history, view_.turns};
    const auto points = static_cast<std::size_t>(topology_.points()) + static_cast<std::size_t>(topology_.owned());
    std::vector<Real> f(points * std::max(D, rotations<D>) * 2), without(f.size());
    for (const TermReport& term : field_.report({view_.x, view_.v, nobody, none, view_.walls, view_.t})) {
      lists.clear_walls();
      field_.force_of({term.name}, view, without.data());
      const auto add = [&](const auto& to) {
        field_.force_of({term.name}, view, f.data());
        for (Index i = 0; i < topology_.owned_points(); ++i)
          if (const Vec<D> change = point<D>(f.data(), i) - point<D>(without.data(), i); change != Vec<D>::Zero())
            to(i, change);
      };
      for (Index layer = 0; layer < layers_; ++layer) {
        lists.now().walls = lists.all().walls;
        for (std::size_t e = 0; e < layer_.size(); ++e)
          if (layer_[e] != layer) lists.now().walls.pairs[e].second = nowhere_;
        add([&](Index i, const Vec<D>& force) {
          const std::size_t at = first_[static_cast<std::size_t>(i)] + static_cast<std::size_t>(layer);
          if (at < first_[static_cast<std::size_t>(i) + 1]) places_[at].add(force, term.is_energy);
        });
      }
      if (lips_.empty()) continue;
      lists.clear_walls();
      lists.now().lips = lists.all().lips;
      add([&](Index i, const Vec<D>& force) {
        if (Place<D>* lip = lip_of(i)) lip->add(force, term.is_energy);
      });
    }
  }

  /// The nearest lip that the particle of a point touches.
  Place<D>* lip_of(Index point) {
    Place<D>* nearest = nullptr;
    Real least = std::numeric_limits<Real>::infinity();
    for (Place<D>& lip : lips_)
      if (const Real far = (lip.position - view_.position(point)).norm();
          topology_.particle[lip.point] == topology_.particle[point] && far < least)
        least = far, nearest = &lip;
    return nearest;
  }

  /// Vertices that touch a lip which edges of their particle feel, too, have one contact with these.
  void join_lips() {
    for (Place<D>& p : places_) {
      Place<D>* const lip = lip_of(p.point);
      if (lip == nullptr || (lip->position - p.position).norm() > 1e-9) continue;
      lip->force += p.force;
      lip->friction += p.friction;
      p.force.setZero();
    }
  }

  ContactRecord<D> record(const Place<D>& p) const {
    ContactRecord<D> r;
    const Index particle = topology_.particle[p.point];
    r.particles = {topology_.id[particle], p.wall};
    r.overlap = 1 - p.d / radius(p.point);
    const Real length = p.normal.norm();
    const Vec<D> shift = box_.shift(box_.image_of(mean_of_points<D>(view_.x, topology_, particle)));
    for (int k = 0; k < D; ++k) {
      r.position[k] = p.position[k] - shift[k];  // where the particle is drawn
      r.normal[k] = length > 0 ? p.normal[k] / length : 0;
      r.force[k] = p.force[k];
      r.friction[k] = p.friction[k];
    }
    return r;
  }

  const ForceField<D>& field_;
  const Box<D>& box_;
  Neighbours<D>& neighbours_;
  const StateView<D>& view_;
  const Topology& topology_;
  const Real beyond_;
  Walls<D> walls_;
  Index nowhere_;
  std::vector<Place<D>> places_, lips_;
  std::vector<std::size_t> first_;  ///< [own points + 1] places of each point
  std::vector<Index> layer_;        ///< [list]
  Index layers_ = 1;
};

}  // namespace

template <int D>
std::vector<ContactRecord<D>> find_wall_contacts(ParticleSystem<D>& system, const StateView<D>& view) {
  if (view.walls.size() == 0) return {};
  return WallContactFinder<D>(system, view).find();
}

template std::vector<ContactRecord<2>> find_wall_contacts(ParticleSystem<2>&, const StateView<2>&);
template std::vector<ContactRecord<3>> find_wall_contacts(ParticleSystem<3>&, const StateView<3>&);

}  // namespace pliant
