"""Threads and ranks: the same run as on one thread of one rank, stopped, continued and failing in the same way."""

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import (HANGS, PROGRAM, SMALL, Results, arguments, assert_same_runs, hopper, pliant,
                      wait_for)

needs_mpi = pytest.mark.ranks
CASES = Path(__file__).parent.parent / "data/evaluate"
POLYGONS = {"n": 20, "hopper_wall_distance": 6, "hopper_width": 2.5, "frame_interval": 0.05, "sample_interval": 0.02}
# Short enough that rounding errors are still negligible.
KINDS = {
    "soft": {"t_end": 2.6},
    "soft_3d": {"dim": 3, "n": 120, "hopper_wall_distance": 5, "hopper_width": 3.5, "pack_fraction": 0.5, "t_end": 1.2},
    "rough": {**POLYGONS, "model": "rough", "t_end": 0.4},
    "smooth": {**POLYGONS, "model": "smooth", "t_end": 0.06, "frame_interval": 0.02},
    "surfaces": {"model": "rough", "dim": 3, "n": 12, "hopper_wall_distance": 4, "hopper_width": 2, "pack_fraction": 0.5,
                 "t_end": 0.6, "frame_interval": 0.1, "sample_interval": 0.02},
    # Ends soon after the first contacts: in them rounding grows tenfold in a time of 0.02.
    "smooth_surfaces": {"model": "smooth", "dim": 3, "n": 12, "hopper_wall_distance": 2.5, "hopper_width": 1.5, "pack_fraction": 0.5,
                        "edge_width": 0.3, "e_c": 100, "e_w": 100, "k_v": 2000, "t_end": 0.72, "frame_interval": 0.08, "sample_interval": 0.02},
    "discharge": {"flow": "discharge", "hopper_angle": 45, "n": 40, "t_end": 4},
    "ts": {"integrator": "ts", "ts_type": "rk", "ts_adapt_type": "none", "dt": 1.5e-3, "t_end": 1.5},
}


def mpi_environment():
    """Open MPI: as root, with more ranks than free cores, and without a second's wait for other ranks if one rank ends
    with a code; the settings for runs without mpiexec are removed."""
    names = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
             "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_mpi_yield_when_idle": "1",
             "OMPI_MCA_odls_base_sigkill_timeout": "0"}
    return os.environ | names


def start_ranks(ranks, *command, **options):
    return subprocess.Popen(["mpiexec", "-n", str(ranks), PROGRAM, *map(str, command), *arguments(options)], encoding="utf-8",
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=mpi_environment())


def on_ranks(ranks, *command, **options):
    """Runs the program under mpiexec to its end; a hanging program is killed."""
    child = start_ranks(ranks, *command, **options)
    try:
        output, errors = child.communicate(timeout=HANGS)
    except subprocess.TimeoutExpired:
        child.terminate()
        child.communicate()
        raise
    return subprocess.CompletedProcess(child.args, child.returncode, output, errors)


def on_any_ranks(ranks, *command, **options):
    """On one rank without mpiexec, which these tests need only for several ranks."""
    return on_ranks(ranks, *command, **options) if ranks > 1 else pliant(*command, **options)


def complaints(result):
    """The standard error of the program, without lines of mpiexec."""
    return [line for line in result.stderr.splitlines() if line.startswith("pliant:")]


def hopper_on_ranks(ranks, folder, **options):
    result = on_ranks(ranks, "hopper", output=folder, **{**SMALL, **options})
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("hopper:") == 1  # one rank prints
    return Results(folder)


def assert_near_runs(a, b, tolerance=1e-9):
    """As assert_same_runs, up to rounding."""
    assert len(a.frames) == len(b.frames) > 2
    for n, (one, other) in enumerate(zip(a.frames, b.frames)):
        assert one.keys() == other.keys()
        for name in one:
            stiffness = 4e4 if "force" in name else 100  # stiffness of a wall: 4 E_w/sigma^2
            np.testing.assert_allclose(other[name], one[name], rtol=1e-9, atol=stiffness * tolerance,
                                       err_msg=f"frame {n}: {name}")
        np.testing.assert_allclose(other["positions"], one["positions"], rtol=0, atol=tolerance)
    assert a.series.keys() == b.series.keys()
    for name in a.series:
        np.testing.assert_allclose(b.series[name], a.series[name], rtol=1e-8, atol=100 * tolerance, err_msg=name)
    assert a.events.keys() == b.events.keys()
    for name in a.events:
        np.testing.assert_allclose(b.events[name], a.events[name], rtol=0, atol=100 * tolerance, err_msg=name)
    assert a.summary.keys() == b.summary.keys()
    for name in {"status", "particles", "t", "steps", "crossed_count", "packing_iterations", "integrator", "dt"} & a.summary.keys():
        assert a.summary[name] == b.summary[name], name


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """Runs on one rank, each made once."""
    runs = {}

    def run(kind):
        if kind not in runs:
            runs[kind] = hopper(tmp_path_factory.mktemp("serial") / kind, **KINDS[kind])
        return runs[kind]

    return run


# --- Threads

# Soft contacts and shapes, for long steps; 8400 vertices, in two chunks.
SURFACES = {"dim": 3, "n": 200, "hopper_wall_distance": 6, "hopper_width": 3, "pack_fraction": 0.6, "e_c": 100, "e_w": 100, "k_v": 2000,
            "k_a": 20, "mu": 0.2, "zeta": 0.3, "t_end": 1, "frame_interval": 0.25, "sample_interval": 0.1}


@pytest.mark.parametrize("options", [
    {"n": 3000, "hopper_wall_distance": 40, "hopper_width": 6, "t_end": 0.3, "frame_interval": 0.1},
    {"n": 8500, "dim": 3, "hopper_wall_distance": 18, "hopper_width": 6, "pack_fraction": 0.5, "t_end": 0.05,
     "frame_interval": 0.02},
    {"n": 200, "hopper_wall_distance": 14, "hopper_width": 4, "model": "rough", "t_end": 0.1, "frame_interval": 0.02},
    {"n": 200, "hopper_wall_distance": 14, "hopper_width": 4, "model": "smooth", "t_end": 0.02,
     "frame_interval": 0.01},
    {**SURFACES, "model": "rough"}, {**SURFACES, "model": "smooth", "edge_width": 0.3}],
    ids=["soft", "soft_3d", "rough", "smooth", "rough_3d", "smooth_3d"])
def test_threads_change_no_bit(options, tmp_path):
    one, two = hopper(tmp_path / "one", **options), hopper(tmp_path / "two", **options, threads=2)
    assert np.abs(one.frames[-1]["positions"] - one.frames[0]["positions"]).max() > 1e-4
    if options.get("dim") == 3 and "model" in options:
        assert len(one.frames[-1]["contacts/overlap"]) > 20
    assert_same_runs(one, two)


@needs_mpi
def test_threads_of_ranks_change_no_bit(tmp_path):
    options = {"n": 400, "hopper_wall_distance": 20, "hopper_width": 4, "model": "rough", "t_end": 0.1,
               "frame_interval": 0.02}
    assert_same_runs(hopper_on_ranks(2, tmp_path / "one", **options),
                     hopper_on_ranks(2, tmp_path / "two", **options, threads=2))


# --- Ranks

@needs_mpi
@pytest.mark.parametrize("kind, ranks", [("soft", 2), ("soft", 3), ("soft_3d", 3), ("rough", 3), ("smooth", 2), ("surfaces", 3), ("smooth_surfaces", 3),
                                         ("discharge", 3), ("ts", 2)])
def test_ranks_give_the_same_run(kind, ranks, serial, tmp_path):
    one, several = serial(kind), hopper_on_ranks(ranks, tmp_path / "ranks", **KINDS[kind])
    assert_near_runs(one, several)
    moved = one.frames[-1]["centres"] - one.frames[0]["centres"]
    assert np.abs(moved).max() > (0.001 if kind == "smooth" else 0.05)
    if kind == "soft":
        assert (np.diff(one.column("centres")[:, :, -1], axis=0) > 2).any()  # reinserted
    if kind == "smooth_surfaces":
        assert any(len(frame["contacts/overlap"]) for frame in one.frames)
    if kind == "discharge":
        assert not one.frames[-1]["active"].all()


@needs_mpi
def test_more_ranks_than_particles(tmp_path):
    options = {"n": 3, "hopper_wall_distance": 4, "hopper_width": 2, "t_end": 1}
    assert_near_runs(hopper(tmp_path / "one", **options), hopper_on_ranks(4, tmp_path / "four", **options))


# A rank without particles must call every collective function too. Short; with samples and frames on the way.
ALONE = {"n": 1, "hopper_wall_distance": 6, "hopper_width": 2, "zeta": 0.3, "t_end": 0.1, "sample_interval": 0.05,
         "frame_interval": 0.05}
LEAVING = {**ALONE, "flow": "discharge", "t_end": 4, "sample_interval": 1, "frame_interval": 1}
SOLVED = {**ALONE, "integrator": "ts", "t_end": 0.02, "sample_interval": 0.01, "frame_interval": 0.01}
DISK = {"radii": "2", "counts": "1", "area_fraction": 0.1, "channel_width": 10, "channel_arm": 16, "pushes": 1, "stroke": 0.5,
        "plunger_speed": 10, "sample_travel": 0.25, "frame_travel": 0.25}
FLOWING = {"n": 2, "path": "quench", "shear_rate": 0.5, "strain": 0.2, "sample_interval": 0.1, "frame_interval": 0.1}
SOLITARY = {
    **{f"hopper_{model}": ("hopper", {**ALONE, "model": model}) for model in ("sp", "disk", "rough", "smooth")},
    **{f"discharge_{model}": ("hopper", {**LEAVING, "model": model}) for model in ("sp", "disk")},
    "hopper_3d": ("hopper", {**ALONE, "dim": 3}),
    "hopper_disk_3d": ("hopper", {**ALONE, "dim": 3, "model": "disk"}),
    "discharge_3d": ("hopper", {**LEAVING, "dim": 3, "hopper_width": 3}),
    "hopper_overdamped": ("hopper", {**SOLVED, "dynamics": "overdamped"}),
    **{f"hopper_{kind}": ("hopper", {**SOLVED, "model": "rough", "ts_type": kind})
       for kind in ("rk", "verlet", "cvode", "arkode", "alpha2", "bdf", "arkimex")},
    "vibrate": ("vibrate", {"n": 1, "box_width": 4, "cycles": 1}),
    "vibrate_3d": ("vibrate", {"n": 1, "dim": 3, "box_width": 4, "cycles": 1}),
    "channel_disk": ("channel", DISK),
    "channel_rough": ("channel", {**DISK, "model": "rough"}),
    **{f"shear_{model}": ("shear", {**FLOWING, "model": model}) for model in ("sp", "rough", "smooth")},
    "shear_3d": ("shear", {**FLOWING, "dim": 3}),
    "shear_surface": ("shear", {**FLOWING, "dim": 3, "model": "rough"}),
    **{f"shear_{kind}": ("shear", {**FLOWING, "integrator": "ts", "ts_type": kind}) for kind in ("rk", "cn")},
}


@needs_mpi
@pytest.mark.parametrize("name", SOLITARY)
def test_more_ranks_than_particles_in_every_scenario(name, tmp_path):
    scenario, options = SOLITARY[name]
    result = on_ranks(3, scenario, output=tmp_path / "run", **options)
    assert result.returncode == 0, result.stderr
    run = Results(tmp_path / "run")
    assert run.summary["particles"] < 3 and len(run.frames) > 1 and len(run.series["time"]) > 1


@needs_mpi
def test_a_discharge_that_empties(tmp_path):
    options = {**KINDS["discharge"], "n": 12, "t_end": 100, "mu": 0}
    one, two = hopper(tmp_path / "one", **options), hopper_on_ranks(2, tmp_path / "two", **options)
    assert one.summary["status"] == two.summary["status"] == "empty"
    assert two.summary["crossed_count"] == 12
    assert one.summary.keys() == two.summary.keys()


# --- Droplets

RK4 = {"ts_type": "rk", "ts_rk_type": 4, "ts_adapt_type": "none", "dt": 0.1}
# Fixed steps, because controlled steps depend on the last bit; different sizes, because the fracture of a symmetric
# raft depends on it too.
RAFT = {"rows": 3, "columns": 3, "delta": 0.01, "end_distance": 4, "v_wall": 2e-2, "sample_interval": 2,
        "frame_interval": 20, **RK4}
# Half of the droplets leave before it clogs.
CLOG = {"n": 20, "seed": 3, "g": 0.1, "hopper_width": 2, "phi_c": 3e-4, "dt": 0.4, "frame_interval": 20,
        "sample_interval": 5}


@needs_mpi
@pytest.mark.parametrize("scenario, options", [("raft", RAFT), ("clog", CLOG)])
def test_droplets_refuse_several_ranks(scenario, options, tmp_path):
    result = on_ranks(2, scenario, output=tmp_path / "run", **options)
    assert result.returncode == 2 and not (tmp_path / "run").exists()
    (error,) = complaints(result)
    assert f"{scenario} on 2 ranks: " in error and "without mpiexec" in error


# --- Stopped and continued

@needs_mpi
@pytest.mark.parametrize("kind", ["rough", "ts"])
def test_stopped_by_its_wall_time_and_continued(kind, serial, tmp_path):
    command = {**SMALL, **KINDS[kind], "output": tmp_path / "parts"}
    first = on_ranks(2, "hopper", **command, max_wall_time=1e-3)
    assert first.returncode == 75 and complaints(first) == []
    assert first.stdout.count("run the same command again") == 1
    stopped = json.loads((tmp_path / "parts/summary.json").read_text(encoding="utf-8"))
    assert stopped["status"] == "stopped" and 0 < stopped["t"] < KINDS[kind]["t_end"]
    second = on_ranks(2, "hopper", **command)
    assert second.returncode == 0, second.stderr
    assert second.stdout.count("continuing at t =") == 1
    assert_near_runs(serial(kind), Results(tmp_path / "parts"))


@needs_mpi
@pytest.mark.parametrize("kind, first, then", [("soft", 2, 3), ("smooth", 2, 1), ("discharge", 1, 2)])
def test_continued_by_another_number_of_ranks(kind, first, then, serial, tmp_path):
    end = KINDS[kind]["t_end"]
    hopper_on_ranks(first, tmp_path / "run", **{**KINDS[kind], "t_end": end / 2})
    result = on_ranks(then, "hopper", restart=tmp_path / "run", t_end=end)
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("continuing at t =") == 1
    assert_near_runs(serial(kind), Results(tmp_path / "run"))


def children(process):
    return [int(pid) for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text(encoding="utf-8").split()]


@needs_mpi
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="no list of child processes")
def test_a_signal_to_one_rank_stops_all(tmp_path):
    child = start_ranks(2, "hopper", output=tmp_path / "run", **{**SMALL, "t_end": 1e6, "frame_interval": 100})
    wait_for((tmp_path / "run/run.xdmf").exists, child)
    time.sleep(0.1)
    os.kill(children(child)[-1], signal.SIGTERM)
    output, _ = child.communicate(timeout=HANGS)
    assert child.returncode == 75 and output.count("stopped at t =") == 1
    summary = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
    assert summary["status"] == "stopped" and summary["t"] > 0
    result = on_ranks(2, "hopper", restart=tmp_path / "run", t_end=summary["t"] + 1)
    assert result.returncode == 0 and "continuing at t =" in result.stdout


# --- Errors, output

@needs_mpi
@pytest.mark.parametrize("command, options, code, word", [
    ("hopper", {"zetta": 1}, 2, "zetta"),
    ("hopper", {**SMALL, "output": "{folder}/file/run"}, 4, "file/run"),
    ("hopper", {"restart": "{folder}/nothing"}, 2, "nothing"),
    ("evaluate nothing.json", {}, 2, "nothing.json"),
], ids=["option", "output", "restart", "case"])
def test_errors_end_all_ranks(command, options, code, word, tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    asked = {name: value.format(folder=tmp_path) if isinstance(value, str) else value
             for name, value in options.items()}
    result = on_ranks(2, *command.split(), **asked)
    assert result.returncode == code, result.stderr
    assert len(complaints(result)) == 1 and word in complaints(result)[0]
    one = pliant(*command.split(), **asked)
    assert one.returncode == code and complaints(one) == complaints(result)


@needs_mpi
@pytest.mark.parametrize("options", [{"dt": 0.02}, {"integrator": "ts", "ts_type": "euler", "ts_dt": 0.5},
                                     {"mu": 0, "e_w": 1, "n": 300, "hopper_wall_distance": 16}],
                         ids=["verlet", "ts", "through_the_floor"])
def test_a_run_that_fails(options, tmp_path):
    result = on_ranks(2, "hopper", output=tmp_path / "run", **{**SMALL, **options, "t_end": 100}, allow_unstable_dt="true")
    errors = [line for line in complaints(result) if "warning" not in line]
    assert result.returncode == 3 and len(errors) == 1, result.stderr
    run = Results(tmp_path / "run")
    assert run.summary["status"] == "failed" and run.summary["message"] in errors[0]
    assert all(np.isfinite(frame["positions"]).all() for frame in run.frames)


@needs_mpi
def test_evaluate_prints_once():
    path = CASES / "sp3d_09_cluster.json"
    one, three = pliant("evaluate", path), on_ranks(3, "evaluate", path)
    assert one.returncode == three.returncode == 0
    assert json.loads(three.stdout) and three.stdout == one.stdout and three.stderr == one.stderr


@needs_mpi
def test_help_is_printed_once():
    assert on_ranks(2, "hopper", "-help").stdout == pliant("hopper", "-help").stdout


@needs_mpi
def test_an_arch_across_ranks(tmp_path):
    options = {**SMALL, "hopper_angle": 45, "hopper_width": 0.6, "zeta": 1, "clog_time": 3, "t_end": 100, "mu": 0}
    assert on_ranks(2, "hopper", output=tmp_path / "run", **options).returncode == 0
    assert Results(tmp_path / "run").summary["status"] == "clogged"
