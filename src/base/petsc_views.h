// Options of PETSc that show an object or why it ended, and that PETSc reads only where it solves.
#pragma once

#include <petscviewer.h>

#include <array>
#include <span>
#include <string>

#include <pliant/base/petsc.h>

namespace pliant {

inline constexpr std::array ksp_views{
    "ksp_view",     "ksp_view_pre",      "ksp_view_mat",         "ksp_view_pmat",
    "ksp_view_rhs", "ksp_view_solution", "ksp_converged_reason", "ksp_converged_rate"};

/// Whether the command has this option; `name` begins with a dash.
bool has_petsc_option(const std::string& name);

/// The viewer that an option names, or null.
Handle<PetscViewer, PetscViewerDestroy> viewer_option(MPI_Comm comm, const std::string& name);

/// Marks the options -PREFIX_NAME as used, so that they are not refused before PETSc reads them. Errors: InputError
/// for an unknown viewer, OutputError for a file that cannot be written.
void read_views(MPI_Comm comm, std::span<const char* const> names, const std::string& prefix = "");

}  // namespace pliant
