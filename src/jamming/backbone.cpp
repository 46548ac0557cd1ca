#include <pliant/jamming/backbone.h>

#include <unordered_map>
#include <vector>

namespace pliant {

template <int D>
Backbone<D>::Backbone(ParticleSystem<D>& system, std::span<const Index> without)
    : system_(system), all_(system.topology()) {
  if (system.rotates_or_remembers())
    throw InputError(
        "particles that rotate or have contact history cannot be removed; use a model whose forces depend on positions "
        "only");
  all_.drop_ghosts();
  std::unordered_map<Index, Index> place;
  for (Index m = 0; m < all_.particles(); ++m)
    if (all_.active[m] != 0) place[all_.id[m]] = m;
  std::vector<Index> places;
  for (const Index id : without) {
    const auto at = place.find(id);
    if (at == place.end())
      throw InputError("particle {} is not active, and cannot be removed; name active particles", id);
    places.push_back(at->second);
  }
  for (const Index m : places) system.deactivate(m);
}

template class Backbone<2>;
template class Backbone<3>;

}  // namespace pliant
