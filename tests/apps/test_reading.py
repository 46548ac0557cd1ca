"""python/pliant reads a run while the program writes it."""

import signal
import sys
from pathlib import Path

import numpy as np
from conftest import SMALL, pliant, start, wait_for

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))
from pliant import Run  # noqa: E402


def test_a_run_that_goes_on(tmp_path):
    """Every Run is one state of the file, and a later one has more."""
    options = SMALL | {"t_end": 1e4, "frame_interval": 0.2}
    child = start("hopper", output=tmp_path / "run", **options)
    try:
        xdmf = tmp_path / "run/run.xdmf"
        wait_for(lambda: xdmf.exists() and "000001" in xdmf.read_text(encoding="utf-8"), child)
        runs, counts = [], []
        while len(counts) < 15 or counts[-1] < counts[0] + 50:
            run = Run(tmp_path / "run")
            counts.append(len(run.frames))
            assert np.allclose(np.diff(run.frames.times), 0.2, atol=0.01)
            assert run.frames[-1].centres.shape == (60, 2)
            assert abs(run.series.time.iloc[-1] - run.frames.times[-1]) < 0.11
            runs = [*runs[-4:], run]
        assert sorted(counts) == counts
        for run, count in zip(runs, counts[-len(runs):]):
            assert len(run.frames) == count and len(run.frames[-1].contacts) > 0
        assert len(counts) > len(runs)
    finally:
        child.send_signal(signal.SIGTERM)
        child.communicate()


def test_a_run_that_is_continued_between_two_opens(tmp_path):
    assert pliant("hopper", output=tmp_path / "run", **SMALL | {"t_end": 1}).returncode == 0
    first = Run(tmp_path / "run")
    assert first.series.time.iloc[-1] < 1.1
    assert pliant("hopper", restart=tmp_path / "run", t_end=3).returncode == 0
    second = Run(tmp_path / "run")
    assert second.series.time.iloc[-1] > 2.9 and second.summary["t"] > 2.9 and len(second.frames) > len(first.frames)
    assert first.summary["t"] < 1.1 and len(first.frames) == 3 and len(first.frames[-1].contacts) > 0
