#include <pliant/scenarios/packings/measures.h>

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include <pliant/model/crossing.h>
#include <pliant/model/polygon.h>
#include <pliant/model/surface_measures.h>
#include <pliant/setup/particles.h>

namespace pliant {
namespace {

/// A square or cube with this packing fraction of particles in their rest shapes.
template <int D>
Box<D> box_of_fraction(const Topology& particles, Real fraction) {
  Real content = 0;
  for (const Real a0 : particles.a0) content += a0;
  return {Vec<D>::Zero(), Vec<D>::Constant(std::pow(content / fraction, Real(1) / D))};
}

}  // namespace

template <int D>
std::pair<Topology, ParticleSystem<D>> particles_in_box(const PackingOptions& p, const Ranks& ranks) {
  Topology all = make_particles(p.model.particles(), D,
                                draw_diameters(p.sizes, p.particles, static_cast<std::uint64_t>(p.seed)), p.shape);
  ParticleSystem<D> particles({}, {}, p.model.force_field<D>({}), usual_skin(p.model.particles(), D), ranks,
                              box_of_fraction<D>(all, *p.fraction));
  return {std::move(all), std::move(particles)};
}

template <int D>
Real packing_fraction(const ParticleSystem<D>& system, const Real* x) {
  const Topology& t = system.topology();
  const auto present = [&](Index m) {
    if (t.points_of(m) == 1) return t.a0[m];
    if constexpr (D == 2)
      return polygon_area(x, t, m);
    else
      return surface_volume(x, t, t.surfaces->of(t, m), m);
  };
  Real content = 0;
  for (Index m = 0; m < t.owned(); ++m) content += present(m);
  return system.ranks().sum(content) / system.box().volume();
}

template <int D>
Real rim_fraction(const ParticleSystem<D>& system, const Real* x, ModelKind particles) {
  const Topology& t = system.topology();
  Real rim = 0;
  for (Index m = 0; m < t.owned(); ++m) {
    if (t.points_of(m) == 1) continue;
    const Real delta = t.diameter[t.offset[m]];
    if constexpr (D == 2) {
      const Real disk = pi * square(delta) / 4;
      if (particles == ModelKind::rough)
        rim += (Real(t.points_of(m)) / 2 + 1) * disk;
      else
        rim += polygon_perimeter(x, t, m) * delta / 2 + disk;
    } else {
      const Surface& surface = t.surfaces->of(t, m);
      rim += particles == ModelKind::rough ? outer_spheres_volume(x, t, surface, m, delta)
                                           : shell_volume(x, t, surface, m, delta / 2);
    }
  }
  return packing_fraction(system, x) + system.ranks().sum(rim) / system.box().volume();
}

template <int D>
void check_crossings(ParticleSystem<D>& system, const Real* x, std::string_view when, const SurfaceCures& cures) {
  // A rank without particles takes part.
  if (!system.ranks().any(system.topology().deformable())) return;
  const StateView<D> s = system.view(x, nullptr);
  if constexpr (D == 2) {
    const auto id = [&](Index m) { return system.topology().id[m]; };
    const std::string cure = fmt::format("{}, or {}", cures.contacts, cures.shape);
    system.ranks().together([&] {
      if (const SelfLook look = look_at_own_outlines(s); look.crossing)
        throw NumericalError("the outline of particle {} crosses itself {}; {}", id(look.crossing->particle), when,
                             cure);
      if (const auto crossing = find_crossing(s))
        throw NumericalError("a vertex of particle {} lies inside particle {} {}; {}", id(crossing->particle),
                             id(crossing->other), when, cure);
    });
  } else {
    check_surfaces(s, system.ranks(), cures);
  }
}

template <int D>
void check_overlaps(ParticleSystem<D>& system, const Real* x, std::string_view cure) {
  if (system.topology().deformable()) return;
  const StateView<D> s = system.view(x, nullptr);
  system.field().for_each_contact(s, [&](const Contact<D>& c) {
    const Real radius = std::min(s.topology.sigma[c.first], s.topology.sigma[c.second]) / 2;
    if (c.overlap * c.reach > radius)
      throw InputError("particles {} and {} overlap by {:.0f} % of the smaller radius at the minimum; {}",
                       s.topology.id[c.first], s.topology.id[c.second], 100 * c.overlap * c.reach / radius, cure);
  });
}

template std::pair<Topology, ParticleSystem<2>> particles_in_box<2>(const PackingOptions&, const Ranks&);
template std::pair<Topology, ParticleSystem<3>> particles_in_box<3>(const PackingOptions&, const Ranks&);
template Real packing_fraction<2>(const ParticleSystem<2>&, const Real*);
template Real packing_fraction<3>(const ParticleSystem<3>&, const Real*);
template Real rim_fraction<2>(const ParticleSystem<2>&, const Real*, ModelKind);
template Real rim_fraction<3>(const ParticleSystem<3>&, const Real*, ModelKind);
template void check_overlaps<2>(ParticleSystem<2>&, const Real*, std::string_view);
template void check_overlaps<3>(ParticleSystem<3>&, const Real*, std::string_view);
template void check_crossings<2>(ParticleSystem<2>&, const Real*, std::string_view, const SurfaceCures&);
template void check_crossings<3>(ParticleSystem<3>&, const Real*, std::string_view, const SurfaceCures&);

}  // namespace pliant
