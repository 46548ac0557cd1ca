"""Wheel of Pliant: CMake builds and installs its components, setuptools packs them. pyproject.toml has the metadata.

CMAKE_ARGS (environment) adds arguments to the configuration.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py
from distutils.command.install_data import install_data  # by setuptools, also where Python has no distutils

ROOT = Path(__file__).resolve().parent
BUILD = ROOT / "build/wheel"


def cmake(*arguments):
    subprocess.run(["cmake", *arguments], cwd=ROOT, check=True)


class Build(build_py):
    """The Python package with its compiled module."""

    def run(self):
        cmake("--preset", "package", "-B", str(BUILD), "-D", f"PLIANT_PYTHON_PROGRAM={sys.executable}", "-D", "PLIANT_PYTHON_DIR=.",
              *shlex.split(os.environ.get("CMAKE_ARGS", "")))
        cmake("--build", str(BUILD), "--target", "pliant", "pliant_python")
        shutil.rmtree(self.build_lib, ignore_errors=True)  # files of earlier versions
        cmake("--install", str(BUILD), "--component", "python", "--prefix", str(Path(self.build_lib).absolute()))


class InstallData(install_data):
    """The program, and the figures, tables and examples, below the prefix of the environment."""

    def run(self):
        for component in ("program", "data"):
            cmake("--install", str(BUILD), "--component", component, "--prefix", str(Path(self.install_dir).absolute()))


class Compiled(Distribution):
    """A package with parts of each kind, which setuptools does not find itself."""

    has_ext_modules = has_pure_modules = has_data_files = lambda self: True


(ROOT / "build").mkdir(exist_ok=True)
setup(version=re.search(r"^project\(pliant VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"), re.M)[1],
      packages=[], ext_modules=[], data_files=[], distclass=Compiled, cmdclass={"build_py": Build, "install_data": InstallData},
      scripts=[str(path.relative_to(ROOT)) for path in sorted(ROOT.glob("python/pliant-*"))])
