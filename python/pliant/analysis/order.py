"""Coordination, rattlers and bond-orientational order."""

import numpy as np

from .neighbours import touching_pairs
from .particles import Particles
from .voronoi import voronoi


def _bonds(particles, walls):
    """([K] first, [K] second): contacts between different partners, each once; walls are numbers from N on."""
    pairs = touching_pairs(particles)
    if not walls:
        return pairs.T
    at_wall = particles.pairs[:, 1] < 0
    number = particles.walls[at_wall] if particles.walls is not None else np.zeros(at_wall.sum(), int)
    wall = np.unique(np.stack([particles.pairs[at_wall, 0], particles.count + number], 1), axis=0)
    return np.concatenate([pairs, wall]).T


def coordination(particles, walls=True):
    """[N] partners in contact with each particle, however many points touch: other particles (in a small periodic box each image
    that touches) and, with `walls`, each wall once (as far as the frame has wall contacts). 0 for absent particles.
    `particles`: a Frame or Particles with pairs."""
    particles = Particles.of(particles, "pairs")
    first, second = _bonds(particles, walls)
    ends = np.concatenate([first, second[second < particles.count]])
    return np.bincount(ends, minlength=particles.count)


def rattlers(particles, least=None, walls=True):
    """[N] bool: present particles without a rigid place: with fewer than `least` contacts, after the contacts of other rattlers
    have been removed, until none is left to remove. Two particles that touch at several vertices have one contact. least:
    default D + 1, the least number that holds a particle without weight and friction (D for particles that lie under
    gravity). Absent particles are False."""
    particles = Particles.of(particles, "pairs")
    least = particles.dim + 1 if least is None else least
    first, second = _bonds(particles, walls)
    pair = second < particles.count
    loose = ~particles.active
    while True:
        held = ~loose[first] & ~(loose[np.where(pair, second, 0)] & pair)
        number = np.bincount(np.concatenate([first[held], second[held & pair]]), minlength=particles.count)
        more = (number < least) & ~loose
        if not more.any():
            return loose & particles.active
        loose |= more


def mean_coordination(particles, walls=False, without_rattlers=True):
    """(mean coordination, fraction of rattlers). Without rattlers, neither they nor their contacts count; contacts with walls
    count with `walls` (rattlers are found with walls in any case). NaN if no particle is left."""
    particles = Particles.of(particles, "pairs")
    loose = rattlers(particles)
    first, second = _bonds(particles, walls)
    pair = second < particles.count
    kept = particles.active & ~loose if without_rattlers else particles.active
    held = kept[first] & (kept[np.where(pair, second, 0)] | ~pair)
    ends = np.concatenate([first[held], second[held & pair]])
    with np.errstate(invalid="ignore"):
        return float(np.float64(len(ends)) / kept.sum()), float(np.float64(loose.sum()) / particles.active.sum())


def bond_order(particles, order=6, neighbours=None, weighted=False, box=None):
    """[N] complex ψ = Σ w exp(i·order·θ)/Σ w over the bonds at angle θ of each particle, in 2D; order 6: hexatic. NaN without
    neighbours.

    `neighbours`: Neighbours (`within`, `nearest`, `touching`); default: cells of the Voronoi diagram that share a side.
    `weighted`: w is the length of this side (W. Mickel et al., J. Chem. Phys. 138, 044501 (2013)), else 1."""
    particles = Particles.of(particles, box=box)
    if particles.dim != 2:
        raise ValueError(f"bond_order needs 2D, the particles have {particles.dim} dimensions; use coordination or "
                         "radial_distribution")
    if neighbours is None:
        neighbours = voronoi(particles).neighbours
    weights = neighbours.weights if weighted else np.ones(len(neighbours.first))
    angle = np.arctan2(neighbours.vectors[:, 1], neighbours.vectors[:, 0])
    total = neighbours.sums(weights)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(total > 0, neighbours.sums(weights * np.exp(1j * order * angle)) / total, np.nan)
