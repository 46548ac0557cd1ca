"""Tracks of disks that are pushed through a channel: from a run of `pliant channel`, or from any table of positions.

Lengths in cm, times in s, angles in rad. The outer corner of the channel is the origin, its arms are the axes x and y.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from .errors import RunError
from .run import Run

NEEDED = ("frame", "particle", "x", "y", "r")
ANGLE_UNITS = {"radians": 1.0, "degrees": np.pi / 180, "turns": 2 * np.pi}


@dataclass(frozen=True)
class Push:
    """The frames of one stroke of a plunger, in order. Positions and angles are NaN where a disk is missing."""

    number: int
    frame: np.ndarray          #: [F] numbers of the frames
    time: np.ndarray           #: [F] s
    travel: np.ndarray         #: [F] how far the plunger has come, in cm, increasing
    position: np.ndarray       #: [F, N, 2]
    radius: np.ndarray         #: [N]
    particle: np.ndarray       #: [N] the disks' numbers
    angle: np.ndarray | None   #: [F, N]; no jumps from one frame to the next

    @cached_property
    def present(self):
        """[F, N] bool"""
        return np.isfinite(self.position).all(-1)

    def mirrored(self):
        """The push with x and y exchanged, which turns every rotation round."""
        angle = None if self.angle is None else -self.angle
        return replace(self, position=self.position[..., ::-1].copy(), angle=angle)


@dataclass(frozen=True)
class Tracks:
    """Pushes in order, and their source."""

    source: str
    pushes: tuple
    run: dict | None = None  #: state_of the run that they were read from

    @cached_property
    def _seen(self):
        """Radii, and in how many frames a disk of each was seen."""
        counts = np.concatenate([push.present.sum(0) for push in self.pushes])
        return np.concatenate([push.radius for push in self.pushes]), counts

    @property
    def frames(self):
        return sum(len(push.frame) for push in self.pushes)

    @cached_property
    def mean_radius(self):
        """<R> in cm: over all disks, a disk in each of its frames."""
        radius, count = self._seen
        return float(np.average(radius, weights=count))

    @cached_property
    def polydispersity(self):
        """delta = sqrt(<(R - <R>)^2>)/<R>; [T 3.1] prints the root over <R> too."""
        radius, count = self._seen
        return float(np.sqrt(np.average((radius - self.mean_radius) ** 2, weights=count))) / self.mean_radius

    def without(self, first):
        """The tracks without the first pushes; RunError if none is left."""
        if first >= len(self.pushes):
            raise RunError(f"{self.source}: pushes: {len(self.pushes)}; the analysis leaves out the first {first} "
                           "(--skip-pushes)")
        return replace(self, pushes=self.pushes[first:])

    def oriented(self, mirror):
        """The tracks with the plunger of every push at the end of the x axis: `mirror` selects the pushes that have x and y
        exchanged, odd, even or none. RunError if a push runs against that."""
        if mirror == "none":
            return self
        pushes = tuple(push.mirrored() if push.number % 2 == (mirror == "odd") else push for push in self.pushes)
        for push in pushes:
            shift = push.position[-1] - push.position[0]
            shift = shift[np.isfinite(shift).all(1)]
            if len(shift) and shift[:, 0].mean() > shift[:, 1].mean():
                raise RunError(f"{self.source}: push {push.number} does not flow from x to y with --mirror {mirror} "
                               "(if the other plunger is first, use the other of odd and even; without a bend, none)")
        return replace(self, pushes=pushes)


def _unwrapped(angle, period):
    """[F, N] angles without jumps of a period from one frame to the next that has the disk."""
    known = np.isfinite(angle)
    last = np.maximum.accumulate(np.where(known, np.arange(len(angle))[:, None], 0), axis=0)
    filled = np.take_along_axis(angle, last, axis=0)
    # Where a disk comes later than the first frame there is no value to continue from.
    step = np.nan_to_num(np.diff(filled, axis=0))
    turns = np.concatenate([np.zeros((1, angle.shape[1])), np.cumsum(np.round(step / period), axis=0)])
    return angle - period * turns


def _check_travel(source, push, travel):
    if not np.isfinite(travel).all() or np.any(np.diff(travel) <= 0):
        at = int(np.argmin(np.where(np.isfinite(np.diff(travel)), np.diff(travel), -np.inf))) if len(travel) > 1 else 0
        raise RunError(f"{source}: the plunger's travel does not grow in push {push} after its frame {at} "
                       f"({' and '.join(f'{t:g}' for t in travel[at:at + 2])} cm)")


def state_of(run):
    """Identifies the run and its last frame: {created, frames, time}."""
    times = run.frame_times.tolist()
    return {"created": run.manifest.get("created"), "frames": len(times), "time": times[-1] if times else None}


def from_run(path):
    """Tracks of the frames of a run, whose angles are continuous. Raises RunError if they have no `push` and `plunger_travel`."""
    with Run(path) as run:
        if not len(run.frames):
            run.frame(0)  # raises the error
        by_push = {}
        for frame in run.frames:
            number, travel = (frame.attribute(name, "the scenario channel") for name in ("push", "plunger_travel"))
            position = np.where(frame.active[:, None], frame.centres, np.nan)
            by_push.setdefault(int(number), []).append((int(frame.name), frame.time, travel, position, frame.angles))
        radius, state = run.topology.sigma / 2, state_of(run)
    pushes = []
    for number, rows in sorted(by_push.items()):
        name, time, travel, position, angle = zip(*rows)
        _check_travel(path, number, np.array(travel, float))
        angle = None if any(a is None for a in angle) else np.array(angle)
        pushes.append(Push(number, np.array(name), np.array(time), np.array(travel, float), np.array(position), radius,
                           np.arange(len(radius)), angle))
    return Tracks(str(path), tuple(pushes), state)


def _numbers(source, table, column):
    values = pd.to_numeric(table[column], errors="coerce").to_numpy(float)
    bad = np.flatnonzero(~np.isfinite(values))
    # No angle is a disk whose angle was not seen; no position, no row.
    if len(bad) and column != "angle":
        raise RunError(f"{source}: row {bad[0] + 1} has no number in column '{column}' "
                       f"({table[column].iloc[bad[0]]!r}); leave out the rows of disks that were not found")
    return values


def _whole_numbers(source, table, column):
    values = _numbers(source, table, column)
    if np.any(values != np.round(values)):
        row = int(np.argmax(values != np.round(values)))
        raise RunError(f"{source}: row {row + 1} has {values[row]:g} in column '{column}'; it needs whole numbers")
    return values.astype(np.int64)


def from_table(table, source="table", fps=6.0, plunger_speed=0.22, frames_per_push=None, scale=1.0, origin=(0.0, 0.0),
               flip_y=False, angle_unit="radians", angle_period=2 * np.pi):
    """Tracks of a DataFrame with the columns frame, particle, x, y, r and, if they are there, angle, push, time and
    plunger_travel, in any order of rows.

    x, y, r are multiplied by `scale` (cm); `origin` (before scaling) is the outer corner; `flip_y` for pixels, whose y
    points down. Without `time` it is frame/fps; without `plunger_travel` it is plunger_speed times the time since the
    push began; without `push`, frame // frames_per_push, or one push. Angles are continuous or known up to
    `angle_period` (rad). The radius of a disk is the median of its rows. Raises RunError for missing columns, for values that
    are not numbers, and for a disk that is twice in a frame.
    """
    table = table.reset_index(drop=True)
    for column in NEEDED:
        if column not in table:
            raise RunError(f"{source}: the table has no column '{column}' (it needs {', '.join(NEEDED)}; "
                           f"it has {', '.join(map(str, table.columns))})")
    if table.empty:
        raise RunError(f"{source}: the table has no rows")
    frame, particle = (_whole_numbers(source, table, column) for column in ("frame", "particle"))
    x, y, r = (_numbers(source, table, column) for column in ("x", "y", "r"))
    if (r <= 0).any():
        raise RunError(f"{source}: row {int(np.argmax(r <= 0)) + 1} has the radius {r[r <= 0][0]:g}")
    position = scale * (np.stack([x, y], -1) - np.asarray(origin, float)) * [1, -1 if flip_y else 1]
    time = _numbers(source, table, "time") if "time" in table else frame / fps
    if "push" in table:
        push = _whole_numbers(source, table, "push")
    else:
        push = frame // frames_per_push if frames_per_push else np.zeros_like(frame)
    travel = _numbers(source, table, "plunger_travel") if "plunger_travel" in table else None
    angle = None
    if "angle" in table:
        angle = _numbers(source, table, "angle") * ANGLE_UNITS[angle_unit] * (-1 if flip_y else 1)

    pushes = []
    for number in np.unique(push):
        rows = np.flatnonzero(push == number)
        frames, first, at_frame = np.unique(frame[rows], return_index=True, return_inverse=True)
        particles, at_particle = np.unique(particle[rows], return_inverse=True)
        shape = len(frames), len(particles)
        flat = at_frame * shape[1] + at_particle
        if len(np.unique(flat)) < len(flat):
            where = int(np.argmax(np.bincount(flat) > 1))
            raise RunError(f"{source}: disk {particles[where % shape[1]]} is more than once in frame "
                           f"{frames[where // shape[1]]}")
        places = np.full((shape[0] * shape[1], 2), np.nan)
        places[flat] = position[rows]
        radius = pd.Series(r[rows] * scale).groupby(at_particle).median().to_numpy()
        angles = None
        if angle is not None:
            angles = np.full(len(places), np.nan)
            angles[flat] = angle[rows]
            angles = _unwrapped(angles.reshape(shape), angle_period)
        times = time[rows][first]
        way = plunger_speed * (times - times[0]) if travel is None else travel[rows][first]
        _check_travel(source, number, way)
        pushes.append(Push(int(number), frames, times, way, places.reshape(*shape, 2), radius, particles, angles))
    return Tracks(str(source), tuple(pushes))


def load(path, angle_period=2 * np.pi, **table_options):
    """Tracks of a run folder, or of a CSV file, whose angles are known up to `angle_period` (from_table has the options)."""
    path = Path(path)
    if not path.is_file():
        return from_run(path)
    try:
        table = pd.read_csv(path, comment="#", float_precision="round_trip")
    except (OSError, ValueError) as error:  # pandas' parser errors are ValueErrors
        raise RunError(f"{path}: cannot be read as a table ({str(error).strip().splitlines()[0]})") from None
    return from_table(table, path, angle_period=angle_period, **table_options)


def size_classes(radii, tolerance, bins=None):
    """Classes of radii, smallest first: ([C] mean radius, [n] class of each). A gap wider than `tolerance` times the
    mean radius begins a class; `bins` classes of about as many disks each, if given, for continuous distributions."""
    radii = np.asarray(radii, float)
    order = np.argsort(radii, kind="stable")
    if bins:
        edges = np.unique(np.quantile(radii, np.linspace(0, 1, bins + 1)[1:-1]))
        label = np.searchsorted(edges, radii, side="right")
    else:
        label = np.empty(len(radii), int)
        label[order] = np.concatenate([[0], np.cumsum(np.diff(radii[order]) > tolerance * radii.mean())])
    _, label = np.unique(label, return_inverse=True)
    return np.bincount(label, radii) / np.bincount(label), label
