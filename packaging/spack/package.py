# Untested. Copy it to packages/pliant/package.py of a Spack repository.
from spack.package import *


class Pliant(CMakePackage):
    """Simulator of soft and deformable particles."""

    license("BSD-3-Clause")
    # Until there is a release: spack develop --path SOURCES pliant@main
    version("main")

    variant("python", default=True, description="Python package with the engine, sweeps and figures")
    extends("python", when="+python")

    depends_on("c", type="build")
    depends_on("cxx", type="build")
    depends_on("cmake@3.25:", type="build")
    depends_on("ninja", type="build")
    depends_on("pkgconfig", type=("build", "link"))
    depends_on("mpi")
    depends_on("petsc@3.18:+mpi")
    depends_on("slepc@3.18:")
    depends_on("sundials@6.4:+mpi+petsc")
    depends_on("hdf5@1.10:+mpi")
    depends_on("eigen@3.4:")
    depends_on("fmt")
    depends_on("nlohmann-json")
    depends_on("libyaml")
    depends_on("zlib-api")
    with when("+python"):
        depends_on("python@3.9:", type=("build", "link", "run"))
        depends_on("py-pybind11@2.10:", type="build")
        for module in ("h5py", "lmfit", "matplotlib", "numpy", "pandas", "pillow", "scipy", "uncertainties"):
            depends_on(f"py-{module}", type="run")

    generator("ninja")

    def cmake_args(self):
        args = [self.define("PLIANT_BUILD_TESTS", False), self.define("PLIANT_BUILD_EXAMPLES", False),
                self.define_from_variant("PLIANT_PYTHON", "python")]
        if "+python" in self.spec:
            args += [self.define("PLIANT_PYTHON_PROGRAM", self.spec["python"].command.path),
                     self.define("PLIANT_PYTHON_DIR", python_platlib)]
        return args
