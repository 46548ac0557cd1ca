#include <pliant/jamming/contact_network.h>

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include <pliant/model/polygon.h>

namespace pliant {
namespace {

/// The two particles of a contact, which the view numbers.
template <int D>
std::pair<Index, Index> pair_of(const Contact<D>& c) {
  return std::minmax(c.first, c.second);
}

/// Visits the contacts of each pair of particles, pair by pair: visit(pair, contacts).
template <int D, class Visit>
void for_each_pair(const std::vector<Contact<D>>& sorted, Visit&& visit) {
  for (auto first = sorted.begin(); first != sorted.end();) {
    const auto pair = pair_of<D>(*first);
    const auto last = std::find_if(first, sorted.end(), [&](const Contact<D>& c) { return pair_of<D>(c) != pair; });
    visit(pair, std::span(first, last));
    first = last;
  }
}

/// Contacts, sorted by their pair. Forces at the same place are one contact.
template <int D>
std::vector<Contact<D>> find_contacts(const ForceField<D>& field, const StateView<D>& s) {
  std::vector<Contact<D>> found, merged;
  field.for_each_contact(s, [&](const Contact<D>& c) {
    const bool pushes = c.overlap > 0, pulls = c.force.dot(c.normal) < 0;
    if ((pushes || pulls) && c.first != c.second) found.push_back(c);
  });
  std::ranges::stable_sort(found, {}, pair_of<D>);
  merged.reserve(found.size());
  for_each_pair<D>(found, [&](const auto&, std::span<const Contact<D>> contacts) {
    constexpr Real same_place = 1e-6;  // in contact distances
    const auto of_pair = static_cast<std::ptrdiff_t>(merged.size());
    for (const Contact<D>& c : contacts) {
      const auto same = std::find_if(merged.begin() + of_pair, merged.end(), [&](const Contact<D>& other) {
        return (other.position - c.position).norm() < same_place * c.reach;
      });
      if (same == merged.end())
        merged.push_back(c);
      else
        same->force += c.first == same->first ? c.force : -c.force;
    }
  });
  return merged;
}

/// Ids of the rattlers. Removes their pairs.
template <int D>
std::vector<Index> remove_rattlers(const Topology& topology, std::vector<TouchingPair<D>>& pairs) {
  struct Particle {
    Index id = 0, needed_neighbours = 0, needed_contacts = 0, neighbours = 0, contacts = 0;
    std::vector<std::size_t> pairs = {};
    bool held() const { return neighbours >= needed_neighbours && contacts >= needed_contacts; }
  };
  std::vector<Particle> particles(static_cast<std::size_t>(topology.owned()));  // by id
  for (Index m = 0; m < topology.owned(); ++m)
    if (topology.active[m] != 0)
      particles.at(topology.id[m]) = {topology.id[m], topology.points_of(m) > 1 ? 2 : 0, D + 1};
  for (std::size_t k = 0; k < pairs.size(); ++k)
    for (const Index id : {pairs[k].first, pairs[k].second}) {
      Particle& particle = particles.at(id);
      ++particle.neighbours;
      particle.contacts += pairs[k].contacts;
      particle.pairs.push_back(k);
    }

  std::vector<Index> rattlers;
  std::vector<bool> dropped(pairs.size());
  std::vector<Particle*> unheld;
  for (Particle& particle : particles)
    if (!particle.held()) unheld.push_back(&particle);
  while (!unheld.empty()) {
    const Particle& rattler = *unheld.back();
    unheld.pop_back();
    rattlers.push_back(rattler.id);
    for (const std::size_t k : rattler.pairs) {
      if (dropped[k]) continue;
      dropped[k] = true;
      for (const Index id : {pairs[k].first, pairs[k].second}) {
        Particle& particle = particles.at(id);
        const bool was_held = particle.held();
        --particle.neighbours;
        particle.contacts -= pairs[k].contacts;
        if (was_held && !particle.held()) unheld.push_back(&particle);
      }
    }
  }
  std::vector<TouchingPair<D>> kept;
  for (std::size_t k = 0; k < pairs.size(); ++k)
    if (!dropped[k]) kept.push_back(pairs[k]);
  pairs = std::move(kept);
  std::ranges::sort(rattlers);
  return rattlers;
}

}  // namespace

template <int D>
ContactNetwork<D> contact_network(ParticleSystem<D>& system, std::span<const Real> x, Real threshold) {
  if (!(threshold >= 0 && threshold < 1))
    throw InputError(
        "the threshold of contact forces is {}; it must be a fraction of the typical force, at least 0 and below 1",
        threshold);
  if (system.ranks().several())
    throw InputError("contact networks are found on one rank, not on {}; use one process", system.ranks().size());
  if (system.walls().size() > 0)
    throw InputError("contact networks count no contacts with walls, but there are {} walls; use a box without walls",
                     system.walls().size());
  const StateView<D> s = system.view(x.data(), nullptr);
  const Topology& topology = s.topology;
  const std::vector<Contact<D>> contacts = find_contacts(system.field(), s);

  ContactNetwork<D> network;
  Real sum = 0, squares = 0;
  for (const Contact<D>& c : contacts) {
    sum += c.force.norm();
    squares += c.force.squaredNorm();
  }
  network.typical_force = sum > 0 ? squares / sum : 0;
  for_each_pair<D>(contacts, [&](const auto& particles, std::span<const Contact<D>> of_pair) {
    const auto [m, n] = particles;
    TouchingPair<D> pair{topology.id[m], topology.id[n], mean_of_points<D>(s.x, topology, n), Vec<D>::Zero(), 0};
    pair.branch -= mean_of_points<D>(s.x, topology, m);
    for (const Contact<D>& c : of_pair) {
      if (threshold > 0 && c.force.norm() <= threshold * network.typical_force) continue;
      pair.force += c.first == m ? c.force : -c.force;
      ++pair.contacts;
    }
    if (pair.contacts > 0) network.pairs.push_back(pair);
  });

  network.rattlers = remove_rattlers<D>(topology, network.pairs);
  network.backbone =
      static_cast<Index>(std::count(topology.active.begin(), topology.active.begin() + topology.owned(), 1)) -
      static_cast<Index>(network.rattlers.size());
  for (const TouchingPair<D>& pair : network.pairs) network.contacts += pair.contacts;
  return network;
}

template ContactNetwork<2> contact_network(ParticleSystem<2>&, std::span<const Real>, Real);
template ContactNetwork<3> contact_network(ParticleSystem<3>&, std::span<const Real>, Real);

}  // namespace pliant
