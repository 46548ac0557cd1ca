#include <pliant/model/term_sum.h>

#include <omp.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>

#include <pliant/kernels/points.h>
#include <pliant/model/chunks.h>

namespace pliant {
namespace {

constexpr std::size_t per_page = 512;  // coordinates: each thread writes to separate pages

template <int D, class Visit>
void for_each_chunk(const StateView<D>& s, Visit&& visit) {
  pliant::for_each_chunk(s.neighbours.chunks(), std::ref(visit));  // a reference, which takes no memory
}

/// Σ value(chunk), in the same order for any number of threads.
template <int D, class Value>
Real sum_over_chunks(const StateView<D>& s, Value&& value) {
  std::array<Real, Neighbours<D>::max_chunks> part;
  for_each_chunk(s, [&](Index c) { part[c] = value(c); });
  return std::accumulate(part.begin(), part.begin() + s.neighbours.chunks(), Real(0));
}

bool belongs_to(const TermKind& kind, TermGroup group) {
  return group == TermGroup::all || kind.shape == (group == TermGroup::shape);
}

}  // namespace

template <int D>
template <class Visit>
void TermSum<D>::for_each_enabled(const StateView<D>& s, Visit&& visit) const {
  for (const auto& term : terms_)
    if (term->enabled(s)) visit(*term);
}

template <int D>
template <class Visit>
void TermSum<D>::for_each(Chosen kind, const StateView<D>& s, Visit&& visit) const {
  for_each_enabled(s, [&](const TermFunctions<D>& term) {
    if (term.kind.*kind) visit(term);
  });
}

template <int D>
NeighbourNeeds TermSum<D>::needs() const {
  NeighbourNeeds needs;
  std::optional<Edges> edges;
  for (const auto& term : terms_) term->add_needs(needs, edges);
  needs.edges = edges.value_or(Edges::wide);
  return needs;
}

template <int D>
void TermSum<D>::check_walls(const Walls<D>& walls) const {
  for (const auto& term : terms_) term->check_walls(walls);
}

template <int D>
void TermSum<D>::forces(const StateView<D>& s, Real* f) const {
  for_each_chunk(s, [&](Index chunk) { set_total(s, nullptr, chunk, f); });
}

template <int D>
bool TermSum<D>::accelerations(const StateView<D>& s, Real* a, HistoryWorkspace* workspace) const {
  std::atomic<bool> finite = true;
  for_each_chunk(s, [&](Index chunk) {
    if (!set_accelerations(s, workspace, chunk, a)) finite = false;
  });
  return finite;
}

template <int D>
bool TermSum<D>::accelerations(const StateView<D>& s, std::vector<Real>& scratch,
                               const std::function<void(Index, const Real*)>& done) const {
  if (this->rotates()) throw std::logic_error("torques are not made chunk by chunk");
  Index most = 0;
  for (Index c = 0; c < s.neighbours.chunks(); ++c) most = std::max(most, s.neighbours.points(c).size());
  // A page between them: kernels fetch ahead, to write.
  const std::size_t share = (static_cast<std::size_t>(most) * D / per_page + 2) * per_page;
  scratch.resize(share * omp_get_max_threads());
  std::atomic<bool> finite = true;
  for_each_chunk(s, [&](Index chunk) {
    // Where an array of all points would begin.
    const auto before = static_cast<std::uintptr_t>(s.neighbours.points(chunk).first) * D * sizeof(Real);
    Real* const mine = scratch.data() + share * omp_get_thread_num();
    Real* const a = reinterpret_cast<Real*>(reinterpret_cast<std::uintptr_t>(mine) - before);
    if (!set_accelerations(s, nullptr, chunk, a)) finite = false;
    done(chunk, a);
  });
  return finite;
}

template <int D>
void TermSum<D>::group_accelerations(const StateView<D>& s, TermGroup group, Real* a) const {
  for_each_chunk(s, [&](Index chunk) {
    set_group(s, group, chunk, a);
    divide_by_masses(s, chunk, a);
  });
}

template <int D>
void TermSum<D>::derivatives(const StateView<D>& s, TermGroup group, BlockSink<D>& df_dx, BlockSink<D>& df_dv) const {
  for_each_chunk(s, [&](Index chunk) {
    for_each_enabled(s, [&](const TermFunctions<D>& term) {
      if (belongs_to(term.kind, group)) term.derivatives(s, chunk, df_dx, df_dv);
    });
  });
}

template <int D>
Couplings TermSum<D>::couplings(const StateView<D>& s, TermGroup group) const {
  Couplings all;
  for_each_enabled(s, [&](const TermFunctions<D>& term) {
    if (belongs_to(term.kind, group)) term.add_couplings(all);
  });
  return all;
}

template <int D>
Real TermSum<D>::energy(const StateView<D>& s, Real* f) const {
  bool dissipative = false;
  for_each_enabled(s, [&](const TermFunctions<D>& term) { dissipative |= term.kind.dissipation || term.kind.history; });
  return sum_over_chunks(s, [&](Index chunk) {
    Real sum = 0;
    if (f != nullptr && dissipative) zero(s, chunk, f);
    for_each(&TermKind::energy, s, [&](const TermFunctions<D>& term) {
      sum = term.add_energy(s, chunk, sum);
      if (f != nullptr && dissipative) term.add_forces(s, nullptr, chunk, f);
    });
    for_each(&TermKind::history, s, [&](const TermFunctions<D>& term) { sum = term.add_energy(s, chunk, sum); });
    if (f != nullptr && !dissipative) set_total(s, nullptr, chunk, f);
    return sum;
  });
}

template <int D>
std::vector<TermVirial<D>> TermSum<D>::virials(const StateView<D>& s) const {
  std::vector<TermVirial<D>> all;
  const auto add = [&](const TermFunctions<D>& term) {
    std::array<Mat<D>, Neighbours<D>::max_chunks> part;
    for_each_chunk(s, [&](Index c) { part[c] = term.virial(s, c); });
    all.push_back({std::string(term.name()), Mat<D>::Zero()});
    for (Index c = 0; c < s.neighbours.chunks(); ++c) all.back().virial += part[c];
  };
  for_each(&TermKind::energy, s, add);
  for_each(&TermKind::history, s, add);
  return all;
}

template <int D>
std::vector<Mat<D>> TermSum<D>::particle_virials(const StateView<D>& s) const {
  std::vector<Mat<D>> sums(static_cast<std::size_t>(s.topology.owned()), Mat<D>::Zero());
  const auto add = [&](const TermFunctions<D>& term) {
    for_each_chunk(s, [&](Index c) { term.add_particle_virials(s, c, sums.data()); });
  };
  for_each(&TermKind::energy, s, add);
  for_each(&TermKind::history, s, add);
  return sums;
}

template <int D>
Real TermSum<D>::energy_of(const StateView<D>& s, std::span<const Index> ids) const {
  std::vector<Range> points;  // ghosts have points, too
  for (const Index id : ids)
    for (Index m = 0; m < s.topology.particles(); ++m)
      if (s.topology.id[m] == id) points.push_back({s.topology.offset[m], s.topology.offset[m + 1]});
  Real sum = 0;
  const auto add = [&](const TermFunctions<D>& term) { sum = term.add_energy_of(s, points, sum); };
  for_each(&TermKind::energy, s, add);
  for_each(&TermKind::history, s, add);
  return sum;
}

template <int D>
Real TermSum<D>::power(const StateView<D>& s) const {
  return sum_over_chunks(s, [&](Index chunk) {
    Real sum = 0;
    const auto add = [&](const TermFunctions<D>& term) { sum = term.add_power(s, chunk, sum); };
    for_each(&TermKind::dissipation, s, add);
    for_each(&TermKind::history, s, add);
    return sum;
  });
}

template <int D>
void TermSum<D>::dissipative_forces(const StateView<D>& s, Real* f) const {
  for_each_chunk(s, [&](Index chunk) { set_dissipation(s, chunk, f); });
}

template <int D>
std::vector<TermReport> TermSum<D>::report(const StateView<D>& s) const {
  std::vector<TermReport> reports;
  for_each_enabled(s, [&](const TermFunctions<D>& term) { reports.push_back(term.report(s, numbers(s))); });
  return reports;
}

template <int D>
void TermSum<D>::force_of(std::initializer_list<std::string_view> names, const StateView<D>& s, Real* f) const {
  for_each_chunk(s, [&](Index chunk) {
    zero(s, chunk, f);
    for_each_enabled(s, [&](const TermFunctions<D>& term) {
      if (std::ranges::find(names, term.name()) != names.end()) term.add_forces(s, nullptr, chunk, f);
    });
  });
}

template <int D>
void TermSum<D>::hessian(const StateView<D>& s, BlockSink<D>& h, PreStress pre_stress) const {
  for_each(&TermKind::energy, s, [&](const TermFunctions<D>& term) { term.add_blocks(s, h, pre_stress); });
}

template <int D>
void TermSum<D>::damping(const StateView<D>& s, BlockSink<D>& h) const {
  for_each(&TermKind::dissipation, s, [&](const TermFunctions<D>& term) { term.add_blocks(s, h, PreStress::kept); });
}

template <int D>
void TermSum<D>::for_each_contact(const StateView<D>& s, const std::function<void(const Contact<D>&)>& visit) const {
  for_each_enabled(s, [&](const TermFunctions<D>& term) { term.for_each_contact(s, visit); });
}

template <int D>
void TermSum<D>::for_each_pair_force(const StateView<D>& s,
                                     const std::function<void(const PairForce<D>&)>& visit) const {
  for_each_enabled(s, [&](const TermFunctions<D>& term) { term.for_each_pair_force(s, visit); });
}

template <int D>
void TermSum<D>::add_wall_forces(const StateView<D>& s, Real* f, Real* on_pivots, WallGroup which) const {
  for_each_enabled(s, [&](const TermFunctions<D>& term) { term.add_wall_forces(s, f, on_pivots, which); });
}

template <int D>
CriticalStep TermSum<D>::critical_step(const Topology& topology, bool walls) const {
  CriticalStep step;
  std::array<MotionRates, element_kinds> of_kind;
  for (const auto& term : terms_) {
    if (!walls && (term->kind.elements == Elements::walls || term->kind.elements == Elements::lips)) continue;
    const TermRates rates = term->rates(topology);
    if (rates.elastic) step.elastic = std::min(step.elastic, 2 / *rates.elastic);
    if (rates.damping) step.damping = std::min(step.damping, 1 / *rates.damping);
    of_kind[static_cast<std::size_t>(term->kind.elements)] += rates.crowded;
  }
  // Where two surfaces lie flat on each other, their edges cross while their vertices touch faces.
  of_kind[static_cast<std::size_t>(Elements::vertex_faces)] += of_kind[static_cast<std::size_t>(Elements::edge_pairs)];
  // Other kinds of contacts compete for the space around a point: a wall takes the space of half the neighbours.
  MotionRates contacts;
  for_each_kind([&]<Elements E>(ElementKind<E>) {
    const MotionRates& rates = of_kind[static_cast<std::size_t>(E)];
    if constexpr (ElementKind<E>::listed)
      contacts.raise_to(rates);
    else
      step.crowded += rates;
  });
  step.crowded += contacts;
  return step;
}

template <int D>
std::vector<HistoryNeeds> TermSum<D>::history_needs() const {
  std::vector<HistoryNeeds> all;
  for (const auto& term : terms_)
    if (const std::optional<HistoryNeeds> needs = term->history_needs()) all.push_back(*needs);
  return all;
}

template <int D>
void TermSum<D>::accept(const StateView<D>& s, Real h, ContactHistory& history, HistoryWorkspace& workspace,
                        bool found) const {
  if (!found) {
    std::vector<Real> unused(numbers(s));
    for_each_chunk(s, [&](Index chunk) {
      for_each(&TermKind::history, s,
               [&](const TermFunctions<D>& term) { term.add_forces(s, &workspace, chunk, unused.data()); });
    });
  }
  for_each(&TermKind::history, s, [&](const TermFunctions<D>& term) { term.accept(s, h, history, workspace); });
}

template <int D>
std::size_t TermSum<D>::numbers(const StateView<D>& s) const {
  return static_cast<std::size_t>(s.topology.points()) * (this->rotates() ? D + rotations<D> : D);
}

template <int D>
void TermSum<D>::zero(const StateView<D>& s, Index chunk, Real* f) const {
  const Range own = s.neighbours.points(chunk);
  std::fill(f + static_cast<std::size_t>(own.first) * D, f + static_cast<std::size_t>(own.last) * D, 0.0);
  if (this->rotates()) zero_torques(s, chunk, f);
}

template <int D>
void TermSum<D>::zero_torques(const StateView<D>& s, Index chunk, Real* f) {
  const Range own = s.neighbours.points(chunk);
  std::fill_n(torques_in(s, f) + static_cast<std::size_t>(own.first) * rotations<D>,
              static_cast<std::size_t>(own.size()) * rotations<D>, 0.0);
}

template <int D>
bool TermSum<D>::set_accelerations(const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* a) const {
  set_total(s, workspace, chunk, a);
  return divide_by_masses(s, chunk, a);
}

template <int D>
bool TermSum<D>::divide_by_masses(const StateView<D>& s, Index chunk, Real* a) const {
  const Topology& topology = s.topology;
  const Range own = s.neighbours.particles(chunk);
  const bool finite =
      scale_points<D>(topology.offset.data(), topology.inverse_point_mass.data(), own.first, own.last, a);
  if (!this->rotates()) return finite;
  // Particles that rotate have one point each.
  return scale_points<rotations<D>>(topology.offset.data(), topology.inverse_inertia.data(), own.first, own.last,
                                    torques_in(s, a)) &&
         finite;
}

template class TermSum<2>;
template class TermSum<3>;

}  // namespace pliant
