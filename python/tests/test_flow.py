"""Averages omit samples without flow or without a filling."""

import json

import h5py
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal
from synthetic import write_run

from pliant import Run, RunError
from pliant.flow import axis_velocity, filling_top, flow_end, flowing


def series(crossed, interval=0.5):
    return pd.DataFrame({"time": interval * np.arange(len(crossed)), "crossed_count": np.asarray(crossed, float)})


def with_crossings(path, crossed, **options):
    """A run whose counts of crossings are these, every 0.5 t0."""
    path, _ = write_run(path, samples=len(crossed), **options)
    with h5py.File(path / "run.h5", "a") as file:
        file["series/crossed_count"][...] = crossed
    return path


def test_flow_end():
    flow = np.arange(200)
    assert flow_end(series(flow)) is None
    assert flow_end(series(np.r_[flow, np.full(8, 199)])) is None  # a pause
    assert flow_end(series(np.r_[flow, np.full(30, 199)])) == pytest.approx(199 * 0.5)
    assert flow_end(series(np.zeros(50))) is None and flow_end(series([])) is None


def test_the_dead_part_is_left_out(tmp_path):
    path = with_crossings(tmp_path / "clogged", np.minimum(np.arange(400), 100), status="clogged")
    summary = json.loads((path / "summary.json").read_text(encoding="utf-8"))
    summary["steady_start"]["value"] = 150  # the rest is steady: long after the last crossing at 50
    (path / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    run = Run(path)
    assert flowing(run) == (25, 50, "the flow ended at t = 50 t0")
    assert flowing(run, 10) == (10, 50, "the flow ended at t = 50 t0")
    assert len(run.profile.between(25, 50).time) == 51


def test_steady_flow_and_runs_that_go_on(tmp_path):
    assert flowing(Run(with_crossings(tmp_path / "done", np.arange(200)))) == (20, 99.5, None)
    start, end, remark = flowing(Run(with_crossings(tmp_path / "on", np.arange(201), summary=False)))
    assert (start, end) == (50, 100) and "no steady state" in remark


def test_a_discharge(tmp_path):
    left = np.r_[2 * np.arange(100), np.full(300, 200)]
    start, end, remark = flowing(Run(with_crossings(tmp_path / "run", left, extra={"flow": ("discharge", "")})))
    assert (start, end) == (10, 40) and "discharge" in remark


def test_without_flow(tmp_path):
    with pytest.raises(RunError, match="nothing has crossed"):
        flowing(Run(with_crossings(tmp_path / "run", np.zeros(50))))


def test_the_filling_ends_below_the_free_fall(tmp_path):
    path, _ = write_run(tmp_path / "run")
    with h5py.File(path / "run.h5", "a") as file:
        height = file["series_axes/profile_height"][()]
        # Thin at the orifice, dense, and a few that fall above h = 12.
        density = np.where(height < 1, 0.5, np.where(height <= 12, 1.0, 0.3)) * np.ones((200, 1))
        file["series/profile_weight"][...] = density
    assert filling_top(Run(path).profile) == 12


def test_averages_of_a_run_whose_interval_has_changed(tmp_path):
    """Each time has the same weight: the samples are thinned to the longest interval."""
    path = with_crossings(tmp_path / "run", np.arange(201))  # every 0.5 up to 100
    plain = axis_velocity(Run(path))
    summary = json.loads((path / "summary.json").read_text(encoding="utf-8"))
    (path / "summary.json").write_text(json.dumps(summary | {"longest_sample_interval": 2}), encoding="utf-8")
    with Run(path) as run:
        profile = run.profile.every(2)
        assert list(profile.time) == list(np.arange(0, 101, 2))
        thinned = axis_velocity(run)
        used = profile.between(thinned.start, thinned.end)
        filled = len(thinned.height)
        assert thinned.velocity == pytest.approx((used.momentum.sum(0) / used.weight.sum(0))[:filled])
    assert (plain.start, plain.end) == (thinned.start, thinned.end)


def test_errors_of_the_profile_are_those_of_the_program(tmp_path):
    """Only the steady state has errors; other times and older summaries have none, and a remark."""
    path = with_crossings(tmp_path / "run", np.arange(201))
    summary = json.loads((path / "summary.json").read_text(encoding="utf-8"))
    plain = axis_velocity(Run(path))
    assert np.isnan(plain.error).all() and "older version" in plain.remark
    heights = len(Run(path).profile.height)
    for error, expected in ((list(np.arange(heights) / 10), np.arange(heights) / 10), ([None] * heights, np.nan), (None, np.nan)):
        summary["axis_velocity"] = {"error": error, "unit": "sigma_avg/t0"}
        (path / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
        curve = axis_velocity(Run(path))
        assert curve.remark is None and (curve.velocity == plain.velocity).all()
        assert_array_equal(curve.error, np.broadcast_to(expected, heights)[:len(curve.height)])
    summary["axis_velocity"]["error"] = [0.1] * heights
    (path / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    assert np.isnan(axis_velocity(Run(path), start=30).error).all()
