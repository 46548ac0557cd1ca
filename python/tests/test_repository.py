"""Files of the repository that no program reads: citation, presets, workflow, pictures."""

import ast
import json
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def text_of(name):
    return (ROOT / name).read_text(encoding="utf-8")


def test_citation_has_the_version_and_no_date_without_a_release():
    version = re.search(r"^project\(pliant VERSION ([\d.]+)", text_of("CMakeLists.txt"), re.MULTILINE)[1]
    citation = text_of("CITATION.cff")
    assert re.search(r"^version: (.*)$", citation, re.MULTILINE)[1] == version
    date = re.search(r'^date-released: "(.*)"$', citation, re.MULTILINE)
    released = re.search(rf"^## \[?{re.escape(version)}\]?(.*)$", text_of("CHANGELOG.md"), re.MULTILINE)
    if date:
        assert released and date[1] in released[1], f"CHANGELOG.md has no release {version} of {date[1]}"
    else:
        assert not released or not re.search(r"\d{4}-\d\d-\d\d", released[1]), f"CITATION.cff has no date of {version}"


def test_no_parameter_of_a_model_has_a_second_default():
    """The program declares the defaults of models; functions of the package take these, or have no default."""
    names = {name for options in json.loads(text_of("python/pliant/parameters.json")).values() for name, entry in options.items()
             if "models" in entry}
    assert {"k_l", "e_sp", "phi_c", "mu_disk"} <= names
    second = []
    for path in (ROOT / "python/pliant").rglob("*.py"):
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(function, (ast.FunctionDef, ast.Lambda)):
                given = function.args
                places = [*given.posonlyargs, *given.args]
                pairs = [*zip(places[len(places) - len(given.defaults):], given.defaults), *zip(given.kwonlyargs, given.kw_defaults)]
                second += [f"{path.name}:{argument.lineno}: {argument.arg}" for argument, value in pairs
                           if argument.arg in names and isinstance(value, ast.Constant) and isinstance(value.value, float)]
    assert not second, second


def test_presets():
    presets = json.loads(text_of("CMakePresets.json"))
    configure = {one["name"]: one for one in presets["configurePresets"]}
    assert {"release", "debug", "asan", "tidy"} <= set(configure)
    assert len({one["binaryDir"] for one in configure.values() if "binaryDir" in one}) == len(configure) - 1
    flags = configure["asan"]["cacheVariables"]["CMAKE_CXX_FLAGS"].split()
    assert all(flag in text_of("scripts/sanitize.sh") for flag in flags), "scripts/sanitize.sh has other flags"
    listed = subprocess.run(["cmake", "--list-presets=all"], cwd=ROOT, capture_output=True, encoding="utf-8")
    assert listed.returncode == 0, listed.stderr
    assert all(f'"{name}"' in listed.stdout for name in ("release", "debug", "asan", "tidy"))


def test_containers_have_the_tested_system():
    assert re.search(r"container: debian:12$", text_of(".github/workflows/ci.yml"), re.MULTILINE)
    assert re.search(r"run: \.ci/run$", text_of(".github/workflows/ci.yml"), re.MULTILINE)
    assert set(re.findall(r"^FROM (\S+)", text_of("Dockerfile"), re.MULTILINE)) == {"debian:12"}


def test_pictures_are_small():
    """As plotting.write_figure makes them: WebP files of few colours, two thirds of the bytes of PNG files."""
    sizes = {path.name: path.stat().st_size for path in (ROOT / "docs/images").iterdir()}
    assert {Path(name).suffix for name in sizes} <= {".webp", ".svg"}
    assert sum(sizes.values()) <= 3_000_000
    assert sorted(name for name, size in sizes.items() if size > 120_000) == ["flow.webp", "surfaces.webp"]  # they move


def test_subjects_of_commits_are_short():
    if not (ROOT / ".git").exists():
        pytest.skip("no git repository")
    log = subprocess.run(["git", "-C", ROOT, "log", "--since=2026-11-29T12:48:00Z", "--no-merges", "--format=%s"],
                         capture_output=True, encoding="utf-8")
    if log.returncode:
        pytest.skip("git cannot read the history")
    assert [subject for subject in log.stdout.splitlines() if len(subject) > 72] == []
