"""Each tutorial of the gallery runs alone and draws its picture."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

GALLERY = Path(__file__).resolve().parents[2] / "examples/gallery"
TUTORIALS = sorted(GALLERY.glob("plot_*.py"))

#: Start of the name: a line of the output, with the number that is known and its tolerance.
KNOWN = {"02": (r"(\d+) of 150 disks left", 130, 4),
         "04": (r"relative difference ([-+.e\d]+)", 0, 1e-3),
         "09": (r"order of velocity Verlet: ([\d.]+)", 2, 0.3),
         "11": (r"weight above: ([\d.]+)", 1, 1e-3),
         "12": (r"difference of a position: ([\d.]+)", 0, 0)}


def test_tutorials_are_numbered():
    assert [path.name[5:7] for path in TUTORIALS] == [f"{k:02}" for k in range(1, 13)]


@pytest.mark.parametrize("script", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_runs_alone(script, tmp_path):
    own_term = os.environ.get("PLIANT_OWN_TERM")
    env = {**os.environ, "PATH": os.pathsep.join([str(Path(own_term).parent), os.environ["PATH"]])} if own_term else None
    result = subprocess.run([sys.executable, "-B", str(script)], cwd=tmp_path, env=env, capture_output=True, encoding="utf-8")
    assert result.returncode == 0, result.stderr
    assert not own_term or "is not built" not in result.stdout
    if script.name[5:7] in KNOWN:
        pattern, value, tolerance = KNOWN[script.name[5:7]]
        assert float(re.search(pattern, result.stdout)[1]) == pytest.approx(value, abs=tolerance), result.stdout
    assert (tmp_path / f"{script.stem[8:]}.png").read_bytes().startswith(b"\x89PNG")
