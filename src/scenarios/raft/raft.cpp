#include <pliant/scenarios/raft/raft.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <pliant/analysis/graph.h>
#include <pliant/base/errors.h>
#include <pliant/catalogue/droplet_rest.h>
#include <pliant/run/memory.h>
#include <pliant/scenarios/droplets/protocol.h>

namespace pliant {
namespace {

using Bond = std::array<Index, 2>;

const Real row_height = std::sqrt(Real(3)) / 2;  ///< of rows, in spacings

std::vector<Real> hexagonal_places(const RaftOptions& p, Real spacing) {
  std::vector<Real> x;
  for (Index row = 0; row < p.rows; ++row) {
    const bool odd = row % 2 == 1;
    const Index columns = p.columns - (p.alternating() && odd ? 1 : 0);
    const Real shift = p.alternating() ? 0 : odd ? 0.25 : -0.25;
    for (Index column = 0; column < columns; ++column) {
      x.push_back((row - (p.rows - 1) / Real(2)) * row_height * spacing);
      x.push_back((column - (columns - 1) / Real(2) + shift) * spacing);
    }
  }
  return x;
}

std::vector<Real> disordered_places(const RaftOptions& p, const std::vector<Real>& radii, Real spacing) {
  const Real half = (p.rows - 1) * row_height * spacing / 2 + 1e-9, scale = spacing / 2;
  std::vector<Vec<2>> place{Vec<2>(-half, 0)};
  for (std::size_t k = 1; k < radii.size(); ++k) {
    Vec<2> best(0, std::numeric_limits<Real>::infinity());
    const auto reach = [&](std::size_t i) { return scale * (radii[i] + radii[k]); };
    const auto try_at = [&](const Vec<2>& r) {
      const auto cost = [](const Vec<2>& a) { return std::pair(std::abs(a[1]), a[0]); };
      if (std::abs(r[0]) > half || !(cost(r) < cost(best))) return;
      for (std::size_t i = 0; i < k; ++i)
        if ((r - place[i]).norm() < reach(i) * (1 - 1e-9)) return;
      best = r;
    };
    for (std::size_t i = 0; i < k; ++i) {
      // Places in contact with i alone: behind it, or next to it; then places in contact with i and j.
      for (const Vec<2>& step : {Vec<2>(1, 0), Vec<2>(0, 1), Vec<2>(0, -1)}) try_at(place[i] + reach(i) * step);
      for (std::size_t j = 0; j < i; ++j) {
        const Vec<2> base = place[j] - place[i];
        const Real d = base.norm(), a = reach(i), b = reach(j);
        if (d >= a + b) continue;
        const Real along = (square(a) - square(b) + square(d)) / (2 * d);
        const Vec<2> across = std::sqrt(std::max(Real(0), square(a) - square(along))) * Vec<2>(-base[1], base[0]) / d;
        for (const Real side : {-1, 1}) try_at(place[i] + along * base / d + side * across);
      }
    }
    place.push_back(best);
  }
  std::vector<Real> x;
  for (const Vec<2>& r : place) x.insert(x.end(), {r[0], r[1]});
  return x;
}

/// Quantities derived from the options.
struct Raft {
  explicit Raft(const RaftOptions& p)
      : pair(droplets_at_rest(p.depletion().repulsion, p.depletion().law, 1, 1)),
        wall(droplet_at_wall(p.model.term(WallRepulsion<2>{}).law, p.model.term(WallDepletion<2>{}).law, 1)),
        radii(draw_radii(p.radii, p.droplets(), static_cast<std::uint64_t>(p.seed))),
        places(raft_places(p, radii, pair.distance)) {
    const bool compression = p.motion == WallMotion::compression;
    slope = std::tan(p.tilt * pi / 180);
    Real left = 0, right = 0;  // farthest reach to either side, seen from the origin
    const Real cosine = std::cos(p.tilt * pi / 180);
    for (std::size_t m = 0; m < radii.size(); ++m) {
      const Real reach = compression ? radii[m] + p.attraction_range() : wall.distance + radii[m] - 1;
      left = std::max(left, reach - places[2 * m]);
      right = std::max(right, places[2 * m] + slope * places[2 * m + 1] + reach / cosine);
    }
    start = p.start_distance.value_or(left + right);
    shift = left + (start - left - right) / 2;
    const Real rest = 2 * wall.distance + (p.rows_end - 1) * row_height * pair.distance;
    end = p.end_distance.value_or(compression ? rest : start + 2);
    if (compression ? end >= start : end <= start)
      throw InputError(
          "the walls are {:.6g} apart at the start and {:.6g} at the end, but -motion {} {} the distance; "
          "change -rows_end, -end_distance or -start_distance",
          start, end, compression ? "compression" : "extension", compression ? "lowers" : "raises");
    velocity = compression ? -p.v_wall : p.v_wall;
  }

  Topology droplets() const {
    Topology t;
    for (const Real r : radii) t.add_soft(2 * r, 1);
    return t;
  }

  Walls<2> walls() const {
    Walls<2> walls(std::vector{Solid<2>::half_space({0, 0}, {1, 0})});
    walls.add(Solid<2>::half_space({start, 0}, {-1, -slope}), {.velocity = {velocity, 0}});
    return walls;
  }

  DropletRest pair, wall;
  std::vector<Real> radii, places;
  Real slope;                 ///< slope of the moving wall: its surface is at x = distance − slope · y
  Real start, end, velocity;  ///< start, end and velocity of the walls' distance on the axis
  Real shift;                 ///< of the places, from the fixed wall
};

class RaftProtocol final : public DropletProtocol {
 public:
  RaftProtocol(const RaftOptions& p, const Ranks& ranks) : RaftProtocol(p, ranks, Raft(p)) {}

  std::string title() const override {
    return fmt::format("raft: {} droplets, {} rows, {} columns, {}; walls from {:.4g} to {:.4g} R apart at {:g} R/t0",
                       p_.droplets(), p_.rows, p_.columns,
                       p_.lattice == RaftLattice::hexagonal ? "hexagonal" : "disordered", raft_.start, raft_.end,
                       std::abs(raft_.velocity));
  }

  Real last_time() const override { return std::min(p_.t_end.value_or(time_of_end()), time_of_end()); }

  std::string end_at_last_time() const override {
    if (p_.t_end && *p_.t_end < time_of_end()) return "t_end";
    return p_.end_distance || p_.motion == WallMotion::extension ? "end_distance" : "rows_end";
  }

  std::vector<Real> start() override {
    std::vector<Real> x = raft_.places;
    for (std::size_t k = 0; k < x.size(); k += 2) x[k] += raft_.shift;
    return x;
  }

  RunGeometry geometry() const override {
    return {"raft",
            drawn_walls(0),
            {{"rows", p_.rows},
             {"columns", p_.columns},
             {"tilt", p_.tilt},
             {"v_wall", raft_.velocity},
             {"start_distance", raft_.start}}};
  }

  std::vector<Real> drawn_walls(Real t) const override {
    // There is no state before the run; the height follows from the places of the droplets.
    const std::span<const Real> x = t > 0 ? state().x().first(2 * raft_.radii.size()) : std::span(raft_.places);
    Real half = 2;
    for (std::size_t k = 1; k < x.size(); k += 2) half = std::max(half, std::abs(x[k]) + 2);
    const Real d = distance(t), lean = raft_.slope * half;
    return {0, -half, 0, half, d + lean, -half, d - lean, half};
  }

  bool follow_stages() override {
    // In most steps neither the list nor a bond changes: then follow_stages() sorts nothing.
    find_listed_bonds(next_listed_);
    if (next_listed_ == listed_) return false;
    listed_.swap(next_listed_);
    std::vector<Bond> now = in_order(listed_);
    if (now != bonds_) {
      record(bonds_, now, true);
      record(now, bonds_, false);
      bonds_ = std::move(now);
    }
    return false;
  }

  void measure(std::vector<SeriesValue>& row) override {
    if (state().step == 0) bonds_ = find_bonds();  // bonds at the start are not events
    const StateView<2> s = view();
    const std::vector<Real> force = wall_forces();
    std::array<Real, 2> push{};
    std::array<std::vector<Index>, 2> at;
    for (Index k = 0; k < 2; ++k) push[k] = -point<2>(force.data(), k).dot(s.walls.solids()[k].out);
    for (const auto [i, k] : s.neighbours.walls)
      if (s.walls.distance(s.position(i), k, s.t) < radius(i) + p_.attraction_range()) at[k].push_back(i);
    rows_ = count_rows(droplets(), bonds_, at[0], at[1]);
    row.insert(row.end(), {{"wall_distance", distance(state().t)},
                           {"fixed_wall_force", push[0]},
                           {"moving_wall_force", push[1]},
                           {"fixed_wall_bonds", static_cast<Real>(at[0].size())},
                           {"moving_wall_bonds", static_cast<Real>(at[1].size())},
                           {"rows", static_cast<Real>(rows_)},
                           {"broken", static_cast<Real>(broken_)},
                           {"formed", static_cast<Real>(formed_)}});
  }

  std::string progress() const override {
    return fmt::format("walls {:.3f} R apart  rows {}  broken {}", distance(state().t), rows_, broken_);
  }

  void visit_more(Archive& a) override {
    // Each is an event.
    const std::int64_t events = a.reads() ? a.from().integer("events") : broken_ + formed_;
    a.number("broken", broken_, 0, events);
    a.number("formed", formed_, events - broken_, events - broken_);
    if (a.reads()) bonds_ = find_bonds();
  }

  void conclude_more(nlohmann::ordered_json& s) override {
    s["wall_distance"] = distance(state().t);
    s["start_distance"] = raft_.start;
    s["rows"] = rows_;
    s["broken"] = broken_;
    s["formed"] = formed_;
    s["d_eq"] = raft_.pair.distance;
    s["k1"] = raft_.pair.stiffness;
    s["E1"] = raft_.pair.energy;
    s["h_eq"] = raft_.wall.distance;
    s["k_wall"] = raft_.wall.stiffness;
    s["E_wall"] = raft_.wall.energy;
  }

 private:
  RaftProtocol(const RaftOptions& p, const Ranks& ranks, Raft raft)
      : DropletProtocol(p, ranks,
                        {.droplets = raft.droplets(), .walls = raft.walls(), .walls_at_once = p.rows == 1 ? 2 : 1}),
        p_(p),
        raft_(std::move(raft)) {}

  Real distance(Real t) const { return raft_.start + raft_.velocity * t; }
  Real time_of_end() const { return (raft_.end - raft_.start) / raft_.velocity; }

  /// Pairs in the range of the attraction, in the order of the neighbour list.
  void find_listed_bonds(std::vector<Bond>& bonds) {
    bonds.clear();
    particles().field().for_each_contact(view(), [&](const Contact<2>& c) {
      bonds.push_back({std::min(c.first, c.second), std::max(c.first, c.second)});
    });
  }

  static std::vector<Bond> in_order(std::vector<Bond> bonds) {
    std::sort(bonds.begin(), bonds.end());
    return bonds;
  }

  /// The present bonds, sorted.
  std::vector<Bond> find_bonds() {
    find_listed_bonds(listed_);
    return in_order(listed_);
  }

  /// The bonds that only `some` has and `others` has not are events.
  void record(const std::vector<Bond>& some, const std::vector<Bond>& others, bool broken) {
    std::vector<Bond> only;
    std::set_difference(some.begin(), some.end(), others.begin(), others.end(), std::back_inserter(only));
    (broken ? broken_ : formed_) += static_cast<std::int64_t>(only.size());
    for (const auto [i, j] : only) {
      const Vec<2> middle = (position(i) + position(j)) / 2;
      const std::array<Real, 2> pair{static_cast<Real>(i), static_cast<Real>(j)}, place{middle[0], middle[1]};
      run().add_event({{"time", state().t},
                       {"wall_distance", distance(state().t)},
                       {"broken", Real(broken)},
                       {"particles", pair},
                       {"position", place}});
    }
  }

  const RaftOptions& p_;
  Raft raft_;
  std::vector<Bond> bonds_;
  std::vector<Bond> listed_;       ///< the same bonds in the order of the neighbour list
  std::vector<Bond> next_listed_;  ///< memory of follow_stages(), for the bonds after a step
  std::int64_t broken_ = 0, formed_ = 0;
  Index rows_ = 0;
};

}  // namespace

std::vector<Real> raft_places(const RaftOptions& p, const std::vector<Real>& radii, Real spacing) {
  return p.lattice == RaftLattice::hexagonal ? hexagonal_places(p, spacing) : disordered_places(p, radii, spacing);
}

Index count_rows(Index droplets, const std::vector<Bond>& bonds, const std::vector<Index>& at_first,
                 const std::vector<Index>& at_second) {
  const std::vector<Index> links = links_from(at_second, make_graph(droplets, bonds));
  std::vector<Index> lengths;
  for (const Index i : at_first)
    if (links[i] >= 0) lengths.push_back(links[i] + 1);
  if (lengths.empty()) return 0;
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle;
}

Scenario raft_scenario() {
  Scenario s = option_scenario<RaftOptions>(
      "raft", "droplets between two walls that compress them or pull them apart",
      [](const RaftOptions& p, const Options& options, const Ranks& ranks, std::optional<Checkpoint> checkpoint) {
        refuse_ranks("raft", ranks);
        // Check before the droplets are created.
        check_memory({p.droplets(), p.droplets()},
                     p.n > 0 ? fmt::format("-n {}", p.n) : fmt::format("-rows {} -columns {}", p.rows, p.columns),
                     ranks);
        if (!checkpoint) p.refuse_unread(options);
        if (checkpoint) checkpoint->integer_array("active", static_cast<std::size_t>(p.droplets()));
        return std::make_unique<Run<2>>("raft", p, options, ranks, std::make_unique<RaftProtocol>(p, ranks),
                                        std::move(checkpoint));
      },
      {},
      {"rows", "columns", "delta", "small_fraction",
       std::string(RaftOptions().model.parameters(Role::attraction)[0]->name), "motion", "v_wall", "end_distance",
       "seed", "output"});
  s.units =
      "Units: ⟨R⟩ (R), the radius of a large droplet, and the unit of force F0 (in the table F) in which f0 is given; "
      "b = 1, t0 = b⟨R⟩/F0. "
      "Options that begin with `-mobility_ksp_` and `-mobility_pc_` go to the solver for the velocities.";
  return s;
}

}  // namespace pliant
