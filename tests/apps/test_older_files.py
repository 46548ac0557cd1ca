"""Files of an older version: tests/data/older has the folder of a run of commit b69d3ce (2026-11-26), whose texts are
attributes of variable length, whose frames have copies for ParaView, and whose JSON file has no checksum."""

import sys
import tarfile
from pathlib import Path

import numpy as np
import pytest
from conftest import pliant

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))
from pliant import Run  # noqa: E402

ARCHIVE = Path(__file__).resolve().parents[1] / "data/older/hopper-b69d3ce.tar.xz"


@pytest.fixture
def run(tmp_path):
    with tarfile.open(ARCHIVE) as archive:
        archive.extractall(tmp_path)
    return tmp_path / "hopper"


def test_the_reader_reads_them(run):
    with Run(run) as older:
        assert older.manifest["build"].startswith("b69d3ce39902") and older.manifest["options"]["zeta"]["value"] == 0.3
        assert older.summary["status"] == "done" and older.summary["t"] == 1
        assert len(older.series) == 5 and older.series["kinetic_energy"].iloc[-1] == 1.5351718818217162
        frame = older.frames[2]
        assert len(older.frames) == 3 and frame.time == 1 and np.array_equal(frame.centres, frame.positions)
        assert frame.positions[1].tolist() == [-0.24906985797600423, 0.7301326944878]
        assert frame.contact_count.sum() == 2 * len(frame.contacts) == 18


def test_a_restart_of_them_is_refused(run):
    """Their checkpoints lack values that a run needs now."""
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    for options in ({"restart": run, "t_end": 1.5}, {"restart": run, "output": run.parent / "branch", "t_end": 1.5}):
        result = pliant("hopper", **options)
        assert result.returncode == 2 and result.stderr.count("\n") == 1
        assert "checkpoint-b.h5: it has no " in result.stderr
        assert "continue the run with the version of the program that wrote it" in result.stderr
        assert {path.name: path.read_bytes() for path in run.iterdir() if path.name != "run.lock"} == before
