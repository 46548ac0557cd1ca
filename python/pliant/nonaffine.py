"""Non-affine motion of disks [T 3.3-3.10]: mean displacement on a grid, neighbours, D2_min, strain, intervals.

Works on arrays; tracks.py reads runs, channel_analysis.py combines both.
"""

from dataclasses import dataclass

import numpy as np

from .errors import RunError

FEWEST_NEIGHBOURS = 3  # in 2D; two always fit
_CHUNK = 4_000_000     # bytes of an array that is processed at a time: fits into the cache


# ---- pairs of frames -------------------------------------------------------------------------------------------------

def spacing(pushes):
    """Median travel from one frame to the next, in cm. RunError if no push has two frames."""
    steps = [np.diff(push.travel) for push in pushes]
    steps = np.concatenate(steps) if steps else np.zeros(0)
    if not len(steps):
        raise RunError("no push has two frames")
    return float(np.median(steps))


def frame_pairs(travel, interval, tolerance, stride=1):
    """(before, after): indices [M] of frames of one push that are `interval` of travel [F] apart, within `tolerance`
    (cm); every `stride`-th frame begins a pair if there is one."""
    before = np.arange(0, len(travel), stride)
    target = travel[before] + interval
    above = np.clip(np.searchsorted(travel, target), 1, max(len(travel) - 1, 1))
    above = np.minimum(above, len(travel) - 1)
    below = np.maximum(above - 1, 0)
    after = np.where(target - travel[below] < travel[above] - target, below, above)
    near = (np.abs(travel[after] - target) <= tolerance) & (after > before)
    return before[near], after[near]


# ---- neighbours ------------------------------------------------------------------------------------------------------

def surface_distances(position, radius, present):
    """[M, N, N] |r_n - r_0| - R_n - R_0 [T 3.5] of disk n (last) from disk 0; infinite from itself, and from and to
    disks that are not present. position [M, N, 2], radius [N], present [M, N]."""
    place = np.where(present[..., None], position, np.inf)
    with np.errstate(invalid="ignore"):
        x = place[:, None, :, 0] - place[:, :, None, 0]
        y = place[:, None, :, 1] - place[:, :, None, 1]
        x *= x
        y *= y
        x += y
        np.sqrt(x, out=x)
    x -= radius
    x -= radius[:, None]
    x[np.isnan(x)] = np.inf  # both are missing
    x[:, np.arange(len(radius)), np.arange(len(radius))] = np.inf
    return x


def chunks(frames, particles):
    """Slices of frames whose distances of all disks from all fit the cache."""
    step = max(1, _CHUNK // (8 * max(particles, 1) ** 2))
    return [slice(i, i + step) for i in range(0, frames, step)]


def neighbours(position, radius, present, count=15, within=None):
    """([M, N, K] indices, [M, N, K] bool: is a neighbour) of the `count` disks nearest by surface distance, the nearest
    first, or of all within the surface distance `within`. Equal distances are decided by the order of the disks."""
    frames, particles = present.shape
    found = []
    for part in chunks(frames, particles):
        distance = surface_distances(position[part], radius, present[part])
        wanted = count if within is None else int((distance <= within).sum(-1).max(initial=0))
        wanted = min(wanted, particles - 1)
        nearest = np.argpartition(distance, max(wanted - 1, 0), axis=-1)[..., :wanted]
        size = np.take_along_axis(distance, nearest, axis=-1)
        order = np.argsort(size, axis=-1)
        nearest, size = (np.take_along_axis(values, order, axis=-1) for values in (nearest, size))
        found.append((nearest, np.isfinite(size) if within is None else size <= within))
    width = max((index.shape[-1] for index, _ in found), default=0)
    index = np.zeros((frames, particles, width), np.int32)
    used = np.zeros((frames, particles, width), bool)
    for part, (nearest, mask) in zip(chunks(frames, particles), found):
        index[part, :, :nearest.shape[-1]] = nearest
        used[part, :, :nearest.shape[-1]] = mask
    return index, used


class Neighbourhoods:
    """Neighbours of the disks of one push, found once for all intervals: the neighbours of a displacement are the
    nearest of the disks that are also present at its end."""

    def __init__(self, position, radius, present, count=15, within=None):
        """position [F, N, 2], radius [N], present [F, N]; the rest as `neighbours`."""
        self.position, self.radius, self.present, self.count, self.within = position, radius, present, count, within
        # Some to spare for those that are missing at the end.
        spare = 1 if present.all() else 2
        self.index, self.used = neighbours(position, radius, present, spare * count, within)

    def of(self, before, after, disk):
        """([S, K], [S, K] bool) as `neighbours`, of `disk` [S] from the frames `before` [S] to `after` [S]."""
        index, used = self.index[before, disk], self.used[before, disk]
        if self.present.all():
            return index, used
        used &= self.present[after[:, None], index]
        if self.within is not None:
            return index, used
        short = np.flatnonzero(~used[:, :self.count].all(1))
        order = np.argsort(~used[short], axis=1, kind="stable")
        index[short], used[short] = (np.take_along_axis(values[short], order, 1) for values in (index, used))
        index, used = index[:, :self.count], used[:, :self.count].copy()
        # Where even those to spare are too few: all disks of these frames.
        short = short[~used[short].all(1)]
        pairs, at = np.unique(np.stack([before[short], after[short]], 1), axis=0, return_inverse=True)
        if len(pairs):
            there = self.present[pairs[:, 0]] & self.present[pairs[:, 1]]
            every, known = neighbours(self.position[pairs[:, 0]], self.radius, there, self.count)
            at = at.ravel()  # some versions of numpy keep an axis
            index[short], used[short] = every[at, disk[short]], known[at, disk[short]]
        return index, used


# ---- D2_min ----------------------------------------------------------------------------------------------------------

def d2_min(before, after, used=None):
    """(D2_min [...], neighbours [...]): the least sum over the neighbours of |after - F before|^2, over all matrices F
    [T 3.4]. before, after [..., K, 2] are relative to the reference disk, so that the fit goes through it.

    `used` [..., K] bool: mask of the neighbours. NaN with fewer than three (in 3D, vectors [..., K, 3]: four). Where all
    neighbours are on a line, which leaves F open, the least sum is unique all the same. Closed form by normal equations; the
    sum is taken over the residuals themselves, so that an affine motion leaves their rounding only.
    """
    before, after = np.asarray(before, float), np.asarray(after, float)
    if before.shape[-1] == 3:
        return _d2_min_3d(before, after, used)
    x, y, u, v = before[..., 0], before[..., 1], after[..., 0], after[..., 1]
    if used is None:
        used = np.ones(x.shape, bool)
    if not used.all():
        x, y, u, v = (np.where(used, a, 0.0) for a in (x, y, u, v))
    number = used.sum(-1)

    def dot(a, b):
        return np.einsum("...k,...k->...", a, b)

    xx, xy, yy = dot(x, x), dot(x, y), dot(y, y)
    determinant = xx * yy - xy * xy
    line = determinant <= 1e-12 * (xx + yy) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / determinant

        def row(ax, ay):
            return (ax * yy - ay * xy) * inverse, (ay * xx - ax * xy) * inverse

        total = 0.0
        for a in (u, v):
            fx, fy = row(dot(a, x), dot(a, y))
            rest = a - fx[..., None] * x
            rest -= fy[..., None] * y
            total = total + dot(rest, rest)
    total = np.asarray(total)
    line &= number >= FEWEST_NEIGHBOURS
    if line.any():
        left = np.stack([x[line], y[line]], -1)
        right = np.stack([u[line], v[line]], -1)
        total[line] = _residues(left, right)
    return np.where(number >= FEWEST_NEIGHBOURS, total, np.nan), number


def _residues(before, after):
    """[…] least sums of squares of after − before · F, for vectors […, K, D] and any matrix F [D, D]."""
    rest = after - before @ (np.linalg.pinv(before, rcond=1e-6) @ after)
    return (rest**2).sum((-1, -2))


def _d2_min_3d(before, after, used):
    """`d2_min` of vectors in 3D, by the pseudoinverse of the matrix of the neighbours."""
    used = np.ones(before.shape[:-1], bool) if used is None else used
    before, after = (np.where(used[..., None], side, 0.0) for side in (before, after))
    number = used.sum(-1)
    return np.where(number > FEWEST_NEIGHBOURS, _residues(before, after), np.nan), number


def push_d2_min(position, before, after, disk, index, used):
    """(D2_min [S], neighbours [S]) of `disk` [S] from the frames `before` [S] to `after` [S] of a push; position [F, N,
    2], index and used [S, K] as of `Neighbourhoods`."""
    particles = position.shape[1]
    total, number = np.full(len(disk), np.nan), np.zeros(len(disk), int)
    places = np.ascontiguousarray(position, float).view(complex).ravel()  # one gather for both coordinates
    step = max(1, _CHUNK // (64 * max(index.shape[1], 1)))
    for part in (slice(i, i + step) for i in range(0, len(disk), step)):
        def relative(frame):
            first = particles * frame[part]
            place = places.take(index[part] + first[:, None]) - places.take(first + disk[part])[:, None]
            return place.view(float).reshape(*place.shape, 2)

        with np.errstate(invalid="ignore"):  # disks that are missing
            total[part], number[part] = d2_min(relative(before), relative(after), used[part])
    return total, number


# ---- fields ----------------------------------------------------------------------------------------------------------

@dataclass(frozen=True)
class Grid:
    """Square cells; cell (0, 0) begins at low * width, so that the origin is always a corner of cells."""

    width: float
    low: tuple
    shape: tuple

    @classmethod
    def over(cls, places, width):
        """The cells that hold all `places`, arrays [..., 2] with NaN where there is nothing."""
        lows, highs = zip(*((np.nanmin(p, axis=tuple(range(p.ndim - 1))), np.nanmax(p, axis=tuple(range(p.ndim - 1))))
                            for p in places))
        low = np.floor(np.min(lows, axis=0) / width).astype(int)
        high = np.floor(np.max(highs, axis=0) / width).astype(int)
        if np.prod(high - low + 1.0) > 1e6:
            raise RunError(f"cells of {width:g} cm make a grid of {high[0] - low[0] + 1} x {high[1] - low[1] + 1} "
                           "(are lengths in cm? see --scale, --cell)")
        return cls(float(width), tuple(low), tuple(high - low + 1))

    @property
    def cells(self):
        return self.shape[0] * self.shape[1]

    @property
    def centres(self):
        """[cells, 2] in cm"""
        i, j = np.divmod(np.arange(self.cells), self.shape[1])
        return (np.stack([i + self.low[0], j + self.low[1]], -1) + 0.5) * self.width

    def cell(self, position):
        """The cells of positions [S, 2]."""
        index = np.floor(position / self.width).astype(int) - self.low
        return index[:, 0] * self.shape[1] + index[:, 1]


def moments(grid, start, displacement, cell=None):
    """[12, cells] sums of 1, x, y, xx, xy, yy, u, v, ux, uy, vx, vy over samples in each cell of their start; sums of
    several runs are the values of all their samples. start, displacement: [S, 2]."""
    cell = grid.cell(start) if cell is None else cell
    (x, y), (u, v) = start.T, displacement.T
    return np.stack([np.bincount(cell, weights, grid.cells).astype(float)
                     for weights in (None, x, y, x * x, x * y, y * y, u, v, u * x, u * y, v * x, v * y)])


@dataclass(frozen=True)
class Field:
    """Mean displacement in each cell, at the mean of the places where its samples begin; NaN with too few of them."""

    grid: Grid
    count: np.ndarray      #: [cells]
    place: np.ndarray      #: [cells, 2]
    mean: np.ndarray       #: [cells, 2]
    gradient: np.ndarray   #: [cells, 2, 2] d mean_i/d x_j [T 3.9]

    @classmethod
    def of(cls, grid, sums, min_count=10):
        """From `moments`. The gradient in a cell is the slope of the straight-line fit to all samples in the block of 3
        x 3 cells around it: exact for homogeneous strain, for any places of the samples."""
        enough = sums[0] >= max(min_count, 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            place, mean = (np.where(enough, sums[k:k + 2] / sums[0], np.nan).T for k in (1, 6))
        table = np.pad(np.where(enough, sums, 0.0).reshape(12, *grid.shape), ((0, 0), (1, 1), (1, 1)))
        block = sum(table[:, 1 + i:1 + i + grid.shape[0], 1 + j:1 + j + grid.shape[1]]
                    for i in (-1, 0, 1) for j in (-1, 0, 1)).reshape(12, -1)
        n, x, y, xx, xy, yy, u, v, ux, uy, vx, vy = block
        with np.errstate(divide="ignore", invalid="ignore"):
            cxx, cxy, cyy = xx - x * x / n, xy - x * y / n, yy - y * y / n
            determinant = cxx * cyy - cxy * cxy
            # Samples on a line do not determine the derivative across the line.
            known = enough & (determinant > 1e-6 * (cxx + cyy) ** 2)
            rows = []
            for w, wx, wy in ((u, ux, uy), (v, vx, vy)):
                ax, ay = wx - w * x / n, wy - w * y / n
                rows.append(np.stack([ax * cyy - ay * cxy, ay * cxx - ax * cxy], -1) / determinant[:, None])
        gradient = np.where(known[:, None, None], np.stack(rows, 1), np.nan)
        return cls(grid, sums[0], place, mean, gradient)

    def at(self, start, cell, interpolation):
        """[S, 2] mean displacement at samples' starts [S, 2] in their cells [S]: `cell`, the mean of the cell;
        `linear`, the mean with the cell's gradient. NaN where the field is not known."""
        value = self.mean[cell]
        if interpolation == "linear":
            value = value + np.einsum("sij,sj->si", self.gradient[cell], start - self.place[cell])
        return value

    @property
    def strain(self):
        """[cells] |DF| [T 3.10]: the Frobenius norm of the gradient, rotation included."""
        return np.sqrt((self.gradient**2).sum((1, 2)))


def strain_clock(intervals, strain, df0):
    """[cells] index of the interval whose |DF| is nearest to df0, -1 where none is known. intervals [K], strain [K,
    cells]; of two that are equally near the shorter one."""
    off = np.abs(np.asarray(strain) - df0)
    known = np.isfinite(off)
    if not len(intervals):
        return np.full(off.shape[1:], -1)
    return np.where(known.any(0), np.argmin(np.where(known, off, np.inf), axis=0), -1)


# ---- statistics ------------------------------------------------------------------------------------------------------

def _variance_of_jackknife(function, sums, total, length):
    """Variance of function(total) from leaving out one stretch of `length` successive blocks after the other; a remaining last
    block is never left out."""
    blocks = len(sums[0])
    others = [function(*(t - s[b:b + length].sum(0) for t, s in zip(total, sums))) for b in range(0, blocks - length + 1, length)]
    return (blocks - length) ** 2 / (length * blocks) * np.var(np.array(others, float), axis=0, ddof=1)


def jackknife(function, sums):
    """(value, error) of function(sum over blocks), error [same shape]; NaN with fewer than two blocks. sums: list of arrays
    [blocks, …] in the order of time, all given to `function` without their first axis.

    The variance comes from leaving out single blocks (v1) and, with at least four blocks, pairs of successive blocks (v2).
    Correlations of successive blocks make v2 larger than v1: the variance is v1 + 2 max(0, v2 - v1), which is exact if each block is
    correlated with the next one only and the blocks are many (the same rule as slow_average in src/analysis)."""
    blocks = len(sums[0])
    total = [s.sum(0) for s in sums]
    value = np.asarray(function(*total), float)
    if blocks < 2:
        return value, np.full(value.shape, np.nan)
    with np.errstate(invalid="ignore"):
        variance = _variance_of_jackknife(function, sums, total, 1)
        if blocks >= 4:
            variance = variance + 2 * np.fmax(0, _variance_of_jackknife(function, sums, total, 2) - variance)
        return value, np.sqrt(variance)


def exponent(x, y):
    """Slope of the straight line through log y against log x, by least squares; NaN with fewer than two points."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    good = np.isfinite(x) & np.isfinite(y) & (x > 0) & (y > 0)
    if good.sum() < 2 or np.ptp(np.log(x[good])) == 0:
        return np.nan
    return float(np.polyfit(np.log(x[good]), np.log(y[good]), 1)[0])
