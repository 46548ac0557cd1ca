"""Displacements between frames: mean squared displacement, D²_min, deformation, non-affine motion."""

import numpy as np
import pandas as pd

from .. import nonaffine
from ..run import Frame
from .neighbours import Neighbours, nearest, within
from .particles import Particles
from .sources import several

_PAIRS = 100      # pairs of frames per lag, by default
_LAGS = 50


def _tracks(source):
    """(times [F], unwrapped positions [F, N, D], reinsertions [F, N]) of a run or of a list of its frames; NaN for absent
    particles."""
    frames = list(several(source))
    if len(frames) < 2:
        raise ValueError(f"{len(frames)} frames have no displacements; write frames more often (-frame_interval)")
    if isinstance(frames[0], Particles):
        if all(f.ids is not None for f in frames):
            ids = np.unique(np.concatenate([f.ids for f in frames]))
            frames = [f.in_order(ids) for f in frames]
        moved = np.array([displacements(a, b) for a, b in zip(frames, frames[1:])])
        places = np.concatenate([np.zeros((1, *moved.shape[1:])), np.nancumsum(moved, axis=0)])
        # A particle that was absent has an unknown displacement from then on, as one that was reinserted.
        jumps = np.concatenate([np.zeros((1, moved.shape[1]), int), np.cumsum(np.isnan(moved[:, :, 0]), axis=0)])
        return np.array([f.time for f in frames]), places, jumps
    places = np.array([np.where(f.active[:, None], f.unwrapped_centres, np.nan) for f in frames])
    return np.array([f.time for f in frames]), places, np.array([f.reinsertions for f in frames])


def _lags(frames, lags):
    if lags is None:
        lags = np.arange(1, frames) if frames <= 2 * _LAGS else np.unique(np.geomspace(1, frames - 1, _LAGS).astype(int))
    lags = np.unique(np.asarray(lags, int))
    if not len(lags) or lags[0] < 1 or lags[-1] >= frames:
        raise ValueError(f"lags are {lags.tolist()}; give numbers of frames from 1 to {frames - 1}")
    return lags


def mean_squared_displacement(source, times=None, reinsertions=None, lags=None, drift=True, origins=_PAIRS):
    """DataFrame, one row per lag: time (mean time between the frames), msd, msd_x, msd_y [msd_z], alpha2 (non-Gaussian
    parameter <u⁴> D/((D+2) <u²>²) - 1), samples (displacements averaged).

    `source`: a Run, a list of its frames, a list of Particles (which move less than half a periodic box from one to the next), or
    unwrapped positions [F, N, D] with NaN for absent particles, `times` [F] and, if
    particles jump, `reinsertions` [F, N], a counter that grows with each jump. Displacements across a reinsertion do not
    count. lags: numbers of frames (default all up to 100 frames, else 50 in geometric order). drift=False subtracts the
    mean displacement of all particles from each displacement. At most `origins` pairs of frames are averaged for a lag, spread
    evenly."""
    if isinstance(source, np.ndarray):
        places = np.asarray(source, float)
        if places.ndim != 3 or places.shape[2] not in (2, 3):
            raise ValueError(f"positions has the shape {list(places.shape)}; give [frames, N, 2] or [frames, N, 3]")
        times = np.arange(len(places)) if times is None else np.asarray(times, float)
        jumps = np.zeros(places.shape[:2], int) if reinsertions is None else np.asarray(reinsertions)
        if times.shape != places.shape[:1] or jumps.shape != places.shape[:2]:
            raise ValueError(f"times has the shape {list(times.shape)} and reinsertions {list(jumps.shape)}; give "
                             f"[{len(places)}] and {list(places.shape[:2])}")
    else:
        times, places, jumps = _tracks(source)
    dim, rows = places.shape[2], []
    for lag in _lags(len(places), lags):
        starts = np.unique(np.linspace(0, len(places) - 1 - lag, min(origins, len(places) - lag)).astype(int))
        squares, fourth, samples, apart = np.zeros(dim), 0.0, 0, 0.0
        for start in starts:
            moved = places[start + lag] - places[start]
            moved = moved[(jumps[start + lag] == jumps[start]) & np.isfinite(moved).all(1)]
            if not drift and len(moved):
                moved = moved - moved.mean(0)
            square = moved**2
            squares += square.sum(0)
            fourth += (square.sum(1) ** 2).sum()
            samples += len(moved)
            apart += times[start + lag] - times[start]
        with np.errstate(invalid="ignore", divide="ignore"):
            each = squares / np.float64(samples)
            alpha = fourth / np.float64(samples) * dim / ((dim + 2) * each.sum() ** 2) - 1
        rows.append({"time": apart / len(starts), "msd": each.sum(), **{f"msd_{a}": m for a, m in zip("xyz", each)},
                     "alpha2": alpha, "samples": samples})
    return pd.DataFrame(rows)


def _same_particles(before, after, box):
    """Two Frames, or two Particles with the same particles in the same rows as `before`. ValueError for others."""
    if isinstance(before, Frame) and isinstance(after, Frame):
        one, other = before.run.topology.sigma, after.run.topology.sigma
        if not np.array_equal(one, other):
            raise ValueError(f"{before.run.path} has {len(one)} particles and {after.run.path} {len(other)}, or their sizes differ; "
                             "give two frames of the same run")
        return before, after
    before, after = (Particles.of(one, box=box) for one in (before, after))
    if before.dim == after.dim and not np.array_equal(np.isfinite(before.period), np.isfinite(after.period)):
        raise ValueError(f"the periods are {before.period.tolist()} before and {after.period.tolist()} after, inf in open directions; "
                         "give both moments a box that is open in the same directions")
    if before.dim == after.dim and before.ids is not None and after.ids is not None:
        return before, after.in_order(before.ids)
    if before.positions.shape != after.positions.shape:
        raise ValueError(f"the positions have the shapes {list(before.positions.shape)} and {list(after.positions.shape)}; give "
                         "the same particles in the same order, or Particles(positions, ids=…)")
    return before, after


def displacements(before, after, box=None):
    """[N, D] displacements between two frames of a run, or two arrays [N, D] or Particles; NaN for particles that are absent in
    one of them, or were reinserted in between. Rows belong to the particles of `before`; Particles with ids may have other particles, too.
    Arrays and Particles: in a periodic box each particle must move by less than half the box, apart from the strain of the box."""
    before, after = _same_particles(before, after, box)
    if isinstance(before, Frame):
        return after.displacements(before)
    strained = before.positions
    if not np.array_equal(before.lattice, after.lattice):
        origin = before.box[0]
        strained = origin + (strained - origin) @ _strain_of_box(before.lattice, after.lattice)
    moved = strained + after.nearest_image(after.positions - strained) - before.positions
    stayed = before.active & after.active
    if before.reinsertions is not None and after.reinsertions is not None:
        stayed = stayed & (before.reinsertions == after.reinsertions)
    return np.where(stayed[:, None], moved, np.nan)


def _invertible(lattice):
    """The lattice [D, D] with edges of length 1 in open directions, where its edges are zero."""
    return lattice + np.diag(np.diag(lattice) == 0)


def _strain_of_box(before, after):
    """[D, D] matrix M of the motion r → r M of vectors that follow the box from one lattice [D, D] to another; 1 in open directions."""
    return np.linalg.solve(_invertible(before), _invertible(after))


def _lattices(before, after, box):
    """The lattices [D, D] of two moments, the edges of the second the ones that the edges of the first have become."""
    if isinstance(before, Frame) and isinstance(after, Frame):
        if before.box is None:
            return None
        return before.followed_lattice, after.followed_lattice
    before, after = (Particles.of(one, box=box) for one in (before, after))
    return None if before.box is None else (before.lattice, after.lattice)


def _changes(before, after, neighbours, moved, box):
    """[M, D] change of the vectors from the first to the second particle of each pair of neighbours in `before`, whose
    displacements are `moved` [N, D]. Images move with the lattice."""
    change = moved[neighbours.second] - moved[neighbours.first]
    lattices = _lattices(before, after, box)
    if lattices is None or np.array_equal(*lattices):
        return change
    place = before.unwrapped_centres if isinstance(before, Frame) else Particles.of(before, box=box).positions
    apart = neighbours.vectors - (place[neighbours.second] - place[neighbours.first])
    return change + np.round(np.linalg.solve(_invertible(lattices[0]).T, apart.T).T) @ (lattices[1] - lattices[0])


def _bundles(before, after, neighbours, box):
    """(Neighbours, [M, D] vectors before, [M, D] after, [M] bool: both particles were there and not reinserted)."""
    moved = displacements(before, after, box)
    if neighbours is None:
        neighbours = _usual_neighbours(_present(before, moved, box))
    change = _changes(before, after, neighbours, moved, box)
    known = np.isfinite(change).all(1)
    return neighbours, neighbours.vectors, neighbours.vectors + np.where(known[:, None], change, 0.0), known


def _usual_neighbours(particles):
    """The 15 nearest; all others in an open box with fewer."""
    others = int(particles.active.sum()) - 1
    count = 15 if np.isfinite(particles.half_lattice) and others >= 0 else min(15, others)
    if count < 1:
        none = np.zeros(0, int)
        return Neighbours(particles.count, none, none, np.zeros((0, particles.dim)), np.zeros(0))
    return nearest(particles, count)


def _present(before, moved, box):
    """The particles of `before` that have displacements."""
    there = np.isfinite(moved).all(1)
    part = Particles.of(before, box=box)
    return Particles(np.where(there[:, None], part.positions, 0.0), box=part.box, tilt=part.tilt, active=there)


def d2_min(before, after, neighbours=None, box=None):
    """(D²_min [N], neighbours [N]): the least sum over the neighbours of |r' - F r|², r and r' their places relative to the
    particle before and after, over all matrices F [M. L. Falk and J. S. Langer, Phys. Rev. E 57, 7192 (1998)]. In the
    square of the run's length; divide by the number of neighbours for the mean.

    before, after: as of `displacements`. `neighbours`: Neighbours in `before` (`within`, `nearest`, …); default the 15 nearest of
    the particles that are in both, in a small periodic box images included, in an open box all others if they are fewer.
    Reinserted or absent particles neither have a value nor count. NaN with fewer than three neighbours (3D: four)."""
    neighbours, old, new, known = _bundles(before, after, neighbours, box)
    _, row, used = neighbours.padded()
    if not row.size:
        return np.full(neighbours.count, np.nan), np.zeros(neighbours.count, int)
    return nonaffine.d2_min(old[row], new[row], used & known[row])


def deformation(before, after, neighbours=None, box=None):
    """[N, D, D] matrix F of the affine motion r' ≈ F r of the neighbours of each particle that leaves D²_min; F - 1 is the local
    displacement gradient du_i/dx_j. NaN where neighbours are too few, or on a line (3D: plane). Arguments as of `d2_min`."""
    neighbours, old, new, known = _bundles(before, after, neighbours, box)
    old, new = (np.where(known[:, None], side, 0.0) for side in (old, new))
    left = neighbours.sums(old[:, :, None] * old[:, None, :])
    right = neighbours.sums(new[:, :, None] * old[:, None, :])
    scale = np.trace(left, axis1=1, axis2=2)
    dim = old.shape[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        solvable = np.linalg.det(left) > 1e-9 * scale**dim
    result = np.full((neighbours.count, dim, dim), np.nan)
    result[solvable] = np.linalg.solve(left[solvable], right[solvable].transpose(0, 2, 1)).transpose(0, 2, 1)
    return result


def strain(gradient):
    """(symmetric strain [N, D, D], rotation [N, D, D]) of deformations F [N, D, D]: parts of F - 1 for small motion."""
    change = np.asarray(gradient, float) - np.eye(np.shape(gradient)[-1])
    turned = np.swapaxes(change, -1, -2)
    return (change + turned) / 2, (change - turned) / 2


def non_affine_displacements(before, after, width, box=None):
    """[N, D] displacement less its mean around the particle: weights exp(-r²/(2 width²)) of the particles up to 4 widths away,
    itself included. NaN for particles without a displacement. The strain of a periodic box that changes is subtracted exactly,
    any other homogeneous strain only where the neighbours are distributed evenly on all sides; D²_min subtracts it at borders, too."""
    moved = displacements(before, after, box)
    there = np.isfinite(moved).all(1)
    near = within(_present(before, moved, box), 4 * width)
    weight = np.exp(-(near.vectors**2).sum(1) / (2 * width**2))
    filled = np.where(there[:, None], moved, 0.0)
    change = _changes(before, after, near, filled, box)
    lattices = _lattices(before, after, box)
    if lattices is not None and not np.array_equal(*lattices):
        change = change - near.vectors @ (_strain_of_box(*lattices) - np.eye(near.vectors.shape[1]))
    mean = near.sums(weight[:, None] * change) / (1 + near.sums(weight))[:, None]
    return np.where(there[:, None], -mean, np.nan)
