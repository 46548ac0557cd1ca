// Energies of droplets at walls; the laws are in separate headers.
#pragma once

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>
#include <pliant/geometry/overlap.h>
#include <pliant/model/parameter.h>
#include <pliant/model/term.h>

namespace pliant {

/// U = Σ Law(r − wall; R) over droplets and walls, R half the contact diameter, the walls at their places at the view's
/// time; joints count −U. A law has a name, a range beyond R, the value with two derivatives, the smallest distance
/// allowed for a droplet's centre, and max_rate. Value and smallest distance take the solid if the wall is a solid. A
/// law that does not support all walls has check(walls). Elements: neighbour list of points and parts of the walls.
/// Errors: NumericalError where a droplet is nearer.
template <int D, class Law>
struct DropletWalls {
  Law law;

  static constexpr Elements elements = Elements::walls;
  static std::string_view name() { return Law::name; }
  void read(ParameterReader& p) { law.read(p); }
  bool enabled(const StateView<D>& s) const { return s.walls.size() > 0; }
  Real range() const { return law.range(); }
  void check(const Walls<D>& walls) const {
    if constexpr (requires { law.check(walls); }) law.check(walls);
  }

  Real energy(const StateView<D>& s, Index e) const { return at(s, e).value; }

  template <class G>
  void add_gradient(const StateView<D>& s, Index e, G& grad) const {
    grad.add(s.neighbours.walls[e].first, at(s, e).gradient);
  }

  void add_hessian(const StateView<D>& s, Index e, BlockSink<D>& h) const {
    const Index i = s.neighbours.walls[e].first;
    h.add(i, i, at(s, e).hessian);
  }

  /// Force of the wall on the droplet; the wall feels the opposite.
  Vec<D> force(const StateView<D>& s, Index e) const { return -at(s, e).gradient; }
  Real max_rate(const Topology& topology) const { return law.max_rate(topology); }

 private:
  Expansion<D> at(const StateView<D>& s, Index e) const {
    const auto [i, part] = s.neighbours.walls[e];
    const std::optional<Solid<D>> solid = s.walls.solid(part, s.t);
    const WallFoot<D> foot = solid ? solid->foot(s.position(i)) : s.walls.foot(s.position(i), part, s.t);
    if (!(foot.d > law.least_distance(solid)))
      throw NumericalError(
          "droplet {} has run into wall {}: its centre is {:.3g} from it at t = {}, where it must be more than {}; use "
          "{}",
          s.topology.id[s.topology.particle[i]], s.walls.wall_of_part(part), foot.d, s.t, law.least_distance(solid),
          cures({Cure::shorter_step, Cure::smaller_load, Cure::less_overlap}));
    const Expansion<D> u = law.at(solid, foot, s.position(i), s.topology.diameter[i] / 2);
    const Real w = s.walls.weight(part);
    return w == 1 ? u : Expansion<D>{w * u.value, w * u.gradient, w * u.hessian};
  }
};

}  // namespace pliant
