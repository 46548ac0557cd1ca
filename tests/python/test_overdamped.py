"""Simulations of particles without inertia: droplets, and others in strong drag."""

import numpy as np
import pytest

import pliant
import pliant.analysis
from pliant import Run, Simulation, Walls

DROPLETS = dict(model="bubble")  # in their units: radius 1, f0 = 10, b = 1


def lattice(rows, columns, spacing=2.02):
    """A hexagonal raft."""
    return spacing * np.array([((column + 0.5 * (row % 2)), row * np.sqrt(0.75)) for row in range(rows) for column in range(columns)])


def plates(low, high, **motion):
    """A fixed wall below and a wall above."""
    walls = Walls()
    walls.half_space((0, low), (0, 1))
    walls.half_space((0, high), (0, -1), **motion)
    return walls


def total(sim):
    return sum(sim.energies.values())


def test_a_pair_of_droplets_comes_to_rest_where_evaluate_finds_no_force():
    sim = Simulation([[0, 0], [2.01, 0.0]], 2, **DROPLETS)
    assert len(sim.contacts) == 1 and sim.contacts.fx[0] * sim.contacts.nx[0] < 0  # attraction
    sim.run(200)
    assert np.abs(sim.forces).max() < 1e-7 and np.abs(sim.velocities).max() < 1e-7
    x = sim.positions
    assert x.sum(axis=0) == pytest.approx([2.01, 0]) and x[1, 0] - x[0, 0] == pytest.approx(1.993, abs=1e-3)
    assert total(sim) == pytest.approx(-0.00173, rel=1e-2)
    expected = pliant.evaluate({"model": "bubble", "inputs": {"positions": x, "R": [1, 1]}})
    assert {k: e for k, e in sim.energies.items() if e} == pytest.approx({k: e for k, e in expected["energy"].items() if e})
    assert sim.contacts.overlap[0] > 0 and sim.counters["integrator"] == "ts:rk 3bs"


def test_velocities_balance_drag_and_friction_between_neighbours():
    """Forces on a single droplet and on a pair; the pair has friction between its droplets."""
    alone = Simulation([[0, 5]], 2, gravity=(0, -0.3), b=2, **DROPLETS)
    assert alone.masses == pytest.approx([1])  # density · radius³
    assert alone.velocities == pytest.approx(np.array([[0, -0.15]]))
    alone.run(2)
    assert alone.positions == pytest.approx(np.array([[0, 4.7]]))
    sim = Simulation([[0, 0], [2.05, 0], [9, 0]], 2, b=1.5, **DROPLETS)
    force = sim.forces[:2]
    assert np.abs(force).max() > 1e-5
    np.testing.assert_allclose(sim.velocities[:2], np.linalg.solve(1.5 * np.array([[2, -1], [-1, 2]]), force), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_strong_drag_is_the_limit_of_motion_with_inertia(dim):
    rng = np.random.default_rng(4)
    grid = np.stack(np.meshgrid(*[np.arange(3.0)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    x = 0.9 * grid + 0.1 * rng.random(grid.shape)
    options = dict(gravity=[20] * dim, e_sp=10, zeta=5, mass=0.01)
    limit, inertial = Simulation(x, 1, **options, dynamics="overdamped"), Simulation(x, 1, **options)
    limit.run(2), inertial.run(2)
    assert limit.positions == pytest.approx(inertial.positions, abs=1e-3) and np.abs(limit.positions - x).max() > 0.05
    assert limit.velocities == pytest.approx(limit.forces / 5) and inertial.velocities == pytest.approx(limit.velocities, abs=1e-2)


@pytest.mark.parametrize("model", ["rough", "smooth"])
def test_polygons_in_strong_drag(model):
    sim = Simulation(polygons=pliant.regular_polygons([[0, 0], [0.99, 0]], 1, 10, np.pi / 10), model=model, zeta=50, dynamics="overdamped",
                     e_c=100, k_a=100)
    before = total(sim)
    sim.run(0.2)
    assert total(sim) < before and sim.dissipated == pytest.approx(before - total(sim), rel=1e-2)
    assert "kinetic" not in sim.energies


def test_the_energy_budget_with_a_wall_that_moves():
    walls = plates(-1.0, 5.0, velocity=(0, -0.08))
    sim = Simulation(lattice(3, 4), 2, walls=walls, **DROPLETS)
    start = total(sim)
    sim.run(10)
    assert sim.work > 0.01 and sim.dissipated > 0
    assert total(sim) - start == pytest.approx(sim.work - sim.dissipated, abs=1e-4)
    sim.move_wall(1)
    work = sim.work
    sim.run(5)
    assert sim.work == work


def test_a_raft_is_that_of_the_scenario(tmp_path):
    """The motion of a compressed raft, from its first frame and the walls of the scenario."""
    run = pliant.raft(rows=3, columns=4, v_wall=0.01, t_end=30, frame_interval=10, output=tmp_path / "raft", quiet=True)
    first, last = run.frames[0], run.frames[3]
    walls = Walls()
    (fixed, moving), (_, moved) = (frame.wall_segments.reshape(-1, 2, 2) for frame in (first, last))
    speed = (moved - moving)[0] / last.time
    middle = first.positions.mean(axis=0)
    for line, velocity in ((fixed, (0, 0)), (moving, speed)):
        normal = np.array([line[0, 1] - line[1, 1], line[1, 0] - line[0, 0]])
        walls.half_space(line[0], normal * np.sign((middle - line[0]) @ normal), velocity=velocity)
    sim = Simulation(first.positions, run.topology.sigma, model="bubble", walls=walls)
    sim.run(last.time)
    assert np.abs(last.positions - first.positions).max() > 0.01
    assert sim.positions == pytest.approx(last.positions, abs=1e-5)
    assert total(sim) == pytest.approx(run.series["energy"].iloc[-1], rel=1e-3)


def test_droplets_in_a_periodic_box():
    sim = Simulation(lattice(4, 5, 1.99), 2, box=(5 * 1.99, 4 * 1.99 * np.sqrt(0.75)), **DROPLETS)
    assert len(sim.contacts) == 3 * 20
    stress = pliant.analysis.mean_stress(sim, kinetic=False)
    assert np.abs(stress - stress.T).max() < 1e-12
    minimum = sim.minimize(1e-9)
    assert minimum.converged and np.abs(sim.forces).max() <= 1e-9
    hessian = sim.hessian()
    assert hessian.shape == (40, 40) and abs(hessian - hessian.T).max() < 1e-10


def test_velocities_are_derived_and_cannot_be_written():
    sim = Simulation([[0, 0], [3, 0]], 2, gravity=(0, -1), **DROPLETS)
    view = sim.velocities
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 1
    with pytest.raises(pliant.InputError, match="follow from the forces"):
        sim.velocities = 0
    with pytest.raises(ValueError, match="read-only"):
        sim.velocities += 1
    assert view == pytest.approx(np.array([[0, -1], [0, -1]]))
    sim.positions[1] = [1.9, 0]
    assert sim.velocities[1, 0] > 0.01 and view[1, 0] > 0.01
    sim.positions[1, 0] = np.nan
    with pytest.raises(pliant.InputError, match=r"positions\[1\]"):
        sim.velocities
    sim.positions[1, 0] = 8
    sim.run(0.1)
    assert view[1] == pytest.approx([0, -1])
    del sim
    assert view[1] == pytest.approx([0, -1])


def test_protocols_of_droplets():
    """Callbacks, a force function, changed parameters, more and fewer droplets."""
    sim = Simulation([[0, 0], [4, 0]], 2, **DROPLETS)
    sim.force = lambda x, v, t: -0.1 * x
    seen = []
    sim.run(1, callback=lambda s: seen.append(s.velocities.copy()), every=0.25)
    assert len(seen) == 4 and seen[0] == pytest.approx(-0.1 * np.array([[0, 0], [4, 0]]) * np.exp(-0.1 * 0.25), rel=0.05, abs=1e-9)
    assert sim.positions[1, 0] == pytest.approx(4 * np.exp(-0.1), rel=1e-4)
    assert sim.velocities[1, 0] == pytest.approx(-0.1 * sim.positions[1, 0], rel=1e-4)
    sim.force = None
    with pytest.raises(pliant.InputError, match="follow from the forces"):
        sim.add([[10, 0]], 2, velocities=[[1, 0]])
    sim.add([[10, 0]], 2)
    before = sim.dissipated
    assert before > 0
    sim.set(b=3)
    assert sim.dissipated == before and len(sim) == 3
    sim.remove(0)
    sim.run(1)
    assert len(sim) == 2 and sim.t == pytest.approx(2)


@pytest.mark.parametrize("case", [dict(**DROPLETS), dict(**DROPLETS, mobility="lagged"), dict(dynamics="overdamped", zeta=5),
                                  dict(**DROPLETS, ts_rk_type="4", ts_dt=0.02)], ids=str)
def test_a_restart(case, tmp_path):
    """A run in two parts, each from a new call of run(), is the same with a restart between them."""
    def make(folder):
        walls = plates(-1.0, 4.7, velocity=(0, -0.05))
        size = 2 if case.get("model") else 2.1
        return Simulation(lattice(3, 3), size, walls=walls, gravity=(0.01, 0), **case, output=folder, frame_interval=1,
                          sample_interval=0.5)
    with make(tmp_path / "whole") as whole:
        whole.run(until=3), whole.run(until=6)
        result = whole.positions.copy(), whole.velocities.copy(), whole.work, whole.dissipated
    with make(tmp_path / "parts") as sim:
        sim.run(until=3)
    with Simulation.restart(tmp_path / "parts") as sim:
        sim.run(until=6)
        for a, b in zip(result, (sim.positions, sim.velocities, sim.work, sim.dissipated)):
            np.testing.assert_array_equal(a, b)
    a, b = Run(tmp_path / "whole"), Run(tmp_path / "parts")
    assert a.series.equals(b.series) and {"work", "dissipated"} <= set(a.series) and "kinetic_energy" not in a.series
    np.testing.assert_array_equal(a.frames[-1].velocities, result[1])
    assert len(a.frames) == len(b.frames) == 7


@pytest.mark.parametrize("changes, words", [
    ({"velocities": [[0, 0], [1, 0]]}, "follow from the forces"),
    ({"dynamics": "inertial"}, "droplets have no inertia"),
    ({"integrator": "verlet"}, "needs inertia"),
    ({"b": 0}, "b 0"), ({"b": np.nan}, "b nan"), ({"phi_c": -1}, "phi_c -1"), ({"zeta": 1}, "zeta"), ({"mobility": "fast"}, "mobility fast"),
    ({"mobility_ksp_typ": "cg"}, "mobility_ksp_typ"), ({"diameters": 0}, "diameter"), ({"diameters": [1, np.nan]}, "diameter"),
    ({"positions": np.zeros((0, 2))}, "no particles"), ({"box": (-1, 1)}, "box"), ({"box": (4,)}, "box"),
    ({"positions": [[0, 0], [0, 0]]}, "same place"),
])
def test_bad_droplets(changes, words):
    with pytest.raises(pliant.InputError, match=words):
        Simulation(**{**dict(positions=[[0, 0], [3, 0]], diameters=2, **DROPLETS), **changes})


@pytest.mark.parametrize("options, words", [
    (dict(dynamics="overdamped"), "positive"), (dict(dynamics="overdamped", zeta=1, mu=0.5), "mu 0.5"),
    (dict(dynamics="overdamped", model="disk"), "needs inertia"), (dict(dynamics="fast"), "dynamics fast"),
    (dict(dynamics="overdamped", zeta=1, integrator="verlet"), "needs inertia"), (dict(b=1), "b with the model sp"),
    (dict(wall_friction=True), "wall_friction with the model sp"), (dict(mobility="mean"), "mobility with the model sp"),
])
def test_bad_motion_without_inertia(options, words):
    with pytest.raises(pliant.InputError, match=words):
        Simulation([[0, 0], [3, 0]], 1, **options)


def test_another_solver_of_the_force_balance():
    """PETSc reads the options of each simulation."""
    iterative = dict(mobility_ksp_type="cg", mobility_pc_type="icc")
    sims = [Simulation(lattice(3, 3), 2, gravity=(0.1, 0), **DROPLETS, **options) for options in ({}, iterative, {})]
    for _ in range(2):
        for sim in sims:
            sim.run(1)
    assert np.array_equal(sims[0].positions, sims[2].positions)
    assert sims[1].positions == pytest.approx(sims[0].positions, abs=1e-9)


@pytest.mark.parametrize("integrator", ["beuler", "alpha2", "arkimex"])
def test_an_implicit_method_is_refused(integrator):
    with pytest.raises(pliant.InputError, match="needs derivatives"):
        Simulation([[0, 0], [3, 0]], 2, integrator=integrator, **DROPLETS)
