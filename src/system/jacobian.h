// Derivatives of the acceleration as PETSc matrices, for implicit methods.
#pragma once

#include <memory>

#include <pliant/base/petsc.h>
#include <pliant/model/force_field.h>

namespace pliant {

template <int D>
class ParticleSystem;

/// assembled: one sparse matrix, also to precondition with. matrix_free: products by the element loops from the terms'
/// second derivatives, and a matrix of the blocks on the diagonal, one per particle, to precondition with.
enum class JacobianKind { assembled, matrix_free };

/// The unknowns: y = [x; v], or x alone.
enum class JacobianForm { first_order, second_order };

/// Factors of the parts of an operator; see Jacobian::update.
struct JacobianWeights {
  Real identity, x, v;
};

/// With A = ∂a/∂x and B = ∂a/∂v of a group of the terms of a system, the operator is
///
///     first order:   identity · 1 + x · [[0, 1], [A, 0]] + v · [[0, 0], [0, B]]    for [x; v], rank by rank
///     second order:  identity · 1 + x · A + v · B
///
/// so that (0, 1, 1) is the Jacobian of ẏ = [v; a], (σ, −1, −1) the Jacobian of σ y − ẏ, and (σ², −1, −σ) the Jacobian
/// of ẍ − a. The pattern contains all entries of the neighbour lists, with zeros for elements that do not touch, and
/// follows the lists when they are rebuilt.
class Jacobian {
 public:
  virtual ~Jacobian() = default;

  /// Sets both matrices at time t and x, v [size of the system]. Collective. Errors: as of the neighbour lists.
  virtual void update(Real t, const Real* x, const Real* v, const JacobianWeights& weights) = 0;

  ::Mat matrix() const { return shell_ ? shell_ : blocks_; }
  ::Mat preconditioner() const { return blocks_; }

 protected:
  PetscMat shell_;   ///< matrix_free only
  PetscMat blocks_;  ///< assembled
};

/// Refers to the system, which must outlive it.
template <int D>
std::unique_ptr<Jacobian> make_jacobian(ParticleSystem<D>& system, JacobianForm form, JacobianKind kind,
                                        TermGroup group);

}  // namespace pliant
