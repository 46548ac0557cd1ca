"""Analysis of disks that are pushed through a channel, as in chapter 3 and appendix A of the thesis: mean displacement
field, non-affine displacement, D2_min, strain clock, rotation ([T n] are its equations; docs/scenarios/channel-analysis.md).

>>> from pliant import channel_analysis as channel, tracks
>>> result, = channel.analyse([tracks.load("runs/bidisperse")], channel.Choices())
>>> result["dr_na"]["centre"]["value"]
"""

from dataclasses import asdict, dataclass, field, fields

import numpy as np

from . import nonaffine, tracks
from .errors import RunError
from .nonaffine import Field, Grid, exponent, jackknife

REGIONS = ("all", "centre")
#: Averaged quantities: name → power of <R> by which the quantity is divided.
QUANTITIES = {"displacement": 1, "dr_na": 1, "d2_min_sum": 2, "d2_min_per_neighbour": 2, "rotation": 0,
              "neighbours": 0}
CURVES = ("dr_na", "d2_min_sum", "d2_min_per_neighbour")  # against the distance from a disk


def _choice(default, help, unit="", **more):
    return field(default=default, metadata={"help": help, "unit": unit, **more})


@dataclass(frozen=True)
class Choices:
    """All choices of the analysis; `help` and `unit` of each are in its metadata. The result contains all choices."""

    skip_pushes: int = _choice(2, "pushes left out at the start", least=0)
    mirror: str = _choice("odd", "pushes with x and y exchanged, so that the plunger is at the end of x",
                          choices=("odd", "even", "none"))
    interval: float = _choice(1.1, "travel of the plunger over which displacements are taken", "cm", above=0)
    tolerance: float = _choice(0.05, "largest relative difference of an interval from the requested one", above=0)
    stride: int = _choice(1, "displacements begin in every such frame", least=1)
    cell: float = _choice(1.6, "width of the cells", "cm", above=0)
    min_count: int = _choice(10, "fewest samples of a cell that counts", least=1)
    interpolation: str = _choice("linear", "mean displacement at a disk: of its cell, or with the cell's gradient",
                                 choices=("linear", "cell"))
    field: str = _choice("own", "mean displacement field: of each run, or of all given together",
                         choices=("own", "pooled"))
    neighbours: int = _choice(15, "neighbours nearest by surface distance in D2_min", least=3)
    within: float | None = _choice(None, "instead: all neighbours within this surface distance", "cm", above=0)
    average: str = _choice("bin", "mean over the cells of each cell's mean, or over all samples alike",
                           choices=("bin", "particle"))
    centre: float = _choice(23.7, "side of the central square, which has a corner at the origin", "cm", above=0)
    size_tolerance: float = _choice(0.1, "gap between classes of size, in mean radii", "<R>", above=0)
    size_bins: int | None = _choice(None, "instead: so many classes of about as many disks", least=1)
    intervals: tuple = _choice((0.2, 5.0, 9), "lowest, highest and number of the intervals (evenly spaced logarithms)",
                               "interval", numbers=("LOW", "HIGH", "N"))
    fit_range: tuple = _choice((0.2, 5.0), "range of the intervals in the fits of the exponents", "interval",
                               numbers=("LOW", "HIGH"))
    distance_bin: float = _choice(0.15, "width of the bins of the distance from a disk", "cm", above=0)
    distance_max: float = _choice(6.0, "largest distance from a disk", "cm", above=0)
    distance_stride: int = _choice(5, "distances are taken in every such frame", least=1)
    df0: float = _choice(0.1, "strain of a tick of the strain clock", above=0)
    clock_max: float = _choice(3.74, "longest interval of the strain clock; cells that need more are left out", "cm",
                               above=0)
    clock_tolerance: float = _choice(0.5, "cells whose strain differs from df0 by a larger part of it are left out",
                                     above=0)
    clock_intervals: int = _choice(40, "most intervals that the strain clock chooses from", least=2)

    def __post_init__(self):
        for f in fields(self):
            value, name = getattr(self, f.name), "--" + f.name.replace("_", "-")
            if value is None:
                continue
            if "choices" in f.metadata and value not in f.metadata["choices"]:
                raise RunError(f"{name} {value}: one of {', '.join(f.metadata['choices'])}")
            if "least" in f.metadata and value < f.metadata["least"]:
                raise RunError(f"{name} {value}: at least {f.metadata['least']}")
            if "above" in f.metadata and not (np.isfinite(value) and value > f.metadata["above"]):
                raise RunError(f"{name} {value:g}: must be more than {f.metadata['above']}")
            if "numbers" in f.metadata and not 0 < value[0] < value[1] < np.inf:
                raise RunError(f"{name} {' '.join(f'{v:g}' for v in value)}: needs 0 < low < high")
        if self.intervals[2] < 2 or self.intervals[2] != int(self.intervals[2]):
            raise RunError(f"--intervals: {self.intervals[2]:g} intervals; needs a whole number from 2 on")


class _Sums:
    """Sums and counts of every quantity: arrays [pushes, classes, cells], or other bins instead of cells."""

    def __init__(self, *shape):
        self.shape = shape
        self.sums = {name: np.zeros(shape) for name in QUANTITIES}
        self.counts = {name: np.zeros(shape) for name in QUANTITIES}

    def add(self, push, size, bin_, values):
        """values: name → [S]; NaN where a sample lacks the value."""
        at = size * self.shape[2] + bin_
        for name, value in values.items():
            good = np.isfinite(value)
            bins = self.shape[1] * self.shape[2]
            self.counts[name][push] += np.bincount(at[good], minlength=bins).reshape(self.shape[1:])
            self.sums[name][push] += np.bincount(at[good], value[good], bins).reshape(self.shape[1:])

    def of(self, name):
        return self.sums[name], self.counts[name]


@dataclass(frozen=True)
class _Sample:
    """Displacements of one push over one interval: [S] each, sorted by frame and disk."""

    before: np.ndarray   #: frames, as indices into the push
    after: np.ndarray
    disk: np.ndarray     #: likewise
    start: np.ndarray    #: [S, 2]
    shift: np.ndarray    #: [S, 2]
    cell: np.ndarray


class _Analysis:
    """One run's tracks on a grid."""

    def __init__(self, run, grid, choices):
        self.run, self.grid, self.choices = run, grid, choices
        self.spacing = nonaffine.spacing(run.pushes)
        self.sizes, label = tracks.size_classes(np.concatenate([p.radius for p in run.pushes]), choices.size_tolerance,
                                                choices.size_bins)
        self.size = np.split(label, np.cumsum([len(p.radius) for p in run.pushes])[:-1])
        self._neighbours = {}
        centres = grid.centres
        low, high = -1e-9, choices.centre * (1 + 1e-9)
        self.region = {"all": np.ones(grid.cells, bool), "centre": ((centres > low) & (centres < high)).all(1)}

    # ---- samples

    def multiple(self, interval):
        """`interval` as a whole number of frames' travel; RunError if that is too far off."""
        result, = self.multiples([interval])
        if abs(result - interval) > self.choices.tolerance * interval * (1 + 1e-9):
            raise RunError(f"{self.run.source}: frames are {self.spacing:.4g} cm of travel apart; the interval "
                           f"{interval:g} cm is not a multiple of that within {100 * self.choices.tolerance:g} % "
                           "(--interval, --tolerance)")
        return result

    def multiples(self, intervals):
        """The same for many intervals, for any tolerance, each once."""
        # Halves are rounded up, independent of rounding errors.
        return np.unique(np.maximum(np.floor(np.asarray(intervals) / self.spacing + 0.5 + 1e-6), 1)) * self.spacing

    def pairs(self, push, interval):
        """Frames before and after; where a frame is missing the one next to it may be used within the tolerance."""
        off = max(self.choices.tolerance * interval, 0.25 * self.spacing)
        return nonaffine.frame_pairs(push.travel, interval, off, self.choices.stride)

    def sample(self, index, interval, cells=None):
        """Samples of push `index`; None if there are none. `cells` [cells] bool: only samples that begin in these
        cells."""
        push = self.run.pushes[index]
        before, after = self.pairs(push, interval)
        pair, disk = np.nonzero(push.present[before] & push.present[after])
        before, after = before[pair], after[pair]
        start = push.position[before, disk]
        cell = self.grid.cell(start)
        if cells is not None:
            keep = cells[cell]
            before, after, disk, start, cell = (part[keep] for part in (before, after, disk, start, cell))
        return _Sample(before, after, disk, start, push.position[after, disk] - start, cell) if len(disk) else None

    def moments(self, interval):
        """[12, cells], summed over the pushes."""
        samples = filter(None, (self.sample(i, interval) for i in range(len(self.run.pushes))))
        return sum((nonaffine.moments(self.grid, s.start, s.shift, s.cell) for s in samples),
                   np.zeros((12, self.grid.cells)))

    def neighbours(self, index, sample):
        """As Neighbourhoods.of: [S, K] each."""
        if index not in self._neighbours:
            push, choices = self.run.pushes[index], self.choices
            self._neighbours[index] = nonaffine.Neighbourhoods(push.position, push.radius, push.present,
                                                               choices.neighbours, choices.within)
        return self._neighbours[index].of(sample.before, sample.after, sample.disk)

    def values(self, index, sample, mean_field):
        """Quantities of the samples, in cm and rad: name → [S]."""
        push, frames = self.run.pushes[index], (sample.before, sample.after, sample.disk)
        mean = mean_field.at(sample.start, sample.cell, self.choices.interpolation)
        total, number = nonaffine.push_d2_min(push.position, *frames, *self.neighbours(index, sample))
        result = {"displacement": np.hypot(*sample.shift.T), "dr_na": np.hypot(*(sample.shift - mean).T),
                  "d2_min_sum": total, "d2_min_per_neighbour": total / np.maximum(number, 1), "neighbours": number}
        if push.angle is not None:
            result["rotation"] = np.abs(push.angle[sample.after, sample.disk] - push.angle[sample.before, sample.disk])
        return result

    def sums(self, interval_of_cell, field_of):
        """_Sums where interval_of_cell [cells] gives the interval of the samples that begin in a cell (NaN: none), and
        field_of(interval) the mean displacement."""
        result = _Sums(len(self.run.pushes), len(self.sizes), self.grid.cells)
        for interval in np.unique(interval_of_cell[np.isfinite(interval_of_cell)]):
            cells = interval_of_cell == interval
            mean_field = field_of(interval)
            for i in range(len(self.run.pushes)):
                if sample := self.sample(i, interval, None if cells.all() else cells):
                    result.add(i, self.size[i][sample.disk], sample.cell, self.values(i, sample, mean_field))
        return result

    # ---- averages

    def _average(self, region, enough):
        cells = self.region[region]
        if self.choices.average == "particle":
            def function(sums, counts):
                with np.errstate(divide="ignore", invalid="ignore"):
                    return sums[..., cells].sum(-1) / counts[..., cells].sum(-1)
        else:
            def function(sums, counts):
                # Leaving out a push may leave cells without samples.
                good = cells & enough & (counts > 0)
                with np.errstate(divide="ignore", invalid="ignore"):
                    return np.where(good, sums / np.where(good, counts, 1), 0).sum(-1) / good.sum(-1)
        return function

    def average(self, sums, counts, region):
        """(value, error) of the mean in a region; sums, counts [pushes, …, cells]. Blocks are the pushes that have
        samples at all."""
        blocks = counts.reshape(len(counts), -1).any(1)
        if not blocks.any():
            shape = sums.shape[1:-1]
            return np.full(shape, np.nan), np.full(shape, np.nan)
        enough = counts.sum(0) >= self.choices.min_count
        return jackknife(self._average(region, enough), [sums[blocks], counts[blocks]])

    def scale(self, name):
        return self.run.mean_radius ** QUANTITIES[name]

    def averages(self, sums, name):
        """{"all": {"value", "error"}, "centre": …} of one quantity of all disks."""
        parts = [part.sum(1) for part in sums.of(name)]
        return {region: _entry(*(v / self.scale(name) for v in self.average(*parts, region))) for region in REGIONS}

    def by_size(self, sums):
        """A row per class of size."""
        rows = [{"radius": float(radius), "relative_radius": float(radius / self.run.mean_radius),
                 "disks": int(sum((size == c).sum() for size in self.size) / len(self.size) + 0.5)}
                for c, radius in enumerate(self.sizes)]
        for name in QUANTITIES:
            for region in REGIONS:
                value, error = (v / self.scale(name) for v in self.average(*sums.of(name), region))
                for row, v, e in zip(rows, value, error):
                    row.setdefault(name, {})[region] = _entry(v, e)
                if name in CURVES:
                    for row, v, e in zip(rows, *self.relative(sums, name, region)):
                        row.setdefault("relative_" + name, {})[region] = _entry(v, e)
        return rows

    def relative(self, sums, name, region):
        """(value, error) [classes]: mean of a size class over the mean of all disks in the cells that the class has
        visited. Large disks do not approach walls: without this ratio a mean would depend on the place as much as on
        the size."""
        cells, weigh = self.region[region], self.choices.average == "particle"
        parts = sums.of(name)
        blocks = parts[1].any((1, 2))
        if not blocks.any():
            return np.full(len(self.sizes), np.nan), np.full(len(self.sizes), np.nan)
        enough = parts[1].sum(0) >= self.choices.min_count

        def ratio(total, count):
            every, number = total.sum(0), count.sum(0)
            good = cells & enough & (count > 0)
            weight = np.where(good, count if weigh else 1.0, 0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                mine, others = np.where(good, total / count, 0), np.where(good, every / number, 0)
                return (weight * mine).sum(-1) / (weight * others).sum(-1)

        return jackknife(ratio, [part[blocks] for part in parts])

    def by_interval(self, intervals, fields_of):
        """(rows, exponents): every quantity against the interval, and the slopes of their logarithms."""
        every = [self.sums(np.full(self.grid.cells, k), fields_of) for k in intervals]
        rows = [{"travel": float(k), "relative": float(k / self.choices.interval),
                 **{name: self.averages(sums, name) for name in QUANTITIES}} for k, sums in zip(intervals, every)]
        low, high = (limit * self.choices.interval for limit in self.choices.fit_range)
        used = [i for i, k in enumerate(intervals) if low * (1 - 1e-9) <= k <= high * (1 + 1e-9)]
        slopes = {name: {} for name in ("dr_na", "d2_min_per_neighbour")}
        for name, found in slopes.items():
            for region in REGIONS:
                parts = [part.sum(1) for i in used for part in every[i].of(name)]
                blocks = np.all([p.any(1) for p in parts[1::2]], axis=0) if parts else np.zeros(0, bool)
                functions = [self._average(region, p.sum(0) >= self.choices.min_count) for p in parts[1::2]]

                def slope(*p):
                    return exponent(intervals[used], [f(*p[2 * i:2 * i + 2]) for i, f in enumerate(functions)])

                if blocks.any():
                    found[region] = _entry(*jackknife(slope, [p[blocks] for p in parts]))
                else:
                    found[region] = _entry(np.nan, np.nan)
        range_ = [float(intervals[i] / self.choices.interval) for i in (used[0], used[-1])] if used else None
        return rows, slopes, {"range": range_, "points": len(used), "unit": "interval"}

    def _distance_sums(self, interval, mean_field, bins):
        """Region → _Sums of [pushes, classes of the disk that is near, bins of the distance], over pairs of disks."""
        choices = self.choices
        result = {region: _Sums(len(self.run.pushes), len(self.sizes), bins) for region in REGIONS}
        for i, push in enumerate(self.run.pushes):
            if not (sample := self.sample(i, interval)):
                continue
            values = self.values(i, sample, mean_field)
            # Number of the sample of a disk that begins a displacement in a frame; -1 if the disk is not in a sample.
            row = np.full(push.present.shape, -1)
            row[sample.before, sample.disk] = np.arange(len(sample.disk))
            frames = np.unique(sample.before)[::choices.distance_stride]
            for part in nonaffine.chunks(len(frames), len(push.radius)):
                at = frames[part]
                distance = nonaffine.surface_distances(push.position[at], push.radius, row[at] >= 0)
                m, disk, near = np.nonzero(distance < bins * choices.distance_bin)
                # A little overlap counts as touching.
                bin_ = np.maximum((distance[m, disk, near] / choices.distance_bin).astype(int), 0)
                at_row, size = row[at[m], disk], self.size[i][near]
                for region in REGIONS:
                    in_it = self.region[region][sample.cell[at_row]]
                    result[region].add(i, size[in_it], bin_[in_it],
                                       {name: values[name][at_row[in_it]] for name in CURVES})
        return result

    def by_distance(self, interval, mean_field):
        """Quantities against the surface distance to a disk of each class, every pair of disks alike; `peak` is the
        largest value nearer than the smallest disk's diameter, less the mean over all pairs."""
        choices = self.choices
        bins = int(np.ceil(choices.distance_max / choices.distance_bin))
        middle = (np.arange(bins) + 0.5) * choices.distance_bin
        found = self._distance_sums(interval, mean_field, bins)

        def curve(sums, counts):
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.where(counts >= choices.min_count, sums / counts, np.nan)

        def peak(sums, counts, every, number):
            near = curve(sums, counts)[middle < 2 * self.sizes[0]]
            return np.max(near, where=np.isfinite(near), initial=-np.inf) - every.sum() / max(number.sum(), 1)

        rows = [{"radius": float(radius), "relative_radius": float(radius / self.run.mean_radius),
                 **{name: {} for name in CURVES}} for radius in self.sizes]
        for c, row in enumerate(rows):
            for name in CURVES:
                for region in REGIONS:
                    parts = [part[:, c] for part in found[region].of(name)]
                    parts += [part.sum(1) for part in found[region].of(name)]
                    blocks = parts[1].any(1)
                    entry = {"value": np.full(bins, np.nan), "error": np.full(bins, np.nan)}
                    top = np.nan, np.nan
                    if blocks.any():
                        parts = [part[blocks] for part in parts]
                        entry = dict(zip(entry, (v / self.scale(name) for v in jackknife(curve, parts[:2]))))
                        top = (v / self.scale(name) if np.isfinite(v) else np.nan for v in jackknife(peak, parts))
                    row[name][region] = {key: values.tolist() for key, values in entry.items()} | {
                        "count": parts[1].sum(0).tolist(), "peak": _entry(*top)}
        return {"distance": middle.tolist(), "sizes": rows}

    def cell_table(self, mean_field, sums, clock, clock_strain, clock_sums):
        """Columns with a row per cell that has enough samples."""
        shown = np.flatnonzero(mean_field.count >= self.choices.min_count)
        centres = self.grid.centres
        table = {"x": centres[:, 0], "y": centres[:, 1], "count": mean_field.count, "mean_x": mean_field.mean[:, 0],
                 "mean_y": mean_field.mean[:, 1], "strain": mean_field.strain,
                 **{f"strain_{i}{j}": mean_field.gradient[:, "xy".index(i), "xy".index(j)] for i in "xy" for j in "xy"},
                 "centre": self.region["centre"].astype(int), "clock": clock, "clock_strain": clock_strain}
        for prefix, source in (("", sums), ("clock_", clock_sums)):
            for name in QUANTITIES:
                s, n = (part.sum((0, 1)) for part in source.of(name))
                with np.errstate(divide="ignore", invalid="ignore"):
                    table[prefix + name] = np.where(n >= self.choices.min_count, s / n, np.nan) / self.scale(name)
        return {name: values[shown].tolist() for name, values in table.items()}


def _entry(value, error):
    return {"value": float(value), "error": float(error)}


def _same(analyses, intervals):
    """The intervals, in multiples of the frames' travel; RunError where pooled runs differ in that."""
    first = analyses[0].multiples(intervals)
    for other in analyses[1:]:
        mine = other.multiples(intervals)
        if len(mine) != len(first) or np.abs(mine / first - 1).max() > 1e-3:
            raise RunError(f"{other.run.source}: frames are {other.spacing:.4g} cm of travel apart, but in "
                           f"{analyses[0].run.source} {analyses[0].spacing:.4g} cm: their fields cannot be pooled")
    return first


def _analyse_together(runs, choices):
    """Results of runs that share one mean displacement field per interval."""
    grid = Grid.over([push.position for run in runs for push in run.pushes], choices.cell)
    analyses = [_Analysis(run, grid, choices) for run in runs]
    cache = {}

    def field_of(interval):
        if interval not in cache:
            cache[interval] = Field.of(grid, sum(a.moments(interval) for a in analyses), choices.min_count)
        return cache[interval]

    for a in analyses:
        a.multiple(choices.interval)
    interval, = _same(analyses, [choices.interval])
    low, high, number = choices.intervals
    intervals = _same(analyses, np.geomspace(low, high, int(number)) * choices.interval)
    longest = max(max(p.travel[-1] - p.travel[0] for p in run.pushes) for run in runs)
    if not field_of(interval).count.any():
        raise RunError(f"{runs[0].source}: no disk is in two frames {interval:g} cm of travel apart within one push "
                       f"(the longest push has {longest:g} cm)")
    intervals = intervals[intervals <= longest]

    # Half as long again as the longest that counts: so that a cell that needs more is known to.
    ticks = _same(analyses, np.linspace(0, min(1.5 * choices.clock_max, longest), choices.clock_intervals + 1)[1:])
    strains = np.array([field_of(tick).strain for tick in ticks])
    which = nonaffine.strain_clock(ticks, strains, choices.df0)
    clock = np.where(which >= 0, ticks[which], np.nan)
    clock_strain = np.where(which >= 0, np.take_along_axis(strains, np.maximum(which, 0)[None], 0)[0], np.nan)
    with np.errstate(invalid="ignore"):
        clock[(clock > choices.clock_max * (1 + 1e-9)) |
              (np.abs(clock_strain - choices.df0) > choices.clock_tolerance * choices.df0)] = np.nan
    clock_strain[np.isnan(clock)] = np.nan
    return [_result(a, interval, intervals, field_of, clock, clock_strain) for a in analyses]


def _result(a, interval, intervals, field_of, clock, clock_strain):
    run, choices, mean_field = a.run, a.choices, field_of(interval)
    sums = a.sums(np.full(a.grid.cells, interval), field_of)
    clock_sums = a.sums(clock, field_of)
    rows, slopes, fit = a.by_interval(intervals, field_of)
    times = np.concatenate([push.time[after] - push.time[before] for push in run.pushes
                            for before, after in [a.pairs(push, interval)]])
    result = {
        "analysis": "channel", "source": run.source, "run": run.run, "choices": asdict(choices),
        "units": {"length": "cm", "time": "s", "angle": "rad", "dr_na": "<R>", "d2_min": "<R>^2"},
        "mean_radius": run.mean_radius, "polydispersity": run.polydispersity,
        "pushes": len(run.pushes), "frames": run.frames,
        "disks": int(np.mean([len(push.radius) for push in run.pushes]) + 0.5),
        "samples": int(sums.counts["displacement"].sum()),
        "interval": {"travel": float(interval), "time": float(times.mean())},
        **{name: a.averages(sums, name) for name in QUANTITIES},
        "exponent_dr_na": slopes["dr_na"], "exponent_d2_min": slopes["d2_min_per_neighbour"], "exponent_fit": fit,
    }
    result["rotation_turns"] = {region: {k: v / (2 * np.pi) for k, v in entry.items()}
                                for region, entry in result["rotation"].items()}
    result["clock"] = {"df0": choices.df0, **{name: a.averages(clock_sums, name) for name in QUANTITIES}}
    result["sizes"] = a.by_size(sums)
    result["intervals"] = rows
    result["distances"] = a.by_distance(interval, mean_field)
    result["cells"] = a.cell_table(mean_field, sums, clock, clock_strain, clock_sums)
    return result


def _prepared(run, choices):
    """The pushes to analyse, with the plunger at the end of the x axis."""
    run = run.without(choices.skip_pushes).oriented(choices.mirror)
    fewest = min(len(push.radius) for push in run.pushes)
    if choices.within is None and fewest <= choices.neighbours:
        raise RunError(f"{run.source}: a push has {fewest} disks, too few for {choices.neighbours} neighbours "
                       "(--neighbours)")
    return run


def snapshot(run, choices, number=None, travel=None):
    """One displacement of every disk, in cm: a dict of `push`, `travel` (where it begins), `position` [n, 2], `radius`
    [n], `shift` [n, 2], `mean` [n, 2] (the run's own field), `dr_na`, `d2_min_sum`, `d2_min_per_neighbour` [n] and
    `neighbours` (list of n arrays of indices among these n). number: the push (None: the last one); travel: travel of
    the plunger at the start (None: the middle frame). Raises RunError."""
    run = _prepared(run, choices)
    a = _Analysis(run, Grid.over([push.position for push in run.pushes], choices.cell), choices)
    interval = a.multiple(choices.interval)
    mean_field = Field.of(a.grid, a.moments(interval), choices.min_count)
    numbers = [push.number for push in run.pushes]
    if number is not None and number not in numbers:
        raise RunError(f"{run.source}: no push {number} (there are {', '.join(map(str, numbers))})")
    index = numbers.index(number) if number is not None else len(numbers) - 1
    push, sample = run.pushes[index], a.sample(index, interval)
    if sample is None:
        raise RunError(f"{run.source}: push {push.number} has no two frames {interval:g} cm of travel apart")
    frames = np.unique(sample.before)
    frame = frames[len(frames) // 2 if travel is None else np.argmin(np.abs(push.travel[frames] - travel))]
    here = sample.before == frame
    disks, values, (nearest, used) = sample.disk[here], a.values(index, sample, mean_field), a.neighbours(index, sample)
    order = np.full(len(push.radius), -1)
    order[disks] = np.arange(len(disks))
    return {"push": push.number, "travel": float(push.travel[frame]), "interval": float(interval),
            "position": sample.start[here], "radius": push.radius[disks], "shift": sample.shift[here],
            "mean": mean_field.at(sample.start[here], sample.cell[here], choices.interpolation),
            **{name: values[name][here] for name in CURVES},
            "neighbours": [order[near[mask]] for near, mask in zip(nearest[here], used[here])]}


def analyse(runs, choices=Choices()):
    """A dict per run, as analysis.json has it but with NaN for unknown values. runs: list of Tracks.

    Raises RunError if the tracks lack data that the choices need."""
    if choices.field == "pooled" and len(runs) < 2:
        raise RunError("--field pooled needs at least two runs")
    runs = [_prepared(run, choices) for run in runs]
    groups = [runs] if choices.field == "pooled" else [[run] for run in runs]
    return [result for group in groups for result in _analyse_together(group, choices)]
