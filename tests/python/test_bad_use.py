"""Unusual use: numbers that numpy would convert, copies, calls from the middle of a step, forks, threads, Ctrl-C.
Each ends with a clear exception, and the simulation continues."""

import copy
import gc
import pickle
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import pliant
from pliant import Box, Container, Mesh, Simulation, Walls


def pair(**options):
    """A particle in motion, and one at rest."""
    return Simulation([[0.0, 0], [3, 0]], 1, velocities=[[1, 0], [0, 0]], **{"dt": 0.01, "e_w": 10, **options})


def on_a_floor(**options):
    walls = Walls()
    walls.half_space((0, -9), (0, 1))
    return pair(walls=walls, **options)


MASKED = np.ma.array([[0.0, 0], [3, 0]], mask=[[0, 0], [1, 0]])


@pytest.mark.parametrize("values, words", [
    (MASKED, "masked numbers"), (np.zeros((2, 2), complex), "complex128"), (np.zeros((2, 2), "M8[s]"), "datetime64"),
    (np.array([["1", "2"], ["3", "4"]]), "<U1"), (np.zeros(2, [("x", "f8"), ("y", "f8")]), "shape"),
    ([[1e308, 0], [-1e308, 0]], "at most 1e[+]?150"), ([[0, 0], [1e151, 0]], "at most 1e[+]?150"),
])
def test_positions_that_are_no_real_numbers(values, words):
    with pytest.raises(pliant.InputError, match=f"positions.*{words}"):
        Simulation(values, 1)
    if np.shape(values) == (2, 2):
        sim = pair()
        with pytest.raises(pliant.InputError, match=f"positions.*{words}"):
            sim.positions = values
            sim.step()
        sim.positions = [[0, 0], [3, 0]]
        sim.step()


@pytest.mark.parametrize("call, words", [
    (lambda: Simulation([[0, 0], [3, 0]], np.array([1, 2j])), "diameters.*complex"),
    (lambda: Simulation([[0, 0], [3, 0]], np.ma.array([1, 2], mask=[0, 1])), "diameters has masked"),
    (lambda: Simulation([[0, 0]], 1, velocities=np.ma.array([[1, 2]], mask=[[0, 1]])), "velocities has masked"),
    (lambda: Simulation([[0, 0]], 1, mass=np.array([1j])), "mass.*complex"),
    (lambda: Simulation([[0, 0]], 1, gravity="12"), "gravity.*text"),
    (lambda: Simulation([[0, 0]], 1, box="12"), "lengths"),
    (lambda: pair().step(2**70), "n is 1180591620717411303424"),
    (lambda: pair().minimize(max_iterations=2**70), "max_iterations is"),
    (lambda: on_a_floor().move_wall(2**40), "body is 1099511627776"),
    (lambda: pliant.diameters(2**40), "n is 1099511627776"),
    (lambda: Container(3, 8).pack([1], dim=2**40), "dim is"),
    (lambda: Mesh(np.zeros((4, 3)), np.array([[2**32, 1, 2]] * 4)), "beyond 2\\^31"),
    (lambda: on_a_floor().move_wall(0, velocity=(np.nan, 0)), "velocity has a number that is not finite"),
    (lambda: on_a_floor().move_wall(0, spin=np.nan), "spin"),
    (lambda: on_a_floor().move_wall(0, amplitude=(np.inf, 0)), "amplitude"),
    (lambda: on_a_floor().move_wall(0, amplitude=(1, 0)), "without a frequency never moves"),
    (lambda: on_a_floor().move_wall(0, frequency=np.nan), "frequency and phase must be finite"),
    (lambda: on_a_floor().move_wall(0, phase=np.nan), "frequency and phase must be finite"),
    (lambda: on_a_floor().move_wall(0, pivot=(np.nan, 0), spin=1), "pivot"),
    (lambda: on_a_floor().move_wall(-1), "no wall -1"),
    (lambda: on_a_floor().move_wall(True), "body: True is not an integer"),
    (lambda: on_a_floor().run(1, callback=lambda s: s.move_wall(0, velocity=(np.nan, 0))), "velocity"),
    (lambda: Container(6, 20, obstacles=[("disk", (0, 8), 1), ("disk", (0.5, 8), 1)]), "overlap"),
    (lambda: Container(6, 20, obstacles=[("disk", (10, 8), 1)]), "overlaps the wall"),
    (lambda: Container.outline([[-2, 0], [6, 5]], [[2, 0], [-6, 5]]), "must not cross"),
    (lambda: pair(frame_interval=np.nan, output="never"), "frame_interval"),
    (lambda: pair(sample_interval="a", output="never"), "sample_interval"),
], ids=lambda value: value if isinstance(value, str) else "")
def test_arguments_with_messages(call, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(pliant.InputError, match=words):
        call()


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy, pickle.dumps])
@pytest.mark.parametrize("make, cure", [(pair, "restart(folder)"), (Walls, "by the same calls"), (lambda: Container(3, 8), "by the same calls")])
def test_handles_of_the_engine_are_not_copied(how, make, cure):
    with pytest.raises(TypeError, match=f"neither be copied nor pickled; .*{re.escape(cure)}"):
        how(make())


def test_data_are_copied_and_pickled():
    for how in (copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))):
        box, mesh, sim = how(Box((5, None), (1, 2))), how(Mesh.icosphere(12)), pair()
        assert (box.lengths, box.origin) == ((5, np.inf), (1, 2))
        assert np.array_equal(mesh.vertices, Mesh.icosphere(12).vertices) and len(mesh.faces) == 20
        assert np.array_equal(how(sim.particles()).positions, sim.positions) and how(sim.minimize()).converged


def test_objects_that_were_not_initialised():
    class Derived(Simulation):
        def __init__(self):
            pass
    for make in (Derived, lambda: Simulation.__new__(Simulation), lambda: Walls.__new__(Walls)):
        for use in (lambda one: one.run(1), lambda one: one.positions, lambda one: one.disk((0, 0), 1), lambda one: len(one)):
            with pytest.raises((pliant.UsageError, AttributeError), match="super|no attribute"):
                use(make())
    with pytest.raises(pliant.UsageError, match=r"this Derived was not initialised; call super\(\).__init__"):
        Derived().run(1)


@pytest.mark.parametrize("use", [
    lambda s: s.set(e_sp=2), lambda s: s.move_wall(0, velocity=(0, 1)), lambda s: s.remove(0), lambda s: s.add([[9, 9]], 1),
    lambda s: s.energies, lambda s: s.forces, lambda s: s.contacts, lambda s: s.wall_forces, lambda s: s.hessian(), lambda s: s.work,
    lambda s: s.run(1), lambda s: s.step(), lambda s: s.minimize(), lambda s: s.close(), lambda s: s.moduli(),
], ids=range(15))
def test_a_force_function_may_not_use_its_simulation(use):
    """The engine is in the middle of a step: changes would act on forces that are being added up."""
    sim, calls = on_a_floor(), []

    def force(x, v, t):
        calls.append(t)
        use(sim)
        return 0 * x
    sim.force = force
    with pytest.raises((pliant.UsageError, pliant.InputError), match="force function|callback|in the middle"):
        sim.run(0.1)
    assert len(calls) == 1 and len(sim) == 2 and sim.t == 0
    sim.force = None
    sim.run(0.1)
    assert sim.positions[0] == pytest.approx([0.1, 0])


def test_a_force_function_may_read_the_last_state_and_another_simulation():
    sim, other, seen = pair(), pair(), []

    def force(x, v, t):
        seen.append((sim.t, sim.positions.copy(), sum(other.energies.values())))
        x[:] = 7  # its own array
        return 0 * x
    sim.force = force
    sim.run(0.05)
    assert len(seen) > 4 and sim.positions[0] == pytest.approx([0.05, 0])


@pytest.mark.parametrize("returned", [lambda x: x * 1j, lambda x: np.full(x.shape, "1"), lambda x: x.astype("M8[s]"), lambda x: x + 1e400])
def test_forces_that_are_no_real_numbers(returned):
    sim = pair()
    sim.force = lambda x, v, t: returned(x)
    with pytest.raises(pliant.InputError, match="the force function returned"):
        sim.run(0.1)
    assert sim.steps == 0


@pytest.mark.parametrize("error", [SystemExit(3), KeyboardInterrupt(), GeneratorExit(), StopIteration(), RecursionError(), BaseException("b"),
                                   MemoryError(), StopAsyncIteration(), Warning("w"), UnicodeError("u")], ids=lambda error: type(error).__name__)
def test_every_exception_of_a_callback_arrives(error):
    sim = pair()

    def fail(s):
        raise error
    with pytest.raises(type(error)) as caught:
        sim.run(0.1, callback=fail)
    assert caught.value is error and sim.steps == 1
    sim.run(0.1)
    assert sim.steps == 11


@pytest.mark.parametrize("change", [
    lambda s: s.every(0.1)(print), lambda s: s.forget(print), lambda s: s._callbacks.clear(), lambda s: gc.collect(), lambda s: (s.stop(), s.stop()),
    lambda s: Simulation([[0, 0]], 1, e_w=1, dt=0.01), lambda s: Box((9, 9)).pack([1] * 4), lambda s: Simulation([[0, 0]], 1, e_w=1).close(),
    lambda s: pliant.evaluate({"model": "sp", "inputs": {"dim": 2, "positions": [[0, 0]], "sigma": [1]}}),
], ids=range(9))
def test_what_callbacks_may_do(change):
    sim = pair()
    sim.run(0.1, callback=change, every=0.05)
    sim.step(10)
    assert sim.positions[0, 0] == pytest.approx(sim.t)


def test_arrays_that_are_resized_by_force():
    """numpy's own check is switched off."""
    sim = pair()
    sim.positions.base.resize((1, 2), refcheck=False)
    for call in (lambda: sim.run(0.1), lambda: sim.energies):
        with pytest.raises(pliant.InputError, match="positions has 2 numbers, but 4 belong to it"):
            call()
    sim.positions.base.resize((2, 2), refcheck=False)
    sim.positions = [[0, 0], [3, 0]]
    sim.step()


def test_arrays_of_a_simulation_that_is_gone():
    sim = pair()
    held, row = sim.positions, sim.velocities[1]
    sim.remove(0)
    sim.close()
    del sim
    gc.collect()
    held[:], row[:] = 5, 1
    others = [np.ones(1000) for _ in range(100)]
    assert held.sum() == 20 and len(others) == 100


def test_another_thread_may_not_close_or_drop_a_run():
    sim, errors = pair(), []
    kept = [sim]

    def close():
        try:
            kept[0].close()
        except pliant.UsageError as error:
            errors.append(str(error))
        kept.clear()

    def start(s):
        if kept:
            thread = threading.Thread(target=close)
            thread.start()
            thread.join()
    sim.run(0.1, callback=start)
    assert sim.t == pytest.approx(0.1) and len(errors) == 1 and "close" in errors[0]


def test_a_fork_in_a_callback_ends_the_run_of_the_child(script, tmp_path):
    """The parent continues; the child would write to the same files."""
    script(f"""
import os, pliant
sim = pliant.Simulation([[0, 0], [3, 0]], 1, velocities=[[1, 0], [0, 0]], dt=0.01, e_w=10, output={str(tmp_path / 'run')!r}, sample_interval=0.02)
child = -1
def fork(s):
    global child
    if s.steps == 3:
        child = os.fork()
try:
    sim.run(0.1, callback=fork)
except pliant.UsageError as error:
    assert child == 0 and "fork" in str(error) and sim.steps == 3
    raise SystemExit(7)
assert child > 0 and os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
sim.close()
series = pliant.Run({str(tmp_path / 'run')!r}).series
assert len(series) == 6 and abs(series["time"].iloc[-1] - 0.1) < 1e-9, series
""")


def test_a_fork_in_a_force_function_ends_the_run_of_the_child(script):
    script("""
import os, pliant
sim = pliant.Simulation([[0, 0], [3, 0]], 1, velocities=[[1, 0], [0, 0]], dt=0.01, e_w=10)
child = -1
def force(x, v, t):
    global child
    if child < 0 and t > 0.03:
        child = os.fork()
    return 0 * x
sim.force = force
try:
    sim.run(0.1)
except pliant.UsageError as error:
    assert child == 0 and "fork" in str(error)
    raise SystemExit(7)
assert child > 0 and os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7 and abs(sim.t - 0.1) < 1e-9
""")


@pytest.mark.parametrize("work", ["sim.run(1e5)", "sim.run(1e5, callback=lambda s: None)", "[sim.step() for _ in range(10**9)]",
                                  "pliant.hopper(n=60, hopper_wall_distance=8, hopper_width=3, t_end=1e6, output=folder, quiet=True)"])
def test_the_interpreter_ends_while_a_thread_runs(work, script, tmp_path):
    """A daemon thread, which the interpreter does not wait for."""
    result = script(f"""
import threading, time, pliant
folder = {str(tmp_path / 'run')!r}
sim = pliant.Simulation([[0, 0], [3, 0]], 1, velocities=[[1, 0], [0, 0]], dt=0.01, e_w=10)
threading.Thread(target=lambda: {work}, daemon=True).start()
time.sleep(0.3)
""")
    assert "Aborted" not in result.stderr and "Segmentation" not in result.stderr


LATENCY = """
import os, signal, sys, threading, time
import numpy as np
import pliant
from pliant import Simulation
folder = sys.argv[1]
grid = np.stack(np.meshgrid(*[np.arange(60.0)] * 2), -1).reshape(-1, 2)
sim = Simulation(grid, 1, velocities=np.tile([0.1, 0], (3600, 1)), gravity=(0, -1e-6))
sent = []
def interrupt():
    time.sleep(1)
    sent.append(time.monotonic())
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt).start()
try:
    {code}
except KeyboardInterrupt:
    late = time.monotonic() - sent[0]
else:
    raise SystemExit("it was not interrupted")
assert late < 1, late
assert np.isfinite(sim.positions).all()
sim.force = None
steps = sim.steps
sim.step()
assert sim.steps == steps + 1
"""


@pytest.mark.parametrize("code", [
    "sim.run(1e6)", "sim.step(10**9)", "sim.run(1e6, callback=lambda s: None)", "sim.run(1e6, callback=lambda s: time.sleep(0.02))",
    "setattr(sim, 'force', lambda x, v, t: 0 * x); sim.run(1e6)",
    "Simulation(grid, 1, zeta=1.0, gravity=(0, -1), dynamics='overdamped', ts_adapt_type='none', dt=1e-4).run(1e6)",
    "Simulation(0.97 * grid, 1, velocities=np.random.default_rng(1).normal(size=grid.shape), integrator='cvode', box=(58.2, 58.2)).run(1e6)",
    "Simulation(0.9 * grid, 1, box=(54, 54)).minimize(1e-300, 10**9)",
    "pliant.hopper(n=3000, hopper_wall_distance=40, hopper_width=6, t_end=1e5, output=folder, quiet=True)",
    "pliant.pack(n=3000, output=folder, quiet=True)",
    "pliant.hopper(n=60, hopper_wall_distance=8, hopper_width=3, t_end=1e4, ensemble=3, output=folder, quiet=True)",
    "pliant.Box((162, 162)).pack(np.ones(30000))",
], ids=range(12))
def test_ctrl_c_stops_within_a_second(code, tmp_path):
    done = subprocess.run([sys.executable, "-B", "-W", "ignore", "-c", LATENCY.replace("{code}", code), tmp_path / "run"], capture_output=True,
                          encoding="utf-8", timeout=120)
    assert done.returncode == 0, done.stderr


def test_ctrl_c_in_a_callback_that_waits():
    sim = pair()
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(KeyboardInterrupt):
            sim.run(0.1, callback=lambda s: time.sleep(60))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert sim.steps == 1
    sim.step()


@pytest.mark.parametrize("add, motion", [
    (lambda walls, **m: walls.line([(0, 0), (2, 0)], **m), {}), (lambda walls, **m: walls.polygon([(1, 0), (4, 0), (4, -1)], **m), {}),
    (lambda walls, **m: walls.disk((0, 3), 1, **m), {}), (lambda walls, **m: walls.half_space((0, -5), (0, 1), **m), {}),
    (lambda walls, **m: walls.segment((3, 1), (1, 1), **m), {"velocity": (1, 0)})])
def test_walls_on_each_other(add, motion):
    """Particles would feel both. Walls with different motions, and walls that meet, are accepted."""
    walls = pliant.Walls()
    walls.line([(0, 0), (2, 0), (2, 2)])
    walls.disk((0, 3), 1)
    walls.half_space((0, -5), (0, 1))
    walls.segment((0, 1), (2, 1), velocity=(1, 0))
    add(walls, velocity=(0, 1))
    count = len(walls)
    with pytest.raises(pliant.InputError, match=r"body \d of the walls.*leave one out"):
        add(walls, **motion)
    assert len(walls) == count
    walls.segment((2, 2), (5, 3))
    walls.segment((0, 1), (2, 0))
    walls.disk((0, 3.5), 1)


def test_a_force_function_that_returns_a_masked_array():
    sim = Simulation([[0, 0], [3, 0]], 1)
    sim.force = lambda x, v, t: np.ma.array(0 * x, mask=x > 1)
    with pytest.raises(pliant.InputError, match="masked array"):
        sim.step()
