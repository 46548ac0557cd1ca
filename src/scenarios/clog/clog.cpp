#include <pliant/scenarios/clog/clog.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <pliant/analysis/arch.h>
#include <pliant/analysis/graph.h>
#include <pliant/base/console.h>
#include <pliant/base/errors.h>
#include <pliant/base/rng.h>
#include <pliant/base/text.h>
#include <pliant/catalogue/droplet_rest.h>
#include <pliant/io/summary.h>
#include <pliant/model/depletion.h>
#include <pliant/run/memory.h>
#include <pliant/scenarios/droplets/protocol.h>
#include <pliant/setup/streams.h>
#include <pliant/system/minimum.h>

namespace pliant {
namespace {

/// Along the right wall, upwards.
Vec<2> right_wall(const ClogOptions& p) {
  const Real angle = p.angle * pi / 180;
  return {std::sin(angle), std::cos(angle)};
}

std::vector<Real> radii_of(const ClogOptions& p) {
  if (!p.start.given()) return draw_radii(p.radii, p.n, static_cast<std::uint64_t>(p.seed));
  std::vector<Real> radii;
  for (const Real sigma : p.start.particles().topology.sigma) radii.push_back(sigma / 2);
  return radii;
}

Topology make_droplets(const std::vector<Real>& radii) {
  Topology t;
  for (const Real r : radii) t.add_soft(2 * r, r * square(r));
  return t;
}

/// Two wedges with level undersides, and a lid at this height: at 0 it closes the exit, far below no droplet meets it.
Walls<2> make_walls(const ClogOptions& p, Real lid) {
  const Vec<2> up = right_wall(p);
  return Walls<2>(std::vector<Solid<2>>{Solid<2>::wedge({-p.half_width(), 0}, {-up[0], up[1]}, {-1, 0}),
                                        Solid<2>::wedge({p.half_width(), 0}, up, {1, 0}),
                                        Solid<2>::half_space({0, lid}, {0, 1})});
}

class ClogProtocol final : public DropletProtocol {
 public:
  ClogProtocol(const ClogOptions& p, const Ranks& ranks) : ClogProtocol(p, ranks, radii_of(p)) {}

  std::string title() const override {
    return fmt::format(
        "clog: {} droplets, w/d = {:g}, angle {:g}, g = {:g}, depletion energy {:g}, capillary length {:.4g} R", p_.n,
        p_.width, p_.angle, p_.g, p_.model.value(Role::attraction), delta_);
  }

  Real last_time() const override { return *p_.t_end; }
  std::vector<Real> start() override { return p_.start.given() ? p_.start.particles().x : fill_wedge(p_, radii_); }
  nlohmann::ordered_json start_source() const override { return p_.start.source(); }
  void check() const override {
    if (!p_.start.fresh()) return;
    const StartParticles& start = p_.start.particles();
    const Walls<2> walls = make_walls(p_, 0);
    p_.start.check<2>(0, [&](Index m) -> std::optional<std::string> {
      const Vec<2> r = point<2>(start.x.data(), m);
      for (Index part = 0; part < walls.part_count(); ++part)
        if (walls.distance(r, part, 0) <= 0) return "is in a wall or below the exit; move it";
      return {};
    });
    const Real mean = std::accumulate(radii_.begin(), radii_.end(), 0.0) / static_cast<Real>(radii_.size());
    if (mean < 0.5 || mean > 2)
      warn("-start {}: the mean radius is {:.3g}, but lengths of a run are in mean radii; scale the file",
           printable(p_.start.file()), mean);
  }
  RunGeometry geometry() const override {
    return {"wedge", drawn_walls(0), {{"w", 2 * p_.half_width()}, {"angle", p_.angle}}};
  }

  /// The walls up to the topmost droplet, and the lid while it is there.
  std::vector<Real> drawn_walls(Real) const override {
    Real top = 2;
    if (state().size() > 0)
      for (Index m = 0; m < droplets(); ++m) top = std::max(top, position(m)[1] + 2);
    const Real tip = p_.half_width(), far = tip + top * right_wall(p_)[0] / right_wall(p_)[1];
    return {-tip, 0, -far, top, tip, 0, far, top, -tip, 0, opened_ < 0 ? tip : -tip, 0};
  }

  bool follow_stages() override {
    if (state().step % check_every != 0) return false;
    const bool changed = opened_ >= 0 && take_out();
    if (opened_ >= 0) {
      judge_end();
      return changed;
    }
    if (!at_rest()) return changed;
    opened_ = state().t;
    run().write_frame();
    set_walls(make_walls(p_, far_below));
    return true;
  }

  void judge_end() override {
    if (opened_ < 0 || (active() > 0 && !at_rest())) return;
    arch_ = find_arch();
    run().end(!arch_.empty() ? "clogged" : active() > 0 ? "at_rest" : "empty");
  }

  void measure(std::vector<SeriesValue>& row) override {
    row.insert(row.end(), {{"open", Real(opened_ >= 0)},
                           {"in_hopper", static_cast<Real>(above())},
                           {"left", static_cast<Real>(droplets() - active())}});
  }

  std::string progress() const override {
    return opened_ < 0 ? "settling" : fmt::format("{} of {} left", droplets() - active(), droplets());
  }

  void visit_more(Archive& a) override {
    p_.start.visit(a);
    a.number("opened_at", opened_, -1, a.t());
    if (!a.reads()) return;
    const auto& inside = a.from().integer_array("active", static_cast<std::size_t>(droplets()));
    for (Index m = 0; m < droplets(); ++m)
      if (opened_ < 0 && (position(m)[1] <= 0 || inside[m] == 0))
        a.from().refuse("opened_at = {}: droplet {} has already left", opened_, m);
    if (opened_ >= 0) put_walls(make_walls(p_, far_below));
  }

  void conclude_more(nlohmann::ordered_json& s) override {
    const bool ended = s["status"] != "done";
    s["capillary_length"] = quantity(delta_, NAN, "R");
    s["w_over_capillary_length"] = quantity(2 * p_.half_width() / delta_, NAN, "");
    s["opened_at"] = opened_ < 0 ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(opened_);
    if (!ended) return;
    s["avalanche_size"] = quantity(droplets() - active(), NAN, "");
    const std::vector<ClogRole> roles = clog_roles(places(), topology().active, arch_);
    const auto all = [&](ClogRole role) {
      std::vector<Index> which;
      for (Index m = 0; m < droplets(); ++m)
        if (roles[m] == role) which.push_back(m);
      return which;
    };
    s["arch"] = arch_;
    s["attached"] = all(ClogRole::attached);
    s["rest"] = all(ClogRole::rest);
  }

 private:
  ClogProtocol(const ClogOptions& p, const Ranks& ranks, std::vector<Real> radii)
      : DropletProtocol(p, ranks,
                        {.droplets = make_droplets(radii),
                         .walls = make_walls(p, 0),
                         .gravity = {0, -p.g},
                         .walls_rub = p.wall_friction,
                         .integration = {.type = "ssp"}}),
        p_(p),
        radii_(std::move(radii)),
        delta_(capillary_length(p.depletion(), p.g)) {}

  static constexpr std::int64_t check_every = 16, minimum_every = 256;  ///< steps; a search costs as much as about 60
                                                                        ///< steps
  static constexpr Real slow = 0.01;  ///< part of a falling droplet's speed, above which the run searches no minimum
  static constexpr Real near = 0.01;  ///< a minimum: much less than the range of the attraction
  static constexpr Real far_below = -1e6;
  static constexpr Real taken_out_below = -4;  ///< two diameters below the exit

  std::span<const Real> places() const { return state().x().first(2 * static_cast<std::size_t>(droplets())); }
  bool active(Index m) const { return topology().active[m] != 0; }
  Index active() const {
    const auto& a = topology().active;
    return static_cast<Index>(std::count(a.begin(), a.end(), 1));
  }
  bool at_rest() {
    const Real speed = max_speed();
    if (speed < p_.clog_speed) return true;
    if (p_.rest == RestRule::speed || state().step % minimum_every != 0 || speed >= slow * p_.g / p_.b) return false;
    // Droplets that hang below the exit, barely in the range of the walls, can take forever.
    return (opened_ >= 0 && above() == 0) || next_to_minimum<2>(particles(), places(), state().t, near);
  }
  Index above() const {
    Index count = 0;
    for (Index m = 0; m < droplets(); ++m) count += active(m) && position(m)[1] > 0;
    return count;
  }

  /// Pairs and walls within the range of the attraction; `pushing`: only those that carry a load, by more than a
  /// thousandth of a droplet's weight.
  ClogLinks links(bool pushing) {
    ClogLinks found;
    const StateView<2> s = view();
    particles().field().for_each_contact(s, [&](const Contact<2>& c) {
      if (!pushing || c.force.dot(c.normal) > 1e-3 * p_.g) found.pairs.emplace_back(c.first, c.second);
    });
    for (const auto [i, k] : s.neighbours.walls) {
      const Real reach = radius(i) + (pushing ? 0 : p_.attraction_range());
      if (k < 2 && s.walls.distance(s.position(i), k, s.t) < reach) (k == 0 ? found.left : found.right).push_back(i);
    }
    return found;
  }

  std::vector<Index> find_arch() {
    std::vector<Index> chain = lowest_chain(places(), links(true));
    return chain.empty() ? lowest_chain(places(), links(false)) : chain;
  }

  /// Removes the droplets that are far enough below the exit and that no chain of bonds holds to a droplet above the
  /// exit or to a wall.
  bool take_out() {
    std::vector<Index> low;
    for (Index m = 0; m < droplets(); ++m)
      if (active(m) && position(m)[1] < taken_out_below) low.push_back(m);
    if (low.empty()) return false;
    const ClogLinks bonds = links(false);
    std::vector<Index> anchors = bonds.left;
    anchors.insert(anchors.end(), bonds.right.begin(), bonds.right.end());
    for (Index m = 0; m < droplets(); ++m)
      if (active(m) && position(m)[1] > 0) anchors.push_back(m);
    const std::vector<Index> held = links_from(anchors, make_graph(droplets(), bonds.pairs));
    std::erase_if(low, [&](Index m) { return held[m] >= 0; });
    for (const Index m : low) deactivate(m);
    return !low.empty();
  }

  const ClogOptions& p_;
  std::vector<Real> radii_;
  Real delta_;               ///< capillary length
  Real opened_ = -1;         ///< time of opening the exit; −1: closed
  std::vector<Index> arch_;  ///< at the end
};

}  // namespace

std::vector<Real> fill_wedge(const ClogOptions& p, const std::vector<Real>& radii) {
  const Vec<2> up = right_wall(p);
  const Real slope = up[0] / up[1], half = p.half_width();
  Real content = 0;
  for (const Real r : radii) content += pi * square(r);
  // Solution of h (2 half + slope h) = content/fraction.
  Real height = (std::sqrt(square(half) + slope * content / p.fill_fraction) - half) / slope;
  std::vector<Real> x;
  std::uint64_t draws = 0;
  const auto draw = [&] { return rng::uniform(static_cast<std::uint64_t>(p.seed), stream::placement, draws++); };
  for (std::size_t m = 0; m < radii.size(); ++m) {
    for (int attempt = 0;; ++attempt) {
      if (attempt == 1000) {
        height *= 1.02;
        attempt = 0;
      }
      const Real y = height * draw(), wide = half + slope * height;
      const Vec<2> r(wide * (2 * draw() - 1), y);
      const Real to_wall = (half + slope * y - std::abs(r[0])) * up[1];
      bool free = y > radii[m] && to_wall > radii[m];
      for (std::size_t k = 0; free && k < m; ++k)
        free = (r - point<2>(x.data(), static_cast<Index>(k))).norm() > radii[m] + radii[k];
      if (!free) continue;
      x.insert(x.end(), {r[0], r[1]});
      break;
    }
  }
  return x;
}

Real capillary_length(const Depletion<2>& depletion, Real g) {
  const Real force = depletion.law.at(droplets_at_rest(depletion.repulsion, depletion.law, 1, 1).distance, 1, 1).slope;
  return std::sqrt(force / (pi * g));
}

Scenario clog_scenario() {
  Scenario s = option_scenario<ClogOptions>(
      "clog", "droplets that attract each other leave a hopper, or clog it",
      [](const ClogOptions& p, const Options& options, const Ranks& ranks, std::optional<Checkpoint> checkpoint) {
        refuse_ranks("clog", ranks);
        // Check before the droplets are created.
        check_memory({p.n, p.n}, fmt::format("-n {}", p.n), ranks);
        if (!checkpoint) p.start.refuse(options, {"n", "delta", "fill_fraction"});
        if (checkpoint) checkpoint->integer_array("active", static_cast<std::size_t>(p.n));
        return std::make_unique<Run<2>>("clog", p, options, ranks, std::make_unique<ClogProtocol>(p, ranks),
                                        std::move(checkpoint));
      },
      {},
      {"n", "delta", std::string(ClogOptions().model.parameters(Role::attraction)[0]->name), "g", "hopper_width",
       "hopper_angle", "rest", "t_end", "seed", "output"});
  s.units = "Units: as for rafts, with ⟨R⟩ the mean radius of the droplets and ρ = 1.";
  return s;
}

}  // namespace pliant
