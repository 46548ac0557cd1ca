// Passes of minimisers over coordinates x[n], forces f and velocities v. Sums have the same bits on every machine.
#pragma once

#include <cstddef>

#include <pliant/base/types.h>

namespace pliant {

struct FireForces {
  Real largest = 0;  ///< max |f_i|
  Real norm = 0;     ///< |f|, also where f·f underflows; finite only if all forces are
  Real power = 0;    ///< f·v
};
FireForces fire_forces(std::size_t n, const Real* f, const Real* v);

/// v += h f; returns v·v.
Real fire_kick(std::size_t n, Real h, const Real* f, Real* v);
/// v ← kept v + turned f; returns max |v_i|.
Real fire_turn(std::size_t n, Real kept, Real turned, const Real* f, Real* v);
/// x += h v
void add_multiple(std::size_t n, Real h, const Real* v, Real* x);
/// a·b
Real dot(std::size_t n, const Real* a, const Real* b);

}  // namespace pliant
