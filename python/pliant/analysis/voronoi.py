"""Voronoi cells of particles of several sizes, and the local packing fraction.

The cells form the power diagram (radical Voronoi diagram): point x belongs to the particle with the least
|x - r_i|² - R_i² [B. J. Gellatly and J. L. Finney, J. Non-Cryst. Solids 50, 313 (1982)], which never cuts a disk or sphere that
does not overlap with others. Its dual, the regular triangulation, is the lower convex hull of the points
(r_i, |r_i|² - R_i²). A cell is the sum of simplices that run from its particle through the centres of an edge, a triangle, …
to a corner of the cell, with signed heights [P. Mullen et al., ACM Trans. Graph. 30, 103 (2011)].
"""

from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
from scipy.spatial import ConvexHull

from ..run import Frame
from .neighbours import Neighbours
from .particles import Particles

_FLAT = 1e-9      # volume over cubed size of a simplex (2D: area over square) below which its centre is not exact
_ZERO = 1e-14     # volume over cubed size below which a simplex has no centre
_JITTER = 1e-7    # over the mean distance: moves points of a perfect lattice off their common sphere
_MARGIN = 4.0     # first width of the layer of images around a periodic box, in mean distances


@dataclass(frozen=True)
class Voronoi:
    """Cells of N particles. NaN: absent particles, and cells that are not closed within `limit`."""

    volumes: np.ndarray      #: [N] areas (3D: volumes) of the cells
    neighbours: Neighbours   #: particles whose cells share a side; weights: its length (3D: area)


def _mirrored(particles, segments, limit):
    """([M, D] places, [M] numbers of particles) of the mirror images at walls closer than `limit`: the border of the cells of a
    particle and of its image is the wall. segments [S, 4]."""
    places, numbers = [], []
    for x1, y1, x2, y2 in segments:
        start, end = np.array([x1, y1]), np.array([x2, y2])
        along = end - start
        length2 = along @ along
        if length2 == 0:
            continue
        part = np.clip((particles.positions - start) @ along / length2, 0, 1)
        foot = start + np.multiply.outer(part, along)
        distance = np.linalg.norm(particles.positions - foot, axis=1)
        near = particles.active & (part > 0) & (part < 1) & (distance < limit) & (distance > 0)
        places.append((2 * foot - particles.positions)[near])
        numbers.append(np.flatnonzero(near))
    return (np.concatenate(places), np.concatenate(numbers)) if places else (np.zeros((0, particles.dim)), np.zeros(0, int))


def _images(places, numbers, particles, margin):
    """Places [M, D], numbers [M] and bool [M] (is an image) with the periodic images that lie at most `margin` outside."""
    image = np.zeros(len(places), bool)
    for axis in np.flatnonzero(np.isfinite(particles.period)):
        period, origin = particles.period[axis], particles.box[0, axis]
        at = (places[:, axis] - origin) % period
        places = places.copy()
        places[:, axis] = origin + at
        turns = int(np.ceil(margin / period))
        copies = [(places, numbers, image)]
        for turn in [t for t in range(-turns, turns + 1) if t]:
            near = (at + turn * period >= -margin) & (at + turn * period <= period + margin)
            shift = np.zeros(particles.dim)
            shift[axis] = turn * period
            copies.append((places[near] + shift, numbers[near], np.ones(near.sum(), bool)))
        places, numbers, image = (np.concatenate(part) for part in zip(*copies))
    return places, numbers, image


def _triangulation(places, weights, own, spacing):
    """[T, D+1] simplices of the regular triangulation with a corner that is `own` [M], and the places [M, D], moved by a jitter where
    such simplices were flat, as on a cubic lattice."""
    dim = places.shape[1]
    jitter = np.random.default_rng(0).normal(0, _JITTER * spacing, places.shape)
    for moved in (places, places + jitter):
        middle = moved - moved.mean(0)
        hull = ConvexHull(np.c_[middle, (middle**2).sum(1) - weights], qhull_options="Qt")
        simplices = hull.simplices[hull.equations[:, dim] < 0]
        simplices = simplices[own[simplices].any(1)]
        edges = moved[simplices[:, 1:]] - moved[simplices[:, :1]]
        flatness = np.abs(np.linalg.det(edges)) / np.linalg.norm(edges, axis=2).max(1, initial=0) ** dim
        if (flatness > _FLAT).all():
            break
    return simplices[flatness > _ZERO], moved


def _centre(corners, weights):
    """[T, D] points of equal power to the corners [T, k, D] with weights [T, k], in their flat."""
    edges = corners[:, 1:] - corners[:, :1]
    right = ((edges**2).sum(2) - weights[:, 1:] + weights[:, :1]) / 2
    if edges.shape[1] == edges.shape[2]:
        return corners[:, 0] + np.linalg.solve(edges, right[..., None])[..., 0]
    share = np.linalg.solve(edges @ edges.transpose(0, 2, 1), right[..., None])[..., 0]
    return corners[:, 0] + np.einsum("tk,tkd->td", share, edges)


def _heights(corners, weights):
    """Yields (order of the corners, [T, D] signed steps from the first corner through the centres of the flats of the first two,
    three, … corners to the centre of the simplex) for all orders."""
    dim = corners.shape[2]
    centres = {}
    for size in range(1, dim + 2):
        for some in combinations(range(dim + 1), size):
            some = list(some)
            centres[frozenset(some)] = corners[:, some[0]] if size == 1 else _centre(corners[:, some], weights[:, some])
    for order in permutations(range(dim + 1)):
        basis, steps = [], []
        for k in range(1, dim + 1):
            # Unit vector towards the next corner, perpendicular to the flat of the corners before.
            toward = corners[:, order[k]] - corners[:, order[0]]
            for unit in basis:
                toward = toward - (toward * unit).sum(1)[:, None] * unit
            unit = toward / np.linalg.norm(toward, axis=1)[:, None]
            basis.append(unit)
            step = centres[frozenset(order[:k + 1])] - centres[frozenset(order[:k])]
            steps.append((step * unit).sum(1))
        yield order, np.stack(steps, 1), centres[frozenset(order)]


def voronoi(particles, limit=None, walls=None, box=None, radii=None):
    """Voronoi: the cells of the present particles, by their radii (equal ones without).

    `particles`: a Frame, Particles or positions [N, D]. `walls`: (segments [S, 4], radius [S]) in 2D, or True for the walls of the
    Frame: cells end there, next to corners that point towards the particles and free ends approximately. ValueError for disks. limit: largest distance from
    a particle to a corner of its cell; default 2 mean diameters, with positions alone 3 mean distances. Larger cells, such as
    cells at a free surface, are NaN. ValueError for fewer than D + 2 present particles without a periodic box."""
    if walls is True:
        if not isinstance(particles, Frame):
            raise ValueError("walls=True needs a frame of a run; give walls=(segments [S, 4], radius [S])")
        walls = particles.wall_segments, particles.run.geometry.radius
    particles = Particles.of(particles, box=box, radii=radii)
    particles.upright("voronoi")
    present = np.flatnonzero(particles.active)
    dim = particles.dim
    closed = np.isfinite(particles.period)
    if len(present) < (dim + 2 if not closed.all() else 1):
        raise ValueError(f"{len(present)} present particles have no Voronoi cells; at least {dim + 2} are necessary")
    places = particles.positions[present]
    extent = np.where(closed, particles.period, np.maximum(np.ptp(places, axis=0), 1e-300))
    spacing = (np.prod(extent) / len(present)) ** (1 / dim)
    mean = 2 * particles.radii[present].mean() if particles.radii is not None else None
    limit = (2 * mean if mean else 3 * spacing) if limit is None else limit
    if not limit > 0:
        raise ValueError(f"limit is {limit:g}; give a positive length")
    numbers, mirror = present, np.zeros(len(present), bool)
    if walls is not None:
        if dim != 2:
            raise ValueError("walls of Voronoi cells are segments in 2D, the particles have 3 dimensions; leave out walls")
        segments, radius = np.asarray(walls[0], float).reshape(-1, 4), np.asarray(walls[1], float)
        if (radius > 0).any():
            row = int(np.argmax(radius > 0))
            raise ValueError(f"wall {row} is a disk of radius {radius[row]:g}, and cells can only end at segments; give walls=(segments, "
                             "radius) without disks and discard the cells next to them, or leave out walls")
        extra, of = _mirrored(particles, segments, limit)
        places, numbers = np.concatenate([places, extra]), np.concatenate([numbers, of])
        mirror = np.concatenate([mirror, np.ones(len(extra), bool)])
    margin = _MARGIN * max(spacing, mean or 0)
    while True:
        result, corner = _cells(particles, places, numbers, mirror, margin, limit, spacing)
        if not closed.any() or margin >= 2 * particles.period[closed].max() or corner <= margin / 2:
            return result
        margin *= 2


def _cells(particles, places, numbers, mirror, margin, limit, spacing):
    """(Voronoi, the largest distance from a particle to a corner of its closed cell)."""
    index = np.arange(len(places))
    every, index, image = _images(places, index, particles, margin)
    at, mirrored = numbers[index], mirror[index]
    weights = np.zeros(len(every)) if particles.radii is None else particles.radii[at] ** 2
    own = ~image & ~mirrored
    simplices, every = _triangulation(every, weights, own, spacing)
    corners, weight = every[simplices], weights[simplices]
    dim, count = particles.dim, particles.count
    volumes, farthest, pairs = np.zeros(count), np.zeros(count), []
    factor = 1 / np.prod(np.arange(1, dim + 1))
    for order, steps, centre in _heights(corners, weight):
        first, second = simplices[:, order[0]], simplices[:, order[1]]
        use = own[first]
        volumes += np.bincount(at[first[use]], steps[use].prod(1) * factor, count)
        np.maximum.at(farthest, at[first[use]], np.linalg.norm(centre - corners[:, order[0]], axis=1)[use])
        side = steps[:, 1:].prod(1) * factor * dim
        pairs.append((first[use], second[use], side[use]))
    unbounded = _open_cells(simplices, own, at, count)
    volumes[unbounded | (farthest > limit) | ~particles.active] = np.nan
    first, second, side = (np.concatenate(part) for part in zip(*pairs))
    return Voronoi(volumes, _shared(particles, every, at, mirrored, first, second, side, spacing)), (
        farthest[~unbounded].max(initial=0.0))


def _open_cells(simplices, own, at, count):
    """[N] bool: the particle has a side of the triangulation with one simplex only: its cell is unbounded."""
    dim = simplices.shape[1] - 1
    sides = np.concatenate([np.delete(simplices, k, axis=1) for k in range(dim + 1)])
    sides.sort(axis=1)
    _, row, number = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    border = sides[number[row.ravel()] == 1]
    open_ = np.zeros(count, bool)
    # Simplices of images alone were left out before, and their sides belong to images alone.
    open_[at[border[own[border]]]] = True
    return open_


def _shared(particles, every, at, mirrored, first, second, side, spacing):
    """Neighbours with the sides that cells share; pairs whose side has no length, as across a corner of a square lattice, are left out."""
    keep = ~mirrored[second]
    first, second, side = first[keep], second[keep], side[keep]
    pairs, row = np.unique(np.stack([first, second], 1), axis=0, return_inverse=True)
    length = np.bincount(row.ravel(), side, len(pairs)) if len(pairs) else np.zeros(0)
    pairs, length = pairs[length > 1e-5 * spacing ** (particles.dim - 1)], length[length > 1e-5 * spacing ** (particles.dim - 1)]
    one, other = at[pairs].T
    order = np.lexsort((other, one))
    vectors = every[pairs[:, 1]] - every[pairs[:, 0]]
    return Neighbours(particles.count, one[order], other[order], vectors[order], length[order])


def local_fraction(particles, limit=None, walls=None):
    """[N] packing fraction of the Voronoi cell of each particle: its area over the area of the cell (3D: volumes). NaN where the
    cell is not closed. Arguments as of `voronoi`; polygons count with their present area, if the frame has it."""
    return Particles.of(particles).bodies / voronoi(particles, limit, walls).volumes
