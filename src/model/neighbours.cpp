#include <pliant/model/neighbours.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>
#include <pliant/base/large_pages.h>
#include <pliant/base/parallel_errors.h>
#include <pliant/geometry/simplex_distance.h>
#include <pliant/kernels/arrays.h>
#include <pliant/kernels/edge_forces.h>
#include <pliant/kernels/verlet.h>
#include <pliant/model/chunks.h>

namespace pliant {
namespace {

/// Points per chunk: enough that few pairs lie across its border, where forces are computed twice, and more where the
/// other sides of the borders are not in the caches, but so few that threads can share out the chunks of n points.
template <int D>
Index chunk_size(Index n) {
  constexpr Index least = D == 2 ? 1500 : 4000, most = D == 2 ? 6000 : 4000, shares = 32;
  return std::clamp(n / shares, least, most);
}

/// Infinity where there are no values: on a rank without particles.
Real least(const std::vector<Real>& values) {
  Real least = std::numeric_limits<Real>::infinity();
  for (const Real a : values) least = std::min(least, a);
  return least;
}

}  // namespace

template <int D>
Real Neighbours<D>::farthest(const Walls<D>& wall, const Real* x, Real t) const {
  if (!built_) return std::numeric_limits<Real>::infinity();
  const Real of_walls = wall.moved(time_, t, [&](const Vec<D>& p) {
    Real most = 0;
    for (Index i = 0; i < chunk_point_.back(); ++i) most = std::max(most, (point<D>(x, i) - p).norm());
    return most + widest_ / 2 + needs_.beyond_contact;
  });
  const bool deformed = deformation_ != Mat<D>::Identity();
  std::array<Real, max_chunks> moved;
  for_each_chunk(chunks(), [&](Index c) {
    const Range own = points(c);
    const auto first = static_cast<std::size_t>(own.first) * D;
    const Real* reference = reference_.data() + first;
    moved[c] = deformed ? farthest_from_deformed(own.size(), x + first, reference)
                        : pliant::farthest<D>(own.size(), x + first, reference);
  });
  return std::max(of_walls, *std::max_element(moved.begin(), moved.begin() + chunks()));
}

template <int D>
Real Neighbours<D>::farthest_from_deformed(Index points, const Real* x, const Real* reference) const {
  const Mat<D> change = deformation_ - Mat<D>::Identity();
  Real most = 0;
  bool finite = true;
  for (Index i = 0; i < points; ++i) {
    const Vec<D> from = point<D>(reference, i);
    const Real moved = (point<D>(x, i) - from - change * (from - origin_)).squaredNorm();
    finite = finite && moved == moved;
    most = std::max(most, moved);
  }
  return finite ? std::sqrt(most) : std::numeric_limits<Real>::infinity();
}

template <int D>
void Neighbours<D>::set_deformation(const Vec<D>& origin, const Mat<D>& f, Real widest) {
  origin_ = origin;
  deformation_ = f;
  shortened_ = (deformation_ - Mat<D>::Identity()).norm() * (widest + margin()) / 2;
}

template <int D>
Real Neighbours<D>::farthest_wall(const Walls<D>& wall, Real t) const {
  return wall.moved(time_, t, [](const Vec<D>&) { return std::numeric_limits<Real>::infinity(); });
}

template <int D>
void Neighbours<D>::divide(const Topology& topology) {
  const Index n = topology.owned_points();
  const Index chunks = std::clamp<Index>(n / chunk_size<D>(n), 1, max_chunks);
  chunk_.assign(1, 0);
  for (Index c = 1; c < chunks; ++c) {
    // The first particle that begins at or after an equal share of the points.
    const auto share = static_cast<Index>(static_cast<std::int64_t>(n) * c / chunks);
    const auto at =
        std::lower_bound(topology.offset.begin() + chunk_.back(), topology.offset.begin() + topology.owned(), share);
    chunk_.push_back(static_cast<Index>(at - topology.offset.begin()));
  }
  chunk_.push_back(topology.owned());
  chunk_point_.resize(chunk_.size());
  for (std::size_t c = 0; c < chunk_.size(); ++c) chunk_point_[c] = topology.offset[chunk_[c]];
}

/// Chunk of point i; −1 for a ghost.
template <int D>
Index Neighbours<D>::chunk_of(Index i) const {
  if (i >= chunk_point_.back()) return -1;
  return static_cast<Index>(std::upper_bound(chunk_point_.begin(), chunk_point_.end(), i) - chunk_point_.begin()) - 1;
}

template <int D>
SearchSpace<D> Neighbours<D>::search_space(const Topology& topology, const Walls<D>& wall, const Real* x) const {
  return {{x, topology.diameter, topology.particle, topology.next, topology.active},
          grid_,
          wall,
          time_,
          margin(),
          needs_.edges,
          widest_,
          longest_,
          topology,
          boxes_};
}

/// Appends the elements of the next part: inside a chunk, or across the border of a chunk.
template <int D>
void Neighbours<D>::append(PairList& list, const std::vector<Found>& part) {
  for (const Found& found : part) {
    list.pairs.push_back(found.pair);
    list.reach.push_back(found.reach);
  }
  list.start.push_back(list.size());
}

/// In a pair of particles, the particle that started the search is the first if the kind is symmetric, else the second.
/// Ghosts search too, for pairs that owned points do not find.
template <int D>
template <class Kind>
void Neighbours<D>::build_pairs(const SearchSpace<D>& space) {
  PairList& list = this->*Kind::list;
  const Index n = chunks(), own = chunk_point_.back();
  const auto other_point = [](const Pair& pair) {
    const Pair points = Kind::points_of_both(pair);
    return Kind::symmetric ? points.second : points.first;
  };
  list.clear();
  const auto make_room = [&](std::size_t size) {
    list.pairs.reserve(size);
    list.reach.reserve(size);
  };
  std::vector<std::vector<Found>> across(n + 1);
  const auto search = [&](Index c, std::vector<Found>& inside) {
    const Range range = c < n ? points(c) : Range{own, space.cloud.size()};
    inside.clear();
    Kind::search(space, range.first, range.last, [&](Index first, Index second, Real reach) {
      const Index other = other_point({first, second});
      if (c < n && range.contains(other))
        inside.push_back({{first, second}, reach});
      else if (c < n || other < own)
        across[c].push_back({{first, second}, reach});
    });
  };
  const auto append_found = [&](Index c, const std::vector<Found>& inside) {
    if (c >= n) return;
    // Capacity for the final size, if the other chunks, including borders, find as many pairs: doubling would hold
    // the list twice for a while, and untouched memory costs nothing.
    const std::size_t size = list.pairs.size() + inside.size();
    if (size > list.pairs.capacity()) make_room(size + size * static_cast<std::size_t>(n - c) / (c + 1) + size / 4);
    append(list, inside);
  };
  if (n == 1) {  // see for_each_chunk()
    for (const Index c : {0, 1}) {
      search(c, near_);
      append_found(c, near_);
    }
  } else {
    ParallelErrors errors;
#pragma omp parallel
    {
      std::vector<Found> inside;
#pragma omp for ordered schedule(dynamic, 1)
      for (Index c = 0; c <= n; ++c) {
        errors.catch_from([&] { search(c, inside); });
#pragma omp ordered
        errors.catch_from([&] { append_found(c, inside); });
      }
    }
    errors.rethrow();
  }
  std::vector<std::size_t> found;  // the rest will be the pairs of other chunks
  for (const auto& part : across) found.push_back(part.size());
  for (Index c = 0; c <= n; ++c)
    for (std::size_t k = 0; k < found[c]; ++k) {
      Found copy = across[c][k];
      const Index target = chunk_of(other_point(copy.pair));
      if (target < 0) continue;
      if (Kind::symmetric) std::swap(copy.pair.first, copy.pair.second);
      across[target].push_back(copy);
    }
  std::size_t size = list.pairs.size();
  for (Index c = 0; c < n; ++c) size += across[c].size();
  make_room(size);
  for (Index c = 0; c < n; ++c) append(list, across[c]);
}

/// Owned points, or edges, with elements other than particles.
template <int D>
template <class Kind>
void Neighbours<D>::build_own(const SearchSpace<D>& space) {
  const Index n = chunks();
  std::vector<std::vector<Pair>> parts(n);
  for_each_chunk(n, [&](Index c) {
    Kind::search(space, points(c).first, points(c).last, [&](Index first, Index second) {
      parts[c].push_back({first, second});
    });
  });
  PairList& list = this->*Kind::list;
  list.clear();
  for (const std::vector<Pair>& part : parts) {
    list.pairs.insert(list.pairs.end(), part.begin(), part.end());
    list.start.push_back(list.size());
  }
  list.start.insert(list.start.end(), n, list.size());  // nothing across
}

/// Elements of a vertex and a part of an outline or a surface, from the pairs of points: add(vertex, end, found)
/// appends the elements of the vertex with the parts at the other point.
template <int D>
template <class Add>
auto Neighbours<D>::from_points(Add&& add) const -> FoundParts {
  const Index n = chunks();
  FoundParts parts{std::vector<std::vector<Found>>(n), std::vector<std::vector<Found>>(n)};
  for_each_chunk(n, [&](Index c) {
    const auto add_all = [&](const Range& range, std::vector<Found>& found) {
      for (Index e = range.first; e < range.last; ++e) {
        add(point_pairs[e].first, point_pairs[e].second, found);
        add(point_pairs[e].second, point_pairs[e].first, found);
      }
    };
    add_all(point_pairs.inside(c), parts.inside[c]);
    add_all(point_pairs.across(c), parts.across[c]);
  });
  return parts;
}

/// i, j: points of the particles that the element joins.
template <int D>
void Neighbours<D>::add_to(FoundParts& parts, Index i, Index j, const Found& found) const {
  const Index home = chunk_of(i), away = chunk_of(j);
  if (home >= 0) (home == away ? parts.inside : parts.across)[home].push_back(found);
  if (away >= 0 && away != home) parts.across[away].push_back(found);
}

template <int D>
void Neighbours<D>::fill(PairList& list, const FoundParts& parts) {
  list.clear();
  for (const auto* half : {&parts.inside, &parts.across})
    for (const std::vector<Found>& part : *half) append(list, part);
}

/// Vertices and bare edges, from the pairs of points: a vertex near an edge is listed with the nearer end of the edge.
/// Edges that are too long for this rule need the search.
template <int D>
void Neighbours<D>::build_bare_edges(const Topology& topology, const PointCloud& cloud) requires(D == 2) {
  const Real margin = this->margin();
  const Real narrowest = least(topology.diameter);
  const auto at = [&](Index i) { return point<2>(cloud.x, i); };
  const auto d2 = [&](Index i, Index j) { return (at(i) - at(j)).squaredNorm(); };
  // Of a vertex within δ_j/2 + margin of the edge, the nearer end is within (δ_i + δ_j)/2 + margin up to this length.
  const auto is_long = [&](Real length2, Real diameter) {
    return length2 > (1 - 1e-9) * diameter * (2 * narrowest + diameter + 4 * margin);
  };
  FoundParts parts = from_points([&](Index vertex, Index end, std::vector<Found>& found) {
    const auto add = [&](Index edge) {
      if (is_long(d2(edge, topology.next[edge]), topology.diameter[edge])) return;
      const Real reach = vertex_edge_reach(Edges::bare, topology.diameter[vertex], topology.diameter[edge]);
      if (segment_foot(at(vertex), at(edge), at(topology.next[edge])).d2 < square(reach + margin))
        found.push_back({{vertex, edge}, reach});
    };
    const Real near = d2(vertex, end);
    if (near <= d2(vertex, topology.next[end])) add(end);
    if (near < d2(vertex, topology.previous[end])) add(topology.previous[end]);
  });
  if constexpr (D == 2)  // Clang 14 compiles this for D = 3 too, despite the requires clause.
    if (is_long(square(longest_), narrowest))
      for (Index i = 0; i < topology.points(); ++i) {
        if (!is_long(d2(i, topology.next[i]), topology.diameter[i])) continue;
        find_vertex_edge_pairs(cloud, grid_, Edges::bare, margin, widest_, i, i + 1, [&](Index j, Index, Real reach) {
          add_to(parts, i, j, {{j, i}, reach});
        });
      }
  fill(vertex_edges, parts);
}

/// Vertices and bare faces, from the pairs of points: a vertex near a face is listed with the nearest corner of the
/// face. Faces that are too large for this rule need the search.
template <int D>
void Neighbours<D>::build_bare_faces(const Topology& topology, const Real* x) requires(D == 3) {
  const Real margin = this->margin();
  const Real narrowest = least(topology.diameter);
  const auto at = [&](Index i) { return point<3>(x, i); };
  const auto d2 = [&](Index i, Index j) { return (at(i) - at(j)).squaredNorm(); };
  const auto longest2 = [&](const std::array<Index, 3>& r) {
    return std::max({d2(r[0], r[1]), d2(r[1], r[2]), d2(r[2], r[0])});
  };
  // Every place of a face is within longest/√3 of a corner. Of a vertex within δ_j/2 + margin of the face, the nearest
  // corner is therefore within (δ_i + δ_j)/2 + margin up to this length.
  const auto is_large = [&](Real length2, Real diameter) {
    return length2 > (1 - 1e-9) * 0.75 * diameter * (2 * narrowest + diameter + 4 * margin);
  };
  std::vector<Real> around(topology.points());  // square of the longest edge of the faces at each point
  std::vector<std::uint8_t> has_large(topology.particles());
#pragma omp parallel for if (chunks() > 1)
  for (Index m = 0; m < topology.particles(); ++m) {
    const Index first = topology.offset[m];
    for (const auto& [a, b, c] : topology.surfaces->of(topology, m).faces) {
      const Real length2 = longest2({first + a, first + b, first + c});
      if (is_large(length2, topology.diameter[first])) {
        has_large[m] = 1;
        continue;
      }
      for (const Index corner : {a, b, c}) around[first + corner] = std::max(around[first + corner], length2);
    }
  }
  FoundParts parts = from_points([&](Index vertex, Index end, std::vector<Found>& found) {
    const Index m = topology.particle[end];
    const Real reach = vertex_edge_reach(Edges::bare, topology.diameter[vertex], topology.diameter[end]);
    const Real near = d2(vertex, end), range2 = square(reach + margin);
    if (near > (1 + 1e-9) * (range2 + around[end] / 3)) return;
    const std::vector<Face>& faces = topology.surfaces->of(topology, m).faces;
    for (std::size_t k = 0; k < faces.size(); ++k) {
      const Index face = first_face(topology, m) + static_cast<Index>(k);
      const std::array<Index, 3> corners = points_of_face(topology, face);
      const auto own = std::ranges::find(corners, end);
      if (own == corners.end() || is_large(longest2(corners), topology.diameter[end])) continue;
      const bool nearest = std::all_of(corners.begin(), own, [&](Index i) { return near < d2(vertex, i); }) &&
                           std::all_of(own, corners.end(), [&](Index i) { return near <= d2(vertex, i); });
      const FourPoints r{at(vertex), at(corners[0]), at(corners[1]), at(corners[2])};
      if (nearest && VertexOnFace(r).d2() < range2) found.push_back({{vertex, face}, reach});
    }
  });
  for (Index m = 0; m < topology.particles(); ++m) {
    if (has_large[m] == 0) continue;
    const Index first = topology.offset[m];
    const auto large = [&](Index k) {
      return is_large(longest2(points_of_face(topology, first_face(topology, m) + k)), topology.diameter[first]);
    };
    boxes_.for_each_near(topology, m, {}, [&](Index n) {
      const Real reach =
          vertex_edge_reach(Edges::bare, topology.diameter[topology.offset[n]], topology.diameter[first]);
      find_vertex_faces(topology, boxes_, x, reach, margin, n, m, large, [&](const Pair& pair) {
        add_to(parts, first, pair.first, {pair, reach});
      });
    });
  }
  fill(vertex_faces, parts);
}

template <int D>
void Neighbours<D>::rebuild(const Topology& topology, const Walls<D>& wall, const Real* x, Real t) {
  const Index n = topology.points();
  const std::size_t coordinates = static_cast<std::size_t>(n) * D;
  if (const std::size_t bad = first_non_finite(x, coordinates); bad < coordinates) {
    const Index m = topology.particle[bad / D];
    throw NumericalError("position of point {} of particle {} is not finite; use {}", bad / D - topology.offset[m],
                         topology.id[m], cures({Cure::shorter_step, Cure::softer_particles}));
  }

  divide(topology);
  widen();
  time_ = t;
  Real mean = 0;
  widest_ = 0;
  for (const Real d : topology.diameter) {
    mean += d;
    widest_ = std::max(widest_, d);
  }
  Real longest = 0;  // squared
  if (needs_.vertex_edges) {
#pragma omp parallel for reduction(max : longest) if (chunks() > 1)
    for (Index i = 0; i < n; ++i)
      longest = std::max(longest, (point<D>(x, topology.next[i]) - point<D>(x, i)).squaredNorm());
  }
  longest_ = std::sqrt(longest);
  const SearchSpace<D> space = search_space(topology, wall, x);
  if (needs_.point_pairs || needs_.vertex_edges) {
    // Cells as wide as the mean reach of a point: a search then visits a few cells of a few points each.
    grid_.build(x, topology.diameter.data(), n, mean / n + margin(), [&](Index i) { return space.cloud.uses(i); });
  }
  if constexpr (D == 3)
    if (needs_.surface_parts() && topology.surfaces) boxes_.build(topology, x, margin());
  for_each_list([&]<class Kind>(Kind) {
    if (!(needs_.*Kind::need)) return;
    if (needs_.point_pairs && needs_.edges == Edges::bare) {
      // The dimension alone, because Clang 14 looks up functions in branches that depend on the kind.
      if constexpr (D == 2) {
        if constexpr (std::is_same_v<Kind, ElementKind<Elements::vertex_edges>>)
          return build_bare_edges(topology, space.cloud);
      } else if constexpr (std::is_same_v<Kind, ElementKind<Elements::vertex_faces>>) {
        if (topology.surfaces) return build_bare_faces(topology, x);
      }
    }
    if constexpr (Kind::paired)
      build_pairs<Kind>(space);
    else
      build_own<Kind>(space);
  });
  resize_large(reference_, static_cast<std::size_t>(topology.owned_points()) * D);
  reference_.assign(x, x + static_cast<std::size_t>(topology.owned_points()) * D);
  deformation_.setIdentity();
  shortened_ = 0;
  relisted_.clear();
  old_places_.clear();
  places_.clear();
  built_ = true;
  ++rebuilds_;
  ++version_;
}

template <int D>
void Neighbours<D>::narrow(const Topology& topology, const Real* x, Real range) {
  if constexpr (D == 2) {
    near_edges_.clear();
    for (std::size_t part = 1; part < vertex_edges.start.size(); ++part) {
      const Index first = vertex_edges.start[part - 1], last = vertex_edges.start[part];
      add_near_pairs(std::span(vertex_edges.pairs).subspan(first, last - first), vertex_edges.reach.data() + first,
                     range, topology.next.data(), x, near_edges_.pairs, near_edges_.reach);
      near_edges_.start.push_back(near_edges_.size());
    }
  } else {
    narrow_simplices<ElementKind<Elements::vertex_faces>>(topology, x, range, add_near_vertex_faces,
                                                          near_vertex_faces_);
    narrow_simplices<ElementKind<Elements::edge_pairs>>(topology, x, range, add_near_edge_pairs, near_edge_pairs_);
  }
  narrowed_ = true;
}

template <int D>
template <class Kind, class Add>
void Neighbours<D>::narrow_simplices(const Topology& topology, const Real* x, Real range, Add&& add_near,
                                     NearSimplices& near) {
  const PairList& list = this->*Kind::list;
  const std::size_t parts = list.start.empty() ? 0 : list.start.size() - 1;
  near.resize(parts);
  ParallelErrors errors;
#pragma omp parallel for schedule(dynamic, 1) if (parts > 2)
  for (std::size_t part = 0; part < parts; ++part)
    errors.catch_from([&] {
      near[part].clear();
      for_each_block<Kind>(topology, list, {list.start[part], list.start[part + 1]},
                           [&](std::span<const SimplexPair> pairs) { add_near(pairs, range, x, near[part]); });
    });
  errors.rethrow();
}

template <class Unwanted>
void PairList::erase(Unwanted&& unwanted) {
  Index kept = 0, e = 0;
  for (std::size_t part = 1; part < start.size(); ++part) {
    for (; e < start[part]; ++e) {
      if (unwanted(pairs[e])) continue;
      if (!reach.empty()) reach[kept] = reach[e];
      pairs[kept++] = pairs[e];
    }
    start[part] = kept;
  }
  pairs.resize(kept);
  if (!reach.empty()) reach.resize(kept);
}

void PairList::insert(Index chunk, bool across_border, const Pair& pair, Real contact) {
  const std::size_t part = static_cast<std::size_t>(across_border ? chunks() + chunk : chunk) + 1;
  pairs.insert(pairs.begin() + start[part], pair);
  if (contact > 0) reach.insert(reach.begin() + start[part], contact);
  for (std::size_t k = part; k < start.size(); ++k) ++start[k];
}

template <int D>
void Neighbours<D>::relist(const Topology& topology, const Walls<D>& wall, const Real* x, Index m) {
  const Range own{topology.offset[m], topology.offset[m + 1]};
  const auto begin = static_cast<std::ptrdiff_t>(own.first) * D, end = static_cast<std::ptrdiff_t>(own.last) * D;
  relisted_.push_back(m);
  widen();
  ++version_;
  old_places_.insert(old_places_.end(), reference_.begin() + begin, reference_.begin() + end);
  places_.insert(places_.end(), x + begin, x + end);
  std::copy(x + begin, x + end, reference_.begin() + begin);
  if constexpr (D == 3)
    if (needs_.surface_parts() && topology.surfaces) boxes_.move(topology, x, m);
  // Points near it, at the reference positions of the lists. The grid has the old places of relisted particles.
  const SearchSpace<D> space = search_space(topology, wall, reference_.data());
  const auto for_each_near = [&](const Vec<D>& low, const Vec<D>& high, auto&& visit) {
    const auto visit_others = [&](Index j) {
      if (topology.particle[j] != m && space.cloud.uses(j)) visit(j);
    };
    grid_.for_each_in_box(low, high, visit_others);
    for (const Index n : relisted_)
      for (Index j = topology.offset[n]; j < topology.offset[n + 1]; ++j) visit_others(j);
  };
  const Index home = chunk_of(own.first);
  for_each_list([&]<class Kind>(Kind) {
    PairList& list = this->*Kind::list;
    list.erase([&](const Pair& pair) {
      const auto points = Kind::stencil(topology, pair);
      return std::any_of(points.begin(), points.end(), [&](Index i) { return own.contains(i); });
    });
    if (!(needs_.*Kind::need)) return;
    if constexpr (!Kind::paired) {
      Kind::search(space, own.first, own.last, [&](Index a, Index b) { list.insert(home, false, {a, b}); });
    } else {
      near_.clear();
      const auto found = [&](Index a, Index b, Real contact) { near_.push_back({{a, b}, contact}); };
      if constexpr (Kind::of_surfaces) {
        if (topology.surfaces)
          boxes_.for_each_near(topology, m, relisted_, [&](Index n) { Kind::test_surfaces(space, m, n, found); });
      } else {
        for (Index i = own.first; i < own.last; ++i) {
          const auto [low, high] = Kind::near(space, i);
          for_each_near(low, high, [&](Index j) { Kind::test(space, i, j, found); });
        }
      }
      std::sort(near_.begin(), near_.end(), [](const Found& a, const Found& b) { return a.pair < b.pair; });
      near_.erase(
          std::unique(near_.begin(), near_.end(), [](const Found& a, const Found& b) { return a.pair == b.pair; }),
          near_.end());
      for (const auto& [pair, contact] : near_) {
        const Pair points = Kind::points_of_both(pair);
        const Index away = chunk_of(own.contains(points.first) ? points.second : points.first);
        list.insert(home, away != home, pair, contact);
        if (away != home) list.insert(away, true, Kind::symmetric ? Pair{pair.second, pair.first} : pair, contact);
      }
    }
  });
}

template <int D>
typename Neighbours<D>::History Neighbours<D>::history(const Topology& topology) const {
  History history{reference_, relisted_, places_, time_};
  std::size_t end = old_places_.size();
  for (std::size_t k = relisted_.size(); k-- > 0;) {
    const Index first = topology.offset[relisted_[k]], last = topology.offset[relisted_[k] + 1];
    const std::size_t count = static_cast<std::size_t>(last - first) * D;
    end -= count;
    std::copy_n(&old_places_[end], count, &history.reference[static_cast<std::size_t>(first) * D]);
  }
  return history;
}

template <int D>
void Neighbours<D>::replay(const Topology& topology, const Walls<D>& wall, const History& history) {
  rebuild(topology, wall, history.reference.data(), history.time);
  std::vector<Real> x = history.reference;
  std::size_t from = 0;
  for (const Index m : history.relisted) {
    const Index first = topology.offset[m], last = topology.offset[m + 1];
    const std::size_t count = static_cast<std::size_t>(last - first) * D;
    std::copy_n(&history.places[from], count, &x[static_cast<std::size_t>(first) * D]);
    from += count;
    relist(topology, wall, x.data(), m);
  }
}

template class Neighbours<2>;
template class Neighbours<3>;

}  // namespace pliant
