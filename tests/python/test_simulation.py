"""Simulations that Python builds: known motions, the numbers of `evaluate`, arrays, protocols."""

import gc
import resource
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import pliant
import pliant.analysis
from pliant import Simulation, Walls

rng = np.random.default_rng(5)


def cloud(n=60, dim=2, spacing=1.0, seed=3):
    """Disks or spheres that touch here and there."""
    side = int(np.ceil(n ** (1 / dim)))
    grid = np.stack(np.meshgrid(*[np.arange(side)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)[:n]
    return spacing * (grid + 0.2 * np.random.default_rng(seed).random((n, dim)))


def floor(dim=2, height=0.0):
    walls = Walls(dim)
    walls.half_space([0] * (dim - 1) + [height], [0] * (dim - 1) + [1])
    return walls


# --- Known motions and numbers


@pytest.mark.parametrize("dim", [2, 3])
def test_free_fall(dim):
    x, v, g = cloud(8, dim, 3), rng.random((8, dim)), np.arange(dim) - 1.5
    sim = Simulation(x, diameters=1, velocities=v, gravity=g, dt=0.01, e_w=10)
    sim.run(0.5)
    assert sim.t == pytest.approx(0.5) and sim.steps == 50
    assert sim.positions == pytest.approx(x + 0.5 * v + g * 0.5**2 / 2)
    assert sim.velocities == pytest.approx(v + 0.5 * g)


@pytest.mark.parametrize("model, dim", [("sp", 2), ("sp", 3)])
def test_energies_and_forces_are_those_of_evaluate(model, dim):
    x, sigma, v = cloud(20, dim, 0.9), 0.8 + 0.4 * rng.random(20), rng.random((20, dim))
    sim = Simulation(x, sigma, velocities=v, e_sp=70, mu=0.3, zeta=0.2, model=model)
    expected = pliant.evaluate({"model": model, "inputs": {"dim": dim, "positions": x, "sigma": sigma, "velocities": v,
                                                           "e_sp": 70, "mu": 0.3, "zeta": 0.2}})
    energies = sim.energies
    assert energies.pop("kinetic") == pytest.approx(0.5 * np.sum(sim.masses[:, None] * v**2))
    assert {k: e for k, e in energies.items() if e} == pytest.approx({k: e for k, e in expected["energy"].items() if e})
    assert sim.forces == pytest.approx(np.array(expected["force"]["total"]))
    for term, force in sim.term_forces.items():
        assert force == pytest.approx(np.array(expected["force"][term])), term


@pytest.mark.parametrize("model", ["rough", "smooth"])
def test_polygons_are_those_of_evaluate(model):
    outlines = pliant.regular_polygons([[0, 0], [1.07, 0.1]], 1, 10, [0.1, 0.3])
    stretched = [outline * [1.02, 0.98] for outline in outlines]
    a0, l0 = [np.pi / 4] * 2, [np.linalg.norm(outlines[0][0] - outlines[0][1])] * 2
    sim = Simulation(polygons=stretched, a0=a0, l0=l0, model=model)
    expected = pliant.evaluate({"model": model, "inputs": {"vertices": stretched, "a0": a0, "l0": l0}})
    assert sim.forces == pytest.approx(np.concatenate([np.array(f) for f in expected["force"]["total"]]))
    total = {name: np.sum(e) for name, e in expected["energy"].items()}
    assert {k: e for k, e in sim.energies.items() if k != "kinetic"} == pytest.approx(total)
    assert sim.polygons[1] == pytest.approx(stretched[1]) and np.shares_memory(sim.polygons[1], sim.positions)
    assert sim.centres == pytest.approx(np.array([p.mean(axis=0) for p in stretched]))
    before = sim.energies["kinetic"]
    sim.step(20)
    assert sim.energies["kinetic"] > before == 0


def test_a_disk_at_rest_presses_with_its_weight():
    walls = Walls(2)
    walls.segment((-5, 0), (5, 0))
    sim = Simulation([[0.0, 0.5]], diameters=1, walls=walls, gravity=(0, -1), zeta=2, e_w=1000)
    sim.run(20)
    assert sim.wall_forces == pytest.approx(np.array([[0, -np.pi / 4]]), rel=1e-6)
    contact = sim.contacts.iloc[0]
    assert (contact.particle_1, contact.particle_2, contact.wall) == (0, -1, 0)
    assert contact.fy == pytest.approx(np.pi / 4) and contact.ny == pytest.approx(1)


def test_contacts_of_two_disks():
    sim = Simulation([[0, 0], [0.9, 0]], diameters=1, e_sp=100)
    (contact,) = sim.contacts.itertuples()
    assert (contact.particle_1, contact.particle_2, contact.wall) == (0, 1, -1)
    assert contact.overlap == pytest.approx(0.1) and contact.force == pytest.approx(100 * 0.1)
    assert [contact.nx, contact.fx] == pytest.approx([-1, -10])


@pytest.mark.parametrize("friction", ["whole", "tangential"])
def test_stress_of_two_rubbing_disks(friction):
    """The upper disk moves along the lower one, and towards it."""
    v = np.array([0.5, -0.2])
    sim = Simulation([[2, 2], [2, 2.9]], 1, velocities=[[0, 0], v], box=(4, 5), e_sp=100, mu=0.7, friction=friction)
    (contact,) = sim.contacts.itertuples()
    elastic, rubbing = np.array([0, 100 * 0.1]), -0.7 * v * (1, friction == "whole")
    assert [contact.fx, contact.fy] == pytest.approx(-(elastic + rubbing)) and contact.particle_1 == 0
    assert [contact.friction_x, contact.friction_y] == pytest.approx(-rubbing)
    stress = pliant.analysis.mean_stress(sim, kinetic=False)
    assert stress == pytest.approx(np.outer(elastic + rubbing, [0, 0.9]) / 20)
    # Each particle has half of the contact.
    of_each = pliant.analysis.particle_stress(sim, 1.0)
    assert of_each == pytest.approx(np.tile(np.outer(elastic + rubbing, [0, 0.45]), (2, 1, 1)))


@pytest.mark.parametrize("dim", [2, 3])
def test_contacts_have_the_friction_of_frictional_particles(dim, tmp_path):
    """In a box with a floor: contacts and weight add up to the forces, frames have the same contacts, and reading them changes
    no bit of the motion."""
    x = cloud(4**dim, dim, 0.9)
    v = np.random.default_rng(2).normal(size=x.shape)

    def simulation(**options):
        return Simulation(x, 1, velocities=v, walls=floor(dim), gravity=[0] * (dim - 1) + [-1], model="disk", e_disk=1000, e_w=1000,
                          mu_disk=0.5, mu_wall=0.5, **options)
    plain = simulation()
    plain.run(0.1)
    with simulation(output=tmp_path / "run", frame_interval=0.02) as sim:
        sim.run(0.1, callback=lambda sim: sim.contacts, every=0.01)
        assert np.array_equal(sim.positions, plain.positions) and np.array_equal(sim.spins, plain.spins)
        contacts = sim.contacts
        axes = "xyz"[:dim]
        force, friction = contacts[["f" + a for a in axes]].to_numpy(), contacts[["friction_" + a for a in axes]].to_numpy()
        total = sim.masses[:, None] * np.array([0] * (dim - 1) + [-1])
        np.add.at(total, contacts.particle_1, force)
        pair = contacts.wall.to_numpy() < 0
        np.add.at(total, contacts.particle_2[pair], -force[pair])
        assert total == pytest.approx(sim.forces, abs=1e-12 * np.abs(force).max())
        normal = contacts[["n" + a for a in axes]].to_numpy()
        along = ((force - friction) * normal).sum(1)
        assert force - friction == pytest.approx(along[:, None] * normal, abs=1e-10)  # the elastic part
        tangential = friction - (friction * normal).sum(1)[:, None] * normal
        assert (np.linalg.norm(tangential, axis=1) > 0.01).sum() >= 5
        assert (np.linalg.norm(tangential, axis=1) <= 0.5 * (force * normal).sum(1) + 1e-9).all()  # Coulomb
        sim.write_frame()
    frame = pliant.Run(tmp_path / "run").frames[-1]
    assert not frame.elastic_contacts and frame.contacts.equals(contacts)


def test_a_periodic_box():
    sim = Simulation([[0.1, 0.5], [9.2, 0.5]], diameters=1, box=(10, np.inf), e_sp=100)
    assert sim.energies["pair"] == pytest.approx(100 / 2 * 0.1**2)
    lone = Simulation([[0.5, 0.5]], diameters=0.2, box=(1, 1), velocities=[[1, 0]], dt=0.01, allow_unstable_dt=True)
    lone.run(3.2)
    assert lone.positions + lone.images == pytest.approx(np.array([[3.7, 0.5]]))


def test_walls_that_move():
    walls = Walls(2)
    piston = walls.half_space((0, 0), (1, 0), velocity=(0.5, 0))
    sim = Simulation([[1.0, 0]], diameters=1, walls=walls, e_w=1e4)
    sim.run(4)  # an elastic bounce of a wall with speed 0.5
    assert sim.velocities[0] == pytest.approx([1, 0], rel=1e-2)
    sim.move_wall(piston)
    x = sim.positions.copy()
    sim.run(1)
    assert sim.positions[0] == pytest.approx(x[0] + [1, 0], rel=1e-2)
    with pytest.raises(pliant.InputError, match="no wall 7"):
        sim.move_wall(7)


def test_minimum_and_hessian():
    sim = Simulation(cloud(30, spacing=0.8), diameters=1, box=(4.8, 4.2), e_sp=100)
    before = sim.energies["pair"]
    minimum = sim.minimize(force_tolerance=1e-9)
    assert minimum.converged and minimum.energy == pytest.approx(sim.energies["pair"]) and minimum.energy < before
    assert np.abs(sim.forces).max() <= 1e-9 and "Minimum(converged=True" in repr(minimum)
    hessian = sim.hessian()
    assert abs(hessian - hessian.T).max() < 1e-10
    h, x = 1e-6, sim.positions.copy()
    for k in (0, 17, 41):
        forces = []
        for sign in (1, -1):
            sim.positions = x
            sim.positions.ravel()[k] += sign * h
            forces.append(sim.forces.ravel())
        assert hessian[k].toarray()[0] == pytest.approx(-(forces[0] - forces[1]) / (2 * h), abs=1e-4)


def regular_polygon(centre, radius=0.5, vertices=12):
    angles = 2 * np.pi * np.arange(vertices) / vertices
    return np.asarray(centre) + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


@pytest.mark.parametrize("dim, polygons", [(2, False), (3, False), (2, True)])
def test_stress_is_the_derivative_of_the_energy(dim, polygons):
    """Points and box are stretched along one axis. Polygons are in equilibrium, where shape energies balance the moments of
    contacts about the centres."""
    lengths = np.array([3.6, 3.7 if polygons else 3.4, 3.5][:dim])
    centres = cloud(4**dim, dim, spacing=0.87)
    if polygons:
        centres = 0.9 * np.round(centres / 0.87 - 0.1) + 0.05 * np.random.default_rng(1).random((16, 2))

    def simulation(points, box):
        if polygons:
            return Simulation(polygons=np.split(points, len(centres)), a0=np.pi / 4, l0=2 * np.sin(np.pi / 12) / 2, mass=1, box=box,
                              model="rough", e_c=100, k_a=10, k_l=10, k_b=0.1)
        return Simulation(points, 1, box=box, e_sp=100)
    sim = simulation(np.concatenate([regular_polygon(c, 0.36) for c in centres]) if polygons else centres, lengths)
    if polygons:
        assert sim.minimize(1e-9).converged
    stress = pliant.analysis.mean_stress(sim, kinetic=False)
    assert pliant.analysis.pressure(stress) > 1 and np.abs(stress - stress.T).max() < 1e-9
    for axis in range(dim):
        energies = []
        for strain in (1e-5, -1e-5):
            stretch = np.ones(dim)
            stretch[axis] += strain
            energies.append(sum(value for name, value in simulation(sim.positions * stretch, lengths * stretch).energies.items()
                                if name != "kinetic"))
        assert (energies[0] - energies[1]) / 2e-5 == pytest.approx(-stress[axis, axis] * lengths.prod(), rel=1e-4)


def test_particles_of_a_simulation():
    sim = Simulation([[0, 0.45], [0.9, 0.5]], [1, 1.2], walls=floor(), e_sp=100, e_w=100, velocities=[[1, 0], [0, 2]], density=2)
    particles = sim.particles()
    assert particles.masses == pytest.approx([2 * np.pi / 4, 2 * np.pi * 0.36]) and particles.radii == pytest.approx([0.5, 0.6])
    assert particles.velocities.tolist() == [[1, 0], [0, 2]] and particles.pairs.tolist() == [[0, 1], [0, -1], [1, -1]]
    assert pliant.analysis.coordination(sim).tolist() == [2, 2] and pliant.analysis.coordination(sim, walls=False).tolist() == [1, 1]
    polygon = Simulation(polygons=[regular_polygon([3, 2])], mass=1, e_c=1, k_a=1)
    assert polygon.particles().bodies == pytest.approx([3.0 * 0.25]) and polygon.particles().positions[0] == pytest.approx([3, 2])


def test_motion_between_moments_of_a_simulation():
    """Particles are matched by their ids: removed particles have no displacement, added particles do not count."""
    x = cloud(30, spacing=2)
    v = np.random.default_rng(3).normal(size=x.shape)
    sim = Simulation(x, 0.5, velocities=v, dt=0.01, e_w=1, e_sp=1)
    before = sim.particles()
    sim.remove([3, 7])
    sim.add([[-3, -3]], 0.5)
    sim.run(0.1)
    moved = pliant.analysis.displacements(before, sim)
    stays = np.setdiff1d(np.arange(30), [3, 7])
    assert np.isnan(moved[[3, 7]]).all() and moved[stays] == pytest.approx(0.1 * v[stays])
    value, number = pliant.analysis.d2_min(before, sim)
    expected = pliant.analysis.d2_min(x[stays], x[stays] + 0.1 * v[stays])
    assert np.isnan(value[[3, 7]]).all() and value[stays] == pytest.approx(expected[0]) and (number[stays] == 15).all()


def test_hessian_for_petsc():
    """The test starts a separate process, because petsc4py and the engine share PETSc until the process ends."""
    pytest.importorskip("petsc4py")
    script = """
import numpy as np
from pliant import Simulation
sim = Simulation([[0, 0], [0.9, 0], [1.5, 0.6]], diameters=1, e_sp=100)
mat, x = sim.hessian(petsc=True), np.arange(6.0)
to, product = mat.createVecs()
to.setArray(x)
mat.mult(to, product)
assert mat.getSize() == (6, 6) and np.allclose(product.getArray(), sim.hessian() @ x) and np.abs(product.getArray()).max() > 1
sim.run(0.1)
print("as expected")
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, encoding="utf-8", timeout=300)
    assert done.stdout == "as expected\n" and done.returncode == 0, done.stderr


def test_rotating_disks():
    sim = Simulation([[0, 0.5]], 1, walls=floor(), gravity=(0, -1), model="disk", velocities=[[1, 0]], mu_wall=0.5)
    sim.run(3)
    # A sliding disk starts to roll: v = 2/3 of the first speed, and spin -v/R.
    assert sim.velocities[0, 0] == pytest.approx(2 / 3, rel=0.02)
    assert sim.spins[0, 0] == pytest.approx(-4 / 3, rel=0.03) and sim.angles[0, 0] < -1
    with pytest.raises(pliant.InputError, match="rotate"):
        sim.hessian()
    with pytest.raises(pliant.UsageError, match="do not rotate"):
        Simulation([[0, 0]], 1, gravity=(0, -1)).angles


# --- Arrays


def test_arrays_are_in_the_order_of_the_particles_however_they_are_sorted():
    n = 300
    x, v = cloud(n, spacing=3) % 40, rng.normal(size=(n, 2))
    sim = Simulation(x, diameters=1e-6, velocities=v, dt=0.01, box=(51, 51), skin=0.2, allow_unstable_dt=True)
    address, kept = sim.positions.ctypes.data, sim.positions
    sim.run(20)
    assert sim.counters["list_rebuilds"] > 40
    assert sim.positions.ctypes.data == address and np.shares_memory(kept, sim.positions)
    assert kept + 51.0 * sim.images == pytest.approx(x + 20 * v)
    assert list(sim.ids) == list(range(n))


def test_arrays_outlive_the_simulation():
    sim = Simulation(cloud(), diameters=1)
    positions, row = sim.positions, sim.velocities[3]
    sim.run(0.1)
    after = positions.copy()
    sim.close()
    del sim
    gc.collect()
    assert (positions == after).all() and row.base is not None and np.isfinite(row).all()


def test_arrays_cannot_be_resized():
    sim = Simulation([[0, 0], [5, 5]], diameters=1)
    with pytest.raises(ValueError):
        sim.positions.resize((100, 2), refcheck=False)
    sim.positions.shape = (4,)
    sim.step(3)
    assert sim.positions.shape == (2, 2)


def test_numbers_that_are_written_become_the_state():
    sim = Simulation([[0, 0], [5, 5]], diameters=1, dt=0.01, e_w=10)
    sim.velocities[1] = [1, 2]
    sim.positions = [[1, 1], [7, 7]]
    view = sim.positions[0]
    sim.run(1)
    assert sim.positions == pytest.approx(np.array([[1, 1], [8, 9]]))
    view[:] = 3
    sim.step()
    assert sim.positions[0] == pytest.approx([3, 3])
    for bad in (np.nan, np.inf):
        before = sim.positions.copy()
        sim.positions[1, 0] = bad
        with pytest.raises(pliant.InputError, match=r"positions\[1\]"):
            sim.run(1)
        sim.positions = before
    with pytest.raises(pliant.InputError):
        sim.positions = np.zeros((3, 2))


def test_runs_in_parts_and_with_callbacks_are_the_same_bit_for_bit():
    def make():
        return Simulation(cloud(), diameters=1, gravity=(0, -1), walls=floor(height=-1), zeta=0.1, mu=0.2)
    whole, parts, watched = make(), make(), make()
    whole.run(1)
    t = whole.dt
    for _ in range(4):
        parts.run(1 / 4)
        parts.positions
    watched.run(1, callback=lambda sim: sim.positions.sum())
    assert whole.steps == parts.steps == watched.steps and whole.dt == t
    assert (whole.positions == parts.positions).all() and (whole.positions == watched.positions).all()
    threads = Simulation(cloud(), diameters=1, gravity=(0, -1), walls=floor(height=-1), zeta=0.1, mu=0.2, threads=2)
    threads.run(1)
    assert (threads.positions == whole.positions).all()


@pytest.mark.parametrize("model", ["sp", "disk", "rough"])
def test_steps_one_by_one_are_the_same_bit_for_bit(model):
    """Particles are sorted, and the skin of the lists is chosen, at the same steps."""
    rng = np.random.default_rng(3)
    x = np.stack(np.meshgrid(np.arange(6), np.arange(6)), axis=-1).reshape(-1, 2) * 1.2
    rng.shuffle(x)
    v = rng.normal(0, 0.5, x.shape)

    def make():
        if model == "rough":
            return Simulation(polygons=[regular_polygon(c, vertices=8) for c in x], velocities=np.repeat(v / 2, 8, axis=0),
                              box=(7.2, 7.2), model=model, e_c=100, k_a=100, k_l=100, k_b=10, zeta=0.01)
        return Simulation(x, 1, velocities=v, box=(7.2, 7.2), model=model, zeta=0.01)
    whole, parts, single = make(), make(), make()
    first = whole.counters["skin"]
    whole.step(3000)
    for _ in range(430):
        parts.step(7)
        if parts.steps >= 2993:
            break
    parts.step(3000 - parts.steps)
    for _ in range(3000):
        single.step()
    assert whole.counters["skin"] != first
    assert whole.counters == parts.counters == single.counters
    assert (whole.positions == parts.positions).all() and (whole.positions == single.positions).all()


# --- Protocols


def test_callbacks_after_steps_and_at_intervals():
    sim = Simulation([[0, 0]], diameters=1, dt=0.01, e_w=10)
    steps, times = [], []
    sim.run(0.1, callback=lambda s: steps.append(s.steps))
    assert steps == list(range(1, 11))

    @sim.every(0.05)
    def note(s):
        times.append(s.t)
    sim.run(0.2)
    assert times == pytest.approx([0.15, 0.2, 0.25, 0.3])
    sim.forget(note)
    sim.run(0.1)
    assert len(times) == 4
    sim.step(3, callback=lambda s: times.append(0))
    assert len(times) == 7


def test_a_callback_ends_the_run():
    sim = Simulation([[0, 0]], diameters=1, velocities=[[1, 0]], dt=0.01, e_w=10)
    sim.run(100, callback=lambda s: s.stop() if s.positions[0, 0] > 0.505 else None)
    assert sim.t == pytest.approx(0.51)
    sim.run(0.1)
    assert sim.t == pytest.approx(0.61)
    with pytest.raises(pliant.UsageError, match="not running"):
        sim.stop()


def test_errors_of_callbacks_arrive_and_leave_the_state_intact():
    sim = Simulation([[0, 0]], diameters=1, velocities=[[1, 0]], dt=0.01, e_w=10)

    def fail(s):
        if s.steps == 5:
            raise KeyError("mine")
    with pytest.raises(KeyError, match="mine"):
        sim.run(1, callback=fail)
    assert sim.steps == 5 and sim.positions[0] == pytest.approx([0.05, 0])
    sim.run(0.05)
    assert sim.positions[0] == pytest.approx([0.1, 0])
    with pytest.raises(pliant.InputError, match="finite"):
        sim.run(1, callback=lambda s: s.velocities.fill(np.nan))


def test_a_callback_may_not_run_or_close():
    sim, other = Simulation([[0, 0]], 1, dt=0.01, e_w=10), Simulation([[0, 0]], 1, dt=0.01, e_w=10)
    for call in (lambda s: s.run(1), lambda s: s.step(), lambda s: s.minimize(), lambda s: s.close(), lambda s: other.run(1),
                 lambda s: pliant.hopper(n=30)):
        with pytest.raises(pliant.UsageError, match="callback"):
            sim.run(1, callback=call)
    sim.run(0.1)


def test_a_ramp_of_a_parameter():
    sim = Simulation([[0, 0], [0.5, 0]], diameters=1, e_sp=100, e_w=1)
    dt, energies = sim.dt, []

    def stiffen(s):
        s.set(e_sp=s.options["e_sp"] * 4)
        energies.append((s.energies["pair"], s.options["e_sp"] / 2 * max(0, 1 - np.linalg.norm(s.positions[0] - s.positions[1]))**2))
    sim.run(2.4 * dt, callback=stiffen, every=dt)
    assert len(energies) == 2 and energies[1][0] > 1 and sim.options["e_sp"] == 1600
    assert [e for e, _ in energies] == pytest.approx([e for _, e in energies])
    assert sim.dt == pytest.approx(dt / 4, rel=0.01) and sim.t == pytest.approx(2.4 * dt, abs=dt / 4)
    fixed = Simulation([[0, 0], [0.9, 0]], diameters=1, e_sp=100, dt=dt, e_w=1)
    with pytest.raises(pliant.InputError, match="limit of stability"):
        fixed.set(e_sp=1e6)
    assert fixed.energies["pair"] == pytest.approx(0.5)
    for change in ({"e_spp": 1}, {"e_sp": -1}, {"k_a": 1}, {"model": "disk"}, {"integrator": "rk"}, {"e_sp": "a"}):
        with pytest.raises(pliant.InputError):
            fixed.set(**change)
    fixed.run(1)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("change", [{"e_disk": 4000}, {"restitution": 0.1}, {"mu_disk": 0}])
def test_a_change_of_contacts_acts_at_once(dim, change):
    """Two disks or spheres slide along each other with friction. After a change of a parameter they move as in a simulation
    that starts with this parameter."""
    def simulation(positions, velocities, **more):
        return Simulation(positions, diameters=1, velocities=velocities, model="disk", dt=1e-5,
                          **{"e_disk": 1000, "restitution": 0.5, "mu_disk": 0.01, **more})
    positions, velocities = np.zeros((2, dim)), np.zeros((2, dim))
    positions[1, 0], velocities[1, :2] = 0.97, [-1, 1]
    sim = simulation(positions, velocities)
    sim.run(1.5e-5)
    before = sim.positions.copy(), sim.velocities.copy()
    sim.set(**change)
    sim.run(2e-5)
    other = simulation(*before, **change)
    other.run(2e-5)
    assert sim.velocities - before[1] == pytest.approx(other.velocities - before[1], rel=1e-3, abs=1e-6)


def test_a_parameter_that_switches_friction_on():
    sim = Simulation([[0, 0.5]], 1, walls=floor(), gravity=(0, -1), model="disk", velocities=[[1, 0]], mu_wall=0)
    sim.run(0.5)
    assert sim.spins[0, 0] == 0
    sim.run(3, callback=lambda s: s.set(mu_wall=0.5) if s.options["mu_wall"] == 0 else None)
    assert sim.spins[0, 0] == pytest.approx(-4 / 3, rel=0.05)


def test_a_force_of_python():
    calls = []

    def trap(x, v, t):
        calls.append(x.shape)
        return -4 * np.pi**2 * np.pi / 4 * x
    sim = Simulation([[1.0, 0]], diameters=1, dt=1e-3)
    sim.force = trap
    sim.run(0.5)
    assert sim.positions[0] == pytest.approx([-1, 0], abs=1e-4) and calls[0] == (1, 2)
    assert len(calls) == pytest.approx(500, abs=3)
    sim.force = None
    v = sim.velocities.copy()
    sim.run(0.1)
    assert (sim.velocities == v).all()


def test_a_force_on_polygons_and_with_other_integrators():
    outlines = pliant.regular_polygons([[0, 0]], 1, 8)
    for options in ({}, {"integrator": "rk", "ts_adapt_type": "none", "dt": 0.0004}):
        sim = Simulation(polygons=outlines, model="rough", **options)
        sim.force = lambda x, v, t: np.tile([np.pi / 4 / 8, 0], (8, 1))
        sim.run(0.5)
        assert sim.centres[0] - outlines[0].mean(axis=0) == pytest.approx([sim.t**2 / 2, 0], abs=1e-6)


@pytest.mark.parametrize("force", [
    lambda x, v, t: None, lambda x, v, t: np.zeros(3), lambda x, v, t: x[:, :1], lambda x, v, t: "a", lambda x, v: x,
    lambda x, v, t: np.full_like(x, np.nan), lambda x, v, t: 1 / 0, lambda x, v, t: [[1, 2], [3]], 7,
])
def test_bad_forces(force):
    sim = Simulation([[0, 0], [3, 3]], diameters=1, velocities=[[1, 0], [0, 0]], dt=0.01, e_w=10)
    sim.run(0.1)
    x = sim.positions.copy()
    sim.force = force
    with pytest.raises((pliant.InputError, ZeroDivisionError, TypeError, ValueError)):
        sim.run(1)
    assert (sim.positions == x).all() and sim.steps == 10
    sim.force = None
    sim.run(0.1)
    assert sim.positions[0] == pytest.approx([0.2, 0])


def test_particles_are_added_and_removed():
    sim = Simulation(cloud(20, spacing=2), diameters=np.linspace(0.5, 1, 20), velocities=rng.normal(size=(20, 2)), dt=0.01, e_w=1, e_sp=1)
    held = sim.positions
    x, v = sim.positions.copy(), sim.velocities.copy()
    sim.remove([3, 7])
    assert list(sim.ids) == [k for k in range(20) if k not in (3, 7)] and len(sim) == 18 and len(held) == 20
    assert (sim.positions == np.delete(x, [3, 7], axis=0)).all() and (sim.velocities == np.delete(v, [3, 7], axis=0)).all()
    assert sim.diameters == pytest.approx(np.delete(np.linspace(0.5, 1, 20), [3, 7]))
    sim.add([[30, 30], [40, 40]], diameters=2, velocities=[[1, 0], [0, 1]])
    assert list(sim.ids[-2:]) == [20, 21] and sim.masses[-1] == pytest.approx(np.pi)

    def change(s):
        if s.steps == 5:
            s.remove(20)
            s.add([[50, 50]], diameters=1)
    sim.run(0.2, callback=change)
    assert sim.steps == 20 and list(sim.ids[-2:]) == [21, 22]
    assert sim.positions[-2:] == pytest.approx(np.array([[40, 40.2], [50, 50]]))
    with pytest.raises(pliant.InputError, match="no particle with the id 3"):
        sim.remove(3)
    with pytest.raises(pliant.InputError, match="same place"):
        sim.add([[50, 50]], diameters=1)
    with pytest.raises(pliant.InputError, match="keep at least one"):
        sim.remove(sim.ids)
    assert len(sim) == 20
    sim.run(0.1)
    assert sim.t == pytest.approx(0.3)


def test_history_of_contacts_survives_a_removal():
    """A disk that rolls down is held by a tangential spring, whose loss would move it by 1e-3."""
    def roll(remove):
        sim = Simulation([[0, 0.5], [9, 0.5], [5, 5]], 1, walls=floor(), gravity=(0.2, -1), model="disk", mu_wall=0.5,
                         e_disk=200)
        sim.run(2)
        if remove:
            sim.remove([0, 2])
        sim.run(0.3)
        return sim.positions[-1 if remove else 1]
    assert roll(True) == pytest.approx(roll(False), abs=2e-5)


def test_ctrl_c_ends_a_run_with_its_state():
    sim = Simulation(cloud(), diameters=1, gravity=(0, -1e-6))
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        start = time.monotonic()
        with pytest.raises(KeyboardInterrupt):
            sim.run(1e6)
        assert time.monotonic() - start < 20 and np.isfinite(sim.positions).all()
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(KeyboardInterrupt):
            Simulation(cloud(400, spacing=0.5), 1, box=(10, 10)).minimize(force_tolerance=1e-300, max_iterations=10**9)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    steps = sim.steps
    sim.step()
    assert sim.steps == steps + 1


# --- Integrators and several simulations


@pytest.mark.parametrize("options", [
    {"integrator": "rk", "ts_rtol": 1e-8, "ts_atol": 1e-10}, {"integrator": "cvode", "ts_rtol": 1e-8, "ts_atol": 1e-10},
    {"integrator": "alpha2", "ts_dt": 1e-3, "ts_adapt_type": "none"}, {"integrator": "verlet", "dt": 2e-4},
])
def test_integrators_by_name(options):
    """Two disks bounce as an oscillator does: E (1 - r/σ)²/2 and the reduced mass."""
    sim = Simulation([[0, 0], [0.99, 0]], diameters=1, mass=2, e_sp=10, **options)
    period = 2 * np.pi * np.sqrt(1 / 10)
    sim.run(period / 4)
    assert sim.velocities[1, 0] - sim.velocities[0, 0] == pytest.approx(0.01 * np.sqrt(10), rel=2e-3)
    assert options["integrator"] in sim.counters["integrator"]


def test_options_of_one_simulation_are_not_those_of_another():
    def make(tolerance):
        return Simulation(cloud(10), 1, gravity=(0, -1), walls=floor(height=-1), integrator="rk", ts_rtol=tolerance,
                          ts_atol=tolerance, zeta=1)
    alone = []
    for tolerance in (1e-3, 1e-8):
        sim = make(tolerance)
        sim.run(0.2), sim.run(0.2)
        alone.append((sim.positions.copy(), sim.steps))
    one, other = make(1e-3), make(1e-8)
    for _ in range(2):
        one.run(0.2), other.run(0.2)
    for sim, (x, steps) in zip((one, other), alone):
        assert (sim.positions == x).all() and sim.steps == steps


def test_simulations_and_scenarios_in_one_process(tmp_path):
    a, b = Simulation(cloud(), 1, gravity=(0, -1)), Simulation(cloud(), 1, gravity=(0, -1))
    a.step(100)
    pliant.hopper(n=40, hopper_wall_distance=8, hopper_width=3, t_end=0.05, output=tmp_path / "run", quiet=True)
    b.step(50), b.step(50)
    assert (a.positions == b.positions).all()


def test_many_simulations_leave_nothing_behind():
    def used():
        gc.collect()
        with open("/proc/self/statm", encoding="utf-8") as file:
            return int(file.read().split()[1]) * resource.getpagesize()

    def make():
        sim = Simulation(cloud(20), 1, zeta=0.1)
        sim.every(0.5)(lambda s: s.positions)
        sim.step(2, callback=lambda s: s.velocities)
        sim.positions, sim.forces
    for _ in range(50):
        make()
    before = used()
    for _ in range(300):
        make()
    assert used() - before < 3e6


# --- Set-up


def test_a_packed_container():
    container = pliant.Container(width=3, wall_distance=10, angle=60, obstacles=[("disk", (0, 8), 1.0)])
    sizes = pliant.diameters(40, seed=2)
    assert sizes.mean() == pytest.approx(1) and set(np.round(sizes / sizes.min(), 6)) == {1, 1.4}
    x = container.pack(sizes, seed=4)
    assert x.shape == (40, 2) and all(container.inside(r) for r in x) and not container.inside((0, 8))
    sim = Simulation(x, sizes, walls=container, gravity=(0, -1), zeta=0.3)
    assert sim.energies["pair"] < 1e-3 and len(sim.wall_segments) == 5 and sim.wall_radius.max() == 1
    sim.run(2)
    assert sim.positions[:, 1].min() < x[:, 1].min()
    polygons = pliant.Container.outline([[-2, 0], [-6, 5]], [[2, 0], [6, 5]]).pack(np.ones(6), n_vertices=12)
    Simulation(polygons=polygons, model="smooth").step(5)
    assert pliant.Container(3, 8).pack(np.ones(30), dim=3).shape == (30, 3)


@pytest.mark.parametrize("dim, fraction, shape", [(2, 0.78, {}), (3, 0.55, {}), (2, 0.35, {"n_vertices": 12})])
def test_a_packed_box(dim, fraction, shape):
    sizes = pliant.diameters(40, seed=2)
    box = pliant.Box.filled(sizes, fraction, dim)
    x = box.pack(sizes, seed=3, **shape)
    assert len(x) == 40 and np.prod(box.lengths) == pytest.approx(np.sum(np.pi * sizes**dim / (4 if dim == 2 else 6)) / fraction)
    particles = {"polygons": x, "model": "smooth"} if shape else {"positions": x, "diameters": sizes}
    sim = Simulation(**particles, box=box)
    assert sim.box.lengths == box.lengths and (not len(sim.contacts) or sim.contacts.overlap.max() < 2e-4)
    assert np.array_equal(np.concatenate(x) if shape else x, sim.positions)
    again = box.pack(sizes, seed=3, **shape)
    assert np.array_equal(np.asarray(x), np.asarray(again)) and not np.array_equal(np.asarray(x), np.asarray(box.pack(sizes, **shape)))


@pytest.mark.parametrize("unit", [2.0**-30, 1e-3, 100, 1e6])
def test_a_packed_box_in_other_units(unit):
    sizes = pliant.diameters(40, seed=2)
    x, scaled = (pliant.Box.filled(d, 0.8).pack(d, seed=3) for d in (sizes, sizes * unit))
    overlaps = [Simulation(positions, d, box=pliant.Box.filled(d, 0.8)).contacts.overlap for positions, d in ((x, sizes), (scaled, sizes * unit))]
    assert all(overlap.max(initial=0) < 2e-4 for overlap in map(np.asarray, overlaps))
    if unit == 2.0**-30:  # a power of 8
        assert np.array_equal(x * unit, scaled)


def test_a_box_at_a_pressure(tmp_path):
    """Isostatic packings near jamming; frames and a restart have the box of the simulation."""
    sizes = pliant.diameters(32, seed=2)
    box = pliant.Box.filled(sizes, 0.8)
    with Simulation(box.pack(sizes), sizes, box=box, e_sp=1, output=tmp_path / "run") as sim:
        stable = sim.dt
        for pressure in (1e-2, 1e-6):
            minimum = sim.minimize(1e-12, 10**6, pressure)
            assert minimum.converged and minimum.pressure == pytest.approx(pressure, rel=1e-5), minimum.reason
            assert pliant.analysis.pressure(pliant.analysis.mean_stress(sim)) == pytest.approx(pressure, rel=1e-5)
            assert minimum.stress == pytest.approx(minimum.stress.T) and np.abs(sim.forces).max() <= 1.2e-12
            lengths = sim.box.lengths
            assert lengths[0] == pytest.approx(lengths[1]) and lengths[0] < box.lengths[0]
            sim.write_frame()
        bearing = 32 - pliant.analysis.rattlers(sim).sum()
        assert 0 <= len(sim.contacts) - 2 * (bearing - 1) <= 3  # isostatic: 2 (N' - 1) + 1
        assert sim.dt == stable
        sim.run(1)
        state = sim.positions.copy()
    assert pliant.Run(tmp_path / "run").frames[-1].box[1] == pytest.approx(lengths)
    with Simulation.restart(tmp_path / "run") as sim:
        assert sim.box.lengths == lengths and np.array_equal(sim.positions, state)
        sim.run(0.1)


@pytest.mark.parametrize("options, words", [
    ({"pressure": 0}, "must be positive"), ({"pressure": -1}, "must be positive"), ({"pressure": np.nan}, "must be positive"),
    ({"pressure": np.inf}, "must be positive"), ({"pressure": "a"}, "not a number"), ({"pressure": 1, "box": None}, "is open"),
    ({"pressure": 1, "box": (9, None)}, "direction 1 of the box is open"), ({"pressure": 1, "model": "disk"}, "rotate"),
    ({"pressure": 1, "walls": True}, "walls do not follow"), ({"pressure": 1e-9, "force_tolerance": 0}, "force_tolerance"),
])
def test_pressures_that_are_refused(options, words):
    pressure, tolerance = options.pop("pressure"), options.pop("force_tolerance", 1e-8)
    walls = None
    if options.pop("walls", False):
        walls = Walls()
        walls.half_space((0, 0), (0, 1))
        options["box"] = (9, None)
        words = "is open"
    sim = Simulation([[0, 1], [0.8, 1]], 1, walls=walls, **{"box": (9, 9), **options})
    before = sim.positions.copy()
    with pytest.raises(pliant.InputError, match=words):
        sim.minimize(tolerance, pressure=pressure)
    assert np.array_equal(sim.positions, before)
    sim.step()


def test_a_box_that_grows_without_end_stays_as_it_was():
    sim = Simulation([[0.1, 1], [0.8, 1]], 1, box=(2, 2), e_sp=1e6)
    before = sim.positions.copy()
    try:
        sim.minimize(1e-12, 10**5, pressure=1e-30)
    except pliant.NumericalError as error:
        assert "length by a factor" in str(error)
        assert sim.box.lengths == (2, 2) and np.array_equal(sim.positions, before)
    sim.step()


def test_a_minimum_with_crossed_outlines_is_refused():
    """Polygons with little stiffness against bending, inflated to four times their area in a box of their first area."""
    outlines = pliant.regular_polygons([[0, 0], [1.1, 0], [0, 1.1], [1.1, 1.1]], 1, 16)
    sim = Simulation(polygons=outlines, a0=4 * np.pi / 4, l0=0.5, box=(2.2, 2.2), model="smooth", e_c=1, k_a=100, k_l=1, k_b=1e-6)
    before = sim.positions.copy()
    with pytest.raises(pliant.NumericalError, match="cross|inside"):
        sim.minimize(1e-6, 2000)
    assert np.array_equal(sim.positions, before)
    sim.step()


@pytest.mark.parametrize("pressure", [None, 1e-2])
def test_a_minimum_that_is_not_reached(pressure):
    """An error with the largest force and cures, unless the caller accepts it; another call continues."""
    for options in ({}, {"must_converge": False}):
        sim = Simulation(cloud(16, spacing=0.9), 1, box=(3.6, 3.6), e_sp=10)
        before = sim.positions.copy()
        if options:
            minimum = sim.minimize(1e-12, 5, pressure, **options)
            assert not minimum.converged and minimum.iterations == 5 and minimum.max_force > 1e-12
        else:
            with pytest.raises(pliant.NumericalError, match=r"limit of 5 iterations .*force_tolerance 1e-12; .*must_converge=False"):
                sim.minimize(1e-12, 5, pressure)
        assert not np.array_equal(sim.positions, before)
        assert sim.minimize(1e-8, 10**5, pressure).converged
        if pressure:
            assert sim.minimize(1e-8, pressure=pressure).pressure == pytest.approx(pressure, rel=1e-5)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_minimum_of_frictional_particles(dim):
    """Contacts repel until they do not overlap; angles stay."""
    sim = Simulation(cloud(9, dim, 0.9), 1, model="disk", walls=floor(dim, -0.45))
    sim.angles[:] = 0.3
    before = sum(sim.energies.values())
    minimum = sim.minimize(1e-6)
    assert minimum.converged and minimum.energy < 1e-6 < before and minimum.stress is None
    assert np.abs(sim.forces).max() <= 1e-6 and (sim.angles == 0.3).all()
    sim.step()


def test_a_minimum_with_walls_in_motion_and_with_gravity():
    """At the present time of the walls; the energy is negative."""
    walls = Walls()
    walls.half_space((0, -3), (0, 1), velocity=(0, 0.5))
    sim = Simulation([[0, 0.2], [1, 0.4]], 1, walls=walls, gravity=(0, -1), e_w=1e3, dt=1e-3, box=(8, None))
    sim.run(1)
    minimum = sim.minimize(1e-10)
    assert minimum.converged and minimum.energy < 0 and minimum.stress is None and minimum.pressure is None
    gap = np.pi / 4 / 1e3 / 4  # weight over the stiffness of the wall, up to the unit of overlaps
    assert sim.positions[:, 1] == pytest.approx(-2.5 + 0.5, abs=10 * gap)


def test_statistics_are_those_of_the_program():
    noise = np.random.default_rng(1).normal(size=4096)
    average = pliant.block_average(noise + 2)
    assert average["mean"] == pytest.approx(2, abs=0.1) and average["error"] == pytest.approx(1 / 64, rel=0.2)
    assert np.isnan(pliant.block_average(noise[:10])["error"])
    value, error = pliant.flow_rate(np.arange(2000.0), np.cumsum(np.random.default_rng(2).poisson(3, 2000)))
    assert value == pytest.approx(3, abs=0.2) and error == pytest.approx(np.sqrt(3 / 2000), rel=0.3)
    assert pliant.start_up(np.r_[np.linspace(5, 0, 500), noise[:2000] * 0.1]) == pytest.approx(500, abs=60)
    for bad in ([[1, 2]], [np.nan] * 100, "ab", None):
        with pytest.raises(pliant.InputError):
            pliant.flow_rate(bad, bad)
        with pytest.raises(pliant.InputError):
            pliant.block_average(bad)


# --- Bad input

ONE = {"positions": [[0.0, 0.0]], "diameters": 1}
SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]


@pytest.mark.parametrize("changes", [
    {"positions": None}, {"positions": [0, 1]}, {"positions": [[0, 1, 2, 3]]}, {"positions": [[[0, 1]]]}, {"positions": 7},
    {"positions": [[0, np.nan]]}, {"positions": [[np.inf, 0]]}, {"positions": "ab"}, {"positions": [["a", "b"]]},
    {"positions": []}, {"positions": [[0, 1], [2]]}, {"positions": [[0]]}, {"positions": [[1j, 0]]},
    {"positions": np.zeros((0, 2))}, {"positions": [[0, 0], [0, 0]]}, {"positions": [[None, 0]]}, {"positions": {}},
    {"diameters": None}, {"diameters": 0}, {"diameters": -1}, {"diameters": np.nan}, {"diameters": np.inf},
    {"diameters": [1, 2]}, {"diameters": []}, {"diameters": "a"}, {"diameters": [[1]]*3},
    {"velocities": [[0, 0, 0]]}, {"velocities": [[0, np.nan]]}, {"velocities": [0, 0]}, {"velocities": [[0, 0], [0, 0]]},
    {"mass": 0}, {"mass": -2}, {"mass": [1, 2]}, {"mass": np.nan}, {"density": 0}, {"density": "a"}, {"density": np.inf},
    {"gravity": [1]}, {"gravity": [0, np.nan]}, {"gravity": 9.81}, {"gravity": "ab"}, {"gravity": [0, 0, 1]},
    {"box": [1]}, {"box": [0, 1]}, {"box": [-1, 1]}, {"box": [np.nan, 1]}, {"box": "ab"}, {"box": [1, 1, 1]},
    {"walls": 3}, {"walls": Walls(3)}, {"walls": [[0, 1]]},
    {"model": "soft"}, {"model": 3}, {"model": "bubbles"}, {"model": "rough"}, {"model": ""},
    {"integrator": "foo"}, {"integrator": 3}, {"integrator": ""}, {"integrator": "rk", "ts_typ": 3},
    {"integrator": "rk", "ts_rtol": -1}, {"integrator": "verlet", "ts_rtol": 1e-3},
    {"e_sp": -1}, {"e_sp": 0}, {"e_sp": np.nan}, {"e_sp": "a"}, {"e_sp": [1, 2]}, {"e_sq": 1}, {"mu": -0.1}, {"k_a": 1},
    {"dt": 0}, {"dt": -1}, {"dt": 10}, {"dt": np.inf}, {"skin": 0}, {"skin": -1}, {"threads": 0}, {"threads": 1.5},
    {"threads": 10**6}, {"contact_law": "foo"}, {"help": True}, {"nonsense": 1}, {"options_file": "no-such-file"},
    {"polygons": [SQUARE]}, {"a0": 1}, {"l0": 1},
])
def test_bad_particles(changes):
    with pytest.raises((pliant.PliantError, ValueError, TypeError)) as error:
        Simulation(**{**ONE, **changes})
    assert str(error.value)


@pytest.mark.parametrize("arguments", [
    {"polygons": []}, {"polygons": [[[0, 0], [1, 0]]]}, {"polygons": [SQUARE[::-1]]}, {"polygons": [[[0, 0], [1, 1], [1, 0], [0, 1]]]},
    {"polygons": [[[0, 0], [0, 0], [1, 0], [1, 1]]]}, {"polygons": SQUARE}, {"polygons": 3}, {"polygons": [[[0, np.nan], [1, 0], [1, 1]]]},
    {"polygons": [SQUARE], "a0": -1}, {"polygons": [SQUARE], "a0": [1, 2]}, {"polygons": [SQUARE], "l0": 0},
    {"polygons": [SQUARE], "model": "sp"}, {"polygons": [SQUARE], "model": "disk"}, {"polygons": [SQUARE], "diameters": -1},
    {"polygons": [SQUARE, (np.array(SQUARE) * 0.5 + 0.25).tolist()], "model": "smooth"}, {"polygons": [[[0, 0, 0]] * 4]},
    {"polygons": [SQUARE], "velocities": np.zeros((3, 2))}, {"polygons": ["abc"]},
])
def test_bad_polygons(arguments):
    with pytest.raises((pliant.PliantError, ValueError, TypeError)) as error:
        Simulation(**arguments).step()
    assert str(error.value)


@pytest.mark.parametrize("call", [
    lambda w: w.segment((0, 0), (0, 0)), lambda w: w.line([[0, 0]]), lambda w: w.line([[0, 0], [1, np.nan]]), lambda w: w.line(3),
    lambda w: w.line([[0, 0], [2, 2], [2, 0], [0, 2]]), lambda w: w.polygon([[0, 0], [1, 1], [1, 0], [0, 1]]),
    lambda w: w.polygon([[0, 0], [1, 0]]), lambda w: w.disk((0, 0), 0), lambda w: w.disk((0, 0), -1), lambda w: w.disk((0,), 1),
    lambda w: w.disk((0, 0), np.nan), lambda w: w.half_space((0, 0), (0, 0)), lambda w: w.half_space((0, 0, 0), (0, 1, 0)),
    lambda w: w.half_space((0, 0), (0, np.nan)), lambda w: w.segment((0, 0), (1, 0), speed=3), lambda w: w.segment("a", "b"),
    lambda w: w.segment((0, 0), (1, 0), velocity=(1,)), lambda w: w.segment((0, 0), (1, 0), spin=(1, 2)),
    lambda w: w.segment((0, 0), (1, 0), frequency="a"), lambda w: w.segment((0, 0), (1, 0), velocity=(np.inf, 0)),
    lambda w: Walls(4), lambda w: Walls("a"), lambda w: w.container(3), lambda w: pliant.Container(0, 5),
    lambda w: pliant.Container(6, 5), lambda w: pliant.Container(3, 8, 0), lambda w: pliant.Container(3, 8, obstacles=[("disk",)]),
    lambda w: pliant.Container(3, 8, obstacles=["disk"]), lambda w: pliant.Container(3, 8, obstacles=[("disk", (0, 3), -1)]),
    lambda w: pliant.Container.outline([[0, 0]], [[1, 0]]), lambda w: pliant.Container(3, 8).pack([]),
    lambda w: pliant.Container(3, 8).pack([1, -1]), lambda w: pliant.Container(3, 8).pack([1], dim=4),
    lambda w: pliant.Container(3, 8).pack([20]), lambda w: pliant.Container(3, 8).pack([1], fraction=2),
    lambda w: pliant.diameters(0), lambda w: pliant.diameters(3, "foo"), lambda w: pliant.diameters(3, ratio=0),
    lambda w: pliant.diameters(2.5), lambda w: pliant.diameters(3, seed=-1), lambda w: pliant.regular_polygons([[0, 0]], 1, 2),
    lambda w: pliant.regular_polygons([[0, 0]], -1, 5), lambda w: pliant.regular_polygons([[0, 0]], [1, 2], 5),
    lambda w: pliant.Box((5, 5)).pack([]), lambda w: pliant.Box((5, 5)).pack([1, np.nan]), lambda w: pliant.Box((5, 5)).pack([6]),
    lambda w: pliant.Box((5, None)).pack([1]), lambda w: pliant.Box((5,)).pack([1]), lambda w: pliant.Box((5, 5)).pack([1] * 30),
    lambda w: pliant.Box((5, 5)).pack([1], n_vertices=2), lambda w: pliant.Box((5, 5, 5)).pack([1], n_vertices=5),
    lambda w: pliant.Box((5, -5)).pack([1]), lambda w: pliant.Box((5, 5)).pack("a"), lambda w: pliant.Box((5, 5)).pack([1], seed=-1),
    lambda w: pliant.Box.filled([]), lambda w: pliant.Box.filled([1], 0), lambda w: pliant.Box.filled([1], dim=4),
    lambda w: pliant.Box.filled([-1]), lambda w: pliant.Box.filled([np.inf]), lambda w: pliant.Box.filled([1], np.nan),
])
def test_bad_walls_and_set_up(call):
    with pytest.raises((pliant.PliantError, ValueError, TypeError)) as error:
        call(Walls(2))
    assert str(error.value)


def test_particles_inside_walls():
    walls = Walls(2)
    walls.disk((0, 0), 2)
    with pytest.raises(pliant.InputError, match="inside wall 0"):
        Simulation([[0.5, 0]], 1, walls=walls)
    with pytest.raises(pliant.InputError, match="on a wall"):
        line = Walls(2)
        line.segment((-1, 0), (1, 0))
        Simulation([[0.0, 0]], 1, walls=line)


@pytest.mark.parametrize("call", [
    lambda s: s.run(0), lambda s: s.run(-1), lambda s: s.run(np.nan), lambda s: s.run("a"), lambda s: s.run(None),
    lambda s: s.run(1e-9), lambda s: s.step(0), lambda s: s.step(-1), lambda s: s.step(1.5), lambda s: s.run(1, every=0.1),
    lambda s: s.run(1, callback=3), lambda s: s.run(1, callback=print, every=0), lambda s: s.run(1, callback=print, every=-1),
    lambda s: s.run(1, callback=print, every="a"), lambda s: s.every("a"), lambda s: s.minimize(0), lambda s: s.minimize(-1),
    lambda s: s.minimize(max_iterations=0), lambda s: s.minimize("a"), lambda s: s.remove(5), lambda s: s.remove([0.5]),
    lambda s: s.remove("a"), lambda s: s.remove(10**20), lambda s: s.add(), lambda s: s.add([[0, 0]], 1), lambda s: s.add([[1, 2, 3]], 1),
    lambda s: s.add(polygons=[SQUARE]), lambda s: s.move_wall(0), lambda s: s.move_wall("a"), lambda s: s.run(1e300),
])
def test_bad_calls(call):
    sim = Simulation(**ONE, dt=0.01, e_w=10)
    with pytest.raises((pliant.PliantError, ValueError, TypeError, OverflowError)) as error:
        call(sim)
    assert str(error.value)
    sim.run(0.1)
    assert len(sim) == 1 and sim.steps == 10


def test_after_close():
    with Simulation(**ONE, dt=0.01, e_w=10) as sim:
        sim.run(0.1)
        held = sim.positions
    assert sim.closed and "closed" in repr(sim) and held[0, 0] == 0
    for call in (lambda: sim.run(1), lambda: sim.step(), lambda: sim.positions, lambda: sim.t, lambda: sim.energies,
                 lambda: sim.contacts, lambda: sim.hessian(), lambda: sim.set(e_sp=2), lambda: sim.remove(0), lambda: sim.ids,
                 lambda: sim.minimize(), lambda: sim.add([[3, 3]], 1), lambda: sim.wall_forces, lambda: sim.move_wall(0),
                 lambda: sim.counters, lambda: sim.images, lambda: sim.dt, lambda: sim.steps, lambda: sim.wall_segments,
                 lambda: sim.forces):
        with pytest.raises(pliant.UsageError, match="closed"):
            call()
    sim.close()


def test_polygons_that_cross_end_the_run():
    sim = Simulation(polygons=pliant.regular_polygons([[0, 0], [2, 0]], 1, 12), model="smooth", e_c=1,
                     velocities=np.repeat([[50, 0], [-50, 0]], 12, axis=0))
    with pytest.raises(pliant.NumericalError, match="crossed"):
        sim.run(100)
    with pytest.raises(pliant.NumericalError):
        sim.step()
    sim.positions[12:] += [10, 0]
    sim.velocities = 0
    sim.run(0.01)


@pytest.mark.parametrize("dim", [2, 3])
def test_particles_that_go_through_walls_end_the_run(dim):
    start = [[0] * (dim - 1) + [0.5]]
    pressed = Simulation(start, 1, walls=floor(dim), gravity=[0] * (dim - 1) + [-100], e_w=1)
    with pytest.raises(pliant.NumericalError, match=r"particle 0 went through wall 0: .*stiffer walls \(e_w\)"):
        pressed.run(1)
    fast = Simulation(start, 1, walls=floor(dim), velocities=[[0] * (dim - 1) + [1e4]], dt=0.01, e_w=1)
    with pytest.raises(pliant.NumericalError, match=r"moves by 200 radii in a step: .*shorter step \(dt\)"):
        fast.run(1)
    assert fast.t <= 0.02
    alone = Simulation(start, 1, velocities=[[0] * (dim - 1) + [1e4]], dt=0.01, e_w=1)
    alone.run(1)


def thin_floor(dim=2, points=None, **motion):
    """A horizontal segment, in 3D a round plate, without an inside."""
    walls = Walls(dim)
    walls.line(points or [(-5 * (3 - dim), 0), (5, 0)], **motion)
    return walls


def above(dim, height):
    return [[0] * (dim - 1) + [height]]


THROUGH = r"particle 0 went through wall 0: its (centre|vertex \d+) crossed the wall between t = .*; use stiffer walls \(e_w\) or a shorter step \(dt\)"


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("integrator", ["verlet", "rk"])
def test_a_thin_wall_that_is_crossed_ends_the_run(dim, integrator):
    """In the step in which the centre is first beyond the wall, whether the particle moves or the wall."""
    for velocity, motion in ((-8, 0), (0, 8), (-4, 4)):
        walls = thin_floor(dim, velocity=[0] * (dim - 1) + [motion])
        sim = Simulation(above(dim, 1), 1, velocities=above(dim, velocity), walls=walls, e_w=10, integrator=integrator)
        heights = []
        with pytest.raises(pliant.NumericalError, match=THROUGH):
            sim.run(0.5, callback=lambda s: heights.append(s.positions[0, -1] - motion * s.t))
        assert min(heights) > 0 > sim.positions[0, -1] - motion * sim.t


@pytest.mark.parametrize("model", ["rough", "smooth"])
def test_a_polygon_that_a_thin_wall_crosses_ends_the_run(model):
    fast = Simulation(polygons=pliant.regular_polygons([[0, 2]], 1, 12), velocities=np.repeat([[0, -30]], 12, axis=0),
                      walls=thin_floor(), model=model, e_w=1)
    with pytest.raises(pliant.NumericalError, match=THROUGH):
        fast.run(1)
    walls = Walls()
    walls.line([(0, -3), (0, 0.1)])  # its end is within the outline, far from all vertices
    pierced = Simulation(polygons=pliant.regular_polygons([[0, 0.3]], 1, 12), walls=walls, model=model)
    with pytest.raises(pliant.NumericalError, match="particle 0 went through wall 0: the wall crosses its outline; use stiffer"):
        pierced.run(1)


def test_a_droplet_that_crosses_a_thin_wall_ends_the_run():
    # With error control the wall, whose force has no bound, holds the droplet.
    sim = Simulation([[0, 1.2]], 2, walls=thin_floor(), gravity=(0, -1e4), model="bubble", phi_c=0, integrator="rk", ts_adapt_type="none",
                     dt=0.01)
    with pytest.raises(pliant.NumericalError, match="particle 0 went through wall 0"):
        sim.run(100)


def test_a_disk_wall_that_is_crossed_ends_the_run():
    """Before the particle has left on the other side, in fewer steps than between two checks of overlaps."""
    walls = Walls()
    walls.disk((0, 0), 0.2)
    sim = Simulation([[0, 1]], 1, velocities=[[0, -20]], walls=walls, e_w=1, dt=0.005)
    with pytest.raises(pliant.NumericalError, match="particle 0 went through wall 0"):
        sim.run(0.2)
    assert sim.steps < 20 and abs(sim.positions[0, 1]) < 0.2


def test_particles_beyond_walls_may_be_there():
    """Particles below a floor or beside its end do not end a run: not at the start, not after a callback or a periodic
    border has moved them there, not after a callback has moved a wall past them, and not while they roll around an end."""
    below = Simulation([[0, -0.7], [6, 0.3], [3, -0.2]], 1, velocities=[[0, 1], [0, -3], [0, 0]], walls=thin_floor(), e_w=100)
    below.run(2)
    assert below.positions[0, 1] < 0 and below.positions[1, 1] < -1

    moved = Simulation([[0, 1]], 1, velocities=[[0, -1]], walls=thin_floor(), e_w=100)

    def place(s):
        s.positions[0, 1] *= -1
    moved.run(1, callback=place, every=0.25)
    moved.run(1)

    around = Simulation(cloud(9, spacing=1.3), 1, velocities=[[8, 0]] * 9, walls=floor(2, -0.4), gravity=(0, -1), box=(8, None), e_w=1000)
    around.run(10)  # across the border, where sorting wraps the particles
    assert around.images[:, 0].min() > 5

    walls = thin_floor(velocity=(0, -1))
    reversed_ = Simulation([[0, 1], [0, -2]], 1, walls=walls, e_w=100)
    reversed_.run(1, callback=lambda s: s.move_wall(0, velocity=(0, np.cos(9 * s.t))), every=0.05)

    walls = Walls()
    walls.line([(-9, 0), (0, 0)])
    rolls = Simulation([[-0.1, 0.499]], 1, velocities=[[0.1, 0]], walls=walls, gravity=(0, -1), e_w=1000)
    rolls.run(5)
    assert rolls.positions[0, 1] < -1

    changed = Simulation([[0, 1]], 1, walls=thin_floor(), gravity=(0, -1), e_w=100)

    def change(c):
        if len(c) == 1:
            c.add([[2, -1], [2, 1]], 1)
        elif 0 in c.ids:
            c.remove(0)
    changed.run(2, callback=change, every=0.2)
    assert list(changed.ids) == [1, 2] and changed.positions[0, 1] < 0 < changed.positions[1, 1]


def test_a_second_thread():
    sim, other = Simulation(cloud(), 1, gravity=(0, -1e-6)), Simulation(**ONE, dt=0.01, e_w=10)
    started, errors = threading.Event(), []

    def work():
        started.wait()
        for call in (lambda: other.run(1), lambda: sim.energies, lambda: sim.positions, lambda: sim.set(e_sp=3)):
            try:
                call()
            except pliant.UsageError as error:
                errors.append(str(error))
    thread = threading.Thread(target=work)
    thread.start()
    sim.run(1e6, callback=lambda s: (started.set(), s.stop() if len(errors) == 4 or not thread.is_alive() else None))
    thread.join()
    assert len(errors) == 4 and all("another thread" in error for error in errors)
    other.run(1)


def test_the_interpreter_ends_with_open_simulations(script):
    script("""
import pliant, os
sims = [pliant.Simulation([[0, 0], [0.9, 0]], 1, integrator=name) for name in ("verlet", "rk", "cvode", "alpha2")]
for sim in sims: sim.run(0.1)
positions = sims[1].positions
cycle = [sims]; cycle.append(cycle)
child = os.fork()
if child == 0:
    try:
        sims[0].run(1)
    except pliant.UsageError as error:
        assert "fork" in str(error)
        raise SystemExit(7)
    raise SystemExit(1)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
sims[0].run(0.1)
""")


def test_help_lists_the_parameters():
    text = Simulation.__doc__
    for name in ("e_sp", "mu_disk", "k_a", "zeta", "dt", "threads"):
        assert f"\n        {name}: " in text


# --- Drawing


@pytest.mark.parametrize("color", ["speed", "contacts", "size", "shape"])
def test_a_drawing(color):
    """Every kind of wall, disks and polygons; a view that is drawn has its particles in it."""
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    walls = Walls()
    walls.half_space((0, -1), (0, 1))
    walls.line([(-5, 8), (-5, 0)])
    walls.disk((7, 2), 1)
    centres = [[0, 0], [1.5, 0.2], [0.7, 3]]
    particles = ({"polygons": pliant.regular_polygons(centres, 1, 8), "model": "rough"} if color == "shape"
                 else {"positions": centres, "diameters": [1, 1, 1.4]})
    with Simulation(**particles, walls=walls, gravity=(0, -1)) as sim:
        before = sim.positions.copy()
        axes = sim.draw(color)
        assert np.array_equal(sim.positions, before)
    low, high = axes.get_xlim()
    assert low < -5 and high > 8
    assert len(axes.collections) == 2  # walls, particles
    matplotlib.pyplot.close(axes.figure)


def test_a_drawing_in_a_box_and_in_space():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    for dim, box in ((2, (4, 4)), (3, None)):
        with Simulation(cloud(8, dim), 0.9, box=box) as sim:
            axes = sim.draw()
            matplotlib.pyplot.close(axes.figure)
            with pytest.raises(pliant.RunError, match="color is 'mass'"):
                sim.draw("mass")


# --- Free flight, without errors that would shorten a step

CONTROLLED = ["rk", "cvode", "arkode", "bdf", "arkimex"]


@pytest.mark.parametrize("integrator", CONTROLLED)
def test_disks_that_fly_at_each_other_collide(integrator):
    sim = Simulation([[0, 0], [40, 0.1]], 1, velocities=[[1, 0], [-1, 0]], e_sp=100, integrator=integrator)
    sim.run(60)
    assert sim.velocities[0] == pytest.approx([-0.97, -0.245], abs=0.01)


@pytest.mark.parametrize("integrator", CONTROLLED)
def test_a_wall_that_moves_hits_a_disk_at_rest(integrator):
    walls = pliant.Walls(2)
    walls.half_space((-30, 0), (1, 0), velocity=(5, 0))
    sim = Simulation([[0, 0]], 1, walls=walls, e_sp=100, e_w=100, integrator=integrator)
    sim.run(20)
    assert sim.velocities[0] == pytest.approx([10, 0], abs=0.1)


@pytest.mark.parametrize("integrator", CONTROLLED)
def test_a_disk_that_falls_from_rest_hits_the_floor(integrator):
    walls = pliant.Walls(2)
    walls.half_space((0, 0), (0, 1))
    sim = Simulation([[0, 200]], 1, walls=walls, gravity=(0, -1), e_w=1000, integrator=integrator)
    sim.run(30)  # the floor at t = 20, at a speed of 20
    assert sim.velocities[0] == pytest.approx([0, 10], abs=0.2)


@pytest.mark.parametrize("integrator", ["rk", "cvode"])
def test_a_disk_without_inertia_stops_at_the_floor(integrator):
    walls = pliant.Walls(2)
    walls.half_space((0, 0), (0, 1))
    sim = Simulation([[0, 50]], 1, walls=walls, gravity=(0, -1), dynamics="overdamped", zeta=1, e_w=100, integrator=integrator)
    sim.run(100)
    assert sim.positions[0, 1] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("integrator", ["rk", "cvode", "arkode"])
def test_controlled_steps_in_other_units(integrator):
    """The default tolerances and the longest step follow the diameters: the flow is the same in each unit of length."""
    def energies(length):
        rng = np.random.default_rng(2)
        x = np.stack(np.meshgrid(np.arange(4), np.arange(4)), -1).reshape(-1, 2) * 0.95
        sim = Simulation(x * length, length, velocities=rng.normal(size=x.shape) * length, e_sp=100 * length**4, integrator=integrator)
        before = sum(sim.energies.values())
        sim.run(2)
        return before / length**4, sum(sim.energies.values()) / length**4, sim.positions / length

    before, after, x = energies(1)
    assert after == pytest.approx(before, rel=0.01)
    for length in (1e-5, 1e4):
        other_before, other_after, other = energies(length)
        assert other_before == pytest.approx(before) and other_after == pytest.approx(before, rel=0.01)
        assert np.abs(other - x).max() < 0.05


def test_the_longest_step_of_the_user_is_the_longest():
    sim = Simulation([[0, 0], [40, 0.1]], 1, velocities=[[1, 0], [-1, 0]], e_sp=100, integrator="rk", ts_adapt_dt_min=0.006, ts_adapt_dt_max=0.01)
    steps = []
    sim.run(1, lambda sim: steps.append(sim.t))
    assert np.diff(steps).max() == pytest.approx(0.01)


def test_light_vertices_have_no_looser_tolerance():
    polygons = pliant.regular_polygons([[0, 0], [3, 0.2]], [1, 1], 16)
    sim = Simulation(polygons=polygons, model="smooth", integrator="rk", velocities=np.repeat([[1.0, 0], [-1, 0]], 16, axis=0))
    before = sum(sim.energies.values())
    sim.run(3)
    assert sum(sim.energies.values()) == pytest.approx(before, rel=0.01)


def test_energy_of_few_controlled_steps_is_judged():
    sim = Simulation([[0, 0], [5, 0.1]], 1, velocities=[[1, 0], [-1, 0]], e_sp=1e12, integrator="cvode")
    with pytest.raises(pliant.NumericalError, match="energy"):
        sim.run(6)  # one collision, in 48 steps


# --- Particles that pass through each other


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("integrator", ["verlet", "rk"])
def test_particles_that_pass_through_each_other_end_the_run(dim, integrator):
    """In the step in which it happens."""
    def collide(**options):
        x, v = np.zeros((2, dim)), np.zeros((2, dim))
        x[1, 0], v[0, 0] = 1.5, 10
        return Simulation(x, 1, velocities=v, e_sp=1, integrator=integrator, dt=1e-3, **options)
    sim = collide()
    with pytest.raises(pliant.NumericalError, match=r"particles 0 and 1 overlap by 0\.9[5-9]\d* of their contact distance.*"
                                                    r"e_sp.*allow_passing_overlap"):
        sim.run(1)
    assert 0 < sim.positions[1, 0] - sim.positions[0, 0] < 0.05
    free = collide(allow_passing_overlap=True)
    free.run(1)
    assert free.positions[0, 0] > free.positions[1, 0]


@pytest.mark.parametrize("box", [None, (8, 8)])
@pytest.mark.parametrize("e_sp, speed, dt", [(1, 10, 0.05), (100, 10, None)])
def test_particles_that_pass_through_each_other_within_a_step_end_the_run(box, e_sp, speed, dt):
    """They never overlap by 95 % at the end of a step, whose energy is conserved to some percent."""
    x = [[-0.51, 1], [0.57, 1]] if box is None else [[7.49, 1], [0.57, 1]]
    def collide(**options):
        return Simulation(x, 1, velocities=[[speed, 0], [-speed, 0]], e_sp=e_sp, dt=dt, box=box, **options)
    with pytest.raises(pliant.NumericalError, match=r"particles 0 and 1 overlap by (0\.9[5-9]\d*|1) of their contact distance"):
        collide().run(0.4)
    free = collide(allow_passing_overlap=True)
    overlaps = []
    free.run(0.4, callback=lambda sim: overlaps.extend(sim.contacts["overlap"]))
    assert free.velocities[0, 0] > 0 and 0 < max(overlaps) < 0.95


def test_steps_one_by_one_find_particles_that_pass_through():
    """The checks continue from call to call, and begin again after a change."""
    walls = Walls()
    walls.line([(-5, 0), (5, 0)])
    for sim, message in [(Simulation([[-0.51, 1], [0.57, 1]], 1, velocities=[[10, 0], [-10, 0]], e_sp=100), "pass through"),
                         (Simulation([[0, 0.6]], 1, velocities=[[0, -30]], walls=walls, e_w=1, dt=0.001), "went through wall")]:
        with pytest.raises(pliant.NumericalError, match=message):
            for _ in range(200):
                sim.step()
    sim = Simulation([[0, 0.6], [3, 3]], 1, walls=walls)
    for _ in range(20):
        sim.step()
    sim.positions[0] = (0, -0.6)  # on the other side, and back
    for _ in range(20):
        sim.step()
    sim.positions[0] = (0, 0.6)
    sim.velocities[1] = (1e5, 0)
    with pytest.raises(pliant.NumericalError, match="in a step"):
        sim.step()


def test_particles_that_pass_each_other_across_a_periodic_border_end_the_run():
    sim = Simulation([[0.2, 1], [3.5, 1]], 1, velocities=[[-10, 0], [0, 0]], e_sp=1, dt=1e-3, box=(4, 4))
    with pytest.raises(pliant.NumericalError, match="particles 0 and 1 overlap by 0.9"):
        sim.run(1)


def test_particles_inside_each_other_are_refused():
    with pytest.raises(pliant.InputError, match="particles 0 and 1 overlap by 0.97 of their contact distance"):
        Simulation([[0, 0], [0.03, 0]], 1)
    with pytest.raises(pliant.InputError, match="particles 2 and 3 overlap by 0.99 "):  # the deepest
        Simulation([[0, 0], [0.03, 0], [5, 0], [5.01, 0]], 1)
    sim = Simulation([[0, 0], [0.03, 0]], 1, allow_passing_overlap=True)
    with pytest.raises(pliant.InputError, match="particles 1 and 2 overlap"):
        sim.set(allow_passing_overlap=False)
        sim.positions[1] = (3, 0)
        sim.add([[3.01, 0]], 1)
    with pytest.raises(pliant.NumericalError, match="particles 0 and 1 overlap"):
        sim.run(1, callback=lambda sim: sim.positions.__setitem__(1, sim.positions[0] + (0.02, 0)))


def test_a_minimum_with_particles_inside_each_other_is_refused():
    """Soft disks one above the other in a narrow slot, which do not carry their weight."""
    walls = floor()
    walls.half_space((-0.51, 0), (1, 0))
    walls.half_space((0.51, 0), (-1, 0))
    sim = Simulation([[0.005, 0.5], [-0.005, 1.4]], 1, walls=walls, gravity=(0, -1), e_sp=0.05)
    before = sim.positions.copy()
    with pytest.raises(pliant.NumericalError, match="particles 0 and 1 overlap by 0.9.*e_sp"):
        sim.minimize(force_tolerance=1e-6)
    np.testing.assert_array_equal(sim.positions, before)


def test_other_guards_of_the_scenarios():
    """A disk that edges of polygons cannot feel; a shortest controlled step above the limit of stability."""
    walls = Walls()
    walls.disk((0, 0), 0.05)
    with pytest.raises(pliant.InputError, match="use a polygon"):
        Simulation(polygons=pliant.regular_polygons([[0, 3]], 1, 8), walls=walls)
    with pytest.raises(pliant.InputError, match=r"ts_adapt_dt_min 1 is [0-9.]+ times the limit of stability, [0-9.e-]+ t0"):
        Simulation([[0, 0]], 1, integrator="rk", ts_adapt_dt_min=1.0)
    with pytest.raises(pliant.InputError, match=r"dt 1 is [0-9.]+ times the limit of stability, [0-9.e-]+ t0"):
        Simulation([[0, 0]], 1, integrator="rk", ts_adapt_type="none", dt=1.0)


def test_the_default_step_is_stable_for_the_method():
    """Velocity Verlet would allow a longer step. Without drag no step is stable."""
    pair = {"positions": [[0, 1], [2, 1]], "diameters": 1, "walls": floor(), "gravity": (0, -1)}
    verlet, ssp = Simulation(**pair, zeta=1), Simulation(**pair, zeta=1, integrator="ssp")
    assert 0 < ssp.dt < verlet.dt
    with pytest.raises(pliant.InputError, match="shorten it or leave it out"):
        Simulation(**pair, zeta=1, integrator="ssp", dt=verlet.dt)
    with pytest.raises(pliant.InputError, match="no step is stable"):
        Simulation(**pair, integrator="ssp")
