#include <pliant/system/stress.h>

#include <algorithm>

#include <pliant/model/polygon.h>

namespace pliant {

template <int D>
Real virial_of_centres(const StateView<D>& s, const Real* forces) {
  const Topology& t = s.topology;
  std::vector<Index> place(static_cast<std::size_t>(t.owned()));  // own particle of an id
  Real own = 0, images = 0;
  for (Index m = 0; m < t.owned(); ++m) {
    const auto id = static_cast<std::size_t>(t.id[m]);
    place.resize(std::max(place.size(), id + 1));
    place[id] = m;
    own -= point<D>(forces, m).dot(mean_of_points<D>(s.x, t, m));
  }
  // Images follow the edges of the box in addition. A pair across the border is listed twice: each particle with the
  // image of the other.
  for (Index m = t.owned(); m < t.particles(); ++m)
    images -= point<D>(forces, m).dot(s.position(t.offset[m]) - s.position(t.offset[place[t.id[m]]]));
  return own + images / 2;
}

template <int D>
std::vector<Mat<D>> particle_stress(ParticleSystem<D>& system, std::span<const Real> x, std::span<const Real> v,
                                    Real t) {
  for (int k = 0; k < D; ++k)
    if (!system.box().periodic(k))
      throw InputError("direction {} of the box is open; stress needs a box that is periodic in all directions", k);
  const StateView<D> s = system.view(x.data(), v.data(), t);
  std::vector<Mat<D>> stress = system.field().particle_virials(s);
  for (Index m = 0; m < s.topology.owned(); ++m) {
    for (Index i = s.topology.offset[m]; i < s.topology.offset[m + 1]; ++i) stress[m] += momentum_flux(s, i);
    stress[m] /= system.box().volume();
  }
  return stress;
}

template Real virial_of_centres(const StateView<2>&, const Real*);
template Real virial_of_centres(const StateView<3>&, const Real*);
template std::vector<Mat<2>> particle_stress(ParticleSystem<2>&, std::span<const Real>, std::span<const Real>, Real);
template std::vector<Mat<3>> particle_stress(ParticleSystem<3>&, std::span<const Real>, std::span<const Real>, Real);

}  // namespace pliant
