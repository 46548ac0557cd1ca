"""Commands on the pages: options and figures that they name exist."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
#: Options of the library (PETSc TS) and of every command line.
COMMON = ("ts_", "mobility_", "log_view", "options_file", "help", "version")


def commands(text):
    """Command lines of a page: indented lines, lines of code blocks, `inline code`, each up to a comment or a pipe."""
    text = text.replace("\\\n", " ")
    for line in re.findall(r"^(?:    | *>? ?)?(\S.*)$", text, re.M) + re.findall(r"`([^`\n]+)`", text):
        line = re.sub(r"^mpiexec (-\S+ \S+ )*", "", line.strip())
        if re.match(r"(\S*/)?pliant(-\w+)? \S", line) and "`" not in line and "…" not in line:
            yield re.split(r"\s#|[|;&)]", line)[0].split()


def documented():
    """{scenario: its options} of the page of options."""
    found = {}
    for part in re.split(r"^# Options of `pliant ", (ROOT / "docs/reference/options.md").read_text(encoding="utf-8"), flags=re.M)[1:]:
        found[part.split("`")[0]] = set(re.findall(r"^\| `-(\w+)`", part, re.M))
    return found


def unknown(text, options):
    """Words of the commands of a text that mean nothing to the program."""
    found = []
    for program, *words in commands(text):
        name = program.rsplit("/")[-1]
        if name == "pliant" and words[0] in options:
            given = [word[1:] for word in words[1:] if re.match(r"-[a-z]", word)]
            found += [f"{words[0]} -{one}" for one in given if one not in options[words[0]] and not one.startswith(COMMON)]
        elif name == "pliant-plot" and re.fullmatch(r"[a-z_]+", words[0]) and not (ROOT / f"python/plots/{words[0]}.py").is_file():
            found.append(f"pliant-plot {words[0]}")
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_name_options_and_figures_that_exist(page):
    assert unknown(page.read_text(encoding="utf-8"), documented()) == []


def test_the_check_itself():
    options = {"hopper": {"n", "zeta"}}
    assert unknown("    pliant hopper -n 3 \\\n      -zeta 2 -ts_type rk # -q", options) == []
    assert unknown("    pliant hopper -n 3 \\\n      -zeto 2\nand `pliant hopper -m 1`, `mpiexec -n 2 build/apps/pliant hopper -k`", options) == [
        "hopper -zeto", "hopper -m", "hopper -k"]
    assert unknown("    pliant-plot seris runs/x -o x.png", options) == ["pliant-plot seris"]


@pytest.mark.parametrize("command", ["pliant-sweep", "pliant-analyse channel", "pliant-reproduce", "pliant-report"])
def test_long_options_of_python_commands_exist(command):
    program, *words = command.split()
    known = subprocess.run([sys.executable, ROOT / "python" / program, *words, "--help"], capture_output=True, encoding="utf-8", check=True).stdout
    found = [word for page in PAGES for name, *rest in commands(page.read_text(encoding="utf-8"))
             if name.rsplit("/")[-1] == program for word in rest if word.startswith("--")]
    assert found and [word for word in found if word not in known] == []
