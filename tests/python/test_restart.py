"""Simulations that continue from their checkpoints, with the same bits as without the interruption."""

import os
import subprocess
import sys

import numpy as np
import pytest

import pliant
from pliant import Run, Simulation, Walls

STATE = ("positions", "velocities", "angles", "spins", "images")


def crowd(dim=2, **options):
    """Particles in a box that is shaken: a floor that oscillates, a paddle that turns, a disk that moves, an outline."""
    walls = Walls(dim)
    walls.half_space([0] * (dim - 1) + [-0.2], [0] * (dim - 1) + [1], amplitude=[0] * (dim - 1) + [0.1], frequency=9)
    if dim == 2 and "box" not in options:
        walls.line([(-1, 9), (-1, 0.4), (4, 0.4), (4, 9)])
        walls.disk((1, -1), 0.7, velocity=(0.1, 0.3))
        walls.segment((0, 4.7), (1, 4.9), spin=0.5, pivot=(0.5, 4.8))
    grid = np.stack(np.meshgrid(*[np.arange(4.0)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    x = grid * 0.98 + np.eye(dim)[-1]
    polygons = options.pop("polygons", False)
    particles = ({"polygons": pliant.regular_polygons(x, 0.7, 9), "mass": 0.3 + 0.01 * np.arange(len(x))} if polygons
                 else {"positions": x, "diameters": 0.9 + 0.02 * np.arange(len(x)) / len(x)})
    return Simulation(**particles, walls=walls, gravity=[0] * (dim - 1) + [-1], **options)


def state_of(sim):
    result = {}
    for name in STATE:
        try:
            result[name] = getattr(sim, name).copy()
        except pliant.UsageError:
            pass
    return result | {"t": sim.t, "steps": sim.steps, "dt": sim.dt}


def assert_same(a, b):
    assert a.keys() == b.keys()
    for name, value in a.items():
        np.testing.assert_array_equal(value, b[name], err_msg=name)


def protocol(sim):
    """Changes in the course of a run: of walls, and of a parameter that soft particles have."""
    if sim.t > 0.3 and len(sim.wall_radius) > 1:
        sim.move_wall(2, velocity=(0, -0.05))
        sim.move_wall(3, spin=-1 - sim.t, pivot=(0.5, 4.8), velocity=(0.1, 0))
    if "zeta" in sim.options:
        sim.set(zeta=0.1 + 0.1 * sim.t)


CASES = [dict(model="disk", mu_disk=0.5), dict(model="sp", zeta=0.1), dict(model="rough", polygons=True),
         dict(model="smooth", polygons=True), dict(dim=3, model="disk", mu_disk=0.4), dict(dim=3, model="sp", zeta=0.1),
         dict(model="sp", box=(5, None)),
         # Steps with error control are as long as a collision, in which contacts count their heat once in a step.
         dict(model="disk", integrator="rk", ts_rtol=1e-5, allow_energy_error=True),
         dict(model="disk", integrator="rk", ts_rtol=1e-5, ts_adapt_dt_max=1e-3),
         *(dict(model="sp", zeta=0.1, integrator=name, **options) for name, options in
           (("cn", {"dt": 0.005}), ("alpha2", {"ts_rtol": 1e-4}), ("arkimex", {"ts_rtol": 1e-4}), ("bdf", {"ts_rtol": 1e-4})))]


@pytest.mark.parametrize("case", CASES, ids=lambda case: "-".join(str(v) for v in case.values()))
@pytest.mark.parametrize("changes", [False, True])
def test_the_same_bits(case, changes, tmp_path):
    calls = dict(callback=protocol, every=0.11) if changes else {}
    outputs = dict(frame_interval=0.2, sample_interval=0.07)
    with crowd(**case, output=tmp_path / "whole", **outputs) as sim:
        sim.run(until=0.5, **calls)
        sim.run(until=1.0, **calls)
        whole = state_of(sim)
    with crowd(**case, output=tmp_path / "parts", **outputs) as sim:
        sim.run(until=0.5, **calls)
    with Simulation.restart(tmp_path / "parts") as sim:
        assert sim.t == pytest.approx(0.5, abs=0.01) and sim.output == str(tmp_path / "parts")
        sim.run(until=1.0, **calls)
        assert_same(whole, state_of(sim))
    a, b = Run(tmp_path / "whole"), Run(tmp_path / "parts")
    assert a.series.equals(b.series)
    assert [f.time for f in a.frames] == [f.time for f in b.frames]
    np.testing.assert_array_equal(a.frames[-1].positions, b.frames[-1].positions)
    assert a.summary["steps"] == b.summary["steps"] and b.summary["force_evaluations"] >= b.summary["steps"]


@pytest.mark.parametrize("integrator", ["cvode", "arkode"])
def test_sundials_within_the_tolerance(integrator, tmp_path):
    case = dict(model="sp", zeta=0.1, integrator=integrator, ts_rtol=1e-6, ts_atol=1e-6)
    with crowd(**case) as sim:
        sim.run(until=0.5), sim.run(until=1.0)
        whole = sim.positions.copy()
    with crowd(**case, output=tmp_path / "run") as sim:
        sim.run(until=0.5)
    with Simulation.restart(tmp_path / "run") as sim:
        sim.run(until=1.0)
        assert sim.positions == pytest.approx(whole, abs=1e-4)


def drag(x, v, t):
    return -0.3 * v + np.array([0.1 * np.sin(t), 0])


@pytest.mark.parametrize("force", [None, drag])
@pytest.mark.parametrize("at", ["step", "change"])
def test_a_checkpoint_in_a_run_that_is_killed(force, at, tmp_path, script):
    """save() in a callback, after which the process is killed: from an ordinary step, and from one that changes a wall."""
    case = dict(model="disk", mu_disk=0.5)

    def follow(sim):
        if at == "change" and abs(sim.t - 0.4) < 1e-3:
            sim.move_wall(2, velocity=(0, -0.1))

    with crowd(**case) as sim:
        sim.force = force
        sim.run(until=0.8, callback=follow, every=0.1)
        whole = state_of(sim)
    folder = tmp_path / "run"
    script(f"""
import os, sys
sys.path.insert(0, {os.path.dirname(__file__)!r})
from test_restart import crowd, drag
def follow(sim):
    if abs(sim.t - 0.4) < 1e-3:
        if {at == "change"}:
            sim.move_wall(2, velocity=(0, -0.1))
        sim.save()
    if sim.t > 0.55:
        os._exit(7)
sim = crowd(**{case!r}, output={str(folder)!r})
sim.force = {"None" if force is None else "drag"}
sim.run(until=0.8, callback=follow, every=0.1)
""", code=7)
    with Simulation.restart(folder) as sim:
        assert sim.t == pytest.approx(0.4, abs=0.01)
        sim.force = force
        sim.run(until=0.8, callback=follow, every=0.1)
        assert_same(whole, state_of(sim))


def test_parameters_and_walls_are_those_of_the_save(tmp_path):
    with crowd(model="sp", output=tmp_path / "run", e_sp=500, zeta=0.2) as sim:
        sim.run(0.1)
        sim.set(e_sp=350.25, dt=1e-3)
        sim.move_wall(0, velocity=(0.3, 0))
        sim.velocities *= 0.5
        sim.run(0.1)
        forces, walls, options, speeds = sim.forces, sim.wall_segments, sim.options, sim.velocities.copy()
    with Simulation.restart(tmp_path / "run") as sim:
        assert sim.options == {**options, "integrator": "verlet"} and sim.dt == 1e-3 and len(sim) == 16
        np.testing.assert_array_equal(sim.forces, forces)
        np.testing.assert_array_equal(sim.wall_segments, walls)
        np.testing.assert_array_equal(sim.velocities, speeds)
        sim.set(zeta=0.1)  # later changes keep the restored ones
        assert sim.options["e_sp"] == 350.25


def test_bad_restarts(tmp_path):
    folder = tmp_path / "run"
    sim = crowd(model="sp", output=folder, frame_interval=0.1)
    with pytest.raises(pliant.FolderInUseError, match="in use by"):
        Simulation.restart(folder)
    sim.run(0.15)
    sim.close()
    for call in (sim.save, lambda: sim.run(1)):
        with pytest.raises(pliant.UsageError, match="closed"):
            call()
    with pytest.raises(pliant.UsageError, match="no output folder"):
        crowd(model="sp").save()
    with pytest.raises(pliant.InputError, match="no such folder"):
        Simulation.restart(tmp_path / "none")
    with pytest.raises(pliant.InputError, match="frame_interval is -1"):
        Simulation.restart(folder, frame_interval=-1)
    with pytest.raises(pliant.InputError, match="checkpoint_interval is 0"):
        crowd(model="sp", output=tmp_path / "other", checkpoint_interval=0)
    with pytest.raises(pliant.InputError, match=r"holds a pliant.Simulation .*Simulation.restart.*-start .*run.h5"):
        pliant.hopper(restart=folder, quiet=True)
    for file in folder.glob("checkpoint-?.h5"):
        data = bytearray(file.read_bytes())
        data[len(data) // 2] ^= 1
        file.write_bytes(data)
    with pytest.raises(pliant.InputError, match="damaged"):
        Simulation.restart(folder)
    for file in folder.glob("checkpoint-?.h5"):
        file.unlink()
    with pytest.raises(pliant.InputError, match="checkpoint"):
        Simulation.restart(folder)


def test_a_scenario_is_no_simulation(small, tmp_path):
    pliant.hopper(**dict(small, t_end=0.1), output=tmp_path / "hopper", quiet=True)
    with pytest.raises(pliant.InputError, match="scenario hopper; continue it with pliant.hopper"):
        Simulation.restart(tmp_path / "hopper")


def test_the_older_checkpoint_serves_when_the_newer_is_damaged(tmp_path):
    with crowd(model="sp", output=tmp_path / "run") as sim:
        sim.run(0.1)
        sim.save()
        sim.run(0.1)
    newest = max((tmp_path / "run").glob("checkpoint-?.h5"), key=os.path.getmtime)
    newest.write_bytes(newest.read_bytes()[:-5])
    with Simulation.restart(tmp_path / "run") as sim:
        assert sim.t == pytest.approx(0.1, abs=0.01)


def test_run_until():
    sim = crowd(model="sp")
    sim.run(until=0.2)
    assert sim.t == pytest.approx(0.2, abs=sim.dt)
    for until in (np.nan, np.inf, -np.inf):
        with pytest.raises(pliant.InputError, match=rf"run\(until={until}\): the time must be finite; give one after t = 0.199"):
            sim.run(until=until)
    for arguments in ({}, {"t": 1, "until": 2}, {"until": 0.1}, {"until": "1"}):
        with pytest.raises(pliant.InputError):
            sim.run(**arguments)


def test_the_command_line_continues_a_run(tmp_path):
    """With the bits of an uninterrupted run; not where functions of Python took part, unless they may stay away."""
    options = dict(frame_interval=0.2, sample_interval=0.07)
    with crowd(model="disk", output=tmp_path / "whole", **options) as sim:
        sim.run(until=0.5), sim.run(until=1)
    with crowd(model="disk", output=tmp_path / "parts", **options) as sim:
        sim.run(until=0.5)
        assert not sim.called_functions

    def go_on(folder, *more):
        return subprocess.run([sys.executable, "-B", "-m", "pliant", str(tmp_path / folder), "--until", "1", *more],
                              capture_output=True, encoding="utf-8", timeout=120)
    done = go_on("parts")
    assert done.returncode == 0 and "parts: t = 1.00025, " in done.stdout, done.stderr
    a, b = Run(tmp_path / "whole"), Run(tmp_path / "parts")
    assert a.series.equals(b.series) and len(a.frames) == len(b.frames)
    np.testing.assert_array_equal(a.frames[-1].positions, b.frames[-1].positions)
    late = go_on("parts")
    assert late.returncode == 2 and late.stderr.startswith("python3 -m pliant: error: ") and "at t = 1.00025 already" in late.stderr

    for name, call, force in (("called", lambda sim: None, None), ("forced", None, lambda x, v, t: 0 * x)):
        with crowd(output=tmp_path / name) as sim:
            sim.force = force
            sim.run(until=0.1, callback=call)
        with Simulation.restart(tmp_path / name) as sim:
            sim.run(until=0.2)
        refused = go_on(name)
        assert refused.returncode == 2 and "callbacks or a force" in refused.stderr, refused.stderr
        assert go_on(name, "--without-functions").returncode == 0
        assert Run(tmp_path / name).summary["t"] == pytest.approx(1, abs=0.01)


def test_a_simulation_that_goes_on_has_no_older_summary(tmp_path):
    with crowd(model="sp", zeta=0.1, output=tmp_path / "run") as sim:
        sim.run(until=0.2)
    assert Run(tmp_path / "run").summary["status"] == "done"
    with Simulation.restart(tmp_path / "run") as sim:
        assert Run(tmp_path / "run").summary == {}
        sim.run(until=0.4)
    summary = Run(tmp_path / "run").summary
    assert summary["status"] == "done" and summary["t"] >= 0.4
