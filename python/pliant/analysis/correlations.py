"""Pair correlation g(r) and structure factor S(k)."""

import numpy as np
import pandas as pd

from .neighbours import _check_distance, close_pairs
from .sources import each, extent

_BLOCK = 64  # particles


def radial_distribution(particles, r_max=None, bins=100, region=None, box=None, radii=None):
    """g(r): DataFrame with the columns r (middles of the bins), g, pairs (counted ordered pairs).

    `particles`: a Frame, Particles, positions [N, D], or a Run or a list of these, which are averaged. r_max: default 5 mean
    diameters, with positions alone a quarter of the region. In open directions each pair begins at a particle whose distance
    from the border of `region` (lower and upper corner, default the extent of the centres) is at least r_max, so that its
    shells are full. g is the number of pairs over their number at the mean density of the region. ValueError if no particle is
    that far inside."""
    counts = wanted = 0.0
    edges = None
    for part in each(particles, box=box, radii=radii):
        corners = extent(part, region)
        size = corners[1] - corners[0]
        if edges is None:
            if r_max is None:
                r_max = 10 * part.radii[part.active].mean() if part.radii is not None else size.min() / 4
                r_max = min(r_max, part.half_lattice)
            edges = np.linspace(0, r_max, bins + 1)
        _check_distance(part, edges[-1], "r_max")
        places = part.positions[part.active]
        open_ = ~np.isfinite(part.period)
        inside = ((places >= corners[0]) & (places <= corners[1]))[:, open_].all(1)
        first = inside & ((places - corners[0] >= edges[-1]) & (corners[1] - places >= edges[-1]))[:, open_].all(1)
        if not first.any():
            raise ValueError(f"no particle is r_max = {edges[-1]:g} inside the region of size {size}; give a smaller r_max, or "
                             "a larger region=(lower corner, upper corner)")
        pairs = close_pairs(part, edges[-1])
        distance = np.linalg.norm(part.relative(*pairs.T), axis=1)
        begins = np.zeros(part.count)
        begins[part.active] = first
        counts = counts + np.histogram(distance, edges, weights=begins[pairs].sum(1))[0]
        # The centre itself is one of the particles in a periodic box, and absent from its own shells.
        others = inside.sum() - (0 if open_.any() else 1)
        wanted = wanted + first.sum() * others / size.prod()
    shells = np.pi * np.diff(edges**2) if part.dim == 2 else 4 / 3 * np.pi * np.diff(edges**3)
    return pd.DataFrame({"r": (edges[1:] + edges[:-1]) / 2, "g": counts / (wanted * shells), "pairs": counts.astype(int)})


def wave_vectors(size, k_max, bins, per_bin, seed=1):
    """([K, D] wave vectors 2π n/size with 0 < |k| <= k_max, [K] bin of each): one of k and -k, at most `per_bin` of a bin,
    drawn at random."""
    size = np.asarray(size, float)
    most = np.floor(k_max * size / (2 * np.pi)).astype(int)
    if not most.any():
        raise ValueError(f"k_max = {k_max:g} is below the smallest wave number {2 * np.pi / size.max():g}; give a larger one")
    grids = np.meshgrid(*(np.arange(0 if axis == 0 else -m, m + 1) for axis, m in enumerate(most)), indexing="ij")
    whole = np.stack([g.ravel() for g in grids], 1)
    sign = np.sign(whole)
    leading = sign[np.arange(len(sign)), np.argmax(sign != 0, axis=1)]
    whole = whole[leading > 0]
    k = 2 * np.pi * whole / size
    length = np.linalg.norm(k, axis=1)
    k, length = k[length <= k_max], length[length <= k_max]
    at = np.minimum((length / k_max * bins).astype(int), bins - 1)
    order = np.lexsort((np.random.default_rng(seed).random(len(at)), at))
    rank = np.arange(len(at)) - np.searchsorted(at[order], at[order])
    chosen = np.sort(order[rank < per_bin])
    return k[chosen], at[chosen]


def structure_factor(particles, k_max=None, bins=100, per_bin=10, region=None, box=None, radii=None, seed=1):
    """S(k) = |Σ exp(-i k·r)|²/N: DataFrame with the columns k (mean of the wave numbers of a bin), S, vectors (wave vectors of
    the bin, without their opposites, over all boxes of the frames); bins without a wave vector are left out.

    `particles` as of `radial_distribution`. Wave vectors are multiples of 2π/L, L the lengths of the box of each frame or, in
    open directions, of `region` (default: the extent of the centres), whose particles alone count; at most `per_bin` random ones
    (seed) of a bin are used. k_max: default 2π·4 over the mean diameter, with positions alone over the mean distance, of the
    first frame. In open regions S of the smallest k contains the shape of the region."""
    vectors, total, weight, length = {}, np.zeros(bins), np.zeros(bins), np.zeros(bins)
    for part in each(particles, box=box, radii=radii):
        part.upright("structure_factor")
        corners = extent(part, region)
        size = corners[1] - corners[0]
        places = part.positions[part.active]
        open_ = ~np.isfinite(part.period)
        places = places[((places >= corners[0]) & (places <= corners[1]))[:, open_].all(1)]
        if k_max is None:
            spacing = (np.prod(size) / len(places)) ** (1 / part.dim)
            k_max = 8 * np.pi / (2 * part.radii[part.active].mean() if part.radii is not None else spacing)
        if tuple(size) not in vectors:
            vectors[tuple(size)] = wave_vectors(size, k_max, bins, per_bin, seed)
        k, at = vectors[tuple(size)]
        total += np.bincount(at, _intensity(places - corners[0], k, size), bins)
        length += np.bincount(at, np.linalg.norm(k, axis=1), bins)
        weight += np.bincount(at, minlength=bins)
    with np.errstate(invalid="ignore"):
        table = pd.DataFrame({"k": length / weight, "S": total / weight,
                              "vectors": sum(np.bincount(at, minlength=bins) for _, at in vectors.values())})
    return table[table["vectors"] > 0].reset_index(drop=True)


def _powers(base, most):
    """[most + 1, n] base^0 … base^most of complex numbers [n]: each from two smaller powers, so that rounding grows with the
    logarithm only."""
    powers = np.empty((most + 1, len(base)), complex)
    powers[0] = 1
    known, power = 1, base
    while known <= most:
        more = min(known, most + 1 - known)
        np.multiply(powers[:more], power, out=powers[known:known + more])
        known, power = 2 * known, power * power
    return powers


def _intensity(places, k, size):
    """[K] |Σ exp(-i k·r)|²/N: exp(-i k·r) is a product of powers of exp(-2πi x/L), one of each axis, which all k share. Some
    particles at a time, because their powers should stay in the cache."""
    whole = np.round(k * size / (2 * np.pi)).astype(int)
    total = np.zeros(len(k), complex)
    for start in range(0, len(places), _BLOCK):
        phase = np.exp(-2j * np.pi / size * places[start:start + _BLOCK])
        product = None
        for axis, number in enumerate(whole.T):
            most = np.abs(number).max()
            powers = _powers(phase[:, axis], most)
            # Rows from `most` + 1 on belong to the numbers -most … -1.
            powers = np.concatenate([powers, powers[:0:-1].conj()])[number]
            product = powers if product is None else np.multiply(product, powers, out=product)
        total += product.sum(1)
    return np.abs(total) ** 2 / max(len(places), 1)
