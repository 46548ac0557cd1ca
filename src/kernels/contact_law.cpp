#include <pliant/kernels/contact_law.h>

namespace pliant {
namespace {

template <class Of>
Real of_law(const Overlap& v, Of&& of) {
  return with_law(v.kind, [&]<class Law>(Law) { return of(Law{v.epsilon, v.delta}); });
}

}  // namespace

Real Overlap::value(Real d) const {
  return of_law(*this, [&](const auto& law) { return law.value(d); });
}
Real Overlap::curvature(Real d) const {
  return of_law(*this, [&](const auto& law) { return law.curvature(d); });
}
Real Overlap::stiffness(ContactLaw kind) {
  return with_law(kind, []<class Law>(Law) { return Law::stiffness; });
}
Real Overlap::scale(ContactLaw kind, Real delta) {
  return with_law(kind, [&]<class Law>(Law) { return Law::scale(delta); });
}

}  // namespace pliant
