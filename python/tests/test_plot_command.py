"""pliant-plot runs a figure's script by its name."""

import subprocess
import sys
from pathlib import Path

PYTHON = Path(__file__).resolve().parents[1]


def pliant_plot(*arguments):
    return subprocess.run([sys.executable, str(PYTHON / "pliant-plot"), *arguments], capture_output=True, encoding="utf-8")


def test_it_lists_all_figures():
    result = pliant_plot("--help")
    assert result.returncode == 0
    for path in (PYTHON / "plots").glob("*.py"):
        assert f"\n  {path.stem} " in result.stdout
    assert pliant_plot().returncode == 2


def test_a_reader_that_goes_away():
    with subprocess.Popen([sys.executable, str(PYTHON / "pliant-plot"), "--help"], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b"" and process.wait(60) == 141


def test_it_passes_arguments_and_exit_codes_on():
    result = pliant_plot("series", "--help")
    assert result.returncode == 0 and "usage: series.py" in result.stdout
    result = pliant_plot("series", "no-such-run")
    assert result.returncode == 2 and "no-such-run" in result.stderr


def test_an_unknown_name():
    result = pliant_plot("serie")
    assert result.returncode == 2 and "did you mean series?" in result.stderr
