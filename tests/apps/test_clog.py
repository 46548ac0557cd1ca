"""The scenario clog: hoppers that clog or run empty, restarts, bad input."""

import json
import shutil

import numpy as np
import pytest
from conftest import Results, assert_same_runs, pliant, stopped_until_done
from scipy.optimize import brentq

# Few droplets under strong gravity: a second or less.
SMALL = {"n": 14, "g": 0.1, "hopper_width": 1.25, "phi_c": 3e-4, "dt": 0.2, "frame_interval": 20,
         "sample_interval": 2}


def clog(folder, **options):
    result = pliant("clog", output=folder, **{**SMALL, **options})
    assert result.returncode == 0, result.stderr
    return Results(folder)


@pytest.fixture(scope="module")
def cohesive(tmp_path_factory):
    """A cohesive clog, and its folder."""
    folder = tmp_path_factory.mktemp("clog") / "run"
    return clog(folder), folder


@pytest.mark.parametrize("options", [{"delta": 0.15}, {"f0": 50}, {"f0": 1}, {"b": 0.1}, {"b": 10}])
def test_the_standard_step_follows_the_droplets(options, tmp_path):
    result = pliant("clog", output=tmp_path / "run", n=20, t_end=1, **options)
    assert result.returncode == 0 and "limit of stability" not in result.stderr, result.stderr


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_fast_droplets(seed, tmp_path):
    """A step in which a droplet moves by more than its radius is an error between samples too. The standard step avoids
    such steps."""
    fast = {"n": 60, "hopper_width": 1.5, "phi_c": 0, "g": 1, "seed": seed, "sample_interval": 1000}
    result = pliant("clog", output=tmp_path / "long", **fast, dt=0.7)
    assert result.returncode == 3 and "radii in a step: contacts may be missed; lower -dt" in result.stderr
    result = pliant("clog", output=tmp_path / "run", **fast)
    assert result.returncode == 0, result.stderr


def test_a_start_in_other_units_is_warned_of(tmp_path):
    table = tmp_path / "start.csv"
    table.write_text("x,y,diameter\n0,20,6\n8,30,6\n", encoding="utf-8")
    result = pliant("clog", start=table, t_end=1, output=tmp_path / "run")
    assert result.returncode == 0 and "the mean radius is 3, but lengths of a run are in mean radii" in result.stderr


def test_clogged(tmp_path):
    """One droplet that is wider than the exit is a clog, and it rests where both tips hold it."""
    run = clog(tmp_path / "run", n=1, hopper_width=0.6, delta=0, rest="speed", dt=0.05)
    s = run.summary
    assert s["status"] == "clogged" and s["arch"] == [0] and s["rest"] == s["attached"] == []
    assert s["avalanche_size"]["value"] == 0 and 0 < s["opened_at"] < s["t"]
    x, y = run.frames[-1]["positions"][0]
    assert abs(x) < 1e-9 and 0 < y < 1
    speed = run.series["max_speed"]
    assert speed[-1] < 1e-12 and abs(s["budget_error"]) < 1e-3 * s["dissipated"]


def test_empty(tmp_path):
    """Without attraction all droplets pass a wide exit; each weighs g R³ and ends at least two diameters below."""
    run = clog(tmp_path / "run", hopper_width=4, phi_c=0)
    s = run.summary
    assert s["status"] == "empty" and s["avalanche_size"]["value"] == 14
    assert s["arch"] == s["attached"] == s["rest"] == []
    assert s["capillary_length"]["value"] == 0 and s["w_over_capillary_length"]["value"] is None
    last = run.frames[-1]
    assert not last["active"].any() and (last["positions"][:, 1] < -4).all()
    opened = run.series["time"] > s["opened_at"]
    assert (run.series["open"] == opened).all()
    left = run.series["left"]
    assert (left[~opened] == 0).all() and (np.diff(left) >= 0).all() and left[-1] == 14
    assert (run.series["in_hopper"] + left <= 14).all()
    assert abs(s["budget_error"]) < 1e-3 * s["dissipated"]


def test_droplets_that_stick_beside_the_exit(tmp_path):
    """A wide exit, and attraction that holds some at a tip: at rest, neither empty nor clogged."""
    s = clog(tmp_path / "run", hopper_width=4, g=0.02, phi_c=1e-3, dt=0.7, seed=1).summary
    assert s["arch"] == [] and s["rest"] and s["status"] == "at_rest"


def test_arch(cohesive):
    """A cohesive clog: the arch is a chain of touching droplets from wall to wall, all droplets are counted, and the
    forces on the remaining droplets balance."""
    run, _ = cohesive
    s, last = run.summary, run.frames[-1]
    assert s["status"] == "clogged"
    inside = np.flatnonzero(last["active"])
    assert sorted(s["arch"] + s["attached"] + s["rest"]) == list(inside)
    assert s["avalanche_size"]["value"] == 14 - len(inside)
    x, radius = last["positions"], run.topology["sigma"] / 2
    arch = s["arch"]
    steps = np.linalg.norm(np.diff(x[arch], axis=0), axis=1)
    assert (steps < radius[arch][1:] + radius[arch][:-1] + 0.1).all()
    for end, side in ((arch[0], -1), (arch[-1], 1)):
        along = np.array([side, 1]) / np.sqrt(2)
        beyond = x[end] - [side * SMALL["hopper_width"], 0]
        foot = max(beyond @ along, 0) * along
        assert np.linalg.norm(beyond - foot) < radius[end] + 0.1
    weight = 0.1 * (radius[inside] ** 3).sum()
    # Up to the drag and wall friction of droplets slower than a hundredth of a falling droplet.
    assert last["wall_force"].sum(0) == pytest.approx([0, -weight], abs=0.02 * weight)
    assert np.abs(last["velocities"]).max() < 1e-3


def test_a_minimum_nearby_is_rest(cohesive, tmp_path):
    """A run that has ended next to a minimum keeps its outcome when it continues until no droplet moves."""
    early, folder = cohesive
    shutil.copytree(folder, tmp_path / "run")
    result = pliant("clog", restart=tmp_path / "run", rest="speed")
    assert result.returncode == 0, result.stderr
    late = Results(tmp_path / "run")
    for key in ("status", "avalanche_size", "arch", "attached", "rest"):
        assert early.summary[key] == late.summary[key]
    assert early.summary["t"] < late.summary["t"]
    assert late.series["max_speed"][-1] < 1e-12 < early.series["max_speed"][-1]
    inside = late.frames[-1]["active"] == 1
    assert np.abs(early.frames[-1]["positions"] - late.frames[-1]["positions"])[inside].max() < 0.01


def test_capillary_length(tmp_path):
    run = clog(tmp_path / "run", n=1, hopper_width=0.6, phi_c=1.5e-4, a_s=0.04, g=0.05)

    def depletion(r):  # slope of 1.5e-4/(8 a³) times the lens of two spheres of radius 1.04
        return 1.5e-4 / (8 * 0.04**3) * np.pi * (1.04**2 - r**2 / 4)

    d = brentq(lambda r: 10 * (1 - r / 2) - depletion(r), 1.5, 2, xtol=1e-14)
    assert run.summary["capillary_length"]["value"] == pytest.approx(np.sqrt(depletion(d) / np.pi / 0.05), rel=1e-9)


def test_stopped_and_continued(cohesive, tmp_path):
    whole, _ = cohesive
    assert stopped_until_done("clog", **SMALL, output=tmp_path / "parts") > 1
    assert_same_runs(whole, Results(tmp_path / "parts"))


def test_an_end_before_the_outcome_is_neither(tmp_path):
    run = clog(tmp_path / "run", t_end=5)
    s = run.summary
    assert s["status"] == "done" and s["ended_by"] == "t_end" and s["opened_at"] is None
    assert "avalanche_size" not in s and "arch" not in s
    result = pliant("clog", restart=tmp_path / "run", t_end=1e5)
    assert result.returncode == 0, result.stderr
    assert json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))["status"] == "clogged"


@pytest.mark.parametrize("options, message", [
    ({"clog_speed": 0.2}, "-clog_speed 0.2: a single droplet falls only at g/b = 0.1"),
    ({"hopper_angle": 90}, "hopper_angle"),
    ({"fill_fraction": 0.6}, "fill_fraction"),
    ({"phi_c": 1}, "use a lower depletion energy (-phi_c)"),
    ({"hopper_wdith": 3}, "did you mean"),
])
def test_bad_input(options, message, tmp_path):
    result = pliant("clog", output=tmp_path / "run", **{**SMALL, **options})
    assert result.returncode == 2 and message in result.stderr and result.stderr.count("\n") == 1
    assert not (tmp_path / "run").exists()
