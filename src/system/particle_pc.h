// A preconditioner of one block per particle, as a PETSc PC type.
#pragma once

#include <pliant/base/petsc.h>
#include <pliant/model/topology.h>
#include <pliant/system/jacobian.h>

namespace pliant {

/// Name of the type: PCSetType(pc, particle_pc) or -pc_type particle.
inline constexpr char particle_pc[] = "particle";

/// Registers the type with PCRegister; call it after PetscInitialize, as often as you like.
///
/// Solves with the blocks of the preconditioning matrix within each particle and drops blocks between particles: exact
/// if no particles touch. The matrix is that of a Jacobian, scaled and shifted in any way. Of first order it is
/// [[p, q], [R, S]] with numbers p, q; of each particle T = R − (p/q) S is made (σ² − σB − A for σ − J), and factored
/// densely: Cholesky where T is symmetric and positive, else LU with pivots. It has no options. Errors (at set-up): a
/// matrix without set_particle_blocks.
PetscErrorCode particle_pc_register();

/// Tells a matrix which of its rows make a particle. A matrix made by MatDuplicate does not know.
void set_particle_blocks(::Mat matrix, JacobianForm form, const Topology& topology, int dim);

}  // namespace pliant
