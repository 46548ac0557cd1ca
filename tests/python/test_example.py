"""The examples of docs/how-to/python.md and docs/how-to/python-tasks.md."""

import os
import re
import subprocess
import sys

import pytest
from conftest import ROOT

EXAMPLE = ROOT / "examples" / "python" / "funnel.py"


def test_a_funnel_in_forty_lines(tmp_path):
    text = EXAMPLE.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 40
    (tmp_path / "funnel.py").write_text(text.replace("sim.run(130)", "sim.run(60)"), encoding="utf-8")
    result = subprocess.run([sys.executable, "-B", "funnel.py"], cwd=tmp_path, encoding="utf-8", capture_output=True,
                            env=dict(os.environ, MPLBACKEND="Agg"), timeout=300)
    assert result.returncode == 0, result.stderr
    softness, value, error = map(float, re.fullmatch(r"e_sp = (\d+): Q = (\S+) ± (\S+) .*\n", result.stdout).groups())
    assert softness == 100 and 0.5 < value < 10 and not error > value
    assert (tmp_path / "funnel.png").stat().st_size > 10000


@pytest.mark.parametrize("name, changes, said", [
    ("trap", {"run(60)": "run(20)"}, r"radius of gyration [3-9]\.\d+ diameters, \d+ contacts"),
    ("unclog", {"diameters(150": "diameters(40"}, r"empty at t = \d+ t0, after \d+ clogs"),
    ("from_file", {"t_end=30": "t_end=3"}, r"Q = \(.*"),
    ("packings", {"n=64": "n=16", "ensemble=20": "ensemble=4"}, r"0 packings have not converged"),
    ("jam", {"> 1e-4": "> 1e-2", "diameters(100)": "diameters(30)", "(100, 2)": "(30, 2)"}, r"jammed at an area fraction of 0\.[78]\d+"),
])
def test_a_task(name, changes, said, tmp_path):
    text = (ROOT / "examples" / "python" / f"{name}.py").read_text(encoding="utf-8")
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    result = subprocess.run([sys.executable, "-B", "-c", text], cwd=tmp_path, encoding="utf-8", capture_output=True,
                            env=dict(os.environ, MPLBACKEND="Agg"), timeout=120)
    assert result.returncode == 0, result.stderr
    assert re.fullmatch(said, result.stdout.splitlines()[-1]), result.stdout


def test_a_droplet_between_plates_has_the_force_of_young_and_laplace():
    result = subprocess.run([sys.executable, "-B", ROOT / "examples" / "python" / "plates.py", "--quick"], encoding="utf-8",
                            capture_output=True, timeout=300)
    assert result.returncode == 0, result.stderr
    droplet, *_, shell = result.stdout.splitlines()[1:]
    assert float(droplet.split()[-1]) == pytest.approx(1, abs=0.15)  # 162 vertices
    assert float(shell.split()[-1]) == pytest.approx(1, abs=0.1)
