// Velocities of droplets without inertia, from the balance of forces and viscous forces.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <pliant/system/mobility.h>

namespace pliant {

/// How the viscous coupling of neighbours is solved.
enum class Coupling {
  exact,   ///< B v = F/b
  lagged,  ///< one iteration: v_i = (Σ_j v_j + F_i/b)/(N_i + 1) with the v_j of the evaluation before
  mean     ///< the same with the mean of the v_j instead of their sum, as [T 2.9] prints it
};

struct NeighbourDragOptions {
  Real b = 1;                 ///< drag coefficient: force per velocity
  Real beyond_contact = 0.1;  ///< droplets are neighbours at r < R_i + R_j + beyond_contact: 2 a_s
  bool walls = false;         ///< walls within R + beyond_contact also have friction, relative to the velocity of the
                              ///< wall [T 4.1]
  Coupling coupling = Coupling::exact;
};

/// Each droplet feels the drag −b v_i and, from every neighbour j, −b (v_i − v_j) [T 2.2, with the sign that the text
/// describes, and 2.3]; forces and friction sum to zero [T 2.9]: B v = F/b (+ Σ v_wall), B = 1 + the graph Laplacian of
/// the neighbours (+ 1 for each wall in range), symmetric and positive definite. Its entries jump when pairs come into
/// range or leave it, and velocities with them.
///
/// PETSc solves it, one right-hand side per dimension, by sparse Cholesky factors, computed again after a change of
/// neighbours. -mobility_ksp_… and -mobility_pc_… choose others: -mobility_ksp_type cg with -mobility_pc_type icc
/// iterates to a relative tolerance of 1e-12. The pattern follows the lists. All droplets are on one rank; ghosts are
/// images in a periodic box.
template <int D>
class NeighbourDrag final : public Mobility<D> {
 public:
  /// Errors: InputError where b or the range is not positive.
  explicit NeighbourDrag(const NeighbourDragOptions& options);
  ~NeighbourDrag() override;

  /// New lists: the next solve() builds the pattern of B again. numbers [points]: the row of each point; a ghost has
  /// the row of its original.
  void set_numbers(std::vector<Index> numbers) override;

  void find_velocities(const ForceField<D>& field, const StateView<D>& s, Real* v) override;

  /// Writes v [owned points · D] for these forces [points · D]; inactive particles rest. On entry, v holds the previous
  /// velocities, from which an iterative solver starts; lagged coupling uses s.v, including ghosts. Errors:
  /// NumericalError if the solver fails, InputError if neighbours are on other ranks.
  void solve(const StateView<D>& s, const Real* force, Real* v);

  /// Power that drag and friction dissipate at s.v: b (Σ v_i² + Σ_pairs |v_i − v_j|² + Σ_walls |v_i − v_wall|²). With
  /// the exact coupling it equals the power of the forces (and of the walls' friction).
  Real power(const StateView<D>& s) const override;

  bool remembers() const override { return true; }
  Real beyond_contact() const override { return options_.beyond_contact; }

  const NeighbourDragOptions& options() const { return options_; }
  /// Iterations of the solver so far, all dimensions together.
  std::int64_t iterations() const { return iterations_; }

 private:
  struct Solver;  // hides PETSc from those who include this

  /// Calls visit(i, j, e) for each listed pair of an owned point i, once from each side.
  template <class Visit>
  static void for_each_neighbour(const StateView<D>& s, Visit&& visit);
  bool in_range(const StateView<D>& s, Index i, Index j, Index e) const {
    const Real range = s.neighbours.point_pairs.reach[e] + options_.beyond_contact;
    return (s.position(i) - s.position(j)).squaredNorm() < square(range);
  }
  /// Calls visit(i, velocity of the wall there) for each wall in range of an owned point i.
  template <class Visit>
  void for_each_wall(const StateView<D>& s, Visit&& visit) const;
  void find_coupling(const StateView<D>& s);

  NeighbourDragOptions options_;
  std::vector<Index> numbers_;
  std::vector<std::uint8_t> coupled_;  ///< [entries of for_each_neighbour] in range?
  std::vector<Real> diagonal_;         ///< [owned points] of B
  std::vector<Real> force_;            ///< [points · D]
  std::vector<Real> push_;             ///< [owned points · D] sum of the velocities of the walls in range
  std::int64_t iterations_ = 0;
  std::unique_ptr<Solver> solver_;
};

extern template class NeighbourDrag<2>;
extern template class NeighbourDrag<3>;

}  // namespace pliant
