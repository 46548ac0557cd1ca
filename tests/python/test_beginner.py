"""Mistakes of beginners: no request is ignored in silence."""

import signal
import subprocess
import sys
import time
import warnings

import numpy as np
import pliant
import pytest
from conftest import apps
from pliant import Run, Simulation

ONE = {"positions": [[0.0, 0.0]], "diameters": 1.0, "model": "sp"}


# --- Attributes and copies

@pytest.mark.parametrize("name", ["mu_disk", "zeta", "e_sp", "time", "velocity"])
def test_attributes_that_do_not_exist_name_set(name):
    sim = Simulation(**ONE)
    with pytest.raises(AttributeError, match=rf"{name} is no attribute .*sim.set\({name}=…\)"):
        setattr(sim, name, 1)
    assert not hasattr(sim, name)


def test_attributes_that_need_another_simulation():
    with pytest.raises(AttributeError, match="for another gravity make another Simulation"):
        Simulation(**ONE).gravity = (0, -2)


def test_methods_and_read_only_attributes_cannot_be_set():
    sim = Simulation(**ONE)
    for name in ("run", "set", "every"):
        with pytest.raises(AttributeError, match="a method"):
            setattr(sim, name, 3)
    for name in ("t", "dt", "box", "diameters", "masses", "ids", "options", "forces", "centres"):
        with pytest.raises(AttributeError):
            setattr(sim, name, getattr(sim, name))
    sim.force = lambda x, v, t: 0 * x
    sim.positions = [[1, 2]]
    sim.force = None


def test_walls_boxes_and_containers_have_no_other_attributes():
    box, walls, container = pliant.Box((4, 4)), pliant.Walls(), pliant.Container(3, 8)
    for of, name in ((box, "lengths"), (box, "origin"), (box, "size"), (walls, "velocity"), (walls, "dim"), (container, "angle"),
                     (container, "obstacles"), (container, "pack")):
        with pytest.raises(AttributeError):
            setattr(of, name, (1, 1))
    with pytest.raises(TypeError):
        box.lengths[0] = 5
    assert box.lengths == (4, 4) and box.origin == (0, 0)


@pytest.mark.parametrize("name", ["diameters", "masses", "ids", "offsets", "centres", "centre_velocities", "images", "forces",
                                  "wall_forces", "wall_segments", "wall_radius"])
def test_copies_are_read_only(name):
    sim = Simulation(**ONE, walls=pliant.Container(3, 8))
    with pytest.raises(ValueError, match="read-only"):
        getattr(sim, name)[...] = 3


def test_options_are_read_only():
    sim = Simulation(**ONE, zeta=1)
    with pytest.raises(TypeError):
        sim.options["zeta"] = 5
    sim.set(zeta=2)
    assert sim.options["zeta"] == 2


# --- Parameters of terms without elements

@pytest.mark.parametrize("make", [
    lambda **o: Simulation([[0, 0], [3, 0]], 1, model="sp", e_sp=1, **o),
    lambda **o: Simulation([[0, 0], [3, 0]], 1, model="sp", dynamics="overdamped", integrator="euler", zeta=1, e_sp=1, **o),
    lambda **o: Simulation([[0, 0], [3, 0]], 1, model="disk", e_disk=1, **o),
    lambda **o: Simulation([[0, 0, 0], [3, 0, 0]], 1, model="sp", e_sp=1, **o),
    lambda **o: Simulation(polygons=pliant.regular_polygons([(0, 0), (3, 0)], 1, 8), model="smooth", e_c=1, k_a=1, k_l=1, **o)],
    ids=["sp", "overdamped", "disk", "spheres", "smooth"])
def test_walls_limit_steps_only_where_there_are_walls(make):
    soft, stiff = make(e_w=1e-2), make(e_w=1e8)
    assert stiff.counters["dt_critical"] == soft.counters["dt_critical"] and stiff.dt == soft.dt
    stiff.set(e_w=1e9)
    assert stiff.dt == soft.dt
    walls = pliant.Walls(soft.dim)
    walls.half_space((0,) * (soft.dim - 1) + (-5,), (0,) * (soft.dim - 1) + (1,))
    assert make(e_w=1e8, walls=walls).counters["dt_critical"] < 0.01 * soft.counters["dt_critical"]


def test_droplets_without_walls():
    x = [[0, 0], [2.05, 0]]
    walls = pliant.Walls()
    walls.half_space((0, -5), (0, 1))
    options = dict(model="bubble", integrator="euler", R_mean=20)
    free, walled = Simulation(x, 2, **options), Simulation(x, 2, walls=walls, **options)
    assert free.counters["dt_critical"] > 5 * walled.counters["dt_critical"]


def test_minimize_without_walls_converges_whatever_e_w():
    d = pliant.diameters(40)
    box = pliant.Box.filled(d, 0.75)
    x = box.pack(d)
    found = [Simulation(x, d, box=box, model="sp", e_sp=1, e_w=e_w).minimize(1e-6, pressure=1e-3) for e_w in (1e-3, 1e4)]
    assert found[0].iterations == found[1].iterations < 20000


# --- Force functions

def test_minimize_refuses_a_force_function():
    sim = Simulation([[1, 0], [3, 0]], 1, model="sp")
    sim.force = lambda x, v, t: -x
    with pytest.raises(pliant.InputError, match=r"force function, .*set force = None"):
        sim.minimize()
    sim.force = None
    assert sim.minimize().converged


# --- Obstacles

@pytest.mark.parametrize("obstacles, words", [
    ([("disk", (0, 5), 9)], "overlaps the wall at"), ([("disk", (0, -5), 1)], "not inside the container"),
    ([("disk", (9, 5), 1)], "not inside"), ([("disk", (0, 5), 1), ("disk", (0.5, 5), 1)], "overlap; move one"),
    ([("polygon", [(-9, 4), (9, 4), (0, 6)])], "not inside"), ([("polygon", [(0, 4), (1, 5), (1, 4), (0, 5)])], "the corners of an obstacle: its sides cross")])
def test_obstacles_as_in_the_program(obstacles, words):
    with pytest.raises(pliant.InputError, match=words):
        pliant.Container(3, 10, obstacles=obstacles)
    with pytest.raises(pliant.InputError, match=words):
        pliant.Container.outline([(-1.5, 0), (-5, 3), (-5, 9)], [(1.5, 0), (5, 3), (5, 9)], obstacles=obstacles)


def test_obstacles_that_fit():
    for dim in (2, 3):
        walls = pliant.Walls(dim)
        walls.container(pliant.Container(3, 10, obstacles=[("disk", (0, 5), 1), ("disk", (4, 5), 1), ("polygon", [(1.5, 3), (3, 3), (2, 4)])]))
        assert len(walls) == 1


# --- Output

def test_the_summary_names_the_exception_that_ended_the_block(tmp_path):
    def fail(sim):
        return 1 / 0

    for name, call in {"callback": lambda sim: sim.run(1, callback=fail), "between": fail}.items():
        with pytest.raises(ZeroDivisionError), Simulation(**ONE, output=tmp_path / name) as sim:
            call(sim)
        summary = Run(tmp_path / name).summary
        assert summary["status"] == "stopped" and summary["message"] == "ZeroDivisionError: division by zero"
        with Simulation.restart(tmp_path / name) as sim:
            sim.run(0.1)
        assert Run(tmp_path / name).summary["status"] == "done"
    sim = Simulation(**ONE, output=tmp_path / "caught")
    with pytest.raises(ZeroDivisionError):
        sim.run(1, callback=fail)
    sim.close()
    assert Run(tmp_path / "caught").summary["status"] == "stopped"
    with Simulation(**ONE, output=tmp_path / "goes_on") as sim:
        with pytest.raises(ZeroDivisionError):
            sim.run(1, callback=fail)
        sim.run(0.1)
    assert Run(tmp_path / "goes_on").summary["status"] == "done" and "message" not in Run(tmp_path / "goes_on").summary
    with pytest.raises(SystemExit), Simulation(**ONE, output=tmp_path / "exit"):
        sys.exit(0)
    assert Run(tmp_path / "exit").summary["status"] == "done"


def test_no_frame_and_no_sample_twice(tmp_path):
    with Simulation(**ONE, output=tmp_path / "run", frame_interval=0.5, sample_interval=0.5, dt=0.25, e_sp=0.1) as sim:
        sim.write_frame(), sim.write_sample()
        sim.run(1)
        for _ in range(3):
            sim.write_frame(), sim.write_sample()
        sim.positions[:] = 7
        sim.velocities[:] = 1
        sim.write_frame(), sim.write_sample()
    run = Run(tmp_path / "run")
    assert list(run.frames.times) == [0, 0.5, 1, 1] and list(run.series.time) == [0, 0.5, 1, 1]
    assert run.frames[-1].positions[0, 0] == 7 and run.frames[-2].positions[0, 0] == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_end_the_command_line_with_a_checkpoint(number, tmp_path):
    options = dict(model="sp", dt=1e-3)
    with Simulation([[0, 0], [0, 3]], 1, output=tmp_path / "run", **options) as sim:
        sim.run(0.01)
    first = Run(tmp_path / "run").summary["steps"]
    child = subprocess.Popen([sys.executable, "-B", "-m", "pliant", str(tmp_path / "run"), "--until", "1e6"], encoding="utf-8",
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    def listens():
        with open(f"/proc/{child.pid}/status", encoding="utf-8") as status:
            caught = next(line for line in status if line.startswith("SigCgt")).split()[1]
        return int(caught, 16) >> (signal.SIGTERM - 1) & 1

    apps.wait_for(listens, child)
    time.sleep(0.3)
    child.send_signal(number)
    out, errors = child.communicate(timeout=apps.HANGS)
    assert child.returncode == 75 and out.startswith("stopped at t = ") and "with a checkpoint; run the same command again" in out, errors
    summary = Run(tmp_path / "run").summary
    assert summary["status"] == "stopped" and signal.Signals(number).name in summary["message"] and summary["steps"] >= first
    with Simulation.restart(tmp_path / "run") as sim:
        assert sim.steps == summary["steps"]


# --- Messages

P = pliant.regular_polygons([(0, 0), (2, 0)], [1.0, 1.0], 12)
BOW = [(0, 1), (1, 2), (1, 1), (0, 2.0)]


@pytest.mark.parametrize("call, words", [
    (lambda: Simulation(polygons=[P[0][::-1]], model="rough"), "particle 0: its signed area is -0.785.*counter-clockwise"),
    (lambda: Simulation(polygons=[BOW], model="rough"), "particle 0: its outline meets itself"),
    (lambda: Simulation(polygons=P, a0=-1, model="rough"), r"a0\[0\] is -1"),
    (lambda: Simulation(polygons=P, l0=0, model="rough"), r"l0\[0\] is 0"),
    (lambda: Simulation(polygons=P, diameters=0, model="rough"), r"diameter\[0\] is 0"),
    (lambda: Simulation(**ONE, density=np.nan), "density is nan"), (lambda: Simulation(**ONE, density=-1), "density is -1"),
    (lambda: Simulation(**ONE, mass=-1), r"mass\[0\] is -1"),
    (lambda: Simulation(polygons=[P[0], P[0] + [0.5, 0]], model="rough"), "vertex .* of particle .* is inside particle .*; move one of them"),
    (lambda: Simulation([[0, 1], [3, 3], [6, 6]], [1, 2], model="sp"), r"diameters has the shape \(2,\); give a number, or one for each of the 3"),
    (lambda: Simulation(**ONE).set(foo=1), r"unknown option foo; help\(pliant.Simulation\) lists them"),
    (lambda: Simulation(**ONE).set(e_sq=1), r"unknown option e_sq; did you mean e_s"),
    (lambda: Simulation(**ONE, dt=1.0), "^dt 1 is .* override with allow_unstable_dt"),
    (lambda: Simulation(**ONE, zeta=True), "^zeta: needs a value"),
    (lambda: pliant.Walls().polygon(BOW), "the corners of a polygon: its sides cross"),
])
def test_messages_name_what_was_given(call, words):
    with pytest.raises(pliant.InputError, match=words):
        call()


def test_errors_of_runs_name_keywords():
    with pytest.raises(pliant.NumericalError, match=r"\(dt\)") as error:
        Simulation([[0, 5], [9, 9]], 1, model="sp", velocities=[[0, -9000.0], [0, 0]]).run(1)
    assert " -" not in str(error.value) and "(-" not in str(error.value)


# --- Statistics

@pytest.mark.parametrize("rate, words", [
    (lambda t: t, "changes|not steady|mean of the flow rate"), (lambda t: np.where(t < 20, 20, 2), "steady from t = "),
    (lambda t: np.where(t < 60, 2, 0), "flow rate")], ids=["accelerating", "start-up", "ends"])
def test_flow_rate_warns_without_a_steady_state(rate, words):
    t = np.arange(0, 100, 0.1)
    crossed = np.cumsum(np.random.default_rng(0).poisson(rate(t) * 0.1))
    with pytest.warns(pliant.PliantWarning, match=words):
        pliant.flow_rate(t, crossed)


def test_flow_rate_of_a_steady_state_and_of_few_samples():
    t = np.arange(0, 100, 0.1)
    for seed in range(20):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            pliant.flow_rate(t, np.cumsum(np.random.default_rng(seed).poisson(0.5, len(t))))
    with pytest.warns(pliant.PliantWarning, match="20 samples are too few"):
        pliant.flow_rate(t[:20], t[:20])
