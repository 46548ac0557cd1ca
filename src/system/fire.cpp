#include <pliant/system/fire.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/kernels/finite.h>

namespace pliant {
namespace {

void check(const FireOptions& o, std::size_t n, std::span<const Real> mass) {
  if (mass.empty() ? n != 0 : n % mass.size() != 0)
    throw InputError("FIRE got {} coordinates and {} masses; the first must be a multiple of the second", n,
                     mass.size());
  for (const Real m : mass)
    if (!(m > 0)) throw InputError("FIRE got a mass of {}, but masses must be positive", m);
  if (!(o.dt > 0) || !(o.dt_max >= o.dt) || !(o.dt_min >= 0) || !(o.dt_min <= o.dt))
    throw InputError("FIRE got the steps dt_min {}, dt {}, dt_max {}; they must be positive and in this order",
                     o.dt_min, o.dt, o.dt_max);
  if (!(o.grow >= 1) || !(o.shrink > 0 && o.shrink < 1) || !(o.alpha >= 0 && o.alpha <= 1) ||
      !(o.alpha_shrink > 0 && o.alpha_shrink <= 1) || o.delay < 0 || o.max_iterations < 0 || !(o.max_move >= 0) ||
      !(o.force_tolerance >= 0))
    throw InputError(
        "FIRE got an option out of range (grow {}, shrink {}, alpha {}, alpha_shrink {}, delay {}, max_iterations {}, "
        "max_move {}, force_tolerance {}); see FireOptions",
        o.grow, o.shrink, o.alpha, o.alpha_shrink, o.delay, o.max_iterations, o.max_move, o.force_tolerance);
}

using Array = Eigen::Map<Eigen::ArrayXd>;

}  // namespace

FireResult fire(std::span<Real> x_in, std::span<const Real> mass, const EnergyAndForce& energy_and_force,
                const FireOptions& o) {
  check(o, x_in.size(), mass);
  const auto n = static_cast<Eigen::Index>(x_in.size());
  Array x(x_in.data(), n);
  Eigen::ArrayXd v = Eigen::ArrayXd::Zero(n), f(n), inverse_mass;
  if (mass.size() > 1) {
    inverse_mass.resize(n);
    const Eigen::Index shared = n / static_cast<Eigen::Index>(mass.size());
    for (Eigen::Index i = 0; i < n; ++i) inverse_mass[i] = 1 / mass[i / shared];
  }
  const Real dt_min = o.dt_min > 0 ? o.dt_min : 0.02 * o.dt;
  Real dt = o.dt, alpha = o.alpha;
  int downhill = 0;
  FireResult result;

  while (true) {
    const bool with_energy = !o.force || result.iterations % 10 == 0 || result.iterations == o.max_iterations;
    if (with_energy)
      result.energy = energy_and_force(x.data(), f.data());
    else
      o.force(x.data(), f.data());
    ++result.evaluations;
    const std::size_t bad = first_non_finite(f.data(), x_in.size());
    if (bad != x_in.size())
      throw NumericalError("FIRE: the force on coordinate {} is {} in iteration {}; reduce dt_max or set max_move", bad,
                           f[static_cast<Eigen::Index>(bad)], result.iterations);
    if (!std::isfinite(result.energy))
      throw NumericalError("FIRE: the energy is {} in iteration {}; reduce dt_max or set max_move", result.energy,
                           result.iterations);
    result.max_force = n > 0 ? f.abs().maxCoeff() : 0;
    const auto finish = [&](FireStop stop, std::string reason) {
      result.stop = stop;
      result.converged = stop != FireStop::iterations;
      result.reason = std::move(reason);
      return result;
    };
    if (result.max_force <= o.force_tolerance) {
      if (!with_energy) result.energy = energy_and_force(x.data(), f.data());
      return finish(FireStop::force,
                    fmt::format("largest force {:.3g} within {:.3g}", result.max_force, o.force_tolerance));
    }
    if (with_energy && std::abs(result.energy) <= o.energy_tolerance)
      return finish(FireStop::energy, fmt::format("energy {:.3g} within {:.3g}", result.energy, o.energy_tolerance));
    if (with_energy && o.done && o.done(x.data())) return finish(FireStop::done, "done");
    if (result.iterations == o.max_iterations)
      return finish(FireStop::iterations, fmt::format("limit of {} iterations reached with largest force {:.3g}",
                                                      o.max_iterations, result.max_force));
    ++result.iterations;

    if ((f * v).sum() > 0) {
      if (++downhill > o.delay) {
        dt = std::min(dt * o.grow, o.dt_max);
        alpha *= o.alpha_shrink;
      }
    } else {
      downhill = 0;
      if (result.iterations > o.delay) {
        dt = std::max(dt * o.shrink, dt_min);
        alpha = o.alpha;
      }
      x -= 0.5 * dt * v;
      v.setZero();
    }
    if (mass.size() > 1)
      v += dt * f * inverse_mass;
    else
      v += dt / mass.front() * f;
    const Real f_norm = f.matrix().stableNorm();  // f·f underflows before f does
    v = (1 - alpha) * v + (alpha * v.matrix().norm() / f_norm) * f;
    const Real move = dt * v.abs().maxCoeff();
    if (o.max_move > 0 && move > o.max_move) v *= o.max_move / move;
    x += dt * v;
  }
}

}  // namespace pliant
