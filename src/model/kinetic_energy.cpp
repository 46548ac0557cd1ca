#include <pliant/model/term.h>

namespace pliant {

template <int D>
Real kinetic_energy(const StateView<D>& s) {
  Real sum = 0;
  for (Index i = 0; i < s.topology.owned_points(); ++i) sum += s.kinetic_energy(i);
  return sum;
}

template Real kinetic_energy<2>(const StateView<2>&);
template Real kinetic_energy<3>(const StateView<3>&);

}  // namespace pliant
