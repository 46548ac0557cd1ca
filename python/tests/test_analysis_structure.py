"""pliant.analysis: neighbours, g(r), S(k), Voronoi cells, coordination, rattlers and bond order of known configurations."""

import itertools
import re

import numpy as np
import pytest
from lattices import cubic, hexagonal, random_disks, square
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree

from pliant import Run, RunError, analysis
from pliant.analysis import Particles


def brute_pairs(particles, distance):
    return [(i, j) for i, j in itertools.combinations(range(particles.count), 2)
            if np.linalg.norm(particles.relative(np.array(i), np.array(j))) <= distance]


# ---- neighbours ------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("dim, box", [(2, True), (2, False), (3, True)])
def test_close_pairs_equal_all_pairs(dim, box):
    part = random_disks(60, 6.0, dim=dim, box=box)
    assert [tuple(p) for p in analysis.close_pairs(part, 1.3)] == brute_pairs(part, 1.3)


def test_a_box_with_one_open_side_and_an_origin():
    part = Particles([[-4.9, 0.0], [4.9, 0.0], [0.0, 9.0]], box=[[-5, 0], [10, np.inf]])
    assert_array_equal(analysis.close_pairs(part, 0.3), [[0, 1]])
    near = analysis.within(part, 0.3)
    assert_allclose(near.vectors, [[-0.2, 0], [0.2, 0]], atol=1e-12)
    assert_array_equal(near.number, [1, 1, 0])


def test_places_on_the_border_of_the_box():
    part = Particles([[0.0, 0.0], [4.0, 4.0], [4 - 1e-17, 2.0], [-1e-17, 2.5]], box=[4, 4])
    assert_array_equal(analysis.close_pairs(part, 0.6), [[0, 1], [2, 3]])


def test_absent_particles_have_no_neighbours():
    part = Particles([[0, 0], [1, 0], [np.nan, np.nan], [2, 0]], active=[True, True, False, True])
    assert_array_equal(analysis.within(part, 1.1).number, [1, 2, 0, 1])
    assert_array_equal(analysis.nearest(part, 1).number, [1, 1, 0, 1])


def test_nearest():
    part = random_disks(50, 8.0)
    near = analysis.nearest(part, 4)
    distance = np.linalg.norm(part.nearest_image(part.positions[None] - part.positions[:, None]), axis=2)
    expected = np.argsort(distance, axis=1)[:, 1:5]
    assert_array_equal(near.second.reshape(50, 4), expected)
    twice = analysis.nearest(Particles([[0, 0], [0, 0], [1, 0]]), 1)
    assert_array_equal(twice.second[:2], [1, 0])


def test_sums_and_padding():
    near = analysis.within(Particles([[0, 0], [1, 0], [2, 0]]), 1.1)
    assert_allclose(near.sums(near.vectors), [[1, 0], [0, 0], [-1, 0]])
    assert_allclose(near.sums(1j * near.vectors[:, 0]), [1j, 0, -1j])
    second, row, used = near.padded()
    assert_array_equal(second[used], near.second)
    assert_array_equal(used.sum(1), near.number)
    assert_array_equal(row[used], np.arange(4))


# ---- g(r) and S(k) -----------------------------------------------------------------------------------------------------

def test_g_of_a_lattice_has_its_shells():
    table = analysis.radial_distribution(square(20), r_max=2.31, bins=42)
    shells = {r: n for r, n in zip(table["r"].round(3), table["pairs"]) if n}
    assert list(shells.values()) == [1600, 1600, 1600, 3200]  # 4 neighbours at 1, at √2 and at 2, 8 at √5
    ring = 2 * np.pi * table["r"] * 0.055
    assert_allclose((table["g"] * ring).sum() * 399 / 400, 20)


@pytest.mark.parametrize("dim", [2, 3])
def test_g_of_random_places_is_one(dim):
    parts = [random_disks(400, 10.0 if dim == 2 else 7.0, seed, dim) for seed in range(10)]
    table = analysis.radial_distribution(parts, r_max=2.0, bins=8)
    assert_allclose(table["g"], 1, atol=5 / np.sqrt(table["pairs"].min()))


def test_g_of_an_open_region_has_no_effect_of_its_border():
    parts = [random_disks(400, 10.0, seed, box=False) for seed in range(20)]
    table = analysis.radial_distribution(parts, r_max=2.0, bins=5, region=((0, 0), (10, 10)))
    assert_allclose(table["g"], 1, atol=0.04)
    with pytest.raises(ValueError, match="no particle is r_max = 6 inside the region .* give a smaller r_max"):
        analysis.radial_distribution(parts[0], r_max=6.0)
    with pytest.raises(ValueError, match="half the periodic box"):
        analysis.radial_distribution(square(4), r_max=3.0)


def test_s_of_a_lattice_has_its_bragg_peaks():
    part = square(8)
    table = analysis.structure_factor(part, k_max=6.5, bins=400, per_bin=10**6)
    at = np.argmax(table["S"])
    assert_allclose([table["k"][at], table["S"][at]], [2 * np.pi, 64])
    rest = table.drop(index=at)
    assert_allclose(rest["S"], 0, atol=1e-20)
    assert table["vectors"].sum() == sum(0 < np.hypot(i, j) * 2 * np.pi / 8 <= 6.5 for i in range(-9, 10)
                                         for j in range(-9, 10)) // 2


@pytest.mark.parametrize("dim", [2, 3])
def test_s_equals_the_direct_sum(dim):
    part = random_disks(30, 5.0, dim=dim)
    table = analysis.structure_factor(part, k_max=4.0, bins=3, per_bin=10**6)
    n = np.array(list(itertools.product(range(-4, 5), repeat=dim)))
    k = 2 * np.pi / 5 * n
    length = np.linalg.norm(k, axis=1)
    k, length = k[(length > 0) & (length <= 4)], length[(length > 0) & (length <= 4)]
    direct = np.abs(np.exp(-1j * k @ part.positions.T).sum(1)) ** 2 / 30
    bins = np.minimum((length / 4 * 3).astype(int), 2)
    used = np.unique(bins)
    assert_allclose(table["S"], [direct[bins == b].mean() for b in used])
    assert_allclose(table["k"], [length[bins == b].mean() for b in used])
    few = analysis.structure_factor(part, k_max=4.0, bins=3, per_bin=2)
    assert (few["vectors"] <= 2).all()


def test_s_of_random_places_is_one():
    parts = [random_disks(300, 10.0, seed) for seed in range(40)]
    table = analysis.structure_factor(parts, k_max=20, bins=5, per_bin=60)
    assert_allclose(table["S"], 1, atol=0.1)
    with pytest.raises(ValueError, match="k_max = 0.1 is below the smallest wave number"):
        analysis.structure_factor(parts[0], k_max=0.1)


def test_s_has_the_wave_vectors_of_the_box_of_each_frame():
    """Lattices have no scattering between their Bragg peaks, also as an average over boxes of different sizes."""
    parts = [square(20, spacing) for spacing in (1.0, 1.02, 1.0)]
    one, other, mean = (analysis.structure_factor(source, k_max=7.0, bins=10, per_bin=10**6) for source in (*parts[:2], parts))
    assert_allclose(mean["S"].drop(index=8), 0, atol=1e-20)
    weight = 2 * one["vectors"] + other["vectors"]
    assert_allclose(mean["S"], (2 * one["S"] * one["vectors"] + other["S"] * other["vectors"]) / weight, atol=1e-20)
    assert_allclose(mean["k"], (2 * one["k"] * one["vectors"] + other["k"] * other["vectors"]) / weight)
    assert_array_equal(mean["vectors"], one["vectors"] + other["vectors"])


# ---- Voronoi cells -----------------------------------------------------------------------------------------------------

def test_cells_of_lattices():
    part = square(5, 2.0)
    cells = analysis.voronoi(part)
    assert_allclose(cells.volumes, 4)
    assert_array_equal(cells.neighbours.number, 4)
    assert_allclose(cells.neighbours.weights, 2)
    assert_allclose(analysis.local_fraction(part), np.pi / 4)
    part = hexagonal(6, 6)
    cells = analysis.voronoi(part)
    assert_allclose(cells.volumes, np.sqrt(3) / 2)
    assert_array_equal(cells.neighbours.number, 6)
    assert_allclose(cells.neighbours.weights, 1 / np.sqrt(3))
    part = cubic(4)
    cells = analysis.voronoi(part)
    assert_allclose(cells.volumes, 1, rtol=1e-5)
    assert_array_equal(cells.neighbours.number, 6)
    assert_allclose(cells.neighbours.weights, 1, rtol=1e-4)
    assert_allclose(analysis.local_fraction(part), np.pi / 6, rtol=1e-5)


@pytest.mark.parametrize("dim, count, size", [(2, 200, 14.0), (2, 9, 3.0), (3, 150, 5.0)])
def test_cells_fill_the_box(dim, count, size):
    part = random_disks(count, size, dim=dim)
    cells = analysis.voronoi(part, limit=np.inf)
    assert_allclose(cells.volumes.sum(), size**dim, rtol=1e-9)
    assert (cells.volumes > -1e-9).all()
    near = cells.neighbours
    # A pair has the same side seen from both.
    mutual = {(i, j): w for i, j, w in zip(near.first, near.second, near.weights)}
    if count > 9:
        assert_allclose([mutual[j, i] for i, j in mutual], list(mutual.values()), rtol=1e-6, atol=1e-9)


def test_cells_equal_those_of_scipy_and_belong_to_the_nearest_surface():
    from scipy.spatial import Voronoi
    rng = np.random.default_rng(3)
    places = rng.uniform(0, 10, (300, 2))
    ours = analysis.voronoi(places, limit=np.inf)
    theirs = Voronoi(places)

    def area(region):
        x, y = theirs.vertices[region].T
        order = np.argsort(np.arctan2(y - y.mean(), x - x.mean()))
        x, y = x[order], y[order]
        return abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2

    expected = [area(theirs.regions[r]) if -1 not in theirs.regions[r] else np.nan for r in theirs.point_region]
    assert_allclose(ours.volumes, expected, rtol=1e-8)
    # Power cells by counting random points.
    part = random_disks(12, 4.0)
    cells = analysis.voronoi(part, limit=np.inf)
    points = rng.uniform(0, 4, (100_000, 2))
    power = (part.nearest_image(points[:, None] - part.positions) ** 2).sum(2) - part.radii**2
    share = np.bincount(power.argmin(1), minlength=12) / len(points) * 16
    assert_allclose(cells.volumes, share, atol=0.05)


def test_a_pair_is_parted_at_its_radical_line():
    """Two sizes on lines: |x|² - R² is equal at 1/2 + (R1² - R2²)/2."""
    part = Particles([[0.5, 0.5], [1.5, 0.5]], [0.6, 0.4], box=[2, 1])
    assert_allclose(analysis.voronoi(part).volumes, [1 + (0.36 - 0.16), 1 - (0.36 - 0.16)])


def test_cells_end_at_walls_and_are_open_at_a_surface():
    places = np.stack(np.meshgrid([0.5, 1.5, 2.5], [0.5, 1.5]), -1).reshape(-1, 2)
    sides = [[0, 0, 3, 0], [3, 0, 3, 5], [0, 5, 0, 0]]
    part = Particles(places, 0.5)
    cells = analysis.voronoi(part, walls=(sides, np.zeros(3)))
    assert_allclose(cells.volumes, [1, 1, 1, np.nan, np.nan, np.nan])
    closed = analysis.voronoi(part, walls=([*sides, [0, 2, 3, 2]], np.zeros(4)))
    assert_allclose(closed.volumes, 1)
    assert np.isnan(analysis.voronoi(part).volumes).all()
    assert_array_equal(closed.neighbours.number, [2, 3, 2, 2, 3, 2])
    with pytest.raises(ValueError, match="walls=True needs a frame"):
        analysis.voronoi(part, walls=True)
    for function in (analysis.voronoi, analysis.local_fraction):
        with pytest.raises(ValueError, match="wall 3 is a disk of radius 0.2, and cells can only end at segments; give walls="):
            function(part, walls=([*sides, [1, 1, 1, 1]], [0, 0, 0, 0.2]))


def test_cells_at_corners_have_the_error_that_the_page_states():
    """Random points of an L-shaped region belong to the nearest particle; only the corner in its middle has an error."""
    corners = np.array([(0, 6), (0, 0), (3, 0), (3, 3), (6, 3), (6, 6), (0, 6)], float)
    walls = np.c_[corners[:-1], corners[1:]], np.zeros(6)
    grid = np.stack(np.meshgrid(*[np.arange(0.005, 6, 0.01)] * 2, indexing="ij"), -1).reshape(-1, 2)
    grid = grid[(grid[:, 0] < 3) | (grid[:, 1] > 3)]
    base = np.stack(np.meshgrid(*[np.arange(0.5, 6)] * 2, indexing="ij"), -1).reshape(-1, 2)
    base = base[(base[:, 0] < 3) | (base[:, 1] > 3)]
    worst = []
    for seed in range(20):
        part = Particles(base + np.random.default_rng(seed).uniform(-0.15, 0.15, base.shape), 0.35)
        own = cKDTree(part.positions).query(grid)[1]
        error = np.abs(np.bincount(own, minlength=27) * 1e-4 / analysis.voronoi(part, walls=walls).volumes - 1)
        assert error[np.linalg.norm(part.positions - 3, axis=1) > 3 * 0.7].max() < 0.01
        worst.append(error.max())
    assert 0.1 < max(worst) < 0.12


def test_too_few_particles_have_no_cells():
    with pytest.raises(ValueError, match="3 present particles have no Voronoi cells; at least 4"):
        analysis.voronoi(np.eye(3, 2))


# ---- coordination, rattlers, order --------------------------------------------------------------------------------------

def chain():
    """0-1-2 in a line, 1 touches the wall 7 twice, 3 has one contact with 2, 4 none."""
    return Particles(np.c_[np.arange(5.0), np.zeros(5)], 0.5, pairs=[[0, 1], [1, 2], [2, 1], [1, -1], [1, -1], [3, 2]],
                     walls=[-1, -1, -1, 7, 7, -1], forces=np.zeros((6, 2)), points=np.zeros((6, 2)))


def test_coordination():
    assert_array_equal(analysis.coordination(chain()), [1, 3, 2, 1, 0])
    assert_array_equal(analysis.coordination(chain(), walls=False), [1, 2, 2, 1, 0])


def test_rattlers_are_removed_again_and_again():
    # 1 has three contacts until 0 and 2 (fewer than two) are gone.
    assert analysis.rattlers(chain()).all()
    assert_array_equal(analysis.rattlers(chain(), least=1), [False, False, False, False, True])
    # With two contacts necessary all go in turn: 0, 3, 4, then 2, then 1 with its wall alone.
    assert analysis.rattlers(chain(), least=2).all()
    tetrahedron = Particles(np.r_[np.eye(3), [[1, 1, 1]], [[9, 9, 9]]], pairs=list(itertools.combinations(range(4), 2)))
    assert_array_equal(analysis.rattlers(tetrahedron, least=3), [False] * 4 + [True])
    mean, loose = analysis.mean_coordination(hexagonal_contacts())
    assert (mean, loose) == (6, 0)


def hexagonal_contacts():
    part = hexagonal(6, 6)
    return Particles(part.positions, 0.5, box=part.box, pairs=analysis.close_pairs(part, 1.01))


def test_mean_coordination_without_rattlers():
    part = hexagonal_contacts()
    far = Particles(np.r_[part.positions, [[0.6, 0.5]]], 0.5, box=part.box, pairs=np.r_[part.pairs, [[0, 36]]])
    assert analysis.mean_coordination(far) == (6, 1 / 37)
    assert_allclose(analysis.mean_coordination(far, without_rattlers=False)[0], (36 * 6 + 2) / 37)


@pytest.mark.parametrize("weighted", [False, True])
def test_bond_order_of_lattices(weighted):
    assert_allclose(np.abs(analysis.bond_order(hexagonal(6, 6), weighted=weighted)), 1, rtol=1e-6)
    assert_allclose(np.abs(analysis.bond_order(hexagonal(6, 6), 4, weighted=weighted)), 0, atol=1e-6)
    assert_allclose(analysis.bond_order(square(5), 4, weighted=weighted), 1, rtol=1e-6)
    assert_allclose(analysis.bond_order(hexagonal(6, 6), neighbours=analysis.nearest(hexagonal(6, 6), 6)), 1)
    # Turned by an angle, ψ6 turns by six times it.
    turn = 0.2
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    place = hexagonal(8, 8).positions @ matrix.T
    inner = np.linalg.norm(place - place.mean(0), axis=1) < 2
    assert_allclose(analysis.bond_order(place, weighted=weighted)[inner], np.exp(6j * turn), rtol=1e-6)


def test_bond_order_needs_two_dimensions_and_neighbours():
    with pytest.raises(ValueError, match="bond_order needs 2D"):
        analysis.bond_order(cubic(3))
    part = Particles(np.eye(3, 2), pairs=[[0, 1]])
    assert_array_equal(np.isnan(analysis.bond_order(part, neighbours=analysis.touching(part))), [False, False, True])


# ---- input ------------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("fields, message", [
    ({"positions": [1, 2]}, "positions has the shape [2]; give an array [N, 2] or [N, 3]"),
    ({"positions": [[0, 0], [np.nan, 1]]}, "particle 1 is at [nan  1.]; set active[1] = False"),
    ({"positions": [[0, 0]], "radii": [-1]}, "radii of particle 0 is -1; it must be positive"),
    ({"positions": [[0, 0]], "radii": [1, 2]}, "radii has the shape [2]; give an array [1]"),
    ({"positions": [[0, 0]], "box": [1, -1]}, "give the 2 positive lengths"),
    ({"positions": [[0, 0]], "pairs": [[0, 1]]}, "number them from 0 to 0"),
    ({"positions": [[0, 0], [1, 1]], "pairs": [[0, 1]], "forces": np.zeros((2, 2))}, "give one row per contact"),
    ({"positions": [[0, 0]], "velocities": [[1, 2, 3]]}, "velocities has the shape [1, 3]; give an array [1, 2]")])
def test_bad_input_names_the_cure(fields, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        Particles(**fields)


def test_missing_properties():
    with pytest.raises(ValueError, match="the particles have no pairs; give Particles"):
        analysis.coordination(np.eye(4, 2))
    with pytest.raises(ValueError, match="neither volumes nor radii"):
        analysis.local_fraction(np.random.default_rng(1).random((9, 2)))
    with pytest.raises(ValueError, match="give a count from 1 to 3"):
        analysis.nearest(np.eye(4, 2), 4)
    with pytest.raises(ValueError, match="distance is nan"):
        analysis.within(np.eye(4, 2), np.nan)


@pytest.mark.parametrize("model", ["soft", "rough", "soft3d"])
def test_frames_of_a_run(model, request):
    with Run(request.getfixturevalue(model)[0]) as run:
        frame = run.frames[1]
        touching = analysis.coordination(frame, walls=False)
        assert_array_equal(touching, frame.touching)
        assert analysis.coordination(frame).sum() == touching.sum() + 1
        assert analysis.rattlers(frame).dtype == bool and not analysis.rattlers(frame)[~frame.active].any()
        fraction = analysis.local_fraction(frame)
        assert np.isnan(fraction[0]) and np.isfinite(fraction).sum() > 10
        assert len(analysis.radial_distribution(run, r_max=1.5)) == 100
        assert len(analysis.structure_factor(run.frames, k_max=3))
        if run.dim == 2:
            assert np.isfinite(analysis.bond_order(frame)[1:]).all()
            assert np.isfinite(analysis.local_fraction(frame, walls=True)).sum() > np.isfinite(fraction).sum()
        part = Particles.of(frame, "velocities", "forces")
        assert part.velocities.shape == frame.centres.shape and part.time == frame.time
        assert len(part.forces) == len(frame.contacts)


def test_frames_without_contacts_name_the_option(tmp_path):
    import h5py
    from synthetic import write_run
    path, _ = write_run(tmp_path / "run", n=20)
    with h5py.File(path / "run.h5", "r+") as file:
        del file["frames/000000/contacts"]
    with Run(path) as run, pytest.raises(RunError, match="-frame_fields contacts"):
        analysis.coordination(run.frames[0])
