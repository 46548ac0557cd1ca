#include <fmt/format.h>
#include <pliant/base/petsc.h>
#include <pliant/base/version.h>
#include <pliant_version_generated.h>

namespace pliant {

BuildInfo build_info() {
  PetscInt major = 0, minor = 0, subminor = 0, release = 0;
  petsc_check(PetscGetVersionNumber(&major, &minor, &subminor, &release));
  return {PLIANT_VERSION,     PLIANT_COMMIT, PLIANT_COMPILER,
          PLIANT_BUILD_TYPE,  PLIANT_FLAGS,  fmt::format("{}.{}.{}", major, minor, subminor),
          PLIANT_HDF5_VERSION};
}

std::string BuildInfo::build() const { return fmt::format("{}, {}, {}, {}", commit, compiler, build_type, flags); }

std::string BuildInfo::text() const {
  return fmt::format("pliant {}\ncommit {}\ncompiler {}\nbuild {} {}\nPETSc {}\nHDF5 {}\n", version, commit, compiler,
                     build_type, flags, petsc, hdf5);
}

}  // namespace pliant
