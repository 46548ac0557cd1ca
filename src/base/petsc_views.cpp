#include <pliant/base/petsc_views.h>

namespace pliant {

bool has_petsc_option(const std::string& name) {
  PetscBool set = PETSC_FALSE;
  petsc_check(PetscOptionsHasName(nullptr, nullptr, name.c_str(), &set));
  return set == PETSC_TRUE;
}

Handle<PetscViewer, PetscViewerDestroy> viewer_option(MPI_Comm comm, const std::string& name) {
  Handle<PetscViewer, PetscViewerDestroy> viewer;
  petsc_check(PetscOptionsGetViewer(comm, nullptr, nullptr, name.c_str(), viewer.out(), nullptr, nullptr));
  return viewer;
}

void read_views(MPI_Comm comm, std::span<const char* const> names, const std::string& prefix) {
  for (const char* view : names)
    if (const std::string name = "-" + prefix + view; has_petsc_option(name)) (void)viewer_option(comm, name);
}

}  // namespace pliant
