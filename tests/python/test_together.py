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
    (lambda s: (s[1].every(1)(print), advance(s, 1)), "InputError", "simulation 1 calls functions of Python"),
    (lambda s: (setattr(s[1], "force", print), advance(s, 1)), "InputError", "simulation 1 calls functions of Python"),
    (lambda s: advance([*s, fluid(integrator="rk")], 1), "InputError", "simulation 2: its integrator is one of PETSc"),
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
