"""Each guarantee of docs/reference/reliability.md names tests that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/reference/reliability.md"
FOLDERS = sorted(path.name for path in (ROOT / "tests").iterdir() if path.is_dir())
PYTHON = [ROOT / "tests/apps", ROOT / "python/tests", ROOT / "tests/python"]


def guarantees(text):
    """(guarantee, tests) of each row of a table with the columns "guarantee" and "tests"."""
    for table in re.findall(r"^\| guarantee \| tests \|\n\|---\|---\|\n((?:\|.*\n)+)", text, re.M):
        for row in table.splitlines():
            guarantee, tests = row.removesuffix("|").removeprefix("| ").rsplit(" | ", 1)
            yield guarantee, tests.strip()


def parts(tests):
    """Names of tests, each after the file or the folder that the page names before it: (place, name)."""
    place = None
    for folder, quoted in re.findall(r"(?:^|(?<=[\s;(]))([a-z]+)(?=:|;|,|$|\s)|`([^`]+)`", tests.split("Tested by hand")[0]):
        if folder:
            place = folder if folder in FOLDERS else place
            continue
        name = quoted.removeprefix("… ")
        if name.startswith(("scripts/", "python/", "tests/", ".ci/")):
            place = name.split()[0]
            yield place, ""
        elif re.match(r"test_\w+$", name) and python_files(name):
            place = name
            yield place, ""
        elif re.match(r"test_\w+: ", name):
            place, name = name.split(": ", 1)
            yield place, name
        else:
            yield place, name


def python_files(name):
    return [path for folder in PYTHON if (path := folder / f"{name}.py").is_file()]


def exists(place, name):
    """Whether the folder of C++ tests, the Python file or the path has a test of that name (or a beginning of it)."""
    name = name.removesuffix("…").removesuffix("_").strip()
    if place in FOLDERS:
        if name.endswith(".cpp"):
            return (ROOT / "tests" / place / name).is_file()
        titles = "".join(re.sub(r'"\s*\n\s*"', "", path.read_text(encoding="utf-8")) for path in (ROOT / "tests" / place).rglob("*.cpp"))
        return name in titles if name.startswith("[") else re.search(rf'TEST_CASE\(\s*"[^"]*{re.escape(name)}', titles) is not None
    paths = python_files(place) if place and place.startswith("test_") else [path for path in [ROOT / (place or "-")] if path.exists()]
    if not name:
        return bool(paths)
    return any(re.search(rf"^def test_\w*{re.escape(name.removeprefix('test_'))}", path.read_text(encoding="utf-8"), re.M) for path in paths)


ROWS = list(guarantees(PAGE.read_text(encoding="utf-8")))


@pytest.mark.parametrize("guarantee, tests", ROWS, ids=[guarantee[:40] for guarantee, _ in ROWS])
def test_guarantee(guarantee, tests):
    found = list(parts(tests))
    assert found, f"no test: {guarantee}"
    missing = [f"{place}: {name}" for place, name in found if not exists(place, name)]
    assert not missing, f"{guarantee}: {missing}"


def test_every_table_of_guarantees_is_read():
    assert len(ROWS) > 70 and PAGE.read_text(encoding="utf-8").count("| guarantee |") == len(
        re.findall(r"^\| guarantee \| tests \|\n\|---\|---\|$", PAGE.read_text(encoding="utf-8"), re.M))


def test_the_check_itself():
    page = "| guarantee | tests |\n|---|---|\n| a | `test_kills: every_kill`, `no_such`; io: `[lock]`, `no title …` |\n| b |  |\n"
    (first, one), (second, none) = guarantees(page)
    assert [exists(*part) for part in parts(one)] == [True, False, True, False]
    assert second == "b" and list(parts(none)) == []
