#include <pliant/run/surface_check.h>

#include <fmt/format.h>

#include <pliant/base/errors.h>
#include <pliant/model/surface_crossing.h>

namespace pliant {

Index check_surfaces(const StateView<3>& s, const Ranks& ranks, const SurfaceCures& cures) {
  const auto id = [&](Index m) { return s.topology.id[m]; };
  const auto edge = [&](const Piercing& p) {
    return fmt::format("the edge from vertex {} to {} of particle {} pierces face {}", p.a, p.b, id(p.particle),
                       p.face);
  };
  Index self_crossings = 0;
  ranks.together([&] {
    const SurfacesLook seen = look_at_surfaces(s);
    self_crossings = seen.self_crossings;
    if (seen.piercing && cures.piercing_stops)
      throw NumericalError("{} of particle {}: {} or {}", edge(*seen.piercing), id(seen.piercing->other),
                           cures.contacts, cures.shape);
    if (seen.enclosure && cures.piercing_stops)
      throw NumericalError("particle {} is inside particle {}: {} or {}", id(seen.enclosure->inner),
                           id(seen.enclosure->outer), cures.contacts, cures.shape);
    if (seen.bad_shape)
      throw NumericalError("particle {} {}: {}", id(seen.bad_shape->particle),
                           seen.bad_shape->kind == BadShape::Kind::inverted
                               ? "has turned inside out: its volume is not positive"
                               : fmt::format("has lost the area of its face {}", seen.bad_shape->face),
                           cures.shape);
    if (seen.crossing_itself && cures.self_crossing_stops)
      throw NumericalError("particle {} crosses itself: {}; {}{}", id(*seen.crossing_itself),
                           seen.self_piercing ? edge(*seen.self_piercing) : "two of its faces fold over each other",
                           cures.shape, cures.self_crossing);
  });
  return self_crossings;
}

}  // namespace pliant
