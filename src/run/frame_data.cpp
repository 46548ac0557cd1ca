#include <pliant/run/frame_data.h>

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <span>
#include <tuple>
#include <utility>

#include <pliant/model/polygon.h>
#include <pliant/model/surface.h>
#include <pliant/run/wall_contacts.h>
#include <pliant/system/stress.h>

namespace pliant {
namespace {

/// Equal shares of the ids 0 … total − 1, one after the other.
class IdShares {
 public:
  IdShares(const Ranks& ranks, const Topology& topology)
      : total_(ranks.sum(std::int64_t{topology.owned()})), ranks_(ranks.size()) {}
  std::size_t rank_of(Index id) const { return static_cast<std::size_t>(id * ranks_ / total_); }
  Index first(int rank) const { return static_cast<Index>((rank * total_ + ranks_ - 1) / ranks_); }

 private:
  std::int64_t total_, ranks_;
};

/// Values per particle or point, moved to the rank that has their ids' share, into the order of the ids.
class NaturalOrder {
 public:
  NaturalOrder(const Ranks& ranks, const IdShares& shares, const Topology& topology)
      : ranks_(ranks), topology_(topology), particles_(ranks.size(), 0), points_(ranks.size(), 0) {
    leaving_ = sorted(std::span(topology.id).first(topology.owned()));
    std::vector<Index> id;
    for (const Index m : leaving_) {
      const std::size_t rank = shares.rank_of(topology.id[m]);
      ++particles_[rank];
      points_[rank] += topology.points_of(m);
      id.push_back(topology.id[m]);
      arrived_points_.push_back(topology.points_of(m));
    }
    arrived_ = sorted(ranks.exchange(std::move(id), particles_));
    arrived_points_ = ranks.exchange(std::move(arrived_points_), particles_);
  }

  /// [particles + 1]
  std::vector<Index> offset() const {
    std::vector<Index> offset{0};
    for (const Index k : arrived_) offset.push_back(offset.back() + arrived_points_[k]);
    return offset;
  }
  /// values [owned particles · width]
  template <class T>
  std::vector<T> particles(std::span<const T> values, int width = 1) const {
    return moved(
        values, particles_, width, [&](Index m) { return m; }, [](Index) { return 1; });
  }
  /// values [owned points · width]
  std::vector<Real> points(std::span<const Real> values, int width) const {
    return moved(
        values, points_, width, [&](Index m) { return topology_.offset[m]; },
        [&](Index k) { return arrived_points_[k]; });
  }

 private:
  /// Numbers of the values in increasing order of these.
  static std::vector<Index> sorted(std::span<const Index> values) {
    std::vector<Index> order(values.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](Index a, Index b) { return values[a] < values[b]; });
    return order;
  }

  /// `count` rows for each rank: the rows of particle m from first(m) to first(m + 1); the k-th to arrive has
  /// length(k).
  template <class T, class First, class Length>
  std::vector<T> moved(std::span<const T> values, std::vector<std::size_t> count, int width, First first,
                       Length length) const {
    std::vector<T> packed;
    packed.reserve(static_cast<std::size_t>(first(topology_.owned())) * width);
    for (const Index m : leaving_) {
      const auto part = values.subspan(static_cast<std::size_t>(first(m)) * width,
                                       static_cast<std::size_t>(first(m + 1) - first(m)) * width);
      packed.insert(packed.end(), part.begin(), part.end());
    }
    if (!ranks_.several()) return packed;
    for (std::size_t& c : count) c *= width;
    const std::vector<T> all = ranks_.exchange(std::move(packed), count);
    std::vector<std::size_t> start{0};
    for (std::size_t k = 0; k < arrived_.size(); ++k)
      start.push_back(start.back() + static_cast<std::size_t>(length(static_cast<Index>(k))) * width);
    std::vector<T> ordered;
    ordered.reserve(all.size());
    for (const Index k : arrived_)
      ordered.insert(ordered.end(), all.begin() + static_cast<std::ptrdiff_t>(start[k]),
                     all.begin() + static_cast<std::ptrdiff_t>(start[k + 1]));
    return ordered;
  }

  const Ranks& ranks_;
  const Topology& topology_;
  std::vector<Index> leaving_;                   ///< own particles, by id
  std::vector<std::size_t> particles_, points_;  ///< numbers of particles and points that go to each rank
  std::vector<Index> arrived_;                   ///< numbers of those that came, by id
  std::vector<Index> arrived_points_;            ///< of those that came, as they came
};

/// Moves contacts to the rank that has the share of their first particle, in order.
template <int D>
void share_contacts(std::vector<ContactRecord<D>>& contacts, const Ranks& ranks, const IdShares& shares) {
  const auto sort = [&] {
    std::sort(contacts.begin(), contacts.end(), [](const auto& a, const auto& b) {
      return std::tie(a.particles[0], a.particles[1], a.position) <
             std::tie(b.particles[0], b.particles[1], b.position);
    });
  };
  sort();
  std::vector<std::size_t> count(ranks.size(), 0);
  for (const ContactRecord<D>& c : contacts) ++count[shares.rank_of(c.particles[0])];
  contacts = ranks.exchange(std::move(contacts), count);
  if (ranks.several()) sort();
}

/// The number of contacts of each particle of this rank's share.
template <int D>
std::vector<Index> count_contacts(const std::vector<ContactRecord<D>>& contacts, const Ranks& ranks,
                                  const IdShares& shares) {
  std::vector<Index> ids;
  for (const ContactRecord<D>& c : contacts) ids.insert(ids.end(), c.particles.begin(), c.particles.end());
  std::sort(ids.begin(), ids.end());
  std::vector<std::size_t> count(ranks.size(), 0);
  for (const Index id : ids) ++count[shares.rank_of(id)];
  ids = ranks.exchange(std::move(ids), count);
  const Index first = shares.first(ranks.rank());
  std::vector<Index> contacts_of(static_cast<std::size_t>(shares.first(ranks.rank() + 1) - first), 0);
  for (const Index id : ids) ++contacts_of[id - first];
  return contacts_of;
}

template <int D>
FrameContacts listed(const std::vector<ContactRecord<D>>& contacts) {
  if (contacts.empty()) return {};
  const ContactRecord<D>& c = contacts.front();
  constexpr std::size_t stride = sizeof c;
  const bool friction = std::any_of(contacts.begin(), contacts.end(),
                                    [](const ContactRecord<D>& one) { return one.friction != std::array<Real, D>{}; });
  return {contacts.size(),
          {c.particles.data(), stride},
          {c.position.data(), stride},
          {c.normal.data(), stride},
          {&c.overlap, stride},
          {c.force.data(), stride},
          {friction ? c.friction.data() : nullptr, stride}};
}

/// Adds forces of elements to contacts. The force of an element that is not a contact belongs to the contact with the
/// largest overlap of its point (the first one) with the other particle, or else of its two particles; without a
/// contact it is not a contact force.
template <int D>
class ContactForces {
 public:
  ContactForces(const Topology& topology, std::vector<ContactRecord<D>>& contacts)
      : topology_(topology), contacts_(contacts) {}

  /// The next contact in the list; first: the particle that its force acts on.
  void add(const Contact<D>& c, Index first) {
    std::vector<Index>& own = contact_of_[static_cast<std::size_t>(c.elements)];
    if (const auto element = static_cast<std::size_t>(c.element); own.size() <= element) own.resize(element + 1, none);
    own[static_cast<std::size_t>(c.element)] = static_cast<Index>(places_.size());
    places_.push_back({first, c.first + c.second - first, c.point});
  }
  void add(const PairForce<D>& f) {
    const std::vector<Index>& own = contact_of_[static_cast<std::size_t>(f.elements)];
    const auto element = static_cast<std::size_t>(f.element);
    if (element < own.size() && own[element] != none)
      add(f, own[element]);
    else
      others_.push_back(f);
  }
  /// Call last.
  void add_others() {
    if (others_.empty()) return;
    std::map<std::pair<Index, Index>, std::vector<Index>> of_pair;
    for (std::size_t k = 0; k < places_.size(); ++k)
      of_pair[std::minmax(places_[k].first, places_[k].second)].push_back(static_cast<Index>(k));
    // The same sums on any number of ranks.
    std::stable_sort(others_.begin(), others_.end(), [](const PairForce<D>& a, const PairForce<D>& b) {
      return std::lexicographical_compare(a.force.begin(), a.force.end(), b.force.begin(), b.force.end());
    });
    for (const PairForce<D>& f : others_) {
      const Index first = topology_.particle[f.points.first], second = topology_.particle[f.points.second];
      const auto found = of_pair.find(std::minmax(first, second));
      if (found == of_pair.end()) continue;
      const auto rank = [&](Index k) {
        return std::pair(places_[static_cast<std::size_t>(k)].point == f.points.first,
                         contacts_[static_cast<std::size_t>(k)].overlap);
      };
      add(f, *std::max_element(found->second.begin(), found->second.end(),
                               [&](Index a, Index b) { return rank(a) < rank(b); }));
    }
  }

 private:
  struct Place {
    Index first, second, point;
  };
  static constexpr Index none = -1;

  void add(const PairForce<D>& f, Index contact) {
    ContactRecord<D>& r = contacts_[static_cast<std::size_t>(contact)];
    const Real sign = topology_.particle[f.points.first] == places_[static_cast<std::size_t>(contact)].first ? 1 : -1;
    for (int k = 0; k < D; ++k) {
      r.force[k] += sign * f.force[k];
      if (!f.elastic) r.friction[k] += sign * f.force[k];
    }
  }

  const Topology& topology_;
  std::vector<ContactRecord<D>>& contacts_;
  std::vector<Place> places_;                                 ///< [contacts]
  std::array<std::vector<Index>, element_kinds> contact_of_;  ///< for each kind: the contact of each element
  std::vector<PairForce<D>> others_;
};

}  // namespace

template <int D>
void Centres<D>::update(const Topology& topology, const State& state) {
  const std::size_t n = static_cast<std::size_t>(topology.owned()) * D;
  position.resize(n);
  velocity.resize(n);
  for (Index m = 0; m < topology.owned(); ++m) {
    point<D>(position.data(), m) = mean_of_points<D>(state.x().data(), topology, m);
    point<D>(velocity.data(), m) = mean_of_points<D>(state.v().data(), topology, m);
  }
}

template <int D>
FrameData<D>::FrameData(ParticleSystem<D>& system, const State& state, const std::vector<Index>* reinsertions,
                        bool wall_contacts, bool stress, const std::vector<Real>* modes) {
  const StateView<D> view = system.view(state.x().data(), state.v().data(), state.t);
  const Topology& topology = system.topology();
  const Ranks& ranks = system.ranks();
  wall_force_.assign(static_cast<std::size_t>(system.walls().size()) * D, 0);
  // Where a run has failed, a rank may have a configuration without forces.
  ranks.together([&] {
    system.field().add_wall_forces(view, wall_force_.data());
    find_contacts(system, view);
    if (wall_contacts) wall_contacts_ = find_wall_contacts(system, view);
  });
  ranks.sum(wall_force_);

  const IdShares shares(ranks, topology);
  const NaturalOrder order(ranks, shares, topology);
  offset_ = order.offset();
  State wrapped;
  if (!system.box().open()) {
    wrapped.assign(state.x(), state.v());
    wrapped.images = state.images;
    system.wrap(wrapped);
    std::vector<std::int64_t> images;
    for (const Image& image : wrapped.images) images.insert(images.end(), image.begin(), image.begin() + D);
    images_ = order.particles<std::int64_t>(images, D);
    const Box<D>& box = system.box();
    for (const Vec<D>& row : {box.origin(), box.length()}) box_.insert(box_.end(), row.begin(), row.end());
    box_.insert(box_.end(), box.tilt().begin(), box.tilt().end());
    box_.resize(3 * D);
  }
  const State& shown = system.box().open() ? state : wrapped;
  positions_ = order.points(shown.x(), D);
  velocities_ = order.points(shown.v(), D);
  if (const int width = system.coordinates().angles; width > 0) {
    angles_ = order.points(system.rotations_in(state.x()), width);
    spins_ = order.points(system.rotations_in(state.v()), width);
  }
  active_ = order.particles<std::uint8_t>(std::span(topology.active).first(topology.owned()));
  if (ranks.any(topology.deformable())) {
    Centres<D> centres;
    centres.update(topology, shown);
    centres_ = order.particles<Real>(centres.position, D);
    std::vector<Real> content, rim;
    for (Index m = 0; m < topology.owned(); ++m) {
      const Real* const x = state.x().data();
      if constexpr (D == 2) {
        content.push_back(polygon_area(x, topology, m));
        rim.push_back(polygon_perimeter(x, topology, m));
      } else {
        const Surface& surface = topology.surfaces->of(topology, m);
        content.push_back(surface_volume(x, topology, surface, m));
        rim.push_back(surface_area(x, topology, surface, m));
      }
    }
    content_ = order.particles<Real>(content);
    rim_ = order.particles<Real>(rim);
  }
  if (stress) {
    std::vector<Real> upper;
    for (const Mat<D>& m : particle_stress(system, state.x(), state.v(), state.t)) {
      const std::vector<Real> own = upper_triangle<D>(m);
      upper.insert(upper.end(), own.begin(), own.end());
    }
    particle_stress_ = order.particles<Real>(upper, D * (D + 1) / 2);
  }
  if (modes != nullptr && topology.owned_points() > 0) {
    frame.mode_width = modes->size() / static_cast<std::size_t>(topology.owned_points());
    modes_ = order.points(*modes, static_cast<int>(frame.mode_width));
  }
  if (reinsertions != nullptr) reinsertions_ = order.particles<Index>(*reinsertions);
  contact_count_ = count_contacts(contacts_, ranks, shares);
  share_contacts(contacts_, ranks, shares);
  share_contacts(wall_contacts_, ranks, shares);

  frame.time = state.t;
  frame.step = state.step;
  frame.offset = offset_;
  frame.positions = positions_;
  frame.velocities = velocities_;
  frame.angles = angles_;
  frame.spins = spins_;
  frame.centres = centres_.empty() ? positions_ : centres_;
  frame.active = active_;
  frame.images = images_;
  frame.box = box_;
  frame.reinsertions = reinsertions_;
  frame.contact_count = contact_count_;
  frame.particle_stress = particle_stress_;
  frame.modes = modes_;
  (D == 2 ? frame.area : frame.volume) = content_;
  (D == 2 ? frame.perimeter : frame.surface_area) = rim_;
  frame.wall_force = wall_force_;
  frame.contacts = listed(contacts_);
  frame.wall_contacts = listed(wall_contacts_);
}

template <int D>
void FrameData<D>::find_contacts(ParticleSystem<D>& system, const StateView<D>& view) {
  const Topology& topology = system.topology();
  // Capacity for every listed pair: growing would copy, and untouched memory costs nothing.
  contacts_.reserve(static_cast<std::size_t>(system.neighbours().pairs()));
  ContactForces<D> forces(topology, contacts_);
  system.field().for_each_contact(view, [&](const Contact<D>& c) {
    const bool in_order = topology.id[c.first] < topology.id[c.second];
    const Index first = in_order ? c.first : c.second, second = in_order ? c.second : c.first;
    const Real sign = in_order ? 1 : -1;
    const Vec<D> from = mean_of_points<D>(view.x, topology, first);
    ContactRecord<D>& r = contacts_.emplace_back();
    r.particles = {topology.id[first], topology.id[second]};
    r.overlap = c.overlap;
    const Vec<D> shift = system.box().shift(system.box().image_of(from));  // to where the first is drawn
    for (int k = 0; k < D; ++k) {
      r.position[k] = c.position[k] - shift[k];
      r.normal[k] = sign * c.normal[k];
      r.force[k] = c.elements == Elements::point_pairs ? sign * c.force[k] : 0;
      r.friction[k] = 0;
    }
    forces.add(c, first);
  });
  // Several elements of vertices, edges and faces act at one contact.
  system.field().for_each_pair_force(view, [&](const PairForce<D>& f) { forces.add(f); });
  forces.add_others();
}

template struct Centres<2>;
template struct Centres<3>;
template class FrameData<2>;
template class FrameData<3>;

}  // namespace pliant
