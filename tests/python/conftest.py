"""The Python module as a user has it; the program and the readers of tests/apps next to it."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = os.environ.get("PLIANT_PROGRAM", "pliant")
ROOT = Path(__file__).resolve().parents[2]


def _apps():
    spec = importlib.util.spec_from_file_location("apps_conftest", ROOT / "tests" / "apps" / "conftest.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


apps = _apps()


@pytest.fixture
def small():
    """A hopper that flows at once, a few milliseconds per t0."""
    return dict(apps.SMALL, t_end=3)


@pytest.fixture
def program():
    """Runs the program; its process."""
    return apps.pliant


@pytest.fixture
def script():
    """Runs a Python script in a separate process, which must end by itself."""
    def run(text, code=0, **options):
        result = subprocess.run([sys.executable, "-B", "-c", text], encoding="utf-8", capture_output=True, timeout=120,
                                **options)
        assert result.returncode == code, result.stderr
        return result
    return run


@pytest.fixture
def summary():
    return lambda folder: json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
