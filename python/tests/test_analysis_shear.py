"""Analysis in tilted boxes: images, neighbours, non-affine motion, against lists of all images by brute force."""

import itertools

import numpy as np
import pytest
from pliant import analysis
from pliant.analysis.neighbours import close_pairs
from pliant.analysis.particles import Particles
from pliant.run import lattice, nearest_image

BOXES = [([4.0, 5.0], [1.7]), ([4.0, 5.0], [-9.3]), ([6.0, 2.0], [2.9]), ([4.0, 3.0, 5.0], [1.5, -0.7, 1.1]),
         ([2.0, 3.0, 2.5], [4.1, 0.3, -2.2])]


def images(edges, far=9):
    return np.array(list(itertools.product(range(-far, far + 1), repeat=len(edges)))) @ edges


@pytest.mark.parametrize("length, tilt", BOXES)
def test_nearest_image(length, tilt):
    edges, length = lattice(length, tilt), np.array(length)
    vectors = np.random.default_rng(1).uniform(-2, 2, (40, len(length))) * length
    found = nearest_image(vectors, length, tilt)
    every = vectors[:, None, :] + images(edges)
    assert np.linalg.norm(found, axis=1) == pytest.approx(np.linalg.norm(every, axis=2).min(1), abs=1e-12)
    whole = np.linalg.solve(edges.T, (vectors - found).T)
    assert whole == pytest.approx(np.round(whole), abs=1e-9)


@pytest.mark.parametrize("length, tilt", BOXES)
def test_shortest_lattice_vector(length, tilt):
    dim = len(length)
    part = Particles(np.zeros((1, dim)), box=length, tilt=tilt)
    norms = np.linalg.norm(images(lattice(length, tilt)), axis=1)
    assert part.half_lattice == pytest.approx(norms[norms > 0].min() / 2)


@pytest.mark.parametrize("length, tilt", BOXES)
def test_neighbours(length, tilt):
    edges, dim = lattice(length, tilt), len(length)
    rng = np.random.default_rng(2)
    places = rng.uniform(0, 1, (60, dim)) * length
    part = Particles(places, box=length, tilt=tilt, active=np.arange(60) != 7)
    distance = 0.99 * part.half_lattice
    near = analysis.within(part, distance)
    every = np.linalg.norm(places[None] - places[:, None] + images(edges)[:, None, None], axis=3).min(0)
    every[7], every[:, 7] = np.inf, np.inf
    np.fill_diagonal(every, np.inf)
    first, second = np.nonzero(every <= distance)
    moved = Particles(places + rng.integers(-2, 3, (60, dim)) @ edges, box=length, tilt=tilt, active=part.active)
    assert np.array_equal(analysis.within(moved, distance).second, near.second)
    assert len(first) > 20 and np.array_equal(near.first, first) and np.array_equal(near.second, second)
    assert np.linalg.norm(near.vectors, axis=1) == pytest.approx(every[first, second])
    closest = np.sort(every, 1)[np.arange(60) != 7, 0]
    if closest.max() <= part.half_lattice:
        assert np.linalg.norm(analysis.nearest(part, 1).vectors, axis=1) == pytest.approx(closest)
    with pytest.raises(ValueError, match="one image"):
        close_pairs(part, 1.01 * part.half_lattice)


@pytest.mark.parametrize("length, tilt", [*BOXES, ([3.0, 4.0], None), ([3.0, np.inf], None), ([2.0, np.inf, 3.0], None)])
def test_neighbours_beyond_half_the_box(length, tilt):
    """Several images of a particle are neighbours, of the particle itself too."""
    length, dim = np.array(length), len(length)
    edges = np.unique(images(lattice(length, tilt)), axis=0)  # zero in open directions
    rng = np.random.default_rng(6)
    places = rng.uniform(-1, 1, (9, dim)) * np.where(np.isfinite(length), length, 3)
    part = Particles(places, box=length, tilt=tilt, active=np.arange(9) != 4)
    every = places[None, :, None] - places[:, None, None] + edges
    norms = np.linalg.norm(every, axis=3)
    norms[4], norms[:, 4] = np.inf, np.inf
    norms[norms == 0] = np.inf
    distance = 1.8 * part.half_lattice
    near = analysis.within(part, distance)
    first, second, _ = np.nonzero(norms <= distance)
    assert len(first) >= 30 and np.array_equal(near.first, first) and np.array_equal(near.second, second)
    shifts = near.vectors - (places[near.second] - places[near.first])
    assert (np.linalg.norm(shifts[:, None] - edges, axis=2).min(1) < 1e-12).all()
    for i in range(9):
        assert np.sort(np.linalg.norm(near.vectors[near.first == i], axis=1)) == pytest.approx(np.sort(norms[i][norms[i] <= distance]))
    closest = analysis.nearest(part, 14)
    sizes = np.linalg.norm(closest.vectors, axis=1).reshape(8, 14)
    assert sizes == pytest.approx(np.sort(norms[np.arange(9) != 4].reshape(8, -1), 1)[:, :14])


def test_an_affine_shear_leaves_no_d2_min():
    """Particles that follow the box have none, across its borders too; a particle that moves by itself has its displacement."""
    rng = np.random.default_rng(3)
    places, length = rng.uniform(0, 10, (150, 2)), [10.0, 10.0]
    sheared = places + 0.3 * places[:, 1:] * [1, 0]
    start = places + 0.05 * places[:, 1:] * [1, 0]
    before = Particles(start, box=length, tilt=[0.5])
    after = Particles(sheared, box=length, tilt=[3.0])
    least, number = analysis.d2_min(before, after)
    assert least.max() < 1e-20 and (number == 15).all()
    gradient = analysis.deformation(before, after)
    assert gradient == pytest.approx(np.broadcast_to([[1, 0.25], [0, 1]], (150, 2, 2)), abs=1e-9)
    assert analysis.displacements(before, after) == pytest.approx(sheared - start)
    # The same places in other images, and the lattice by another edge.
    other = Particles(sheared + np.outer(rng.integers(-2, 3, 150), [10, 0]), box=length, tilt=[3.0])
    assert analysis.d2_min(before, other)[0].max() < 1e-20
    moved = sheared.copy()
    moved[11] += [0.2, -0.1]
    least, _ = analysis.d2_min(before, Particles(moved, box=length, tilt=[3.0]))
    assert least[11] > 0.1 and least[11] == least.max()
    away = np.linalg.norm(before.relative(np.full(150, 11), np.arange(150)), axis=1) > 4
    assert least[away].max() < 1e-20


def test_non_affine_displacements_across_the_border():
    """On a lattice, whose neighbours are even on all sides, a homogeneous shear has none, also of the particles at the borders."""
    x, y = np.meshgrid(np.arange(12.0), np.arange(12.0), indexing="ij")
    places = np.stack([x.ravel(), y.ravel()], 1)
    before = Particles(places, box=[12.0, 12.0])
    after = Particles(places + 0.1 * places[:, 1:] * [1, 0], box=[12.0, 12.0], tilt=[1.2])
    assert np.abs(analysis.non_affine_displacements(before, after, 1.0)).max() < 1e-12


def test_pair_correlations_do_not_depend_on_the_edge_that_describes_the_lattice():
    places = np.random.default_rng(4).uniform(0, 10, (200, 2))
    one, other = (Particles(places, box=[10.0, 10.0], tilt=tilt) for tilt in ([3.0], [-7.0]))
    a, b = (analysis.radial_distribution(p, r_max=4, bins=40) for p in (one, other))
    assert np.array_equal(a["pairs"], b["pairs"]) and a["pairs"].sum() > 5000


def test_refusals():
    tilted = Particles(np.random.default_rng(5).uniform(0, 5, (30, 2)), radii=0.5, box=[5.0, 5.0], tilt=[1.0])
    for function in (analysis.voronoi, analysis.structure_factor):
        with pytest.raises(ValueError, match="tilted"):
            function(tilted)
    with pytest.raises(ValueError, match="not periodic"):
        Particles(np.zeros((1, 2)), box=[5.0, np.inf], tilt=[1.0])
    with pytest.raises(ValueError, match="tilt factors"):
        Particles(np.zeros((1, 2)), box=[5.0, 5.0], tilt=[1.0, 2.0])
    assert Particles(np.zeros((1, 2)), box=[5.0, 5.0], tilt=[0.0]).tilt is None
