"""Simulations that advance together: the bits of their own runs, errors of one of them, interruptions, output."""

import threading
import warnings

import numpy as np
import pytest

import pliant
from pliant import Box, Run, Simulation, Walls, advance


def fluid(seed=1, n=30, **options):
    """Disks in a periodic box, which collide."""
    box = Box.filled(np.ones(n), 0.7)
    x = box.pack(np.ones(n), seed=seed)
    return Simulation(x, 1, box=box, velocities=np.random.default_rng(seed).normal(size=x.shape), **{"dt": 5e-3, **options})


def falling(model, **options):
    """Particles that fall onto a floor that oscillates."""
    dim = 3 if model == "surface" else 2
    walls = Walls(dim)
    up = np.eye(dim)[-1]
    walls.half_space(0 * up, up, amplitude=0.1 * up, frequency=9)
    grid = np.stack(np.meshgrid(*[np.arange(3.0)] * dim, indexing="ij"), axis=-1).reshape(-1, dim) * 1.5 + up
    if model == "surface":
        mesh = pliant.Mesh.icosphere()
        particles = {"surfaces": mesh.placed(grid), "mesh": mesh}
        options["model"] = "rough"
    else:
        polygons = model in ("rough", "smooth")
        particles = {"polygons": pliant.regular_polygons(grid, 1, 9)} if polygons else {"positions": grid, "diameters": 1}
        options["model"] = model
    return Simulation(**particles, walls=walls, gravity=-up, **options)


MANY = [lambda: fluid(1), lambda: fluid(2, 17, zeta=0.1), lambda: fluid(3, 40, threads=2), lambda: falling("sp", zeta=0.1),
        lambda: falling("disk", mu_disk=0.5), lambda: falling("rough"), lambda: falling("smooth"), lambda: falling("surface")]


def state_of(sim):
    state = [sim.positions, sim.velocities, sim.t, sim.steps, sim.work, sim.dissipated, *sim.counters.values()]
    return state + [sim.angles, sim.spins] if sim.options["model"] == "disk" else state


def assert_same(sim, other):
    for a, b in zip(state_of(sim), state_of(other), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.filterwarnings("ignore::pliant.PliantWarning")
@pytest.mark.parametrize("threads", [1, 2, 5])
def test_bits_of_their_own_runs(threads):
    alone, together = [make() for make in MANY], [make() for make in MANY]
    for sim in alone:
        sim.run(0.5)
        sim.positions[0] += 1e-3
        sim.run(0.5)
    advance(together, 0.5, threads=threads)
    for sim in together:
        sim.positions[0] += 1e-3
    advance((sim for sim in together), 0.5)
    for one, other in zip(alone, together):
        assert one.t > 0.9
        assert_same(one, other)


def test_until_can_be_repeated():
    sims = [fluid(k, dt=dt) for k, dt in enumerate((5e-3, 4e-3, 3e-3))]
    sims[1].run(0.3)
    advance(sims, until=0.4)
    assert [sim.t for sim in sims] == pytest.approx([0.4] * 3, abs=2e-3)
    steps = [sim.steps for sim in sims]
    advance(sims, until=0.4)
    assert [sim.steps for sim in sims] == steps
    sims = [fluid(1, dt=2**-6), fluid(1, dt=2**-6)]
    sims[0].run(until=2**-7)  # a tie, of which run() makes a step
    for _ in range(2):
        advance(sims[1:], until=2**-7)
        assert [sim.steps for sim in sims] == [1, 1]
    advance([], 1)


@pytest.mark.parametrize("call, error, words", [
    (lambda s: advance(s), "InputError", "either the time t"),
    (lambda s: advance(s, 1, until=2), "InputError", "either the time t"),
    (lambda s: advance(s, 0), "InputError", "simulation 0: run\\(0\\): the time must be positive"),
    (lambda s: advance(s, 1e-9), "InputError", "simulation 0: .*is longer"),
    (lambda s: advance(s, np.nan), "InputError", "must be positive"),
    (lambda s: advance(s, until=np.inf), "InputError", "must be positive"),
    (lambda s: advance(s, until=-1), "InputError", "simulation 0 is at t = 0 already"),
    (lambda s: advance(s, 1, threads=0), "InputError", "threads is 0"),
    (lambda s: advance(s, 1, threads=1.5), "InputError", "not an integer"),
    (lambda s: advance(s[0], 1), "InputError", "a list of simulations"),
    (lambda s: advance([*s, 3], 1), "InputError", "simulation 2 is 3, which is not a Simulation"),
    (lambda s: advance([*s, s[1]], 1), "InputError", "simulation 2 is in the list twice"),
    (lambda s: (s[1].close(), advance(s, 1)), "UsageError", "simulation 1 is closed"),
    (lambda s: advance(5, 1), "InputError", "5 is not a list"),
    (lambda s: (s[1].every(1)(print), advance(s, 1)), "InputError", "simulation 1 has a callback of every\\(\\)"),
    (lambda s: (setattr(s[1], "force", print), advance(s, 1)), "InputError", "simulation 1 has a force function"),
    (lambda s: advance([*s, fluid(integrator="rk")], 1), "InputError", "simulation 2: its integrator is one of PETSc.*verlet$"),
    (lambda s: advance([*s, Simulation([[0, 0]], 2, model="bubble")], 1), "InputError", "one of PETSc.*call its run\\(\\)$"),
    (lambda s: advance([*s, fluid(dt=1e-19)], 1), "InputError", "simulation 2: .*too many steps"),
    (lambda s: s[0].run(1, callback=lambda _: advance(s[1:], 1)), "UsageError", "a callback cannot start"),
    (lambda s: s[0].run(1, callback=lambda _: advance(s, 1)), "UsageError", "a callback cannot start"),
    (lambda s: (s[1].positions.fill(np.nan), advance(s, 1)), "InputError", "simulation 1: .*nan"),
], ids=lambda value: value if isinstance(value, str) else "")
def test_refused_before_anything_moves(call, error, words):
    sims = [fluid(1), fluid(2)]
    with pytest.raises(getattr(pliant, error), match=words):
        call(sims)
    assert sims[0].steps < 2
    sims[0].forget(print)
    sims[0].step()


def test_one_that_fails_stops_no_other(tmp_path):
    fails = Simulation([[0.0, 0], [3, 0]], 1, velocities=[[10, 0], [0, 0]], e_sp=1, dt=1e-2, output=tmp_path / "fails")
    sims = [fluid(1), fails, fluid(2), fluid(3)]
    own = fluid(3)
    own.run(1)
    with pytest.raises(pliant.NumericalError, match="^simulation 1: ") as caught:
        advance(sims, 1)
    assert list(caught.value.errors) == [1] and isinstance(caught.value.errors[1], pliant.NumericalError)
    assert str(caught.value) == f"simulation 1: {caught.value.errors[1]}" and "(e_sp)" in str(caught.value)
    assert_same(sims[3], own)
    fails.close()
    summary = (tmp_path / "fails" / "summary.json").read_text(encoding="utf-8")
    assert '"status": "failed"' in summary and str(caught.value.errors[1])[:40] in summary


def test_output_folders(tmp_path):
    def make(folder, k):
        return fluid(k, output=tmp_path / folder / str(k), frame_interval=0.1, sample_interval=0.03, checkpoint_interval=1e-3)

    for folder, runs in (("alone", lambda sims: [sim.run(1) for sim in sims]), ("together", lambda sims: advance(sims, 1))):
        sims = [make(folder, k) for k in range(6)]
        runs(sims)
        for sim in sims:
            sim.close()
    for k in range(6):
        with Run(tmp_path / "alone" / str(k)) as one, Run(tmp_path / "together" / str(k)) as other:
            assert len(one.frames) == len(other.frames) == 11
            assert one.series.equals(other.series)
            for a, b in zip(one.frames, other.frames):
                np.testing.assert_array_equal(a.positions, b.positions)
        again = Simulation.restart(tmp_path / "together" / str(k))
        assert again.t == pytest.approx(1)
        again.close()


def test_a_warning_of_several():
    sims = [fluid(k, e_sp=1000, dt=8e-3) for k in range(4)]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        advance(sims, 3)
    assert len(caught) == 1 and caught[0].filename == __file__
    assert "of 4 simulations, the first is" in str(caught[0].message)


def test_a_failure_comes_before_a_warning_that_is_an_error():
    fails = Simulation([[0.0, 0], [3, 0]], 1, velocities=[[10, 0], [0, 0]], e_sp=1, dt=1e-2)
    with warnings.catch_warnings():
        warnings.simplefilter("error", pliant.PliantWarning)
        with pytest.raises(pliant.NumericalError):
            advance([fluid(1, e_sp=1000, dt=8e-3), fails], 3)


def test_a_failure_at_the_end_is_there_in_the_next_call():
    sims = [fluid(1, dt=1e-3), Simulation([[0, 0], [1.5, 0]], 1, velocities=[[2, 0], [-2, 0]], dt=0.06, e_sp=100)]
    for _ in range(2):
        with pytest.raises(pliant.NumericalError, match="^simulation 1: energy") as caught:
            advance(sims, until=20.04)
        assert list(caught.value.errors) == [1]


INTERRUPTED = """
import signal, json, os, numpy as np, pliant
from pathlib import Path
def fluid(**options):
    box = pliant.Box.filled(np.ones(400), 0.7)
    x = box.pack(np.ones(400))
    return pliant.Simulation(x, 1, box=box, velocities=np.random.default_rng(1).normal(size=x.shape), dt=2e-3, zeta=0.01, **options)
def after(seconds, handler):
    signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, seconds)
"""


def test_signal_handlers_cannot_use_simulations(script):
    script(INTERRUPTED + """
for use in (lambda s: s.energies, lambda s: s.set(e_sp=300), lambda s: s.positions, lambda s: s.run(1), lambda s: s.stop(),
            lambda s: s.images, lambda s: s.wall_segments, lambda s: pliant.advance([fluid()], 1)):
    sims = [fluid(), fluid()]
    after(0.1, lambda *_: use(sims[1]))
    try:
        pliant.advance(sims, 200)
    except pliant.UsageError as error:
        assert "advance() computes" in str(error)
    else:
        raise SystemExit("was not refused")
    pliant.advance(sims, 0.1)
""")


def test_a_signal_handler_forks(script):
    script(INTERRUPTED + """
children, sims = [], [fluid() for _ in range(3)]
after(0.1, lambda *_: children.append(os.fork()))
try:
    pliant.advance(sims, 20)
except pliant.UsageError as error:
    assert children == [0] and "fork" in str(error)
    os._exit(7)
assert os.waitstatus_to_exitcode(os.waitpid(children[0], 0)[1]) == 7
""")


def test_an_interruption_names_the_simulations_that_it_has_stopped(script, tmp_path):
    script(INTERRUPTED + """
fast = [pliant.Simulation([[0, 0.5], [3, 0.5]], 1, output=name, dt=2e-3) for name in ("before", "ended")]
sims = [*fast, fluid(output="stopped"),
        pliant.Simulation([[0.0, 0], [3, 0]], 1, velocities=[[10, 0], [0, 0]], e_sp=1, dt=1e-2, output="failed")]
fast[0].run(40)
after(0.1, lambda *_: signal.raise_signal(signal.SIGINT))
try:
    pliant.advance(sims, until=40)
except KeyboardInterrupt as error:
    assert list(error.__cause__.errors) == [3]
else:
    raise SystemExit("was not interrupted")
for sim in sims:
    sim.close()
for name, status in {"before": "done", "ended": "done", "stopped": "stopped", "failed": "failed"}.items():
    assert json.loads((Path(name) / "summary.json").read_text())["status"] == status, name
""", cwd=tmp_path)


def test_ctrl_c_stops_all_of_them(script, tmp_path):
    script(f"""
import numpy as np, pliant, signal, threading, time, os
sims = [pliant.Simulation([[0, 0.5], [3, 0.5]], 1, zeta=1, output=f"{tmp_path}/{{k}}") for k in range(5)]
threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
begin = time.monotonic()
try:
    pliant.advance(sims, 1e9, threads=3)
except KeyboardInterrupt:
    assert time.monotonic() - begin < 20
else:
    raise SystemExit("was not interrupted")
assert sum(sim.steps > 0 for sim in sims) == 3
before = [sim.steps for sim in sims]
pliant.advance(sims, 1)
assert all(sim.steps > steps for sim, steps in zip(sims, before))
""")


def test_another_thread_is_refused():
    sims = [fluid(1, zeta=1)]
    refused = []

    def ask():
        while not refused:
            try:
                sims[0].energies
            except pliant.UsageError as error:
                refused.append(str(error))

    thread = threading.Thread(target=ask)
    thread.start()
    while thread.is_alive():
        advance(sims, 10)
    assert "another thread uses the engine" in refused[0]


def test_the_interpreter_ends_in_the_middle(script):
    script("""
import pliant, threading, time
sims = [pliant.Simulation([[0, 0.5], [3, 0.5]], 1, zeta=1) for k in range(3)]
threading.Thread(target=lambda: pliant.advance(sims, 1e9), daemon=True).start()
time.sleep(0.3)
""")
