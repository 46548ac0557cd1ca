#include <pliant/system/fire.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/kernels/arrays.h>
#include <pliant/kernels/fire.h>
#include <pliant/model/chunks.h>

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

using ArrayMap = Eigen::Map<Eigen::ArrayXd>;

/// Sums over a block of coordinates.
struct BlockSums {
  std::size_t bad = 0;  ///< first coordinate with a force that is not finite; the end of the block if there is none
  FireForces forces;
  Real speed_square = 0, largest_speed = 0;
};

/// Coordinates in blocks, one after the other in memory, which threads share. Sums over blocks are added in their
/// order, so that results do not depend on the number of threads.
class CoordinateBlocks {
 public:
  explicit CoordinateBlocks(Eigen::Index coordinates)
      : coordinates_(coordinates), sums_(static_cast<std::size_t>((coordinates + size - 1) / size)) {}

  /// visit(first, count, sums) for each block.
  template <class Visit>
  void each(Visit&& visit) {
    for_each_chunk(static_cast<Index>(sums_.size()), [&](Index block) {
      const Eigen::Index first = block * size;
      visit(first, std::min(size, coordinates_ - first), sums_[static_cast<std::size_t>(block)]);
    });
  }
  FireForces forces() const {
    FireForces all;
    Real unit = 0, squares = 0;  // squares may underflow before the numbers do
    for (const BlockSums& block : sums_) {
      all.largest = std::max(all.largest, block.forces.largest);
      all.power += block.forces.power;
      unit = std::max(unit, block.forces.norm);
    }
    for (const BlockSums& block : sums_) squares += block.forces.norm / unit * (block.forces.norm / unit);
    all.norm = unit * std::sqrt(squares);
    return all;
  }
  Real speed_square() const {
    Real sum = 0;
    for (const BlockSums& block : sums_) sum += block.speed_square;
    return sum;
  }
  Real largest_speed() const {
    Real largest = 0;
    for (const BlockSums& block : sums_) largest = std::max(largest, block.largest_speed);
    return largest;
  }
  /// First coordinate with a force that is not finite, or the number of coordinates.
  std::size_t bad() const {
    std::size_t end = 0;
    for (const BlockSums& block : sums_) {
      end += static_cast<std::size_t>(size);
      if (block.bad < end && block.bad < static_cast<std::size_t>(coordinates_)) return block.bad;
    }
    return static_cast<std::size_t>(coordinates_);
  }

 private:
  static constexpr Eigen::Index size = 16384;  ///< three arrays of a block fit into the second-level cache
  Eigen::Index coordinates_;
  std::vector<BlockSums> sums_;
};

}  // namespace

FireResult fire(std::span<Real> x_in, std::span<const Real> mass, const EnergyAndForce& energy_and_force,
                const FireOptions& o) {
  check(o, x_in.size(), mass);
  const auto n = static_cast<Eigen::Index>(x_in.size());
  Real* const x = x_in.data();
  Eigen::ArrayXd v(n), f(n), inverse_mass;
  if (mass.size() > 1) {
    inverse_mass.resize(n);
    const Eigen::Index shared = n / static_cast<Eigen::Index>(mass.size());
    for (Eigen::Index i = 0; i < n; ++i) inverse_mass[i] = 1 / mass[i / shared];
  }
  CoordinateBlocks blocks(n);
  blocks.each([&](Eigen::Index first, Eigen::Index count, BlockSums&) { v.segment(first, count).setZero(); });
  const Real dt_min = o.dt_min > 0 ? o.dt_min : 0.02 * o.dt;
  Real dt = o.dt, alpha = o.alpha;
  int downhill = 0;
  FireResult result;

  while (true) {
    const bool with_energy = !o.force || result.iterations % 10 == 0 || result.iterations == o.max_iterations;
    if (with_energy)
      result.energy = energy_and_force(x, f.data());
    else
      o.force(x, f.data());
    ++result.evaluations;
    blocks.each([&](Eigen::Index first, Eigen::Index count, BlockSums& sums) {
      const auto length = static_cast<std::size_t>(count);
      const Real* const force = f.data() + first;
      sums.forces = fire_forces(length, force, v.data() + first);
      const bool finite = std::isfinite(sums.forces.norm);
      sums.bad = static_cast<std::size_t>(first) + (finite ? length : first_non_finite(force, length));
    });
    if (const std::size_t bad = blocks.bad(); bad != x_in.size())
      throw NumericalError("FIRE: the force on coordinate {} is {} in iteration {}; reduce dt_max or set max_move", bad,
                           f[static_cast<Eigen::Index>(bad)], result.iterations);
    if (!std::isfinite(result.energy))
      throw NumericalError("FIRE: the energy is {} in iteration {}; reduce dt_max or set max_move", result.energy,
                           result.iterations);
    const FireForces forces = blocks.forces();
    result.max_force = forces.largest;
    const auto finish = [&](FireStop stop, std::string reason) {
      result.stop = stop;
      result.converged = stop != FireStop::iterations;
      result.reason = std::move(reason);
      return result;
    };
    if (result.max_force <= o.force_tolerance) {
      if (!with_energy) result.energy = energy_and_force(x, f.data());
      return finish(FireStop::force,
                    fmt::format("largest force {:.3g} within {:.3g}", result.max_force, o.force_tolerance));
    }
    if (with_energy && std::abs(result.energy) <= o.energy_tolerance)
      return finish(FireStop::energy, fmt::format("energy {:.3g} within {:.3g}", result.energy, o.energy_tolerance));
    if (with_energy && o.done && o.done(x)) return finish(FireStop::done, "done");
    if (result.iterations == o.max_iterations)
      return finish(FireStop::iterations, fmt::format("limit of {} iterations reached with largest force {:.3g}",
                                                      o.max_iterations, result.max_force));
    ++result.iterations;

    const bool uphill = !(forces.power > 0);
    if (!uphill) {
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
    }
    // Uphill it goes back half a step, and stops.
    const Real back = 0.5 * dt;
    blocks.each([&](Eigen::Index first, Eigen::Index count, BlockSums& sums) {
      auto velocity = v.segment(first, count);
      const auto force = f.segment(first, count);
      if (uphill) {
        ArrayMap(x + first, count) -= back * velocity;
        velocity.setZero();
      }
      if (mass.size() > 1) {
        velocity += dt * force * inverse_mass.segment(first, count);
        sums.speed_square = velocity.matrix().squaredNorm();
      } else {
        sums.speed_square =
            fire_kick(static_cast<std::size_t>(count), dt / mass.front(), force.data(), velocity.data());
      }
    });
    const Real kept = 1 - alpha, turned = alpha * std::sqrt(blocks.speed_square()) / forces.norm;
    blocks.each([&](Eigen::Index first, Eigen::Index count, BlockSums& sums) {
      const auto length = static_cast<std::size_t>(count);
      sums.largest_speed = fire_turn(length, kept, turned, f.data() + first, v.data() + first);
      if (!(o.max_move > 0)) add_multiple(length, dt, v.data() + first, x + first);
    });
    if (!(o.max_move > 0)) continue;
    const Real move = dt * blocks.largest_speed(), part = o.max_move / move;
    blocks.each([&](Eigen::Index first, Eigen::Index count, BlockSums&) {
      if (move > o.max_move) v.segment(first, count) *= part;
      add_multiple(static_cast<std::size_t>(count), dt, v.data() + first, x + first);
    });
  }
}

}  // namespace pliant
