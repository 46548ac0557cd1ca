// Energies of droplets at solid walls; the laws are in headers of their own.
#pragma once

#include <pliant/base/errors.h>
#include <pliant/geometry/overlap.h>
#include <pliant/model/term.h>

namespace pliant {

/// U = Σ Law(r − solid; R) over droplets and solids, R half the contact diameter, the solids at their places at the
/// view's time. A law has a name, a range beyond R, the value with two derivatives, the distance that a droplet's
/// centre must keep from a solid, and max_rate. Elements: neighbour list of points and solids. Errors: NumericalError
/// where a droplet is nearer.
template <int D, class Law>
struct DropletWalls {
  Law law;

  static constexpr Elements elements = Elements::solids;
  static std::string_view name() { return Law::name; }
  bool enabled(const StateView<D>& s) const { return !s.walls.solids().empty(); }
  Real range() const { return law.range(); }

  Real energy(const StateView<D>& s, Index e) const { return at(s, e).value; }

  template <class G>
  void add_gradient(const StateView<D>& s, Index e, G& grad) const {
    grad.add(s.neighbours.solids[e].first, at(s, e).gradient);
  }

  void add_hessian(const StateView<D>& s, Index e, BlockSink<D>& h) const {
    const Index i = s.neighbours.solids[e].first;
    h.add(i, i, at(s, e).hessian);
  }

  /// Force of the wall on the droplet; the wall feels the opposite.
  Vec<D> force(const StateView<D>& s, Index e) const { return -at(s, e).gradient; }
  Index wall(const StateView<D>& s, Index e) const { return s.walls.wall_of_solid(s.neighbours.solids[e].second); }

  Real max_rate(const Topology& topology) const { return law.max_rate(topology); }

 private:
  Expansion<D> at(const StateView<D>& s, Index e) const {
    const auto [i, k] = s.neighbours.solids[e];
    const Solid<D>& solid = s.walls.solids()[k];
    const WallFoot<D> foot = solid.foot(s.position(i), s.t);
    if (!(foot.d > law.least_distance(solid.flat())))
      throw NumericalError(
          "droplet {} has run into wall {}: its centre is {:.3g} from it at t = {}, where it must be more than {}; "
          "lower "
          "-dt or the load, or start with less overlap",
          s.topology.id[s.topology.particle[i]], s.walls.wall_of_solid(k), foot.d, s.t,
          law.least_distance(solid.flat()));
    return law.at(solid, foot, s.position(i), s.t, s.topology.diameter[i] / 2);
  }
};

}  // namespace pliant
