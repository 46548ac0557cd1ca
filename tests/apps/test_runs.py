"""The same run is the same run: twice, stopped and continued, killed, written more or less often."""

import json
import signal

import h5py
import numpy as np
import pytest
from conftest import (SMALL, Results, assert_same_runs, end, hopper, killed_with, pliant, same, start,
                      stopped_until_done, wait_for)
from test_kills import promised

# Each run is short, but long enough to be interrupted several times.
POLYGONS = {"n": 20, "hopper_wall_distance": 6, "hopper_width": 2.5, "frame_interval": 0.1, "sample_interval": 0.02}
KINDS = {
    "soft": {"t_end": 250, "frame_interval": 20, "sample_interval": 1},
    "soft_3d": {"dim": 3, "n": 80, "hopper_wall_distance": 5, "hopper_width": 3.5, "pack_fraction": 0.5, "t_end": 120,
                "frame_interval": 20, "sample_interval": 1},
    "rough": {**POLYGONS, "model": "rough", "t_end": 5},
    # Contacts are soft, so that particles come through and are reinserted within a second of computing.
    "smooth": {**POLYGONS, "model": "smooth", "n_vertices": 12, "edge_width": 0.3, "hopper_width": 3, "pack_fraction": 0.7,
               "e_c": 500, "e_w": 500, "k_a": 1000, "k_l": 100, "t_end": 40, "frame_interval": 1},
    "discharge": {"flow": "discharge", "hopper_angle": 45, "n": 300, "hopper_wall_distance": 14, "t_end": 400,
                  "frame_interval": 5, "sample_interval": 0.5},
    "clog": {"hopper_width": 0.7, "zeta": 1, "clog_time": 300, "t_end": 1000, "frame_interval": 50, "sample_interval": 1},
}


@pytest.mark.parametrize("kind", ["soft", "rough", "smooth"])
def test_same_seed_same_run(kind, tmp_path):
    options = {**KINDS[kind], "t_end": 0.1 if kind == "smooth" else 0.5 if kind == "rough" else 20}
    one, two = hopper(tmp_path / "one", **options), hopper(tmp_path / "two", **options)
    assert_same_runs(one, two)
    other = hopper(tmp_path / "other", **options, seed=2)
    assert not same(one.frames[0]["positions"], other.frames[0]["positions"])
    assert not same(one.topology["sigma"], other.topology["sigma"])


@pytest.mark.parametrize("kind", KINDS)
def test_stopped_and_continued(kind, tmp_path):
    """Stopped again and again by its wall time, until it is done."""
    whole = hopper(tmp_path / "whole", **KINDS[kind])
    assert whole.summary["status"] == {"discharge": "empty", "clog": "clogged"}.get(kind, "done")
    assert whole.summary["crossed_count"] > 0 or kind == "clog"
    if kind not in ("discharge", "clog"):
        heights = np.array([frame["centres"][:, -1] for frame in whole.frames])
        assert ((heights[:-1] < 0) & (heights[1:] > 1)).sum() > 3  # were reinserted
    assert stopped_until_done("hopper", **{**SMALL, **KINDS[kind], "output": tmp_path / "parts"}) > 1
    assert_same_runs(whole, Results(tmp_path / "parts"))


def test_termination_asks_for_a_checkpoint(tmp_path):
    options = {**SMALL, **KINDS["soft"], "t_end": 1e6}
    child = start("hopper", output=tmp_path / "parts", **options)
    wait_for((tmp_path / "parts/run.xdmf").exists, child)
    code, output, errors = end(child, signal.SIGTERM)
    assert code == 75 and errors == "" and "stopped at t =" in output
    t = json.loads((tmp_path / "parts/summary.json").read_text(encoding="utf-8"))["t"]
    assert t > 0
    options["t_end"] = round(t) + 50
    result = pliant("hopper", output=tmp_path / "parts", **options)
    assert result.returncode == 0 and "continuing at t =" in result.stdout
    assert_same_runs(hopper(tmp_path / "whole", **options), Results(tmp_path / "parts"))


@pytest.mark.parametrize("kind", ["soft", "rough"])
def test_killed_and_restarted(kind, tmp_path):
    options = {**SMALL, **KINDS[kind], "t_end": 1e6}
    child = start("hopper", output=tmp_path / "parts", checkpoint_interval=0.2, **options)
    wait_for((tmp_path / "parts/checkpoint-b.h5").exists, child)  # the other checkpoint is from the start
    wait_for(lambda: "000001" in (tmp_path / "parts/run.xdmf").read_text(encoding="utf-8"), child)
    code, _, _ = end(child, signal.SIGKILL)
    assert code == -signal.SIGKILL

    # A kill within a commit leaves its journal, which a restart applies and HDF5 does not know.
    (tmp_path / "killed").mkdir()
    (tmp_path / "killed/run.h5").write_bytes(promised((tmp_path / "parts/run.h5").read_bytes())[0])
    killed = Results(tmp_path / "killed")  # reads every dataset of every frame
    assert len(killed.frames) > 1
    t_end = killed.frames[-1]["time"] + 2 * options["frame_interval"]
    whole = hopper(tmp_path / "whole", **{**options, "t_end": t_end})
    for frame, reference in zip(killed.frames, whole.frames):
        assert frame.keys() == reference.keys()
        assert all(same(frame[name], reference[name]) for name in frame)

    result = pliant("hopper", restart=tmp_path / "parts", t_end=t_end)
    assert result.returncode == 0, result.stderr
    assert_same_runs(whole, Results(tmp_path / "parts"))


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished") / "run"
    hopper(folder, t_end=4)
    return folder


def test_a_finished_run_goes_on(finished, tmp_path):
    result = pliant("hopper", restart=finished, t_end=6)
    assert result.returncode == 0, result.stderr
    assert_same_runs(hopper(tmp_path / "whole", t_end=6), Results(finished))


def test_what_follows_the_last_checkpoint_is_written_again(tmp_path):
    """As after a kill between it and the last sample."""
    before = hopper(tmp_path / "run", t_end=1.23)
    result = pliant("hopper", restart=tmp_path / "run")
    assert result.returncode == 0, result.stderr
    assert_same_runs(before, Results(tmp_path / "run"))


@pytest.mark.parametrize("name, value", [("zeta", 0.4), ("e_sp", 50), ("seed", 7), ("n", 61), ("hopper_width", 3.5),
                                         ("model", "rough"), ("dt", 2e-3), ("integrator", "ts"), ("dim", 3)])
def test_a_restart_cannot_change_the_physics(name, value, finished):
    before = {path.name: path.read_bytes() for path in finished.iterdir()}
    result = pliant("hopper", **{"restart": finished, "t_end": 9, name: value})
    assert result.returncode == 2 and len(result.stderr.splitlines()) == 1
    assert f"-{name} {value}" in result.stderr and "a restart cannot change it" in result.stderr
    assert {path.name: path.read_bytes() for path in finished.iterdir()} == before


@pytest.mark.parametrize("extra, words", [({"t_end": 1}, ["-t_end 1", "checkpoint"])])
def test_a_restart_that_makes_no_sense(extra, words, finished):
    before = {path.name: path.read_bytes() for path in finished.iterdir()}
    result = pliant("hopper", restart=finished, **extra)
    assert result.returncode == 2 and len(result.stderr.splitlines()) == 1, result.stdout
    assert all(word in result.stderr for word in words), result.stderr
    assert {path.name: path.read_bytes() for path in finished.iterdir()} == before


@pytest.mark.parametrize("options", [{}, {"model": "rough", "n": 20, "t_end": 1.5},
                                     {"flow": "discharge", "hopper_angle": 45, "t_end": 6},
                                     {"integrator": "ts", "ts_rtol": 1e-5, "t_end": 3}],
                         ids=["soft", "rough", "discharge", "ts"])
def test_output_does_not_change_the_trajectory(options, tmp_path):
    rare = hopper(tmp_path / "rare", **{**options, "frame_interval": 100, "sample_interval": 50})
    often = hopper(tmp_path / "often", **{**options, "frame_interval": 0.0213, "sample_interval": 0.0131})
    assert len(rare.frames) == 2 and len(often.frames) > 60
    for name in ("positions", "velocities", "active"):
        assert same(rare.frames[-1][name], often.frames[-1][name])
    for name in ("steps", "force_evaluations", "crossed_count"):
        assert rare.summary[name] == often.summary[name]


def test_fixed_steps_by_either_path(tmp_path):
    """-integrator verlet and -integrator ts -ts_type verlet: the same steps, with particles reinserted. After t = 1.5 rounding
    and sums in another order (only the first sorts particles on the way) grow a hundredfold every 0.1 t0."""
    options = {"dt": 4e-3, "t_end": 3, "frame_interval": 0.5}
    plain = hopper(tmp_path / "plain", **options)
    del options["dt"]
    by_ts = hopper(tmp_path / "ts", integrator="ts", ts_type="verlet", ts_dt=4e-3, **options)
    assert plain.summary["integrator"] == "verlet" and by_ts.summary["integrator"] == "ts:verlet"
    assert plain.summary["steps"] == by_ts.summary["steps"] == 750
    heights = plain.column("centres")[:, :, 1]
    assert (np.diff(heights, axis=0) > 3).sum() >= 3  # reinserted
    assert plain.summary["crossed_count"] == by_ts.summary["crossed_count"] > 3
    for name, tolerance in {"positions": 1e-10, "velocities": 1e-9}.items():
        np.testing.assert_allclose(by_ts.column(name)[:4], plain.column(name)[:4], rtol=0, atol=tolerance)


def test_error_control_agrees_with_small_fixed_steps(tmp_path):
    # Without friction, which sets in with a jump: only then do the methods have their order.
    fixed = hopper(tmp_path / "fixed", dt=5e-5, t_end=0.5, mu=0)
    adaptive = hopper(tmp_path / "adaptive", integrator="ts", ts_type="rk", ts_rk_type="5dp", ts_rtol=1e-10,
                      ts_atol=1e-10, t_end=0.5, mu=0)
    assert adaptive.summary["integrator"] == "ts:rk 5dp"
    moved = fixed.frames[-1]["positions"] - fixed.frames[0]["positions"]
    assert np.abs(moved).max() > 0.05
    np.testing.assert_allclose(adaptive.frames[-1]["positions"], fixed.frames[-1]["positions"], rtol=0, atol=1e-6)


def test_a_frame_is_readable_while_the_run_goes_on(tmp_path, monkeypatch):
    monkeypatch.setenv("HDF5_USE_FILE_LOCKING", "FALSE")
    child = start("hopper", output=tmp_path / "run", **{**SMALL, "t_end": 1e6, "frame_interval": 50})
    try:
        xdmf = tmp_path / "run/run.xdmf"
        wait_for(lambda: xdmf.exists() and "000000" in xdmf.read_text(encoding="utf-8"), child)

        def has_positions():
            try:
                with h5py.File(tmp_path / "run/run.h5", locking=False) as file:
                    return "positions" in file["frames/000000"]
            except (OSError, KeyError, RuntimeError):  # during a commit
                return False

        wait_for(has_positions, child)
    finally:
        code, _, _ = end(child)
    assert code == 75


# --- -hopper_q_rtol: the run ends by itself

PRECISE = {"t_end": 2000, "frame_interval": 20, "sample_interval": 0.2, "hopper_q_rtol": 0.03}


def relative_error(run):
    return run.summary["Q"]["error"] / run.summary["Q"]["value"]


def test_ends_when_the_flow_rate_is_known(tmp_path):
    run = hopper(tmp_path / "run", **PRECISE)
    assert run.summary["status"] == "done" and run.summary["ended_by"] == "q_rtol"
    assert 20 < run.summary["t"] < 1000
    assert run.summary["steady"] and 0 < relative_error(run) <= 0.03
    assert run.summary["t"] == run.series["time"][-1] == run.frames[-1]["time"]
    longer = hopper(tmp_path / "longer", **{**PRECISE, "hopper_q_rtol": 0, "t_end": 10 * run.summary["t"]})
    assert longer.summary["ended_by"] == "t_end"
    difference = run.summary["Q"]["value"] - longer.summary["Q"]["value"]
    assert abs(difference) < 4 * run.summary["Q"]["error"]
    # The rule only observes: up to its end the run is the same.
    rows = len(run.series["time"])
    assert all(same(run.series[name], longer.series[name][:rows]) for name in run.series)


def test_precise_run_killed_and_restarted(tmp_path):
    options = {**SMALL, **PRECISE, "hopper_q_rtol": 0.02}
    whole = hopper(tmp_path / "whole", **options)
    assert whole.summary["ended_by"] == "q_rtol"
    killed_with("checkpoint-b.h5", "hopper", output=tmp_path / "parts", checkpoint_interval=0.01, **options)
    result = pliant("hopper", restart=tmp_path / "parts")
    assert result.returncode == 0, result.stderr
    assert_same_runs(whole, Results(tmp_path / "parts"))
    # The run has ended: another restart changes nothing.
    assert pliant("hopper", restart=tmp_path / "parts").returncode == 0
    assert_same_runs(whole, Results(tmp_path / "parts"))


def test_precise_run_goes_on_for_more(tmp_path):
    hopper(tmp_path / "run", **{**PRECISE, "hopper_q_rtol": 0.05})
    result = pliant("hopper", restart=tmp_path / "run", hopper_q_rtol=0.02)
    assert result.returncode == 0 and result.stderr == ""
    assert_same_runs(hopper(tmp_path / "whole", **{**PRECISE, "hopper_q_rtol": 0.02}), Results(tmp_path / "run"))


def test_t_end_comes_first(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **{**SMALL, **PRECISE, "hopper_q_rtol": 1e-3, "t_end": 50})
    run = Results(tmp_path / "run")
    assert result.returncode == 0 and run.summary["ended_by"] == "t_end" and run.summary["t"] == pytest.approx(50)
    assert len(result.stderr.splitlines()) == 1 and "reached -t_end 50" in result.stderr
    assert f"error of Q is {100 * relative_error(run):.2g} %" in result.stderr


def test_latest_end_unless_given(tmp_path):
    asked = {name: value for name, value in {**SMALL, **PRECISE, "hopper_q_rtol": 0.1}.items() if name != "t_end"}
    assert pliant("hopper", output=tmp_path / "run", **asked).returncode == 0
    assert Results(tmp_path / "run").summary["parameters"]["t_end"]["value"] == 10000


def test_a_discharge_has_no_steady_rate(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **{**SMALL, "flow": "discharge", "hopper_q_rtol": 0.1})
    assert result.returncode == 2 and len(result.stderr.splitlines()) == 1
    assert "-hopper_q_rtol 0.1" in result.stderr and not (tmp_path / "run").exists()
