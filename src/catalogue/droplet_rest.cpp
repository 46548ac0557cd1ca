#include <pliant/catalogue/droplet_rest.h>

#include <cmath>

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>

namespace pliant {
namespace {

/// The energy's minimum between `near`, where droplets must repel, and `touch`, by bisection to rounding.
template <class Law>
DropletRest rest(Real near, Real touch, Law&& law) {
  if (const Real slope = law(near).slope; !(slope < 0))
    throw InputError(
        "droplets do not rest: at the distance {:g} the depletion attraction exceeds the contact force by {:g}; use {}",
        near, slope, cures({Cure::weaker_attraction}));
  Real low = near, high = touch;
  while (true) {
    const Real middle = low + (high - low) / 2;
    if (middle <= low || middle >= high) break;
    (law(middle).slope < 0 ? low : high) = middle;
  }
  const Radial u = law(low);
  return {low, u.curvature, -u.value};
}

}  // namespace

DropletRest droplets_at_rest(const BubbleContactLaw& contact, const DepletionLaw& depletion, Real a, Real b) {
  return rest(std::max(std::abs(a - b), (a + b) / 2), a + b, [&](Real r) {
    const Radial u = contact.at(r, a, b), w = depletion.at(r, a, b);
    return Radial{u.value + w.value, u.slope + w.slope, u.curvature + w.curvature};
  });
}

DropletRest droplet_at_wall(const WallRepulsionLaw& repulsion, const WallDepletionLaw& depletion, Real radius) {
  const std::optional wall = Solid<2>::half_space({0, 0}, {0, 1});
  return rest(radius / 2, radius, [&](Real h) {
    const Vec<2> r(0, h);
    const WallFoot<2> foot = wall->foot(r);
    const Expansion<2> u = repulsion.at(wall, foot, r, radius), w = depletion.at(wall, foot, r, radius);
    return Radial{u.value + w.value, u.gradient[1] + w.gradient[1], u.hessian(1, 1) + w.hessian(1, 1)};
  });
}

}  // namespace pliant
