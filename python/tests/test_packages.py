"""Metadata of the packages: versions, dependencies, and files that packages install to other folders than the sources."""

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
VERSION = re.search(r"^project\(pliant VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"), re.MULTILINE)[1]


#: Module → its name in Debian and elsewhere, if it differs.
NAMES = {"PIL": ("pil", "pillow")}
#: Imported by single functions when they are called: Simulation.hessian(petsc=True), a progress bar.
OPTIONAL = {"petsc4py", "tqdm"}


def fields(first):
    """Fields of the paragraph of debian/control that begins with this line: {field: {names of packages}}."""
    paragraphs = re.split(r"\n\n+", (ROOT / "debian/control").read_text(encoding="utf-8"))
    paragraph = next(text for text in paragraphs if text.startswith(f"{first}\n"))
    found = re.findall(r"^([\w-]+):((?:.*)(?:\n .*)*)", paragraph, re.MULTILINE)
    return {name: {entry.split()[0] for entry in value.split(",") if entry.strip()} for name, value in found}


def imports():
    """Modules that the installed Python files import. Modules of Python itself and of Pliant are left out."""
    files = [path for pattern in ("python/pliant/**/*.py", "python/plots/*.py", "python/pliant-*", "examples/**/*.py")
             for path in ROOT.glob(pattern)]
    found = set()
    for path in files:
        for node in ast.walk(ast.parse(path.read_bytes())):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module]
            found.update(name.split(".")[0] for name in names)
    return found - sys.stdlib_module_names - {"pliant"}


def test_versions():
    assert re.match(r"pliant \(([\d.]+)\)", (ROOT / "debian/changelog").read_text(encoding="utf-8"))[1] == VERSION
    shown = subprocess.run([sys.executable, "-B", "setup.py", "--version"], cwd=ROOT, capture_output=True, encoding="utf-8")
    assert shown.stdout.split()[-1:] == [VERSION], shown.stderr


def test_dependencies_of_the_debian_package():
    needed = imports() - OPTIONAL
    debian = fields("Package: pliant")
    modules = {name.removeprefix("python3-") for name in debian["Depends"] if name.startswith("python3-")}
    assert modules >= {NAMES.get(name, (name,))[0] for name in needed} and {f"python3-{name}" for name in OPTIONAL} <= debian["Recommends"] | debian["Suggests"]


@pytest.mark.parametrize("file, pattern, missing", [
    ("pyproject.toml", '"{}"', ["h5py"]),  # a comment in the file explains it
    ("packaging/conda-forge/meta.yaml", r"- {}(-base)?\n", []), ("packaging/spack/package.py", '"{}"', [])])
def test_dependencies_of_other_packages(file, pattern, missing):
    text = (ROOT / file).read_text(encoding="utf-8")
    assert [name for name in sorted(imports() - OPTIONAL) if not re.search(pattern.format(NAMES.get(name, (name,))[-1]), text)] == missing


def test_setup_installs_the_packages_that_a_debian_package_is_built_from():
    needed = fields("Source: pliant")["Build-Depends"] - {"debhelper-compat", "dh-python"}  # in scripts/deb.sh
    installed = set(re.findall(r"[\w.+-]+", (ROOT / "scripts/setup.sh").read_text(encoding="utf-8")))
    assert needed <= installed
    libraries = {name for name in needed if name.endswith("-dev")} - {"pybind11-dev", "python3-dev"}
    assert libraries <= fields("Package: libpliant-dev")["Depends"]


def test_a_wheel_has_figures_next_to_its_bin(tmp_path):
    (tmp_path / "bin").mkdir()
    shutil.copy(ROOT / "python/pliant-plot", tmp_path / "bin")
    command = [sys.executable, "-B", tmp_path / "bin/pliant-plot", "--help"]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "python")}  # a wheel installs the package
    missing = subprocess.run(command, capture_output=True, encoding="utf-8", env=environment)
    assert missing.returncode == 4 and "no folder plots" in missing.stderr
    (tmp_path / "share/pliant/python/plots").mkdir(parents=True)
    shutil.copy(ROOT / "python/plots/series.py", tmp_path / "share/pliant/python/plots")
    assert "\n  series " in subprocess.run(command, capture_output=True, encoding="utf-8", env=environment).stdout


def test_a_package_has_tables_below_its_prefix(tmp_path):
    packages = tmp_path / "lib/python3/dist-packages"
    shutil.copytree(ROOT / "python/pliant", packages / "pliant", ignore=shutil.ignore_patterns("__pycache__"))
    tables = tmp_path / "share/pliant/validation"
    tables.mkdir(parents=True)
    found = subprocess.run([sys.executable, "-B", "-c", "from pliant.reproduce.figure import VALIDATION; print(VALIDATION)"],
                           cwd=packages, capture_output=True, encoding="utf-8")
    assert found.stdout.strip() == str(tables), found.stderr
