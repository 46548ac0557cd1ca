"""Particles of one frame as a table, between runs and files."""

import io
import warnings
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from ..analysis.particles import Particles
from ..analysis.sources import several
from ..errors import PliantWarning, RunError
from ..run import Frame

#: Fields of frames that become columns, if the frame has them.
_FRAME_FIELDS = ("contact_count", "angles", "spins", "area", "perimeter", "volume", "surface_area")
#: Columns of files, and the fields of Particles.
_PARTICLES = {"position": "positions", "radius": "radii", "velocity": "velocities", "mass": "masses",
              "reinsertions": "reinsertions"}
#: Columns of single formats.
_FILE_COLUMNS = ("id", "type", "species", "x", "y", "z", "vx", "vy", "vz", "pos", "velo")


@dataclass
class Snapshot:
    """The present particles of a frame."""

    time: float
    step: int
    dim: int
    box: np.ndarray | None  #: [2, D] as Particles.box
    ids: np.ndarray         #: [n] numbers of the particles
    columns: dict           #: name → [n] or [n, D]; position and radius or velocity, mass, … if known
    outlines: list | None = None    #: n polygons [vertices, 2]
    contacts: dict = field(default_factory=dict)  #: start, end [C, D], force [C, D], if known

    def extent(self):
        """[2, D] lower and upper corner: the box where it is periodic, else the extent of the particles."""
        places, radius = self.columns["position"], self.columns.get("radius", np.zeros(len(self.ids)))
        low, high = np.zeros(self.dim), np.ones(self.dim)
        if len(places):
            low, high = (places - radius[:, None]).min(0), (places + radius[:, None]).max(0)
        if self.box is not None:
            closed = self.periodic
            low, high = np.where(closed, self.box[0], low), np.where(closed, self.box[0] + self.box[1], high)
        return np.stack([low, np.where(high > low, high, low + 1)])

    @property
    def periodic(self):
        """[D] bool"""
        return np.zeros(self.dim, bool) if self.box is None else np.isfinite(self.box[1])


def snapshots(source, fields=None):
    """Yields the Snapshot of each frame."""
    for number, one in enumerate(several(source)):
        yield _of(one, number, fields)


def _of(source, number, fields):
    frame = source if isinstance(source, Frame) else None
    wanted = [name for group, names in (("velocities", ("velocities",)), ("contacts", ("pairs", "forces", "points")))
              for name in names if frame and frame.has(group)]
    part = Particles.of(source, *wanted)
    part.upright("exchange.write")
    if frame and frame.run.reinserts and part.reinsertions is None:
        warnings.warn(f"{frame.run.path}: the frames have no reinsertions; displacements computed from the file have the jumps of "
                      "reinserted particles. -frame_fields reinsertions writes them, also after a restart", PliantWarning, stacklevel=4)
    here = part.active
    values = {name: getattr(part, target) for name, target in _PARTICLES.items()}
    if frame:
        values |= {name: getattr(frame, name) for name in _FRAME_FIELDS if frame.has(name)}
    for name, given in (fields(source) if fields else {}).items():
        given = np.asarray(given)
        if given.shape not in ((part.count,), (part.count, part.dim)) or given.dtype.kind not in "biuf":
            raise ValueError(f"the field '{name}' has the shape {list(given.shape)} and type {given.dtype}; give numbers "
                             f"[{part.count}] or [{part.count}, {part.dim}]")
        if not name.isidentifier() or name.lower() in (*_FILE_COLUMNS, *map(str.lower, values)):
            raise ValueError(f"'{name}' cannot be the name of a field; use letters, digits and _, and no name of another column: "
                             f"{', '.join(dict.fromkeys((*_FILE_COLUMNS, *values)))}")
        values[name] = given
    columns = {name: np.asarray(data)[here] for name, data in values.items() if data is not None}
    outlines = None
    if frame and frame.run.topology.deformable and part.dim == 2:
        outlines = [outline for outline, present in zip(frame.polygons, here) if present]
    step = frame.step if frame else number
    time = part.time if np.isfinite(part.time) else float(number)
    ids = np.arange(part.count) if part.ids is None else part.ids
    return Snapshot(time, step, part.dim, part.box, ids[here], columns, outlines, _contacts(part))


def _contacts(part):
    """Lines between the centres of touching particles, or from a centre to a contact point at a wall."""
    if part.pairs is None:
        return {}
    one, other = part.branches
    start = part.positions[part.pairs[:, 0]]
    lines = {"start": start, "end": start - one + other}
    return lines | ({"force": part.forces} if part.forces is not None else {})


def particles_of(shots):
    """[Particles] of the Snapshots of a file, whose vectors have three components: in 2D if all are flat (dim = 2). Row k is the
    particle with the k-th of all ids in the file."""
    ids = np.unique(np.concatenate([shot.ids for shot in shots]))
    dim = max(shot.dim for shot in shots)
    result = []
    for shot in shots:
        at = np.searchsorted(ids, shot.ids)
        given = {}
        for name, target in _PARTICLES.items():
            if name in shot.columns:
                values = np.asarray(shot.columns[name], float)
                values = values[:, :dim] if values.ndim == 2 else values
                given[target] = np.full((len(ids), *values.shape[1:]), 0 if name == "reinsertions" else np.nan)
                given[target][at] = values
        box = None if shot.box is None or not np.isfinite(shot.box[1, :dim]).any() else shot.box[:, :dim]
        result.append(Particles(**given, active=np.isin(ids, shot.ids), ids=ids, box=box, time=shot.time))
    return result


def checked_ids(place, ids):
    """The ids [n], whole numbers; RunError where an id is there twice."""
    if len(np.unique(ids)) < len(ids):
        values, counts = np.unique(ids, return_counts=True)
        raise RunError(f"{place}: the id {values[counts > 1][0]} occurs twice; give each particle a different id")
    return ids


def dimension(places, flat=False):
    """2 if the file states it (`flat`), or if all z are 0, else 3."""
    return 2 if flat or not places[:, 2].any() else 3


def three(values):
    """[n, 3] of vectors [n, D], with zeros."""
    return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))


def check_rows(path, frame, first, rows, columns):
    """RunError unless all lines of a frame, whose first one is line `first` of the file, have as many columns and an end."""
    for line, row in enumerate(rows, first):
        found = len(row.split())
        if found != columns:
            raise RunError(f"{path}: frame {frame} (line {line}): {found} columns instead of {columns}; the file is cut or damaged")
        if not row.endswith("\n"):
            raise RunError(f"{path}: frame {frame} (line {line}): the line has no end; the file is cut, or end its last line")


def table_of(rows, names):
    """DataFrame of lines of text with numbers between spaces. ValueError for other lines."""
    if not rows:
        return pd.DataFrame(columns=names, dtype=float)
    return pd.read_csv(io.StringIO("".join(rows)), delim_whitespace=True, header=None, names=names, float_precision="round_trip")
