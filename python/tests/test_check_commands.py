"""The check of commands on pages finds what does not exist."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

import check_commands  # noqa: E402


@pytest.fixture(scope="module")
def checker():
    return check_commands.Checker(ROOT)


def test_the_pages():
    assert check_commands.check(ROOT) == []


@pytest.mark.parametrize(("text", "problems"), [
    ("    pliant hopper -n 3 \\\n      -zeta 2 -ts_type rk -flow discharge # -q", []),
    ("text\n\n    pliant hopper -n 3 \\\n      -zeto 2\nand `pliant hopper -m 1`, `mpiexec -n 2 build/apps/pliant hopper -k`",
     [(3, "hopper has no option -zeto"), (5, "hopper has no option -m"), (5, "hopper has no option -k")]),
    ("    pliant hoper -n 3", [(1, "there is no scenario hoper")]),
    ("    pliant hopper -model rogh -flow x", [(1, "hopper -model cannot be rogh"), (1, "hopper -flow cannot be x")]),
    ("`A=1 pliant raft -n_vertices 3 && pliant raft -zeto 3`", [(1, "raft has no option -n_vertices"), (1, "raft has no option -zeto")]),
    ("    pliant hopper -options_file examples/soft.yaml > log", [(1, "examples/soft.yaml does not exist")]),
    ("    pliant hopper -options_file /usr/share/pliant/examples/soft.yaml", [(1, "/usr/share/pliant/examples/soft.yaml does not exist")]),
    ("    pliant-plot seris runs/x -o x.png", [(1, "there is no figure seris")]),
    ("    pliant-plot series runs/x -o x.png --colour q", [(1, "pliant-plot series has no --colour")]),
    ("    pliant-swep widths.csv", [(1, "pliant-swep: there is no python/pliant-swep")]),
    ("    pliant-sweep widths.csv -j 4 --paralel", [(1, "pliant-sweep has no --paralel")]),
    ("    pliant-reproduce H77 quick", [(1, "pliant-reproduce has no figure H77")]),
    ("    build/examples/own_term/own_term hopper -model line_tension -tension 2 -zeta 1 -tention 2",
     [(1, "examples/own_term has no option -tention")]),
    ("    build/tests/test_modl", [(1, "build/tests/test_modl: there is no tests/modl")]),
    ("    scripts/bench.sh --quick --only x --fast\n    scripts/bnch.sh",
     [(1, "scripts/bench.sh has no --fast"), (2, "scripts/bnch.sh: there is no scripts/bnch.sh")]),
])
def test_problems(checker, text, problems):
    assert list(checker.problems(text)) == problems
