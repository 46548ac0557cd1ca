"""The example of docs/how-to/python.md."""

import os
import re
import subprocess
import sys

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
