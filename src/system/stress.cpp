#include <pliant/system/stress.h>

namespace pliant {

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

template std::vector<Mat<2>> particle_stress(ParticleSystem<2>&, std::span<const Real>, std::span<const Real>, Real);
template std::vector<Mat<3>> particle_stress(ParticleSystem<3>&, std::span<const Real>, std::span<const Real>, Real);

}  // namespace pliant
