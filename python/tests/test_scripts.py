"""The commands as a user starts them."""

import subprocess
import sys
from pathlib import Path

import pytest

PYTHON = Path(__file__).resolve().parents[1]
SCRIPTS = sorted(PYTHON.glob("plots/*.py")) + [PYTHON / f"pliant-{name}" for name in ("sweep", "analyse", "report", "reproduce")]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_a_python_without_packages(script):
    """Like a Python that comes first in the PATH; -S hides Debian's packages."""
    result = subprocess.run([sys.executable, "-S", script, "x"], encoding="utf-8", capture_output=True)
    assert result.returncode == 2
    assert result.stderr.startswith(f"{script.name}: error: ") and len(result.stderr.splitlines()) == 1, result.stderr
    assert "has no numpy, pandas, h5py" in result.stderr and "python3-numpy" in result.stderr


def test_imports_of_others_fail_as_usual(tmp_path):
    result = subprocess.run([sys.executable, "-S", "-c", "import pliant"], encoding="utf-8", capture_output=True, cwd=PYTHON)
    assert result.returncode == 1 and "ModuleNotFoundError" in result.stderr
