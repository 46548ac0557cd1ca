// Version and build of this binary: for -version and the manifest of a run.
#pragma once

#include <string>

namespace pliant {

struct BuildInfo {
  std::string version;     ///< of Pliant, "0.2.0"
  std::string commit;      ///< abbreviated hash with "-dirty" if there were changes; "unknown" outside a git checkout
  std::string compiler;    ///< name and version
  std::string build_type;  ///< "Release", …
  std::string flags;       ///< compiler flags
  std::string petsc;       ///< version of the PETSc library that is loaded
  std::string hdf5;        ///< version of HDF5 that it was built with

  /// The `build` attribute of a run's manifest: commit, compiler, build type, flags in one line.
  std::string build() const;
  /// Text of `-version`, one line each, ending in a newline.
  std::string text() const;
};

/// Errors: NumericalError if PETSc does not return its version.
BuildInfo build_info();

}  // namespace pliant
