"""A user program with a user-defined scenario: examples/own_scenario."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import HANGS, Results, arguments, assert_same_runs

PROGRAM = os.environ.get("PLIANT_OWN_SCENARIO")
ROOT = Path(__file__).resolve().parents[2]
PLOT = ROOT / "python" / "pliant-plot"
BOX = {"n": 20, "t_end": 1, "sample_interval": 0.1, "frame_interval": 0.25}

pytestmark = pytest.mark.skipif(not PROGRAM, reason="PLIANT_OWN_SCENARIO does not name the program")


def own(*command, **options):
    return subprocess.run([PROGRAM, *map(str, command), *arguments(options)], encoding="utf-8", capture_output=True, timeout=HANGS)


def shaken_box(folder, **options):
    result = own("shaken_box", output=folder, **{**BOX, **options})
    assert result.returncode == 0, result.stderr
    return Results(folder)


def test_help_speaks_of_this_program_and_lists_its_options():
    assert own("-help").stdout.startswith("usage: own_scenario SCENARIO")
    result = own("shaken_box", "-help")
    assert result.returncode == 0 and result.stderr == ""
    assert result.stdout.startswith("usage: own_scenario shaken_box [")
    for name in "n seed e_c shape_parameter zeta amplitude frequency dt t_end output restart frame_interval".split():
        assert f"\n  -{name} " in result.stdout


def test_bad_input_is_refused_as_by_pliant(tmp_path):
    for options, message in (({"amplitude": -1}, "-amplitude -1"), ({"ampliude": 1}, "did you mean -amplitude?"),
                             ({"t_end": 1e-9}, "is longer than the run")):
        result = own("shaken_box", output=tmp_path / "run", **options)
        assert result.returncode == 2 and result.stderr.startswith("own_scenario: error: ") and message in result.stderr


def test_half_a_run_and_the_other_half_are_the_whole(tmp_path):
    whole = shaken_box(tmp_path / "whole")
    shaken_box(tmp_path / "halves", t_end=BOX["t_end"] / 2)
    result = own("shaken_box", restart=tmp_path / "halves", t_end=BOX["t_end"])
    assert result.returncode == 0, result.stderr
    assert_same_runs(whole, Results(tmp_path / "halves"))
    assert list(whole.series) and len(whole.frames) == 5 and len(whole.series["time"]) == 11
    # The checkpoint still holds the options of the start.
    highest = whole.series["highest"]
    assert (np.diff(highest) >= 0).all() and highest[-1] > max(frame["positions"][:, 1].max() for frame in whole.frames[2:])


def test_a_free_particle_knows_nothing_of_the_floor(tmp_path):
    """Seen from the laboratory it starts with the floor's velocity and falls on a parabola."""
    amplitude, frequency = 0.1, 1
    run = shaken_box(tmp_path / "run", n=1, zeta=0, amplitude=amplitude, frequency=frequency, t_end=0.5)
    time, floor = run.series["time"], run.series["floor"]
    speed = 2 * np.pi * frequency * amplitude
    np.testing.assert_allclose(floor, amplitude * np.sin(2 * np.pi * frequency * time), rtol=0, atol=1e-12)
    fall = run.series["mean_height"] + floor - run.series["mean_height"][0]
    np.testing.assert_allclose(fall, speed * time - time**2 / 2, rtol=0, atol=1e-6)


def test_messages_name_this_program(tmp_path):
    shaken_box(tmp_path / "run", t_end=0.01)
    result = own("shaken_box", output=tmp_path / "run", **BOX)
    assert result.returncode == 2 and result.stderr.startswith("own_scenario: error: ") and "-t_end LATER" in result.stderr
    unstable = own("shaken_box", output=tmp_path / "hot", n=20, dt=1.7e-4, t_end=1e-3)
    assert unstable.returncode == 0 and unstable.stderr.startswith("own_scenario: warning: -dt 0.00017 is 0.")


def test_the_page_of_its_options_is_made_by_the_same_script(tmp_path):
    def docs(*arguments):
        return subprocess.run([ROOT / "scripts/docs.sh", *arguments, PROGRAM, tmp_path / "options.md"], encoding="utf-8",
                              capture_output=True, timeout=HANGS)

    written = docs()
    assert written.returncode == 0, written.stderr
    text = (tmp_path / "options.md").read_text(encoding="utf-8")
    assert "# Options of `own_scenario shaken_box`\n" in text and "\n| `-amplitude` | real |" in text
    assert "hopper" not in text
    assert docs("--check").returncode == 0
    (tmp_path / "options.md").write_text(text.replace("-amplitude", "-height"), encoding="utf-8")
    assert docs("--check").returncode == 1


def test_a_sweep_needs_no_name_of_the_scenario(tmp_path):
    def sweep(*lines):
        (tmp_path / "t.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return subprocess.run([sys.executable, ROOT / "python/pliant-sweep", tmp_path / "t.csv", "--program", PROGRAM], encoding="utf-8",
                              capture_output=True, timeout=HANGS)

    refused = sweep("ampliude", "0.1")
    assert refused.returncode == 2 and "line 2, column 'ampliude': unknown option -ampliude; did you mean" in refused.stderr
    done = sweep("n,amplitude,t_end", "5,0.1,0.01", "5,0.2,0.01")
    assert done.returncode == 0 and "done 2/2" in done.stdout, done.stderr
    with open(tmp_path / "t/results.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["scenario"] for row in rows] == ["shaken_box"] * 2
    assert [row["row"] for row in rows] == ["amplitude=0.1,n=5,t_end=0.01", "amplitude=0.2,n=5,t_end=0.01"]


def test_figures_are_drawn_or_refused_by_name(tmp_path):
    shaken_box(tmp_path / "run", t_end=0.01)
    assert json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))["scenario"] == "shaken_box"

    def plot(name):
        return subprocess.run([sys.executable, PLOT, name, tmp_path / "run", "-o", tmp_path / f"{name}.png"], encoding="utf-8",
                              capture_output=True, timeout=HANGS)

    snapshot = plot("snapshot")
    assert snapshot.returncode == 0 and (tmp_path / "snapshot.png").stat().st_size > 0, snapshot.stderr
    series = plot("series")
    assert series.returncode == 2 and "a run of scenario shaken_box, not of hopper" in series.stderr
