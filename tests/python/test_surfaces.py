"""Simulations of closed surfaces (deformable particles in 3D) that Python builds."""

import numpy as np
import pytest

import pliant
import pliant.analysis
from pliant import Mesh, Simulation, Walls

BALL = Mesh.icosphere(12)
CUBE = Mesh([(x, y, z) for x in (0, 2) for y in (0, 2) for z in (0, 2)],
            [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7),
             (1, 7, 3)])
SHAPE = {"k_v": 300, "k_a": 20, "k_l": 30, "k_b": 0.5, "gamma": 0.2}
CONTACTS = {"rough": {"e_c": 200, "mu": 0.3}, "smooth": {"e_c": 50, "mu": 0.3}}

TERMS = {"rough": ["rough"], "smooth": ["contact_vertex", "contact_edge"]}


def turn(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def pair(distance=0.93, mesh=BALL, size=1.0):
    """Two distorted surfaces that touch."""
    rng = np.random.default_rng(1)
    placed = mesh.placed([[0, 0, 0], [0.1, 0, distance]], size, [turn(2), turn(3)])
    return [surface + 0.01 * rng.normal(size=surface.shape) for surface in placed]


def touching(model, shift=0.0, **options):
    """The pair at the largest distance at which all contact terms act."""
    options = {"mesh": BALL, "model": model, "diameters": 0.15 if model == "smooth" else None, **SHAPE, **CONTACTS[model], **options}
    for distance in np.arange(1.4, 0.9, -0.01):
        sim = Simulation(surfaces=[surface + shift for surface in pair(distance)], **options)
        if all(sim.energies[name] > 1e-3 for name in TERMS[model]):
            return sim
    raise AssertionError("no contact")


# --- Meshes


def test_meshes(tmp_path):
    assert CUBE.volume == pytest.approx(8) and CUBE.area == pytest.approx(24) and CUBE.shape_parameter == pytest.approx(np.sqrt(6 / np.pi))
    assert BALL.vertices.shape == (12, 3) and BALL.faces.shape == (20, 3) and BALL.volume == pytest.approx(np.pi / 6)
    text = ["OFF 8 12 0", *(" ".join(map(str, r)) for r in CUBE.vertices), *(f"3 {a} {b} {c}" for a, b, c in CUBE.faces)]
    (tmp_path / "cube.off").write_text("\n".join(text), encoding="utf-8")
    again = Mesh.read(tmp_path / "cube.off")
    assert np.array_equal(again.vertices, CUBE.vertices) and np.array_equal(again.faces, CUBE.faces)
    small, large = CUBE.placed([[1, 2, 3], [4, 5, 6]], [1, 2], [np.eye(3), turn(5)])
    assert small.mean(axis=0) == pytest.approx([1, 2, 3]) and large.mean(axis=0) == pytest.approx([4, 5, 6])
    assert np.linalg.norm(large[1] - large[0]) == pytest.approx(np.cbrt(np.pi * 8 / 6))


@pytest.mark.parametrize("make, words", [
    (lambda: Mesh(CUBE.vertices, CUBE.faces[1:]), "open"), (lambda: Mesh(CUBE.vertices, CUBE.faces[:, ::-1]), "signed volume"),
    (lambda: Mesh(np.concatenate([CUBE.vertices, CUBE.vertices + 5]), np.concatenate([CUBE.faces, CUBE.faces + 8])), "2 separate parts"),
    (lambda: Mesh(CUBE.vertices * [1, 1, 0.01], [[0, 1, 2]]), "faces"), (lambda: Mesh.icosphere(13), "12, 42"), (lambda: Mesh.icosphere(2.5), "integer"),
    (lambda: Mesh(CUBE.vertices, CUBE.faces * 1.0), "no integers"), (lambda: Mesh(CUBE.vertices[:, :2], CUBE.faces), "vertices"),
    (lambda: Mesh(CUBE.vertices, CUBE.faces[:, :2]), "faces"), (lambda: Mesh.read("no-such.off"), "no-such"),
    (lambda: CUBE.placed([[0, 0]]), "centres"), (lambda: CUBE.placed([[0, 0, 0]], 1, [1]), "rotations")])
def test_bad_meshes(make, words):
    with pytest.raises(pliant.InputError, match=words):
        make()


# --- Energies and forces


@pytest.mark.parametrize("model", ["rough", "smooth"])
def test_forces_are_the_derivatives_of_the_energies(model):
    sim = touching(model)
    energies, forces, start = sim.energies, sim.term_forces, sim.positions.copy()
    assert {name for name, e in energies.items() if e} >= {"volume", "area", "edge", "bending", "tension"}
    names = TERMS[model]
    direction = np.random.default_rng(4).normal(size=start.shape)
    h = 1e-6
    for name in [*names, "volume", "area", "edge", "bending", "tension"]:
        e = []
        for sign in (1, -1):
            sim.positions = start + sign * h * direction
            e.append(sim.energies[name])
        assert (e[0] - e[1]) / (2 * h) == pytest.approx(-np.sum(forces[name] * direction), rel=1e-6, abs=1e-7), name
    total = sum(forces[name] for name in names)
    assert np.abs(total.sum(axis=0)).max() < 1e-12 * np.abs(total).max()
    assert sim.contacts.force.max() > 0


def test_volumes_faces_and_views():
    surfaces = pair(2.0)
    sim = Simulation(surfaces=surfaces, mesh=BALL, **SHAPE)
    assert repr(sim) == "<Simulation of 2 particles (rough, 3D) at t = 0>"
    assert np.array_equal(sim.surfaces[1], surfaces[1]) and np.shares_memory(sim.surfaces[1], sim.positions)
    assert np.array_equal(sim.faces, np.concatenate([BALL.faces, BALL.faces + 12]))
    assert sim.volumes == pytest.approx([Mesh(s, BALL.faces).volume for s in surfaces])
    assert sim.masses == pytest.approx(sim.volumes)  # density 1; the shapes given have their rest volumes
    assert sim.energies["volume"] == pytest.approx(0, abs=1e-20)
    edges = np.linalg.norm(BALL.vertices[0] - BALL.vertices[11]) * np.cbrt(sim.volumes / BALL.volume)
    assert sim.diameters == pytest.approx(edges)
    assert sim.particles().volumes == pytest.approx(sim.volumes)
    with pytest.raises(pliant.UsageError, match="no faces"):
        Simulation([[0, 0, 0]], 1).faces


def test_rest_shapes():
    """Surfaces in the shape of the mesh are at rest, also of other sizes; with a larger shape parameter they are not."""
    placed = CUBE.placed([[0, 0, 0], [3, 0, 0]], [1, 1.3])
    at_rest = {"k_v": 100, "k_a": 10, "k_l": 10, "k_b": 1, "rest_angles": True, "model": "smooth"}
    sim = Simulation(surfaces=placed, mesh=CUBE, **at_rest)
    assert sum(sim.energies.values()) < 1e-20
    sim = Simulation(surfaces=placed, mesh=CUBE, shape_parameter=1.5, **at_rest)
    assert sim.energies["edge"] > 0.01 and sim.energies["volume"] < 1e-20
    sim = Simulation(surfaces=placed, mesh=[CUBE, CUBE], a0=0.5, **at_rest)
    assert sim.energies["volume"] == pytest.approx(50 * np.sum((np.pi / 6 * np.array([1, 1.3]) ** 3 - 0.5) ** 2))


# --- Motion


@pytest.mark.parametrize("model", ["rough", "smooth"])
def test_a_collision_conserves_energy_and_momentum(model):
    surfaces = pair(1.5)
    v = np.repeat([[0, 0, 1.0], [0, 0, -1.0]], 12, axis=0)
    sim = Simulation(surfaces=surfaces, mesh=BALL, velocities=v, model=model, **SHAPE, e_c=20, diameters=0.15 if model == "smooth" else None,
                     dt=2e-4)
    energy, momentum = sum(sim.energies.values()), sim.masses @ sim.centre_velocities
    overlaps = []
    sim.run(1.2, callback=lambda s: overlaps.append(len(s.contacts)), every=0.05)
    assert max(overlaps) > 0 and sim.centre_velocities[0, 2] < 0 < sim.centre_velocities[1, 2]
    assert sum(sim.energies.values()) == pytest.approx(energy, rel=2e-3)
    assert sim.masses @ sim.centre_velocities == pytest.approx(momentum, abs=1e-12)


@pytest.mark.parametrize("model", ["rough", "smooth"])
def test_particles_on_a_floor_in_a_packed_container(model):
    container = pliant.Container(width=1, wall_distance=4)
    sizes = pliant.diameters(10, seed=2)
    packed = container.pack(sizes, dim=3, fraction=0.4, n_vertices=12)
    assert [len(surface) for surface in packed] == [12] * 10
    sim = Simulation(surfaces=packed, mesh=BALL, walls=container, gravity=(0, 0, -1), zeta=0.5, model=model, e_c=50, e_w=50, **SHAPE)
    assert sim.volumes == pytest.approx(np.pi / 6 * sizes**3)
    before = sim.centres[:, 2].mean()
    forces = []
    sim.run(1.5, callback=lambda s: forces.append(np.abs(s.wall_forces).max()), every=0.02)
    assert sim.centres[:, 2].mean() < before - 0.2 and max(forces) > 0.1
    cubes = container.pack(sizes, dim=3, fraction=0.4, mesh=CUBE)
    Simulation(surfaces=cubes, mesh=CUBE, model=model, walls=container, rest_angles=True).step(3)


def test_a_periodic_box():
    """A pair across the border has the forces of the same pair inside the box."""
    for model in ("rough", "smooth"):
        middle, border = (touching(model, np.array(shift), box=(4, 4, 4)) for shift in ([1, 1, 1], [1, 1, 3.4]))
        assert border.forces == pytest.approx(middle.forces, abs=1e-10)
    box = pliant.Box((4, 4, 4))
    packed = box.pack(np.ones(8), n_vertices=12)
    sim = Simulation(surfaces=packed, mesh=BALL, model="smooth", box=box, **SHAPE)
    minimum = sim.minimize(force_tolerance=1e-6, must_converge=False)
    assert minimum.energy < 8 * (SHAPE["k_b"] * 7.7 + SHAPE["gamma"] * np.pi * 1.2)


@pytest.mark.parametrize("model, options", [("rough", {}), ("smooth", {"e_c": 0.05, "edge_width": 0.3})])
def test_a_packing(model, options, tmp_path):
    """No forces at the minimum; the pressure is the derivative of the energy by the volume; lattice vectors change nothing."""
    run = pliant.pack(model=model, dim=3, n=5, n_vertices=12, size_distribution="mono", pressure=0.05, start_pressure=0.05,
                      force_tolerance=1e-7, output=tmp_path / "run", **options)
    frame, edge = run.frames[-1], np.linalg.norm(BALL.vertices[0] - BALL.vertices[11])
    lengths, start = np.full(3, np.cbrt(run.series["volume"].iloc[-1])), np.split(frame.positions, 5)
    terms = {"k_v": 10, "k_a": 1, "k_l": 1, "k_b": 0, "e_c": options.get("e_c", 1)}

    def simulation(stretch=np.eye(3), cells=0):
        """All points and the box are stretched; particle 2 is in another cell."""
        surfaces = [(x + (cells * lengths[0] if m == 2 else 0)) @ stretch for m, x in enumerate(start)]
        return Simulation(surfaces=surfaces, mesh=BALL, a0=np.pi / 6, model=model, box=tuple(np.diag(stretch) * lengths),
                          diameters=0.3 * edge if model == "smooth" else None, **terms)

    sim = simulation()
    assert sum(sim.energies.values()) == pytest.approx(run.series["energy"].iloc[-1], rel=1e-9)
    assert np.abs(sim.forces).max() < 1.1 * 0.05e-7
    for direction in range(3):
        e, h = np.zeros((3, 3)), 1e-6
        e[direction, direction] = h
        up, down = (sum(simulation(np.eye(3) + sign * e).energies.values()) for sign in (1, -1))
        stress = run.vector_series["stress"][-1][[0, 3, 5]]
        assert (up - down) / (2 * h) / lengths.prod() == pytest.approx(stress[direction], rel=1e-5)
    assert stress.mean() == pytest.approx(-0.05, rel=1e-5)
    shifted = simulation(cells=np.array([1, -2, 1]))
    assert shifted.forces == pytest.approx(sim.forces, abs=1e-11) and sum(shifted.energies.values()) == pytest.approx(sum(sim.energies.values()), rel=1e-12)


def test_threads_change_no_bit():
    centres = np.stack(np.meshgrid(*[np.arange(6) * 1.1] * 3, indexing="ij"), -1).reshape(-1, 3)
    mesh = Mesh.icosphere(42)
    ends = []
    for threads in (1, 2):
        sim = Simulation(surfaces=mesh.placed(centres, 1, [turn(k) for k in range(len(centres))]), mesh=mesh, model="smooth", diameters=0.15,
                         threads=threads, **SHAPE, e_c=10)
        sim.step(30)
        ends.append(sim.positions.copy())
    assert len(sim.positions) > 8000 and len(sim.contacts) > 5 and np.array_equal(*ends)


def test_surfaces_are_added_and_removed():
    sim = Simulation(surfaces=BALL.placed([[0, 0, 0], [2, 0, 0]]), mesh=BALL, model="smooth", **SHAPE)
    sim.add(surfaces=CUBE.placed([[0, 3, 0]]), mesh=CUBE)
    sim.step(5)
    sim.remove([0])
    assert list(sim.ids) == [1, 2] and [len(s) for s in sim.surfaces] == [12, 8]
    assert np.array_equal(sim.faces, np.concatenate([BALL.faces, CUBE.faces + 12]))
    alone = Simulation(surfaces=[s.copy() for s in sim.surfaces], mesh=[BALL, CUBE], a0=np.pi / 6, model="smooth", velocities=sim.velocities, **SHAPE)
    assert alone.forces == pytest.approx(sim.forces, rel=1e-12)
    sim.step(5)


def test_runs_in_parts_are_the_same_bit_for_bit(tmp_path):
    def make(folder):
        return Simulation(surfaces=[*pair(1.15), *CUBE.placed([[0, 2, 0]])], mesh=[BALL, BALL, CUBE], shape_parameter=1.4, model="smooth",
                          output=folder, frame_interval=0.1, **SHAPE, e_c=20)

    whole = make(tmp_path / "whole")
    whole.run(0.3)
    parts = make(tmp_path / "parts")
    parts.run(0.1)
    parts.save()
    parts.run(0.05)
    parts._core.close()
    again = Simulation.restart(tmp_path / "parts")
    again.run(until=whole.t)
    assert np.array_equal(again.positions, whole.positions) and np.array_equal(again.velocities, whole.velocities)
    assert np.array_equal(again.faces, whole.faces)
    volumes = whole.volumes
    whole.close(), again.close()
    run = pliant.Run(tmp_path / "whole")
    assert len(run.frames) > 3 and run.frames[-1].volume == pytest.approx(volumes)
    assert np.array_equal(run.topology.faces[-12:], CUBE.faces + 24)
    assert run.report().stat().st_size > 1000


def test_frames_start_other_runs(tmp_path):
    """A run of the hopper from a frame of a simulation."""
    container = pliant.Container(width=2, wall_distance=4)
    packed = container.pack(np.ones(6), dim=3, fraction=0.4, mesh=CUBE)
    with Simulation(surfaces=packed, mesh=CUBE, model="smooth", walls=container, gravity=(0, 0, -1), zeta=0.3, output=tmp_path / "sim") as sim:
        sim.step(20)
        end = sim.positions.copy()
    run = pliant.hopper(start=tmp_path / "sim/run.h5", model="smooth", dim=3, hopper_width=2, hopper_wall_distance=4, zeta=0.3, t_end=0.01,
                        output=tmp_path / "run")
    assert np.array_equal(run.frames[0].positions, end)
    assert np.array_equal(run.topology.faces, np.concatenate([CUBE.faces + 8 * k for k in range(6)]))


def test_hessian():
    sim = touching("smooth")
    sim.set(mu=0)
    start, h = sim.positions.copy(), 1e-6
    direction = np.random.default_rng(4).normal(size=start.shape)
    forces = []
    for sign in (1, -1):
        sim.positions = start + sign * h * direction
        forces.append(sim.forces.copy())
    sim.positions = start
    assert sim.hessian() @ direction.ravel() == pytest.approx(-(forces[0] - forces[1]).ravel() / (2 * h), rel=1e-4, abs=1e-3)


def test_analysis_and_drawing():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    sim = touching("rough")
    assert np.isfinite(pliant.analysis.mean_stress(sim, volume=8)).all()
    for color in ("speed", "contacts", "size", "area", "shape"):
        axes = sim.draw(color)
        assert axes.collections and len(axes.collections[-1].get_paths()) > 4
        matplotlib.pyplot.close(axes.figure)
    for model in ("rough", "smooth"):
        axes = touching(model).draw()
        assert axes.get_title().startswith(f"{model} surfaces, ")
        matplotlib.pyplot.close(axes.figure)


# --- Errors


@pytest.mark.parametrize("changes, words", [
    ({"mesh": None}, "need a mesh"), ({"mesh": [BALL]}, "one for each of the 2"), ({"mesh": CUBE}, "12 vertices, but its mesh has 8"), ({"mesh": 3}, "mesh"),
    ({"l0": 1}, "l0"), ({"a0": -1}, "a0"), ({"a0": [1, 2, 3]}, "a0"), ({"shape_parameter": 1.05}, "shape parameter"), ({"diameters": 0}, "diameter"),
    ({"surfaces": []}, "no surfaces"), ({"surfaces": [[0, 1]]}, "surfaces"), ({"surfaces": [s[:, :2] for s in pair()]}, "surfaces"),
    ({"surfaces": [-s for s in pair(2)]}, "signed volume"), ({"surfaces": [s * np.nan for s in pair()]}, "nan"), ({"model": "sp"}, "closed surfaces"),
    ({"model": "disk"}, "closed surfaces"), ({"surfaces": pair(0.5)}, "pierces particle"),
    ({"surfaces": [pair()[0], 0.1 * pair()[0]]}, "is inside particle 0"), ({"bending_edges": "full"}, "bending_edges .* in 3D"),
    ({"positions": [[0, 0, 0]]}, "positions"), ({"velocities": np.zeros((3, 3))}, "velocities")])
def test_bad_surfaces(changes, words):
    with pytest.raises(pliant.PliantError, match=words):
        Simulation(**{"surfaces": pair(2), "mesh": BALL, "model": "smooth", **changes})


def test_surfaces_that_pierce_each_other_end_the_run():
    v = np.repeat([[0, 0, 3.0], [0, 0, -3.0]], 12, axis=0)
    sim = Simulation(surfaces=pair(1.3), mesh=BALL, velocities=v, model="smooth", e_c=1e-4, **SHAPE)
    with pytest.raises(pliant.NumericalError, match="pierces face .* raise e_c"):
        sim.run(0.3)


@pytest.mark.parametrize("model", ["rough", "smooth"])
def test_a_particle_written_into_another_one_ends_the_run(model):
    for ids in ((0, 1), (1, 0)):
        sim = Simulation(surfaces=pair(3), mesh=BALL, model=model, dt=1e-5, **SHAPE)
        sim.step(1)
        outer, inner = ids
        sim.surfaces[inner][:] = sim.surfaces[outer].mean(axis=0) + 0.1 * (sim.surfaces[inner] - sim.surfaces[inner].mean(axis=0))
        with pytest.raises(pliant.NumericalError, match=f"particle {inner} is inside particle {outer}: raise e_c"):
            sim.run(1e-3)
    free = Simulation(surfaces=[pair()[0], 0.1 * pair()[0]], mesh=BALL, model="shape", a0=np.pi / 6, dt=1e-5, **SHAPE)
    free.step(1)  # without contacts


def test_other_particles_take_no_mesh():
    with pytest.raises(pliant.InputError, match="belong to surfaces"):
        Simulation([[0, 0, 0]], 1, mesh=BALL)
    with pytest.raises(pliant.InputError, match="closed surfaces"):
        Simulation([[0, 0, 0]], 1, model="rough")
    with pytest.raises(pliant.InputError, match="k_v .* in 2D"):
        Simulation(polygons=pliant.regular_polygons([[0, 0]], 1, 8), model="rough", k_v=1)
