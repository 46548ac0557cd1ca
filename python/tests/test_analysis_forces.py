"""pliant.analysis: stress, fields, force chains, fabric and energy budget of known configurations."""

import re

import numpy as np
import pytest
from lattices import hexagonal, random_disks, square
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import write_run

from pliant import Run, RunError, analysis
from pliant.analysis import Particles


def loaded(part, force=1.0, distance=1.01):
    """The particles with a repulsion `force` between all that are closer than `distance`."""
    pairs = analysis.close_pairs(part, distance)
    vector = part.relative(pairs[:, 1], pairs[:, 0])
    unit = vector / np.linalg.norm(vector, axis=1)[:, None]
    return Particles(part.positions, part.radii, box=part.box, pairs=pairs, forces=np.reshape(force, (-1, 1)) * unit)


def line(count, force=1.0, floor=False):
    """Particles at x = 0 … count-1 that push each other along x; with `floor` walls 0 and 1 hold the ends."""
    pairs = [[k, k + 1] for k in range(count - 1)]
    forces = [[-force, 0.0]] * (count - 1)
    points = [[k + 0.5, 0.0] for k in range(count - 1)]
    if floor:
        pairs += [[0, -1], [count - 1, -1]]
        forces += [[force, 0.0], [-force, 0.0]]
        points += [[-0.5, 0.0], [count - 0.5, 0.0]]
    place = np.c_[np.arange(float(count)), np.zeros(count)]
    return Particles(place, 0.5, pairs=pairs, forces=forces, points=points, masses=np.ones(count),
                     velocities=np.zeros((count, 2)))


# ---- stress ------------------------------------------------------------------------------------------------------------

def test_stress_of_a_square_lattice():
    """Each contact carries f over a line of length a: pressure f/a."""
    part = loaded(square(6, 2.0), 3.0, 2.01)
    assert_allclose(analysis.mean_stress(part, kinetic=False), 1.5 * np.eye(2), atol=1e-12)
    each = analysis.particle_stress(part, 4.0)
    assert_allclose(each, np.broadcast_to(1.5 * np.eye(2), each.shape), atol=1e-12)
    assert_allclose(analysis.pressure(each), 1.5)
    assert_allclose(analysis.shear(each), 0, atol=1e-12)
    own = analysis.particle_stress(part)
    assert_allclose(own[0], 1.5 * 4 / np.pi * np.eye(2), atol=1e-12)


def test_stress_of_a_sheared_direction():
    """Contacts along x alone: σ_xx = f/a, the axis of the largest stress is x."""
    part = square(4)
    pairs = np.array([[i, i + 4 if i < 12 else i - 12] for i in range(16)])
    vector = part.relative(pairs[:, 1], pairs[:, 0])
    part = Particles(part.positions, 0.5, box=part.box, pairs=pairs, forces=2 * vector)
    stress = analysis.particle_stress(part, 1.0)
    assert_allclose(stress, np.broadcast_to([[2, 0], [0, 0]], stress.shape), atol=1e-12)
    values, axes = analysis.principal(stress)
    assert_allclose(values, np.tile([2, 0], (16, 1)), atol=1e-12)
    assert_allclose(np.abs(axes[:, 0]), np.tile([1, 0], (16, 1)), atol=1e-12)
    assert_allclose(analysis.shear(stress), 1)


def test_kinetic_stress_is_of_an_ideal_gas():
    velocity = np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]])
    part = Particles(np.random.default_rng(1).uniform(0, 2, (4, 2)), box=[2, 2], masses=[3] * 4, velocities=velocity + 7.0,
                     pairs=np.zeros((0, 2)), forces=np.zeros((0, 2)))
    # n m <v_x²> = 1·3·(2/4)
    assert_allclose(analysis.mean_stress(part), 1.5 * np.eye(2))


def test_kinetic_stress_is_relative_to_the_flow_of_steady_shear():
    rng = np.random.default_rng(3)
    place, thermal = rng.uniform(0, 10, (500, 2)), rng.normal(0, 0.5, (500, 2))
    given = {"masses": np.full(500, 0.2), "pairs": np.zeros((0, 2)), "forces": np.zeros((0, 2)), "box": [[0, -2], [10, 10]], "tilt": 1.0}
    flow = np.c_[0.3 * (place[:, 1] + 2), np.zeros(500)]
    part = Particles(place, 0.5, velocities=flow + thermal, shear_rate=0.3, **given)
    assert_allclose(analysis.mean_stress(part), 0.2 * thermal.T @ thermal / 100)
    with pytest.raises(ValueError, match=r"mean_stress: the box is tilted, .*; give shear_rate=, 0 for a box that does not shear, or use kin"):
        analysis.mean_stress(Particles(place, 0.5, velocities=flow + thermal, **given))
    at_rest = Particles(place, 0.5, velocities=thermal, shear_rate=0, **given)
    away = thermal - thermal.mean(0)
    assert_allclose(analysis.mean_stress(at_rest), 0.2 * away.T @ away / 100)
    with pytest.raises(ValueError, match="coarse_grained: the box shears at the rate 0.3"):
        analysis.coarse_grained(Particles(place, 0.5, velocities=flow, shear_rate=0.3, **given | {"tilt": None}), width=1.0)
    with pytest.raises(ValueError, match="shear_rate is 0.3; give the finite rate of a periodic box, and box="):
        Particles(place, shear_rate=0.3)


def test_particle_stresses_sum_to_the_mean_stress():
    part = loaded(random_disks(80, 8.0), 1.5, 1.0)
    total = analysis.particle_stress(part, 1.0).sum(0)
    assert_allclose(total, analysis.mean_stress(part, volume=1.0, kinetic=False), atol=1e-12)
    with pytest.raises(ValueError, match="no closed periodic box; give volume="):
        analysis.mean_stress(line(3))


def test_walls_load_the_particles_at_the_ends():
    stress = analysis.particle_stress(line(4, 2.0, floor=True), 1.0)
    assert_allclose(stress, np.broadcast_to([[2, 0], [0, 0]], stress.shape), atol=1e-12)
    free = analysis.particle_stress(line(4, 2.0), 1.0)
    assert_allclose(free[:, 0, 0], [1, 2, 2, 1])


def test_a_frame_has_the_stress_of_its_contacts(soft):
    with Run(soft[0]) as run:
        frame = run.frames[1]
        table = frame.contacts[frame.contacts["wall"] < 0]
        first, second = frame.centres[table["particle_1"]], frame.centres[table["particle_2"]]
        expected = np.einsum("ca,cb->ab", table[["fx", "fy"]].to_numpy(), first - second)
        stress = analysis.particle_stress(frame, 1.0)
        wall = frame.wall_contacts
        expected += np.einsum("ca,cb->ab", wall[["fx", "fy"]].to_numpy(),
                              frame.centres[wall["particle_1"]] - wall[["x", "y"]].to_numpy())
        assert_allclose(stress.sum(0), expected, atol=1e-9)


# ---- fields ------------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("dim", [2, 3])
def test_fields_sum_to_the_totals(dim):
    size = 8.0 if dim == 2 else 5.0
    part = loaded(random_disks(40, size, dim=dim), 1.0, 1.1)
    rng = np.random.default_rng(1)
    part = Particles(part.positions, part.radii, box=part.box, pairs=part.pairs, forces=part.forces,
                     masses=rng.uniform(1, 2, 40), velocities=rng.normal(size=(40, dim)))
    fields = analysis.coarse_grained(part, 0.6, 0.5)
    cell = (size / fields.number.shape[0]) ** dim
    tolerance = 1e-3 if dim == 3 else 1e-4
    assert_allclose(fields.number.sum() * cell, 40, rtol=tolerance)
    assert_allclose(fields.density.sum() * cell, part.masses.sum(), rtol=tolerance)
    assert_allclose(fields.fraction.sum() * cell, part.bodies.sum(), rtol=tolerance)
    assert_allclose((fields.density[..., None] * fields.velocity).reshape(-1, dim).sum(0) * cell,
                    part.masses @ part.velocities, rtol=2e-3, atol=1e-3)
    total = fields.contact_stress.reshape(-1, dim, dim).sum(0) * cell
    assert_allclose(total, analysis.mean_stress(part, 1.0, kinetic=False), rtol=2e-3, atol=1e-3)
    flux = fields.kinetic_stress + fields.density[..., None, None] * (fields.velocity[..., None] * fields.velocity[..., None, :])
    assert_allclose(flux.reshape(-1, dim, dim).sum(0) * cell,
                    np.einsum("n,na,nb->ab", part.masses, part.velocities, part.velocities), rtol=2e-3, atol=1e-3)
    assert fields.stress.shape == fields.number.shape + (dim, dim) and fields.pressure.shape == fields.number.shape


def test_fields_of_a_lattice_are_uniform():
    part = loaded(square(8), 3.0)
    part = Particles(part.positions, 0.5, box=part.box, pairs=part.pairs, forces=part.forces, masses=np.full(64, 2.0),
                     velocities=np.tile([0.0, -1.0], (64, 1)))
    fields = analysis.coarse_grained([part, part], 1.0)
    assert [len(axis) for axis in fields.axes] == [8, 8]
    assert_allclose(fields.density, 2, rtol=1e-4)
    assert_allclose(fields.fraction, np.pi / 4, rtol=1e-4)
    assert_allclose(fields.velocity[..., 1], -1)
    assert_allclose(fields.contact_stress, np.broadcast_to(3 * np.eye(2), (8, 8, 2, 2)), rtol=1e-4, atol=1e-4)
    assert_allclose(fields.kinetic_stress, 0, atol=1e-12)


def test_fields_are_averaged_over_equal_boxes_only():
    some = {"velocities": np.zeros((16, 2)), "masses": np.ones(16), "pairs": np.zeros((0, 2)), "forces": np.zeros((0, 2))}
    part, larger = (square(4, spacing, **some, time=time) for spacing, time in ((1.0, 0.0), (1.1, 3.0)))
    with pytest.raises(ValueError, match=r"the box is \[4.0, 4.0\] with origin \[0.0, 0.0\] in the first frame and \[4.4, 4.4\] .* at "
                                         "time 3; average frames with equal boxes"):
        analysis.coarse_grained([part, larger], width=1.0)
    opened = Particles(part.positions, 0.5, **some)
    with pytest.raises(ValueError, match="in the first frame and open at"):
        analysis.coarse_grained([part, opened], width=1.0)


def test_empty_space_has_no_stress():
    """A sum over a grid with empty space is the total, and the velocity is unknown there."""
    part = Particles([[1.0, 2.0], [1.9, 2.0]], 0.5, box=[20, 4], masses=[1, 1], velocities=np.zeros((2, 2)), pairs=[[0, 1]],
                     forces=[[-2.0, 0.0]])
    fields = analysis.coarse_grained(part, 0.4)
    total = fields.stress.sum((0, 1)) * 0.4**2
    assert_allclose(total, analysis.mean_stress(part, 1.0), rtol=1e-3, atol=1e-6)
    assert np.isnan(fields.velocity[25]).all() and (fields.pressure[25] == 0).all()


def test_field_of_one_contact():
    """Half way along the branch, and far along its line: an integral by quadrature."""
    from scipy.integrate import quad
    part = line(2, 3.0)
    fields = analysis.coarse_grained(part, 0.4, 0.1, region=((0, 0), (1, 1)))
    assert_allclose(fields.axes[0], np.linspace(0, 1, 11))
    for i, j in ((5, 0), (0, 0), (10, 8), (2, 3)):
        x, y = fields.axes[0][i], fields.axes[1][j]
        mean = quad(lambda s, x=x, y=y: np.exp(-((x - s) ** 2 + y**2) / 0.32) / (2 * np.pi * 0.16), 0, 1)[0]
        assert_allclose(fields.contact_stress[i, j], [[3 * mean, 0], [0, 0]], rtol=1e-9, atol=1e-12)
    gauss = np.exp(-(fields.axes[0] ** 2 + 0.25) / 0.32) / (2 * np.pi * 0.16)
    assert_allclose(fields.density[:, 5], gauss + gauss[::-1], rtol=1e-9)


def test_balance_of_momentum_at_every_point():
    """At rest the divergence of the stress is the force on the particles: zero inside a line that walls hold."""
    part = line(5, 1.0, floor=True)
    fields = analysis.coarse_grained(part, 0.3, 0.05, region=((1.5, -1), (2.5, 1)))
    slope = np.gradient(fields.contact_stress[..., 0, 0], 0.05, axis=0)[1:-1]
    assert np.abs(slope).max() < 1e-3 * fields.contact_stress.max()


def test_kinetic_stress_of_an_average_is_relative_to_the_mean_velocity():
    place = np.array([[0.5, 0.5]])
    parts = [Particles(place, 0.5, box=[1, 1], masses=[1], velocities=[[v, 0]], pairs=np.zeros((0, 2)), forces=np.zeros((0, 2)))
             for v in (1.0, 3.0)]
    fields = analysis.coarse_grained(parts, 0.2)
    assert_allclose(fields.velocity, np.broadcast_to([2, 0], fields.velocity.shape), atol=1e-12)
    assert_allclose(fields.kinetic_stress[..., 0, 0], fields.density)


@pytest.mark.parametrize("call, message", [
    (lambda: analysis.coarse_grained(line(3), 0), "width is 0; give a positive length"),
    (lambda: analysis.coarse_grained(line(3), 1.0), "has no volume; give region=(lower corner, upper corner)"),
    (lambda: analysis.coarse_grained(line(3), 1.0, 1e-4, region=((0, 0), (9, 9))), "give a larger one"),
    (lambda: analysis.coarse_grained(np.eye(3, 2), 1.0), "the particles have no masses; give Particles"),
    (lambda: analysis.force_chains(line(3), angle=0), "angle is 0 degrees; give more than 0, up to 90"),
    (lambda: analysis.force_distribution(Particles(np.eye(3, 2), pairs=np.zeros((0, 2)), forces=np.zeros((0, 2)))),
     "no pair has a force; use frames with contacts")])
def test_bad_input(call, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        call()


# ---- forces ------------------------------------------------------------------------------------------------------------

def test_pair_forces_join_the_contacts_of_a_pair():
    part = Particles([[0, 0], [1, 0], [0, 1]], pairs=[[0, 1], [1, 0], [2, 0], [2, -1]],
                     forces=[[-1, 0], [2, 1], [0, 3], [5, 5]], points=np.zeros((4, 2)))
    pairs, force, vector = analysis.pair_forces(part)
    assert_array_equal(pairs, [[0, 1], [0, 2]])
    assert_allclose(force, [[-3, -1], [0, -3]])
    assert_allclose(vector, [[-1, 0], [0, -1]])


def test_contacts_with_several_images_count_for_each():
    """Particle 1 touches 0 on both sides, and both touch their own images above and below."""
    part = Particles([[0.3, 0.5], [1.2, 0.5]], 0.5, box=[1.8, 0.9], pairs=[[0, 1], [1, 0], [0, 0], [1, 1]],
                     points=[[0.75, 0.5], [1.65, 0.5], [0.3, 0.95], [1.2, 0.05]],
                     arms=0.45 * np.array([[[-1, 0], [1, 0]], [[-1, 0], [1, 0]], [[0, -1], [0, 1]], [[0, 1], [0, -1]]]),
                     forces=[[-1, 0], [-1, 0], [0, -2], [0, 2]])
    pairs, force, vector = analysis.pair_forces(part)
    assert_array_equal(pairs, [[0, 0], [0, 1], [0, 1], [1, 1]])
    assert_allclose(force, [[0, 2], [-1, 0], [1, 0], [0, 2]])
    assert_allclose(vector, [[0, 0.9], [-0.9, 0], [0.9, 0], [0, 0.9]])
    assert_array_equal(analysis.coordination(part), [4, 4])
    assert_allclose(analysis.fabric(part), np.eye(2) / 2)
    near = analysis.touching(part)
    assert_array_equal(near.number, [4, 4])
    assert_allclose(near.sums(near.vectors), 0, atol=1e-12)
    assert_allclose(analysis.mean_stress(part, kinetic=False) * 1.62, [[1.8, 0], [0, 3.6]])
    assert_allclose(analysis.particle_stress(part, 0.81)[0] * 0.81, [[0.9, 0], [0, 1.8]])
    weak = Particles([[0.3, 0.5], [1.2, 0.5], [0.3, 1.5]], 0.5, box=[1.8, 5.0], pairs=[[0, 1], [1, 0], [0, 2]],
                     points=[[0.75, 0.5], [1.65, 0.5], [0.3, 1.0]], forces=[[-1, 0], [-1, 0], [0, -0.1]])
    assert analysis.force_chains(weak, least=2).chains[0].tolist() == [0, 1]
    assert analysis.force_clusters(weak)[1].tolist() == [2]


def test_contacts_whose_image_is_unknown_are_refused():
    contact = {"pairs": [[0, 1]], "forces": [[-1, 0]]}
    part = Particles([[0.3, 0.5], [1.2, 0.5]], 0.5, box=[1.8, 5.0], **contact)
    for function in (analysis.touching_pairs, analysis.pair_forces, analysis.particle_stress, analysis.coordination):
        with pytest.raises(ValueError, match=r"particles 0 and 1 touch, .* vector is 0.9\); give points=, or use a frame"):
            function(part)
    assert len(analysis.touching_pairs(Particles(part.positions, 0.5, box=part.box, points=[[0.75, 0.5]], **contact))) == 1
    with pytest.raises(ValueError, match="give arms="):
        analysis.touching_pairs(Particles(part.positions, 0.5, box=[0.98, 5.0], points=[[0.75, 0.5]], **contact))
    with pytest.raises(ValueError, match="particles 0 and 0 touch, .* give points="):
        analysis.coordination(Particles([[0.3, 0.5]], box=[0.9, 5.0], pairs=[[0, 0]]))


def test_force_distribution():
    part = loaded(hexagonal(6, 6))
    table = analysis.force_distribution(part, bins=5, f_max=2.0)
    assert_allclose(table["density"], [0, 0, 1 / 0.4, 0, 0])
    assert_array_equal(table["pairs"], [0, 0, 108, 0, 0])
    assert_allclose(analysis.participation(part), 1)
    force = np.random.default_rng(1).exponential(size=108)
    drawn = loaded(hexagonal(6, 6), force)
    table = analysis.force_distribution([drawn, part], bins=400, f_max=20.0)
    assert_allclose((table["density"] * 0.05).sum(), 1)
    assert_allclose((table["density"] * table["f"] * 0.05).sum(), 1, atol=0.03)
    assert_allclose(analysis.participation(drawn), force.mean() ** 2 / (force**2).mean())
    one = loaded(hexagonal(6, 6), np.r_[1.0, np.zeros(107)])
    assert_allclose(analysis.participation(one), 1 / 108)


def test_fabric():
    assert_allclose(analysis.fabric(loaded(hexagonal(6, 6))), np.eye(2) / 2, atol=1e-12)
    assert_allclose(analysis.fabric(line(4, floor=True)), [[1, 0], [0, 0]])
    cross = Particles([[0, 0], [1, 0], [0, 1]], pairs=[[0, 1], [0, 2]], forces=[[-3, 0], [0, -1]])
    assert_allclose(analysis.fabric(cross), np.eye(2) / 2)
    assert_allclose(analysis.fabric(cross, weighted=True), np.diag([0.75, 0.25]))


def crossing():
    """A strong line of 6 particles along x, and a weak one of 5 along y that crosses it at its third particle."""
    strong = np.c_[np.arange(6.0), np.zeros(6)]
    weak = np.c_[np.full(4, 2.0), [-2, -1, 1, 2]]
    pairs = [[k, k + 1] for k in range(5)] + [[6, 7], [7, 2], [2, 8], [8, 9]]
    forces = [[-10, 0]] * 5 + [[0, -0.1]] * 4
    pairs += [[0, -1], [5, -1]]
    forces += [[10, 0], [-10, 0]]
    points = [[k + 0.5, 0] for k in range(5)] + [[2, -1.5], [2, -0.5], [2, 0.5], [2, 1.5], [-0.5, 0], [5.5, 0]]
    return Particles(np.r_[strong, weak], 0.5, pairs=pairs, forces=forces, points=points)


def test_force_chains():
    found = analysis.force_chains(crossing())
    assert len(found.chains) == 1
    assert_array_equal(found.chains[0], np.arange(6))
    assert_array_equal(found.label, [0] * 6 + [-1] * 4)
    assert_array_equal(found.lengths, [6])
    assert_allclose(found.fraction, 0.6)
    assert_allclose(found.share, 60 / (60 + 0.05 * 2 + 0.1 * 2))
    assert len(analysis.force_chains(crossing(), least=7).chains) == 0
    # At a bend of 60 degrees the axis is 30 degrees from both contacts. The ends bear half of the others' stress.
    place = np.array([[0, 0], [1, 0], [2, 0], [2.5, np.sqrt(3) / 2], [3, np.sqrt(3)], [9, 9], [9, 10]])
    pairs = np.array([[k, k + 1] for k in range(4)] + [[5, 6]])
    bent = Particles(place, 0.5, pairs=pairs, forces=(place[pairs[:, 0]] - place[pairs[:, 1]]) * [[5], [5], [5], [5], [0.1]])
    assert [chain.tolist() for chain in analysis.force_chains(bent, angle=31).chains] == [[1, 2, 3]]
    assert analysis.force_chains(bent, angle=29).chains == []
    none = analysis.force_chains(Particles(np.eye(3, 2), pairs=np.zeros((0, 2)), forces=np.zeros((0, 2)), radii=0.5))
    assert none.chains == [] and np.isnan(none.fraction)


def test_particles_follow_the_best_contact():
    """Two contacts on the right of particle 1: the chain takes the one along the axis."""
    place = np.array([[0, 0], [1, 0], [2, 0], [1.8, 0.6], [3, 0], [9, 9], [9, 8]])
    pairs = np.array([[0, 1], [1, 2], [1, 3], [2, 4], [5, 6]])
    force = np.array([5, 5, 1.5, 5, 0.1])[:, None] * (place[pairs[:, 0]] - place[pairs[:, 1]])
    found = analysis.force_chains(Particles(place, 0.5, pairs=pairs, forces=force))
    assert_array_equal(found.label[[1, 2]], [0, 0])
    assert found.label[3] == -1


def test_a_ring_is_a_chain():
    angle = np.arange(12) * np.pi / 6
    place = np.c_[np.cos(angle), np.sin(angle)] * 2
    place = np.r_[place, [[9, 9], [9, 8]]]
    pairs = np.r_[[[k, (k + 1) % 12] for k in range(12)], [[12, 13]]]
    force = np.r_[np.full(12, 5.0), 0.1][:, None] * (place[pairs[:, 0]] - place[pairs[:, 1]])
    found = analysis.force_chains(Particles(place, 0.5, pairs=pairs, forces=force))
    assert [len(chain) for chain in found.chains] == [12]


def test_force_clusters():
    label, sizes = analysis.force_clusters(crossing())
    assert_array_equal(label, [0] * 6 + [-1] * 4)
    assert_array_equal(sizes, [6])
    label, sizes = analysis.force_clusters(crossing(), 0.0)
    assert_array_equal(sizes, [10])
    part = Particles(np.c_[np.arange(6.0), np.zeros(6)], pairs=[[0, 1], [2, 3], [3, 4]], forces=[[-1, 0]] * 3)
    label, sizes = analysis.force_clusters(part)
    assert_array_equal(label, [1, 1, 0, 0, 0, -1])
    assert_array_equal(sizes, [3, 2])


@pytest.mark.parametrize("model", ["soft", "rough", "soft3d"])
def test_frames_of_a_run(model, request):
    with Run(request.getfixturevalue(model)[0]) as run:
        frame = run.frames[1]
        fields = analysis.coarse_grained(run.frames[:1], 1.0)
        assert fields.density.ndim == run.dim and (fields.velocity[fields.density > 0.1][:, -1] < 0).all()
        assert len(analysis.force_distribution(run)) == 50 and 0 < analysis.participation(frame) < 1
        assert_allclose(np.trace(analysis.fabric(frame)), 1)
        chains = analysis.force_chains(frame)
        assert chains.label.shape == (run.topology.particles,) and (chains.lengths >= 3).all()
        assert analysis.force_clusters(frame)[1].sum() > 0


# ---- energy ------------------------------------------------------------------------------------------------------------

def test_energy_budget(tmp_path):
    import h5py
    path, truth = write_run(tmp_path / "run", n=20)
    with h5py.File(path / "run.h5", "r+") as file:
        time = file["series/time"][()]
        file["series/heat"] = 2 * time
        file["series/disk_contact_sliding"] = 0.5 * time
    with Run(path) as run:
        table = analysis.energy_budget(run)
        assert table.columns.tolist() == ["time", "kinetic_energy", "heat", "disk_contact_sliding", "dissipation_rate"]
        assert_allclose(table["dissipation_rate"], 2)
        assert_array_equal(table["kinetic_energy"], truth["series"]["kinetic_energy"])
    with h5py.File(path / "run.h5", "r+") as file:
        del file["series/heat"], file["series/disk_contact_sliding"], file["series/kinetic_energy"]
    with Run(path) as run, pytest.raises(RunError, match="no columns of energy; repeat it"):
        analysis.energy_budget(run)
