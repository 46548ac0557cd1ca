"""Stress of particles, and fields of density, velocity and stress on a grid.

Compression is positive: σ_ab = 1/V (Σ_contacts f_a l_b + Σ_particles m v'_a v'_b), f the force on the first particle of a contact, l
the vector from the centre of the second particle (at a wall: from the contact point) to the centre of the first, v' the velocity
of a centre less the mean velocity, in steady shear less the flow. Stress is in the run's unit of force over length^(D-1), for sigma_avg units ρ g σ_avg.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.special import erf

from .neighbours import sums
from .particles import Particles
from .sources import each, extent

_CUTOFF = 4.5     # widths from a particle or branch, beyond which its share of a field is left out
_ENTRIES = 2_000_000  # shares that are computed at a time


def particle_stress(particles, volumes=None):
    """[N, D, D] contact stress of each particle: Σ f_a (r - x)_b over its contacts at x, walls included, over its volume: `volumes`
    [N] (for example of `voronoi`), default its own area or volume. Zero without contacts."""
    particles = Particles.of(particles, "pairs", "forces")
    first, second = particles.pairs.T
    one, other = particles.branches
    pair = second >= 0
    at = np.concatenate([first, second[pair]])
    moment = np.concatenate([particles.forces[:, :, None] * one[:, None, :],
                             -particles.forces[pair, :, None] * other[pair, None, :]])
    total = sums(at, moment, particles.count)
    volumes = particles.bodies if volumes is None else np.broadcast_to(np.asarray(volumes, float), particles.count)
    return total / volumes[:, None, None]


def mean_stress(particles, volume=None, kinetic=True):
    """[D, D] stress of all contacts and, with `kinetic`, of the velocities of the particles' centres relative to the velocity of the
    centre of mass, over `volume`: default the periodic box; ValueError where it is open. In steady shear (`pliant shear -shear_rate`,
    or Particles with a shear_rate) velocities are relative to the flow; ValueError for a tilted box with an unknown shear rate."""
    particles = Particles.of(particles, "pairs", "forces", *(("velocities", "masses") if kinetic else ()))
    if volume is None:
        volume = particles.period.prod()
        if not np.isfinite(volume):
            raise ValueError("the particles have no closed periodic box; give volume=, the area (3D: volume) of the region")
    one, other = particles.branches
    total = np.einsum("ca,cb->ab", particles.forces, one - other)
    if kinetic:
        mass, velocity = particles.masses[particles.active], particles.fluctuations("mean_stress")[particles.active]
        total = total + np.einsum("n,na,nb->ab", mass, velocity, velocity)
    return total / volume


def pressure(stress):
    """[…] trace/D of stresses […, D, D]."""
    return np.trace(stress, axis1=-2, axis2=-1) / np.shape(stress)[-1]


def principal(stress):
    """([…, D] principal stresses, the largest first, […, D, D] their axes, unit vectors in the last dimension) of the symmetric
    part of stresses […, D, D]."""
    stress = np.asarray(stress, float)
    values, axes = np.linalg.eigh((stress + np.swapaxes(stress, -1, -2)) / 2)
    return values[..., ::-1], np.swapaxes(axes, -1, -2)[..., ::-1, :]


def shear(stress):
    """[…] half the difference of the largest and the least principal stress, in 2D the maximum shear stress."""
    values, _ = principal(stress)
    return (values[..., 0] - values[..., -1]) / 2


@dataclass(frozen=True)
class Fields:
    """Fields on a regular grid of the shape G = [n_x, n_y(, n_z)]."""

    axes: tuple                 #: D arrays: x [n_x], y [n_y], …
    number: np.ndarray          #: G number density
    density: np.ndarray         #: G mass density
    fraction: np.ndarray        #: G packing fraction
    velocity: np.ndarray        #: [G, D] momentum over mass density; NaN where nothing is near
    contact_stress: np.ndarray  #: [G, D, D]
    kinetic_stress: np.ndarray  #: [G, D, D] of velocities relative to `velocity`

    @property
    def stress(self):
        """[G, D, D] contact and kinetic stress."""
        return self.contact_stress + self.kinetic_stress

    @property
    def pressure(self):
        """G"""
        return pressure(self.stress)


class _Grid:
    """Regular points with their Gaussian weights, in a region that may be periodic in some directions."""

    def __init__(self, particles, width, spacing, region):
        self.low, high = extent(particles, region)
        closed = np.isfinite(particles.period)
        wanted = (high - self.low) / spacing
        self.shape = np.where(closed, np.maximum(np.ceil(wanted - 1e-9), 1), np.floor(wanted + 1e-9) + 1).astype(int)
        if self.shape.prod() > 5_000_000:
            raise ValueError(f"a spacing of {spacing:g} makes a grid of {' x '.join(map(str, self.shape))} points; give a larger "
                             "one")
        self.step = np.where(closed, (high - self.low) / self.shape, spacing)
        self.closed, self.width, self.dim = closed, width, particles.dim

    @property
    def axes(self):
        return tuple(low + step * np.arange(n) for low, step, n in zip(self.low, self.step, self.shape))

    def weights(self, start, branch):
        """Sparse matrix [points, M]: mean of the Gaussian over the lines from `start` [M, D] along `branch` [M, D], which may be
        zero."""
        length = np.linalg.norm(branch, axis=1)
        reach = _CUTOFF * self.width + length / 2
        # Lines of similar lengths at a time: the longest determines how many points are computed for each.
        level = np.ceil(2 * np.log2(reach)).astype(int)
        parts = [part for one in np.unique(level) for part in self._parts(np.flatnonzero(level == one), start, branch, length,
                                                                            reach)]
        rows, columns, shares = (np.concatenate(values) for values in zip(*parts)) if parts else ([], [], [])
        return csr_matrix((shares, (rows, columns)), shape=(self.shape.prod(), len(start)))

    def _parts(self, items, start, branch, length, reach):
        """Yields (points, lines, weights) of the lines `items`, some at a time."""
        farthest = reach[items].max()
        half = np.ceil(farthest / self.step + 0.5).astype(int)
        offsets = np.stack(np.meshgrid(*(np.arange(-n, n + 1) for n in half), indexing="ij"), -1).reshape(-1, self.dim)
        offsets = offsets[np.linalg.norm(offsets * self.step, axis=1) <= farthest + np.linalg.norm(self.step) / 2]
        chunk = max(1, _ENTRIES // len(offsets))
        for some in (items[k:k + chunk] for k in range(0, len(items), chunk)):
            nearest = np.round((start[some] + branch[some] / 2 - self.low) / self.step).astype(int)
            inside = np.ones((len(some), len(offsets)), bool)
            for axis in np.flatnonzero(~self.closed):
                index = nearest[:, axis, None] + offsets[:, axis]
                inside &= (index >= 0) & (index < self.shape[axis])
            row, column = np.nonzero(inside)
            item = some[row]
            index = [nearest[row, axis] + offsets[column, axis] for axis in range(self.dim)]
            away = [low + step * at - x for low, step, at, x in zip(self.low, self.step, index, start[item].T)]
            wrapped = [at % n if closed else at for at, n, closed in zip(index, self.shape, self.closed)]
            yield np.ravel_multi_index(wrapped, self.shape), item, self._share(away, branch[item].T, length[item])

    def _share(self, away, branch, length):
        """Mean of exp(-|away - s·branch|²/2w²)/(2πw²)^(D/2) over s from 0 to 1; away, branch [D][…], length […]."""
        w = self.width
        square = sum(x * x for x in away)
        norm = (2 * np.pi * w**2) ** (-self.dim / 2)
        if not length.any():
            return norm * np.exp(square / (-2 * w**2))
        length = np.maximum(length, 1e-9 * w)
        along = sum(x * b for x, b in zip(away, branch)) / length
        scale = 1 / (np.sqrt(2) * w)
        line = (erf(along * scale) - erf((along - length) * scale)) / length * np.sqrt(np.pi / 2) * w
        return norm * line * np.exp((square - along**2) / (-2 * w**2))

    def fold(self, values):
        """[G, …] of values [points, …]."""
        return values.reshape(*self.shape, *values.shape[1:])


def coarse_grained(source, width, spacing=None, region=None):
    """Fields by coarse-graining with the Gaussian φ of standard deviation `width` [I. Goldhirsch, Granul. Matter 12, 239 (2010);
    walls: T. Weinhart et al., Granul. Matter 14, 289 (2012)]:
    ρ = Σ m φ(x - r), contact stress Σ f_a l_b ∫φ along the lines from the contact point to the centres, kinetic stress
    Σ m v_a v_b φ - ρ V_a V_b, V = Σ m v φ/ρ. Density, momentum and stress fulfil the balance of momentum at every point.

    `source`: a Frame or Particles with masses, velocities, pairs and forces, or a Run or a list of these with equal boxes, which
    are averaged (V is then the mean velocity). The distance of grid points is `spacing` (default `width`). The grid fills a periodic box, in open directions
    `region`: lower and upper corner, default the extent of the centres of the first frame. The sum over a grid that holds all, times the volume of
    a grid cell, is the total mass or stress to about 1e-4. Up to two widths from a wall a part of each field lies behind it."""
    spacing = width if spacing is None else spacing
    for name, value in (("width", width), ("spacing", spacing)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} is {value:g}; give a positive length")
    grid, totals, count, box = None, None, 0, None
    for part in each(source, "masses", "velocities", "pairs", "forces"):
        part.upright("coarse_grained")
        if part.shear_rate:
            raise ValueError(f"coarse_grained: the box shears at the rate {part.shear_rate:g}, so that periodic images of particles have "
                             "different velocities; use mean_stress or particle_stress")
        if grid is None:
            grid, box = _Grid(part, width, spacing, region), part.box
        if not np.array_equal(box, part.box):
            raise ValueError(f"coarse_grained: the box is {_text(box)} in the first frame and {_text(part.box)} at time {part.time:g}; "
                             "average frames with equal boxes, or call it for each frame")
        now = _moments(part, grid)
        totals = now if totals is None else [a + b for a, b in zip(totals, now)]
        count += 1
    number, density, fraction, momentum, flux, contact = (grid.fold(total / count) for total in totals)
    near = density > 1e-12 * density.max()
    with np.errstate(invalid="ignore", divide="ignore"):
        velocity = np.where(near[..., None], momentum / density[..., None], np.nan)
    kinetic = np.where(near[..., None, None], flux - density[..., None, None] * velocity[..., :, None] * velocity[..., None, :], 0.0)
    return Fields(grid.axes, number, density, fraction, velocity, contact, kinetic)


def _text(box):
    """The box in messages."""
    return "open" if box is None else f"{box[1].tolist()} with origin {box[0].tolist()}"


def _moments(particles, grid):
    """Number, mass, volume, momentum, momentum flux and contact stress at the points of a grid."""
    present = particles.active
    places, velocity, mass = particles.positions[present], particles.velocities[present], particles.masses[present]
    weights = grid.weights(places, np.zeros_like(places))
    momentum = mass[:, None] * velocity
    flux = momentum[:, :, None] * velocity[:, None, :]
    dim = particles.dim
    first, second = particles.pairs.T
    one, other = particles.branches
    pair = second >= 0
    start = np.concatenate([particles.positions[first], particles.positions[second[pair]]])
    branch = -np.concatenate([one, other[pair]])  # towards the contact point
    force = np.concatenate([particles.forces, -particles.forces[pair]])
    moment = -force[:, :, None] * branch[:, None, :]
    contact = grid.weights(start, branch) @ moment.reshape(-1, dim * dim)
    total = weights @ np.c_[np.ones(len(places)), mass, particles.bodies[present], momentum, flux.reshape(-1, dim * dim)]
    number, density, fraction = total[:, :3].T
    return (number, density, fraction, total[:, 3:3 + dim], total[:, 3 + dim:].reshape(-1, dim, dim),
            contact.reshape(-1, dim, dim))
