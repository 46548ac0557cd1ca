"""The scenario raft: three droplets against theory, energy budget, restart, extension, bad input."""

import json
import shutil
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from conftest import Results, assert_same_runs, end, pliant, start, stopped_until_done, wait_for

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))

from pliant import Run, raft_analysis as analysis  # noqa: E402

# Two droplets at the fixed wall, one at the other; mostly ten times as fast as in the thesis.
THREE = {"rows": 2, "columns": 2, "n": 3, "delta": 0, "v_wall": 1e-3, "sample_interval": 0.5, "frame_interval": 200,
         "end_distance": 3.55}
LONGER = {"rows": 3, "columns": 4, "n": 0, "end_distance": 5.0, "v_wall": 5e-4, "frame_interval": 100}
RK4 = {"ts_type": "rk", "ts_rk_type": 4, "ts_adapt_type": "none", "dt": 0.1}


def compress(folder, **options):
    result = pliant("raft", output=folder, **{**THREE, **options})
    assert result.returncode == 0, result.stderr
    return Results(folder)


def test_three_droplets(tmp_path):
    """[T Fig. 2.3] at the thesis' speed."""
    run = compress(tmp_path / "run", v_wall=1e-4, end_distance=1.99, sample_interval=5, frame_interval=2000)
    curve = analysis.Compression.of(Run(tmp_path / "run"))
    # Springs in series and a bond across: 3.152 [T 2.30].
    slope, _ = curve.stiffness_at_zero()
    assert slope == pytest.approx(3.152, rel=0.003)
    peak = curve.force.argmax()
    assert curve.force[peak] == pytest.approx(0.110, abs=0.002)
    assert curve.distance[peak] == pytest.approx(3.677, abs=0.002)
    # Earlier, attraction pulls the walls inwards; at rest the forces on them differ only by the droplets' drag.
    assert curve.force[:peak].min() < -0.07
    assert np.median(np.abs(run.series["fixed_wall_force"] - run.series["moving_wall_force"])) < 3e-4
    (reduction,) = curve.reductions().itertuples()
    assert reduction.rows == 2 and reduction.sample == peak and reduction.missing_bonds == 0
    with h5py.File(tmp_path / "run/run.h5") as file:
        events = {name: values[()] for name, values in file["events"].items()}
    broken = events["broken"] == 1
    assert broken.sum() == run.summary["broken"] == 1
    assert sorted(events["particles"][broken][0]) == [0, 1]
    assert events["wall_distance"][broken][0] == pytest.approx(3.6725, abs=0.001)


@pytest.mark.parametrize("options, tolerance", [({}, 1e-8), ({"ts_atol": 1e-6}, 1e-6), ({"ts_atol": 1e-10}, 1e-10),
                                                (RK4, 4e-7)])
def test_energy_budget(options, tolerance, tmp_path):
    """Work of the walls = stored + dissipated, to the integrator's error. Work and dissipation keep the error of every
    step, at most the tolerance, which few steps reach: steps at which bonds break. Thirty of them are allowed. RK4 has
    no error control: its error is the jump v_wall of the velocities in the middle of a step, b v_wall² dt."""
    closed = 30 * tolerance
    run = compress(tmp_path / "run", rows=3, columns=3, n=0, delta=0.01, end_distance=4.6, v_wall=2e-3, **options)
    series = run.series
    assert series["work"][-1] - series["dissipated"][-1] == pytest.approx(series["energy"][-1] - series["energy"][0],
                                                                         abs=closed)
    assert np.abs(series["budget_error"]).max() < closed
    assert series["dissipated"][-1] > 1e-3 and np.all(np.diff(series["dissipated"]) > 0)
    parts = sum(series[f"{name}_energy"] for name in ("contact", "depletion", "wall_repulsion", "wall_depletion",
                                                      "gravity"))
    assert parts == pytest.approx(series["energy"], abs=1e-13)


def test_lagged_velocities_do_not_close_the_budget(tmp_path):
    run = compress(tmp_path / "run", mobility="lagged", **RK4)
    assert np.abs(run.series["budget_error"]).max() > 1e-6


def test_stopped_and_continued(tmp_path):
    """With fixed steps bit for bit."""
    options = {**LONGER, **RK4}
    whole = compress(tmp_path / "whole", **options)
    assert stopped_until_done("raft", **{**THREE, **options, "output": tmp_path / "parts"}) > 1
    assert_same_runs(whole, Results(tmp_path / "parts"))
    with h5py.File(tmp_path / "whole/run.h5") as one, h5py.File(tmp_path / "parts/run.h5") as other:
        assert len(one["events/time"]) > 0
        for name in one["events"]:
            assert np.array_equal(one["events"][name][()], other["events"][name][()])


def test_stopped_by_a_signal_and_continued(tmp_path):
    """With steps that adapt themselves within the tolerance: 1e-8 for a position, with the same allowance as for the energy
    budget. Radii differ, as how a symmetric raft breaks depends on the last bit."""
    options = {**LONGER, "delta": 0.01}
    whole = compress(tmp_path / "whole", **options)
    command = {**THREE, **options, "output": tmp_path / "parts"}
    for _ in range(20):  # the run is short: on a busy machine the signal may come too late
        process = start("raft", **command)
        wait_for((tmp_path / "parts/run.h5").exists, process)
        code, _, errors = end(process)
        if code != 0:
            break
        shutil.rmtree(tmp_path / "parts")
    assert code == 75, errors
    result = pliant("raft", **command, max_wall_time=whole.summary["wall_seconds"] / 2)
    assert result.returncode in (0, 75) and "continuing at t" in result.stdout, result.stderr
    if result.returncode == 75:
        result = pliant("raft", **command)
        assert result.returncode == 0 and "continuing at t" in result.stdout, result.stderr
    parts = Results(tmp_path / "parts")
    for name in ("time", "work", "dissipated", "energy", "broken", "formed", "wall_distance"):
        assert parts.series[name][-1] == pytest.approx(whole.series[name][-1], abs=3e-7), name
    assert np.allclose(whole.frames[-1]["positions"], parts.frames[-1]["positions"], rtol=0, atol=3e-7)


def test_extension_breaks_the_raft(tmp_path):
    run = compress(tmp_path / "run", motion="extension", rows=3, columns=3, n=0, v_wall=2e-3, end_distance=6.5)
    force = run.series["moving_wall_force"]
    # At rest at first; then tension, until it is torn. Afterwards only the drag of the droplets at the wall remains.
    assert abs(force[0]) < 1e-9 and force.min() < -0.1
    assert force[-1] == pytest.approx(-2e-3 * run.series["moving_wall_bonds"][-1], rel=0.01)
    assert run.series["rows"][0] == 3 and run.series["rows"][-1] == 0
    assert run.summary["ended_by"] == "end_distance"
    assert np.abs(run.series["budget_error"]).max() < 1e-6


def test_samples_follow_the_wall(tmp_path):
    """Peaks of the force are narrow in the distance of the walls, and so are samples."""
    for speed, interval in ((1e-5, 10), (2e-3, 0.5)):
        result = pliant("raft", rows=2, columns=2, v_wall=speed, t_end=30, output=tmp_path / str(speed))
        assert result.returncode == 0, result.stderr
        assert np.diff(Results(tmp_path / str(speed)).series["time"]).mean() == pytest.approx(interval, rel=0.2)
    result = pliant("raft", rows=2, columns=2, v_wall=0.05, motion="extension", output=tmp_path / "torn")
    assert result.returncode == 0 and Results(tmp_path / "torn").summary["ended_by"] == "end_distance"


def test_walls_move_and_tilt(tmp_path):
    run = compress(tmp_path / "run", tilt=1, end_distance=3.6)
    first, last = run.frames[0]["wall_segments"], run.frames[-1]["wall_segments"]
    assert np.array_equal(first[0, [0, 2]], [0, 0])
    lean = (first[1, 0] - first[1, 2]) / (first[1, 3] - first[1, 1])
    assert lean == pytest.approx(np.tan(np.radians(1)))
    assert (first[1, [0, 2]] - last[1, [0, 2]]).mean() == pytest.approx(1e-3 * run.summary["t"])


def test_count_of_rows_and_end(tmp_path):
    run = compress(tmp_path / "run", rows=4, columns=3, n=0, delta=1e-3, v_wall=1e-2, end_distance=1e9,
                   motion="extension", t_end=5)
    assert run.summary["ended_by"] == "t_end" and run.series["rows"][0] == 4


@pytest.mark.parametrize("options, message", [
    ({"n": 5}, "-n 5: a hexagonal raft of 2 rows and 2 columns has 4 droplets, or 3"),
    ({"v_wall": 0}, "v_wall"),
    ({"end_distance": 9}, "apart at the start"),
    ({"phi_c": 1, "end_distance": 1}, "use a lower depletion energy (-phi_c)"),
    ({"integrator": "verlet"}, "integrator"),
    ({"ts_type": "verlet"}, "motion with inertia"),
    ({"mobility_ksp_typo": 1}, "mobility_ksp_typo"),
    ({"hopper_width": 3}, "hopper_width"),
    ({"start_distance": 1, "end_distance": 0.5}, "has run into wall 0"),
    ({"rows_end": 2, "motion": "extension"}, "-rows_end (command line) with -motion extension, which does not read it"),
    ({"small_radius": 0.7}, "-small_radius (command line) with -small_fraction 0, which does not read it"),
])
def test_bad_input(options, message, tmp_path):
    result = pliant("raft", **{**THREE, "output": tmp_path / "run", **options})
    assert result.returncode in (2, 3) and message in result.stderr
    assert result.stderr.count("\n") == 1


# Limits: the stability limit of the method over f0/b, the rate at which the walls push a droplet back.
METHODS = {"euler": ({"ts_type": "euler"}, 0.2), "rk4": ({"ts_type": "rk", "ts_rk_type": 4}, 0.2785),
           "3bs": ({"ts_type": "rk", "ts_rk_type": "3bs"}, 0.2513), "ssp": ({"ts_type": "ssp"}, 0.83379)}
# Two droplets at rest between walls: both walls together hold them with 95 % of this rate.
RESTING = {"rows": 2, "columns": 1, "delta": 0, "motion": "extension", "v_wall": 1e-6, "t_end": 400,
           "ts_adapt_type": "none"}


@pytest.mark.parametrize("method", METHODS)
def test_the_limit_of_stability(method, tmp_path):
    """Just below it droplets rest; just above they shake."""
    options, limit = METHODS[method]
    speed = {}
    for factor in (0.95, 1.15):
        result = pliant("raft", output=tmp_path / f"{factor}", **RESTING, **options, dt=factor * limit,
                        allow_unstable_dt="yes", allow_energy_error="yes")
        assert result.returncode == 0 and f"is {factor:.2f} of the limit" in result.stderr, result.stderr
        speed[factor] = Results(tmp_path / f"{factor}").series["max_speed"][-1]
    assert speed[0.95] < 1e-5 and speed[1.15] > 1e-4


def test_the_limit_of_a_single_row(tmp_path):
    """A droplet between two walls comes back twice as fast."""
    alone = {**RESTING, "rows": 1, "ts_type": "euler"}
    refused = pliant("raft", output=tmp_path / "refused", **alone, dt=0.101)
    assert refused.returncode == 2 and "-dt 0.101 is 1.01 times" in refused.stderr
    assert pliant("raft", output=tmp_path / "stable", **alone, dt=0.095).returncode == 0
    assert Results(tmp_path / "stable").series["max_speed"][-1] < 1e-5
    shaking = pliant("raft", output=tmp_path / "shaking", **alone, dt=0.115, allow_unstable_dt="yes")
    assert shaking.returncode == 3 or Results(tmp_path / "shaking").series["max_speed"][-1] > 1e-3


@pytest.mark.parametrize("scenario, method, limit, options", [
    *(("raft", method, METHODS[method][1], RESTING) for method in METHODS),
    # A wall with friction halves the rate of a droplet that touches it; the rate of pairs is as high.
    ("clog", "ssp", 1.66758, {"n": 3, "delta": 0, "t_end": 5}),
    ("clog", "ssp", 0.83379, {"n": 3, "delta": 0, "t_end": 5, "wall_friction": "no"})])
def test_steps_that_are_too_long(scenario, method, limit, options, tmp_path):
    options = {**options, **METHODS[method][0]}
    run = lambda factor: pliant(scenario, output=tmp_path / str(factor), **{**options, "t_end": 5, "dt": factor * limit})
    refused, warned, quiet = run(1.01), run(0.7), run(0.49)
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1 and not (tmp_path / "1.01").exists()
    for words in (f"-dt {1.01 * limit:g}", "1.01 times the limit of stability", "-allow_unstable_dt"):
        assert words in refused.stderr
    assert warned.returncode == 0 and warned.stderr.count("\n") == 1
    assert "0.70 of the limit of stability" in warned.stderr and "half the step" in warned.stderr
    assert quiet.returncode == 0 and quiet.stderr == ""


@pytest.mark.parametrize("options", [{}, {"ts_type": "beuler", "dt": 1}, {"dt": 1}])
def test_controlled_and_implicit_steps_have_no_limit(options, tmp_path):
    result = pliant("raft", output=tmp_path / "run", **{**RESTING, "ts_adapt_type": "basic", "t_end": 20}, **options)
    assert "limit of stability" not in result.stderr


def test_stiff_droplets_find_their_step(tmp_path):
    """The first trial step is far too long, leaves the domain of the formulas and is tried again."""
    result = pliant("raft", output=tmp_path / "run", f0=1e6, t_end=1e-4)
    assert result.returncode == 0, result.stderr
    assert json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))["steps"] > 5


def test_wrong_scenario_of_a_checkpoint(tmp_path):
    compress(tmp_path / "run", end_distance=3.8)
    result = pliant("hopper", restart=tmp_path / "run")
    assert result.returncode == 2 and "holds a run of scenario 'raft', not of hopper" in result.stderr


def test_later_end(tmp_path):
    """A finished run continues to a later end, and equals one run."""
    whole = compress(tmp_path / "whole", end_distance=3.70, **RK4)
    compress(tmp_path / "parts", end_distance=3.70, t_end=50, **RK4)
    result = pliant("raft", restart=tmp_path / "parts", t_end=1e6)
    assert result.returncode == 0, result.stderr
    parts = Results(tmp_path / "parts")
    assert np.allclose(whole.frames[-1]["positions"], parts.frames[-1]["positions"], atol=1e-9)
    assert json.loads((tmp_path / "parts/summary.json").read_text(encoding="utf-8"))["ended_by"] == "end_distance"
