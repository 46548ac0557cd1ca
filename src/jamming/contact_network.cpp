#include <pliant/jamming/contact_network.h>

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include <pliant/model/polygon.h>

namespace pliant {
namespace {

/// Contacts of one pair of particles, which the view numbers.
template <int D>
using ContactsOfPairs = std::map<std::pair<Index, Index>, std::vector<Contact<D>>>;

/// Adds the contact, or its force to a contact at the same place.
template <int D>
void add(std::vector<Contact<D>>& contacts, const Contact<D>& contact) {
  constexpr Real same_place = 1e-6;  // in contact distances
  for (Contact<D>& other : contacts)
    if ((other.position - contact.position).norm() < same_place * contact.reach) {
      other.force += contact.first == other.first ? contact.force : -contact.force;
      return;
    }
  contacts.push_back(contact);
}

template <int D>
ContactsOfPairs<D> find_contacts(const ForceField<D>& field, const StateView<D>& s) {
  ContactsOfPairs<D> found;
  field.for_each_contact(s, [&](const Contact<D>& c) {
    const bool pushes = c.overlap > 0, pulls = c.force.dot(c.normal) < 0;
    if ((pushes || pulls) && c.first != c.second) add(found[std::minmax(c.first, c.second)], c);
  });
  return found;
}

/// Ids of the rattlers. Removes their pairs.
template <int D>
std::vector<Index> remove_rattlers(const Topology& topology, std::vector<TouchingPair<D>>& pairs) {
  struct Particle {
    Index id, needed_neighbours, needed_contacts, neighbours = 0, contacts = 0;
    std::vector<std::size_t> pairs = {};
    bool held() const { return neighbours >= needed_neighbours && contacts >= needed_contacts; }
  };
  std::map<Index, Particle> particles;  // by id
  for (Index m = 0; m < topology.owned(); ++m)
    if (topology.active[m] != 0) {
      const Index neighbours = topology.points_of(m) > 1 ? 2 : 0;
      particles.emplace(topology.id[m], Particle{topology.id[m], neighbours, D + 1});
    }
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
  for (auto& [id, particle] : particles)
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
  const ContactsOfPairs<D> contacts = find_contacts(system.field(), s);

  ContactNetwork<D> network;
  Real sum = 0, squares = 0;
  for (const auto& [particles, of_pair] : contacts)
    for (const Contact<D>& c : of_pair) {
      sum += c.force.norm();
      squares += c.force.squaredNorm();
    }
  network.typical_force = sum > 0 ? squares / sum : 0;
  for (const auto& [particles, of_pair] : contacts) {
    const auto [m, n] = particles;
    TouchingPair<D> pair{topology.id[m], topology.id[n], mean_of_points<D>(s.x, topology, n), Vec<D>::Zero(), 0};
    pair.branch -= mean_of_points<D>(s.x, topology, m);
    for (const Contact<D>& c : of_pair) {
      if (threshold > 0 && c.force.norm() <= threshold * network.typical_force) continue;
      pair.force += c.first == m ? c.force : -c.force;
      ++pair.contacts;
    }
    if (pair.contacts > 0) network.pairs.push_back(pair);
  }

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
