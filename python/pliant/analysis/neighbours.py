"""Neighbours of particles: within a distance, the nearest ones, touching ones. Voronoi neighbours: `voronoi.py`."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .particles import Particles


def sums(at, values, count):
    """[count, …] sums of values [M, …], real or complex, by the index `at` [M]."""
    values = np.asarray(values)
    flat = np.ascontiguousarray(values.reshape(len(values), np.prod(values.shape[1:], dtype=int)))
    columns = flat.view(float) if np.iscomplexobj(flat) else flat
    total = np.stack([np.bincount(at, column, count) for column in columns.T], 1)
    return (total.view(complex) if np.iscomplexobj(flat) else total).reshape(count, *values.shape[1:])


@dataclass(frozen=True)
class Neighbours:
    """Directed pairs, sorted by their first particle: both directions of a mutual pair are there."""

    count: int            #: N
    first: np.ndarray     #: [M]
    second: np.ndarray    #: [M]
    vectors: np.ndarray   #: [M, D] from the first to the second particle, or to an image of it
    weights: np.ndarray   #: [M] 1, or the side that two Voronoi cells share

    @property
    def number(self):
        """[N] neighbours of each particle."""
        return np.bincount(self.first, minlength=self.count)

    def sums(self, values):
        """[N, …] sums over the neighbours of each particle of values [M, …]."""
        return sums(self.first, values, self.count)

    def padded(self):
        """([N, K] second particles, [N, K] rows of the pairs, [N, K] bool: is a neighbour), K the largest number."""
        number = self.number
        width = int(number.max(initial=0))
        used = np.arange(width) < number[:, None]
        row = np.zeros((self.count, width), int)
        row[used] = np.arange(len(self.first))
        return np.where(used, self.second[row] if len(self.second) else 0, 0), row, used


def neighbours_of(particles, first, second, vectors):
    """Neighbours from undirected pairs `first` [K], `second` [K] with the vectors [K, D] from the second to the first."""
    both = np.concatenate([first, second]), np.concatenate([second, first])
    order = np.lexsort(both[::-1])
    one, other = (side[order] for side in both)
    return Neighbours(particles.count, one, other, np.concatenate([-vectors, vectors])[order], np.ones(len(order)))


def _places(particles, distance):
    """(cKDTree, [M] particle of each of its places): the present particles first, then, in a tilted box, all images of them up to
    `distance` from the cell. In an upright box the tree is periodic, and there are no images in it."""
    present = np.flatnonzero(particles.active)
    places = particles.positions[present]
    closed = np.isfinite(particles.period)
    if not closed.any():
        return cKDTree(places), present
    origin, period = particles.box[0], np.where(closed, particles.period, 0.0)
    if particles.tilt is not None:
        return _images(places - origin, present, particles, distance)
    shifted = np.where(closed, places - origin, places)
    wrapped = np.where(closed, shifted - np.where(closed, period, 1) * np.floor(shifted / np.where(closed, period, 1)), shifted)
    wrapped = np.where(closed & (wrapped >= period), 0.0, wrapped)  # rounding
    return cKDTree(wrapped, boxsize=period), present


def _images(places, present, particles, distance):
    """`_places` of a periodic box whose cell begins at 0, with images; in open directions there are none."""
    closed = np.isfinite(particles.period)
    edges, period = particles.lattice, np.where(closed, particles.period, 1.0)
    for axis in reversed(range(particles.dim)):
        places = places - np.floor(places[:, axis:axis + 1] / period[axis]) * edges[axis]
    most = np.where(closed, np.ceil((distance + period) / period), 0).astype(int)
    for axis in reversed(range(particles.dim - 1)):  # the tilt moves images along the axes before it
        most[axis] += int(np.ceil(np.abs(edges[axis + 1:, axis]) @ most[axis + 1:] / period[axis]))
    all_places, of = [places], [present]
    for n in np.ndindex(*(2 * most + 1)):
        shift = (np.array(n) - most) @ edges
        if np.array_equal(np.array(n), most) or not (np.abs(shift) <= period + distance).all():
            continue
        moved = places + shift
        near = (((moved >= -distance) & (moved <= period + distance)) | ~closed).all(1)
        all_places.append(moved[near])
        of.append(present[near])
    return cKDTree(np.concatenate(all_places)), np.concatenate(of)


def _check_length(distance, name="distance"):
    if not (np.isfinite(distance) and distance > 0):
        raise ValueError(f"{name} is {distance:g}; give a positive length")


def _check_distance(particles, distance, name="distance"):
    _check_length(distance, name)
    if distance > particles.half_lattice:
        raise ValueError(f"{name} is {distance:g} and half the periodic box {particles.half_lattice:g}; give less, because "
                         "a particle has one image in this range only")


def close_pairs(particles, distance):
    """[K, 2] pairs of present particles with centres at most `distance` apart, each once, lower number first."""
    particles = Particles.of(particles)
    _check_distance(particles, distance)
    tree, particle = _places(particles, distance)
    pairs = tree.query_pairs(distance, output_type="ndarray").reshape(-1, 2)
    pairs = np.sort(particle[pairs[pairs.min(1) < particles.active.sum()]], axis=1)  # one of them is no image
    return np.unique(pairs, axis=0) if particles.tilt is not None else pairs[np.lexsort(pairs.T[::-1])]


def _with_images(particles, distance):
    """`_places` with all images up to `distance` from the cell."""
    present = np.flatnonzero(particles.active)
    return _images(particles.positions[present] - particles.box[0], present, particles, distance)


def within(particles, distance):
    """Neighbours whose centres are at most `distance` apart. `particles`: a Frame, Particles or positions [N, D]. Beyond half
    the periodic box several images of a particle are neighbours, also images of the particle itself."""
    particles = Particles.of(particles)
    if not distance > particles.half_lattice:
        first, second = close_pairs(particles, distance).T
        return neighbours_of(particles, first, second, particles.relative(second, first))
    _check_length(distance)
    tree, particle = _with_images(particles, distance)
    near = tree.query_ball_point(tree.data[:particles.active.sum()], distance)
    first = np.repeat(np.arange(len(near)), [len(one) for one in near])
    second = np.concatenate([np.zeros(0, int), *near]).astype(int)
    first, second = (side[first != second] for side in (first, second))
    order = np.lexsort((particle[second], particle[first]))
    first, second = first[order], second[order]
    return Neighbours(particles.count, particle[first], particle[second], tree.data[second] - tree.data[first], np.ones(len(first)))


def nearest(particles, count):
    """The `count` nearest particles of each, by centres, the nearest first; ties have no defined order. In a periodic box with
    few particles these are also further images of particles, and of the particle itself. ValueError for an open box with fewer
    present particles than count + 1."""
    particles = Particles.of(particles)
    number, far = int(particles.active.sum()), particles.half_lattice
    closed = np.isfinite(far)
    if count < 1 or not number or not (closed or count < number):
        raise ValueError(f"{count} neighbours of {number} present particles; give a count from 1" + (f" to {number - 1}" if not closed else ""))
    tree, particle = _places(particles, far)
    distance, index = tree.query(tree.data[:number], count + 1)
    images = distance.max() > far
    while closed and distance.max() > far:
        far *= 1.5
        tree, particle = _with_images(particles, far)
        distance, index = tree.query(tree.data[:number], count + 1)
    rows = np.arange(number)
    # The particle itself is the first, unless others have the same place.
    own = index == rows[:, None]
    own[~own.any(1), -1] = True
    second = index[~own].reshape(-1, count).ravel()
    first = np.repeat(rows, count)
    vectors = tree.data[second] - tree.data[first] if images else particles.relative(particle[first], particle[second])
    return Neighbours(particles.count, particle[first], particle[second], vectors, np.ones(len(first)))


def touching_pairs(particles):
    """[K, 2] pairs in contact (droplets: also bound pairs), each once, lower number first, however many points touch. In a small
    periodic box each image that touches counts, including images of the particle itself."""
    return Particles.of(particles, "pairs").touching[0]


def touching(particles):
    """Neighbours in contact, images as of `touching_pairs`."""
    particles = Particles.of(particles, "pairs")
    pairs, _, _, vectors = particles.touching
    return neighbours_of(particles, *pairs.T, vectors)
