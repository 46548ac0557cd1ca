// A preconditioner of one block per particle, as a PETSc PC type.
#pragma once

#include <pliant/base/petsc.h>
#include <pliant/model/topology.h>
#include <pliant/system/jacobian.h>

namespace pliant {

/// Name of the type: PCSetType(pc, particle_pc) or -pc_type particle.
inline constexpr char particle_pc[] = "particle";

/// Registers the type with PCRegister; call it after PetscInitialize, any number of times.
///
/// Solves with the blocks of the preconditioning matrix within each particle and drops blocks between particles: exact
/// if no particles touch. The matrix is a Jacobian, scaled and shifted in any way. In first-order form it is [[p, q],
/// [R, S]] with numbers p, q; for each particle T = R − (p/q) S is formed (σ² − σB − A for σ − J), and factored
/// densely: Cholesky where T is symmetric and positive, else LU with pivots. The type has no options. Errors (at
/// set-up): a matrix without set_particle_blocks.
PetscErrorCode particle_pc_register();

/// Attaches to a matrix the rows of each particle. MatDuplicate does not copy this information.
void set_particle_blocks(::Mat matrix, JacobianForm form, const Topology& topology, int dim);

}  // namespace pliant
