"""Contact forces: distribution, fabric, force chains and clusters of strong contacts."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from .neighbours import sums
from .particles import Particles
from .sources import each
from .stress import particle_stress, principal

_ANGLE = 45.0  # degrees [Peters et al.]
_LEAST = 3     # particles of a chain [Peters et al.]


def pair_forces(particles):
    """(pairs [K, 2], forces [K, D], vectors [K, D]): each pair of touching particles once (in a small periodic box once for each
    image that touches), lower number first, with the sum of its contact forces on the first particle and the vector from the
    second to the first. Walls are left out."""
    particles = Particles.of(particles, "pairs", "forces")
    pairs, row, sign, vectors = particles.touching
    force = sign[:, None] * particles.forces[particles.pairs[:, 1] >= 0]
    return pairs, sums(row, force, len(pairs)), vectors


def force_distribution(source, bins=50, f_max=5.0):
    """DataFrame: f (middles of bins, force of a pair over the mean force of its frame), density (its integral is the fraction of
    pairs below f_max), pairs. `source`: a Frame, Particles, or a Run or a list of these; frames without forces do not count."""
    edges, counts, total = np.linspace(0, f_max, bins + 1), 0, 0
    for part in each(source, "pairs", "forces"):
        size = np.linalg.norm(pair_forces(part)[1], axis=1)
        if size.sum() > 0:
            counts = counts + np.histogram(size / size.mean(), edges)[0]
            total += len(size)
    if not total:
        raise ValueError("no pair has a force; use frames with contacts")
    return pd.DataFrame({"f": (edges[1:] + edges[:-1]) / 2, "density": counts / (total * np.diff(edges)), "pairs": counts})


def participation(particles):
    """(Σ f)²/(K Σ f²) of the forces f of K pairs: 1 if all are equal, 1/K if one has all force; NaN without a force."""
    size = np.linalg.norm(pair_forces(particles)[1], axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(size.sum() ** 2 / np.float64(len(size) * (size**2).sum()))


def fabric(particles, weighted=False):
    """[D, D] mean of n_a n_b over the pairs, n the direction between the centres; `weighted`: by force. The trace is 1, and
    isotropic contacts have 1/D on the diagonal. NaN without a pair."""
    pairs, force, vector = pair_forces(particles)
    normal = vector / np.linalg.norm(vector, axis=1)[:, None]
    weight = np.linalg.norm(force, axis=1) if weighted else np.ones(len(pairs))
    with np.errstate(invalid="ignore"):
        return np.einsum("c,ca,cb->ab", weight, normal, normal) / weight.sum()


@dataclass(frozen=True)
class ForceChains:
    """Chains of particles [J. F. Peters et al., Phys. Rev. E 72, 041307 (2005)]."""

    chains: list           #: K arrays of particles, from one end of the chain to the other
    label: np.ndarray      #: [N] number of the particle's chain, -1 without
    lengths: np.ndarray    #: [K] particles of each chain
    fraction: float        #: particles in chains over particles with a force; NaN without
    share: float           #: largest principal stress in chains over its sum over all particles; NaN without


def force_chains(particles, angle=_ANGLE, least=_LEAST):
    """ForceChains: particles whose largest principal stress (times volume) is above its mean over the particles with forces, linked
    if both lie within `angle` degrees of the axis of the largest stress of the other, in contact, and nearer to this axis than the
    other candidates on this side; at least `least` particles. Attraction does not make chains."""
    particles = Particles.of(particles, "pairs", "forces")
    if not 0 < angle <= 90:
        raise ValueError(f"angle is {angle:g} degrees; give more than 0, up to 90")
    stress, axes = principal(particle_stress(particles, 1.0))
    size, axis = stress[:, 0], axes[:, 0]
    loaded = np.zeros(particles.count, bool)
    ends = particles.pairs[(particles.forces != 0).any(1)]
    loaded[ends[ends >= 0]] = True
    strong = loaded & (size > size[loaded].mean()) if loaded.any() else loaded
    pairs, _, vector = pair_forces(particles)
    both = strong[pairs].all(1)
    links = _links(pairs[both], vector[both], axis, np.cos(np.radians(angle)))
    chains = [chain for chain in _paths(links, particles.count) if len(chain) >= least]
    label = np.full(particles.count, -1)
    for number, chain in enumerate(chains):
        label[chain] = number
    with np.errstate(invalid="ignore", divide="ignore"):
        fraction = np.float64((label >= 0).sum()) / loaded.sum()
        share = np.float64(size[label >= 0].sum()) / size[loaded].sum()
    return ForceChains(chains, label, np.array([len(chain) for chain in chains], int), float(fraction), float(share))


def _links(pairs, vector, axis, cosine):
    """[L, 2] pairs that are the best of either particle on its side: the contact nearest to the axis, within the angle."""
    if not len(pairs):
        return pairs
    unit = vector / np.linalg.norm(vector, axis=1)[:, None]
    centre, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    toward = np.concatenate([-unit, unit])
    along = (toward * axis[centre]).sum(1)
    near = np.abs(along) >= cosine
    order = np.lexsort((-np.abs(along), along > 0, centre))
    order = order[near[order]]
    side = 2 * centre[order] + (along[order] > 0)
    best = order[np.unique(side, return_index=True)[1]]
    chosen, times = np.unique(best % len(pairs), return_counts=True)
    return pairs[chosen[times == 2]]


def _paths(links, count):
    """Chains of particles of a graph whose nodes have at most two links; a ring begins at its lowest number."""
    near = [[] for _ in range(count)]
    for one, other in links.tolist():
        near[one].append(other)
        near[other].append(one)
    ends = [k for k in range(count) if len(near[k]) == 1] + [k for k in range(count) if len(near[k]) == 2]
    seen, chains = np.zeros(count, bool), []
    for start in ends:
        if seen[start]:
            continue
        chain = []
        at = start
        while at is not None:
            seen[at] = True
            chain.append(at)
            at = next((k for k in near[at] if not seen[k]), None)
        chains.append(np.array(chain))
    return chains


def force_clusters(particles, threshold=1.0):
    """(label [N], sizes [K]): clusters of particles joined by pair forces of at least `threshold` times the mean pair force; label -1
    without such a force. Sizes are numbers of particles, cluster by cluster, the largest first."""
    particles = Particles.of(particles, "pairs", "forces")
    pairs, force, _ = pair_forces(particles)
    size = np.linalg.norm(force, axis=1)
    strong = pairs[(size >= threshold * size.mean()) & (size > 0)] if len(size) else pairs
    graph = coo_matrix((np.ones(len(strong)), strong.T), shape=(particles.count,) * 2)
    _, label = connected_components(graph, directed=False)
    label = np.where(np.isin(np.arange(particles.count), strong), label, -1)
    names, sizes = np.unique(label[label >= 0], return_counts=True)
    order = np.argsort(-sizes, kind="stable")
    rank = np.full(label.max(initial=-1) + 2, -1)
    rank[names[order]] = np.arange(len(order))
    return rank[label], sizes[order]
