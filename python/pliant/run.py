"""One run folder: manifest, topology, geometry, frames, series, summary."""

import difflib
import fnmatch
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from .errors import RunError
from .files import decoded_json, read_bytes
from .run_file import RunFile

# Without all of these a frame is not whole.
_FRAME_DATASETS = ("positions", "centres", "active")

#: Optional data of frames: the names that -frame_fields takes.
FRAME_FIELDS = ("velocities", "angles", "spins", "area", "perimeter", "volume", "surface_area", "reinsertions",
                "contact_count", "particle_stress", "modes", "contacts", "wall_contacts", "wall_force")


def _plain(value):
    """An HDF5 attribute as an ordinary Python object."""
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, np.ndarray):
        return value.item() if value.size == 1 else [_plain(v) for v in value.tolist()]
    return value.item() if isinstance(value, np.generic) else value


class Measured(tuple):
    """(value, error) of a measured quantity. no_error: why the error is NaN, as far as the run says so; else None."""

    no_error: str | None

    def __new__(cls, value, error, no_error=None):
        self = super().__new__(cls, (value, error))
        self.no_error = no_error
        return self

    @property
    def value(self):
        return self[0]

    @property
    def error(self):
        return self[1]

    def __repr__(self):
        return f"({self[0]!r}, {self[1]!r})" + (f" (no error: {self.no_error})" if self.no_error else "")


class _read_once:  # noqa: N801 - used as a decorator
    """A value that is read from the file at the first access; RunError after the run is closed."""

    def __init__(self, function):
        self._function, self.__doc__ = function, function.__doc__

    def __get__(self, instance, owner=None):
        if instance is None:
            return self
        instance.check_open()
        values = instance.__dict__.setdefault("_values", {})
        name = self._function.__name__
        if name not in values:
            values[name] = self._function(instance)
        return values[name]


@dataclass(frozen=True)
class Topology:
    """The unchanging data: the points of particle m are offset[m] … offset[m+1]-1."""

    offset: np.ndarray    #: [N+1]
    sigma: np.ndarray     #: [N] diameter, in sigma_avg
    a0: np.ndarray        #: [N] rest area (2D) or volume (3D)
    l0: np.ndarray        #: [N] rest length of an edge; 0 for soft particles
    mass: np.ndarray      #: [N]
    diameter: np.ndarray  #: [P] contact diameter of a point; delta for a vertex
    faces: np.ndarray | None = None        #: [F, 3] points of each triangle of closed surfaces (3D), else None
    face_offset: np.ndarray | None = None  #: [N+1] the faces of particle m are face_offset[m] … face_offset[m+1]-1

    @property
    def particles(self):
        return len(self.offset) - 1

    @property
    def points(self):
        return int(self.offset[-1])

    @property
    def deformable(self):
        """True if particles are polygons or closed surfaces."""
        return self.points > self.particles

    @property
    def particle_diameter(self):
        """[N] contact diameter of each particle's points: sigma_m (soft) or delta_m (deformable)."""
        return self.diameter[self.offset[:-1]]


@dataclass(frozen=True)
class Geometry:
    """The walls; in 3D `segments` is the meridian (rho, z) of walls of revolution."""

    segments: np.ndarray  #: [S, 4] x1 y1 x2 y2
    radius: np.ndarray    #: [S] of disks, which have their centre twice; 0: a segment
    W: float              #: distance of the vertical walls
    w: float              #: width of the orifice
    angle: float          #: degrees; NaN for a container with a user-defined outline
    kind: str             #: hopper2d or hopper3d
    box: np.ndarray | None = None  #: [2, D] of a periodic box: origin and lengths, infinite in open directions

    @property
    def orifice_height(self):
        """Height of the orifice line: the height of the lips, which are the lowest ends of the walls."""
        return float(np.nanmin(self.segments[:, [1, 3]])) if len(self.segments) else 0.0

    def nearest_image(self, difference):
        """The shortest of the periodic images of vectors [..., D]; in an open box the vectors themselves."""
        difference = np.asarray(difference, dtype=float)
        if self.box is None:
            return difference
        return nearest_image(difference, self.box[1])


def contact_table(first, second, wall, position, normal, overlap, force, friction):
    """DataFrame with the columns of Frame.contacts, one row per contact [C]; position, normal, force, friction [C, D]."""
    axes = "xyz"[: position.shape[1]]
    columns = {"particle_1": first, "particle_2": second, "wall": wall}
    for prefix, values in (("", position), ("n", normal)):
        columns.update({prefix + axis: values[:, i] for i, axis in enumerate(axes)})
    columns["overlap"] = overlap
    columns.update({"f" + axis: force[:, i] for i, axis in enumerate(axes)})
    columns["force"] = np.linalg.norm(force, axis=1)
    columns.update({"friction_" + axis: friction[:, i] for i, axis in enumerate(axes)})
    return pd.DataFrame(columns)


def lattice(period, tilt=None):
    """[D, D] edges of a periodic box, one per row: (Lx, 0), (xy, Ly), in 3D (xz, yz, Lz) last; zero in open directions."""
    period = np.asarray(period, dtype=float)
    edges = np.diag(np.where(np.isfinite(period), period, 0.0))
    if tilt is not None:
        edges[np.tril_indices(len(edges), -1)] = tilt  # xy; in 3D xz and yz in the row of the third edge
    return edges


def nearest_image(difference, period, tilt=None):
    """The shortest of the periodic images of vectors [..., D]; `period` [D] is infinite in open directions. tilt
    [D(D - 1)/2]: of a tilted box, which is periodic in all directions."""
    difference = np.asarray(difference, dtype=float)
    if tilt is None or not np.any(tilt):
        return difference - np.where(np.isfinite(period), period, 0.0) * np.round(difference / period)
    edges = lattice(period, tilt)
    dim = len(edges)
    # An image in the upright cell is at most `farthest` long; the shortest one is no farther along any axis.
    farthest = np.linalg.norm(period) / 2

    def along(vector, axis):
        """The shortest image of vectors that are in the cell along all axes after this one."""
        if axis == 0:
            return vector - np.round(vector[..., :1] / period[0]) * edges[0]
        vector = vector - np.round(vector[..., axis:axis + 1] / period[axis]) * edges[axis]
        most = int(farthest / period[axis] + 0.5)
        images = np.stack([along(vector + n * edges[axis], axis - 1) for n in range(-most, most + 1)])
        best = np.argmin((images**2).sum(-1), axis=0)
        return np.take_along_axis(images, best[None, ..., None], 0)[0]

    return along(difference, dim - 1)


@dataclass(frozen=True)
class Profile:
    """Axis profile, one row per sample of the series."""

    time: np.ndarray      #: [T]
    height: np.ndarray    #: [H] above the orifice
    momentum: np.ndarray  #: [T, H] sum of v_i phi
    weight: np.ndarray    #: [T, H] sum of phi

    def between(self, start, end=np.inf):
        """The samples from time `start` to `end`."""
        keep = (self.time >= start) & (self.time <= end)
        return Profile(self.time[keep], self.height, self.momentum[keep], self.weight[keep])

    def every(self, interval):
        """The first sample at or after each multiple of an interval."""
        _, first = np.unique(np.floor(self.time / interval * (1 + 1e-12)), return_index=True)
        return Profile(self.time[first], self.height, self.momentum[first], self.weight[first])


@dataclass(frozen=True)
class ModeEnergies:
    """Energies of packings that are displaced along their K modes by A amplitudes, for each of T samples; NaN where there is no mode."""

    amplitude: np.ndarray  #: [A] displacement of the point that moves farthest, in sigma_avg
    energy: np.ndarray     #: [T, K, A] energy of the displaced packing, minus its energy at rest
    contacts: np.ndarray   #: [T, K, A] energy of the contacts of the displaced packing

    @property
    def quadratic(self):
        """[T, K] energy over the square of the amplitude, at the smallest amplitude."""
        return self.energy[..., 0] / self.amplitude[0]**2

    @property
    def above_crossover(self):
        """[T, K, A] bool: where the energy exceeds 100 times its quadratic part, and new contacts hold at most 1 % of it. Along a
        mode without stiffness the contacts of the packing at rest only lose energy; a rise of the contact energy shows new ones."""
        quadratic = self.quadratic[..., None] * self.amplitude**2
        closed = self.contacts - np.minimum.accumulate(self.contacts, axis=-1) > 0.01 * self.energy
        return (self.energy > 100 * quadratic) & ~np.logical_or.accumulate(closed, axis=-1)

    def exponents(self, where, least=5):
        """[T, K] slopes of ln energy in ln amplitude over the amplitudes `where` [T, K, A]; NaN for fewer than `least` amplitudes."""
        used = where & (self.energy > 0)
        number = used.sum(-1)
        x, y = (np.where(used, np.log(np.where(used, values, 1)), 0) for values in (np.broadcast_to(self.amplitude, used.shape), self.energy))
        with np.errstate(invalid="ignore", divide="ignore"):
            x = np.where(used, x - (x.sum(-1) / number)[..., None], 0)
            slope = (x * y).sum(-1) / (x**2).sum(-1)
        return np.where(number >= least, slope, np.nan)

    @property
    def crossover(self):
        """[T, K] amplitude at which the energy is twice its quadratic part, interpolated; NaN if it is less at all amplitudes."""
        with np.errstate(invalid="ignore", divide="ignore"):
            part = np.log(self.energy / (2 * self.quadratic[..., None] * self.amplitude**2))
            next_ = np.fmax((part >= 0).argmax(-1), 1)
            low, high = (np.take_along_axis(part, k[..., None], -1)[..., 0] for k in (next_ - 1, next_))
            between = self.amplitude[next_] * (self.amplitude[next_ - 1] / self.amplitude[next_]) ** (high / (high - low))
        return np.where((part >= 0).any(-1), between, np.nan)


class Frame:
    """One frame; every array is read at the first access."""

    def __init__(self, run, name, group):
        self._run, self.name, self._group = run, name, group
        self.time = run.number(group, "time", np.nan)
        self.step = run.number(group, "step", -1, int)

    def __repr__(self):
        return f"<Frame {self.name} at t = {self.time:g} t0>"

    def check_open(self):
        self._run.check_open()

    @property
    def run(self):
        """The run of the frame."""
        return self._run

    def attribute(self, name, needed_by="every frame"):
        """The value of an attribute that only some scenarios write; RunError, with `needed_by`, where it is missing."""
        self.check_open()
        if name not in self._group.attrs:
            raise RunError(f"{self._run.path}: frame {self.name} has no attribute '{name}' (it is written for "
                           f"{needed_by})")
        return _plain(self._group.attrs[name])

    def has(self, name):
        """Whether the frame has a dataset or group of this name, for example a field of FRAME_FIELDS."""
        self.check_open()
        return name in self._group

    def _missing(self, name, needed_by):
        """The RunError for a dataset, or a group of some, that the frame lacks."""
        field = name.split("/")[0]
        option = f"; -frame_fields {field} writes it, also after a restart" if field in FRAME_FIELDS else ""
        return RunError(f"{self._run.path}: frame {self.name} has no '{name}' (it is written for {needed_by}{option})")

    def _read(self, name, needed_by="every frame"):
        """Values of a dataset; real numbers as float64, for any -frame_precision."""
        self.check_open()
        if name not in self._group:
            raise self._missing(name, needed_by)
        values = self._run.read(self._group[name])
        return values.astype(np.float64) if values.dtype.kind == "f" else values

    @_read_once
    def positions(self):
        """[P, D] centres of soft particles or vertices."""
        return self._read("positions")

    @_read_once
    def velocities(self):
        """[P, D] velocities of the points, in sigma_avg/t0."""
        return self._read("velocities")

    @_read_once
    def centres(self):
        """[N, D] centres of the particles."""
        # For particles of one point the dataset is a view of positions; HDF5 1.10 dies if it opens a damaged view.
        return self._read("centres") if self._run.topology.deformable else self.positions

    @_read_once
    def _box(self):
        """[3, D] origin, lengths and tilt factors of the periodic box; None in an open one."""
        if "box" in self._group:
            return self._read("box")
        box = self._run.geometry.box
        return None if box is None else np.vstack([box, np.zeros(box.shape[1])])

    @property
    def box(self):
        """[2, D] origin and lengths of the periodic box at the frame's time, infinite in open directions; None without one."""
        return None if self._box is None else self._box[:2]

    @property
    def tilt(self):
        """[D(D - 1)/2] tilt factors of the periodic box (2D: xy; 3D: xy, xz, yz); None without a box."""
        dim = self.centres.shape[1]
        return None if self._box is None else self._box[2, :dim * (dim - 1) // 2]

    @_read_once
    def images(self):
        """[N, D] by how many lengths of a periodic box each particle was wrapped into it; zeros in an open box."""
        if self._run.geometry.box is None:
            return np.zeros(self.centres.shape, dtype=np.int64)
        return self._read("images", "periodic boxes")

    @_read_once
    def unwrapped_centres(self):
        """[N, D] centres without the wrapping of a periodic box: for displacements."""
        if self.box is None:
            return self.centres
        return self.centres + self.images @ lattice(self.box[1], self.tilt)

    @property
    def followed_lattice(self):
        """[D, D] edges of the periodic box, one per row, which have followed its shear since the start of the run. They span the
        same lattice as `box` and `tilt`, whose second edge is shortened when it has become long."""
        edges = lattice(self.box[1], self.tilt)
        if "edge_shortened_by" in self._group.attrs:
            edges[1] += _plain(self._group.attrs["edge_shortened_by"]) * edges[0]
        return edges

    @_read_once
    def reinsertions(self):
        """[N] how often each particle has been reinserted since the run began."""
        if "reinsertions" not in self._group and not self._run.reinserts:
            self.check_open()
            return np.zeros(self._run.topology.particles, dtype=np.int32)
        return self._read("reinsertions", "continuous flow through a hopper")

    def displacements(self, since):
        """[N, D] how far each particle has moved since an earlier frame of the run, across the borders of a periodic box
        too. NaN for particles that were reinserted in between, or have left the run."""
        moved = self.unwrapped_centres - since.unwrapped_centres
        stayed = self.active & since.active & (self.reinsertions == since.reinsertions)
        return np.where(stayed[:, None], moved, np.nan)

    @_read_once
    def active(self):
        """[N] bool; False once a particle has left the run."""
        return self._read("active").astype(bool)

    @_read_once
    def angles(self):
        """[N] angles in radians, of particles that rotate; None if the frame has no angles."""
        return self._read("angles") if "angles" in self._group else None

    @_read_once
    def spins(self):
        """[N] spins in 1/t0, in 3D [N, 3]."""
        return self._read("spins", "particles that rotate")

    @_read_once
    def contact_count(self):
        """[N] contacts of each particle with others, not with walls; pairs of vertices, and of vertex and edge, count one
        each."""
        return self._read("contact_count")

    @_read_once
    def touching(self):
        """[N] other particles that touch each particle (droplets: bonds of the particle), for any number of touching
        vertices; in a small periodic box each image that touches counts."""
        from .analysis import coordination
        return coordination(self, walls=False)

    @_read_once
    def modes(self):
        """[P, K, D] displacements of the points in the lowest vibrational modes of a packing, up to 20; zero for rattlers. The
        largest displacement of a mode is 1."""
        values = self._read("modes", "packings with -modes")
        return values.reshape(len(values), -1, self._run.dim)

    @_read_once
    def particle_stress(self):
        """[N, D(D + 1)/2] contribution of each particle to the stress, kinetic part included: xx, xy, yy (3D: xx, xy, xz, yy, yz, zz);
        tension is positive. The sum over all particles is the stress in the series."""
        return self._read("particle_stress", "packings in periodic boxes")

    @_read_once
    def area(self):
        """[N] areas (polygons only)."""
        return self._read("area", "polygons")

    @_read_once
    def perimeter(self):
        """[N] perimeters (polygons only)."""
        return self._read("perimeter", "polygons")

    @_read_once
    def volume(self):
        """[N] volumes inside the surfaces (closed surfaces only)."""
        return self._read("volume", "closed surfaces")

    @_read_once
    def surface_area(self):
        """[N] areas of the surfaces (closed surfaces only)."""
        return self._read("surface_area", "closed surfaces")

    @property
    def content(self):
        """[N] areas of polygons, or volumes of closed surfaces."""
        return self.area if self._run.dim == 2 else self.volume

    @property
    def shape_parameter(self):
        """[N] p²/(4π a) of polygons, S^(3/2)/(6 √π V) of closed surfaces: 1 for a disk or sphere, else larger."""
        if self._run.dim == 2:
            return self.perimeter**2 / (4 * np.pi * self.area)
        return self.surface_area**1.5 / (6 * np.sqrt(np.pi) * self.volume)

    @_read_once
    def wall_force(self):
        """[S, D] force of the particles on each wall, in rho g sigma_avg^D."""
        return self._read("wall_force", "walls")

    @_read_once
    def wall_segments(self):
        """[S, 4] x1 y1 x2 y2 of the walls at the frame's time; a lid that has been opened has no length."""
        return self._read("wall_segments") if "wall_segments" in self._group else self._run.geometry.segments

    @_read_once
    def particle_velocities(self):
        """[N, D] mean velocity of each particle's points, which have equal masses."""
        offset = self._run.topology.offset
        return np.add.reduceat(self.velocities, offset[:-1], axis=0) / np.diff(offset)[:, None]

    @_read_once
    def speeds(self):
        """[N] magnitudes of the particles' velocities."""
        return np.linalg.norm(self.particle_velocities, axis=1)

    @_read_once
    def polygons(self):
        """List of N arrays [vertices, D] (one row each for soft particles)."""
        return np.split(self.positions, self._run.topology.offset[1:-1])

    @_read_once
    def contacts(self):
        """DataFrame, one row per contact: particle_1, particle_2, wall, x y [z], nx ny [nz], overlap, fx fy [fz], force,
        friction_x friction_y [friction_z].

        Force and normal are those on particle_1; `force` is the magnitude, in rho g sigma_avg^D. (fx, fy) is the whole
        force, (friction_x, friction_y) its part by friction and damping; the rest is elastic. In frames of versions that
        did not store this part it is NaN, and forces between particles are elastic (`elastic_contacts`). Contacts between
        particles come first, with -1 for the wall; then those with walls, if the frame has them, with -1 for particle_2
        and the row of `geometry.segments` as wall.
        """
        pairs = self._contact_table("contacts")
        return pd.concat([pairs, self.wall_contacts], ignore_index=True) if "wall_contacts" in self._group else pairs

    @property
    def elastic_contacts(self):
        """Whether an older version wrote the contacts between particles, with elastic forces only."""
        return "contacts" in self._group and "friction" not in self._group["contacts"]

    @_read_once
    def wall_contacts(self):
        """The rows of `contacts` that are with walls."""
        return self._contact_table("wall_contacts")

    def _contact_table(self, group):
        self.check_open()
        if group not in self._group:
            raise self._missing(group, "every frame")
        vectors = {name: self._read(f"{group}/{name}").reshape(-1, self._run.dim) for name in ("position", "normal", "force")}
        if group == "contacts":
            first, second = self._read("contacts/particles").reshape(-1, 2).T
            wall = np.full(len(first), -1, dtype=np.int32)
        else:
            first, wall = self._read("wall_contacts/particle"), self._read("wall_contacts/wall")
            second = np.full(len(first), -1, dtype=np.int32)
        if "friction" in self._group[group]:
            vectors["friction"] = self._read(f"{group}/friction").reshape(-1, self._run.dim)
        else:
            vectors["friction"] = np.full_like(vectors["force"], np.nan)
        return contact_table(first, second, wall, overlap=self._read(f"{group}/overlap"), **vectors)


class Frames(Sequence):
    """The complete frames of a run, in order; `frames[-1]`, slices and iteration work, nothing is read in advance."""

    def __init__(self, run, names):
        self._run, self._names = run, names

    def __len__(self):
        self._run.check_open()
        return len(self._names)

    def __getitem__(self, index):
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        if not len(self):
            raise RunError(f"{self._run.path}: the run has no frames (set -frame_interval, or let it run longer)")
        try:
            name = self._names[index]
        except IndexError:
            # An IndexError ends a for loop, as required by Sequence; Run.frame() raises errors for users.
            raise IndexError(f"frame {index} of {len(self)}") from None
        return Frame(self._run, name, self._run.frame_group(name))

    def __iter__(self):
        return (self[i] for i in range(len(self)))

    @property
    def times(self):
        """[frames] times in t0."""
        return self._run.frame_times


#: Quantities that only some kinds of runs have.
QUANTITIES = ("Q", "Q_corrected", "Q_correlation_time", "bulk_fraction", "c0", "c0_chi2_per_dof", "c0_end", "c0_residue",
              "c0_start", "c0_start_count", "contacts_per_particle", "drag_friction_ratio", "flow_ended", "left_in_hopper",
              "max_overlap", "orifice_density", "orifice_velocity", "steady_samples", "steady_start", "top_height",
              "total_time", "avalanche_size", "capillary_length", "ns_per_vertex_step")


def _suggestion(name, summary):
    """'did you mean Q?', or the list of names."""
    given = [key for key, entry in summary.items() if isinstance(entry, (dict, int, float)) and key != "parameters"]
    names = {key.lower(): key for key in (*QUANTITIES, *given)}
    near = difflib.get_close_matches(name.lower(), names, 1)
    return f"did you mean {names[near[0]]}?" if near else f"it has {', '.join(given)}"


class Run:
    """The run in folder `path` as it is at this moment, also while the program still writes: open it again to see later
    data. Raises RunError if it is not a run. Use as a context manager to close the file early."""

    def __init__(self, path):
        self.path = Path(path)
        if not self.path.exists():
            raise RunError(f"{self.path}: no such folder")
        if not self.path.is_dir():
            raise RunError(f"{self.path}: not a folder (name the run's folder, not a file in it)")
        h5 = self.path / "run.h5"
        if not h5.exists():
            if (self.path / "ensemble.h5").exists():
                raise RunError(f"{self.path}: an ensemble, not a run; pliant-report shows its runs, and Ensemble(...).extract() of the "
                               "Python package pliant writes one of them to a separate folder")
            raise RunError(f"{self.path}: not a run (it has no run.h5)")
        # The summary first: by then run.h5 has the frames that it counts.
        self._summary_text = read_bytes(self.path / "summary.json")
        self._file = RunFile(h5)
        if "manifest" not in self._file:
            self.close()
            raise RunError(f"{self.path}: not a run (run.h5 has no /manifest)")

    def __repr__(self):
        if self._file.closed:
            return f"<Run {self.path}: closed>"
        return f"<Run {self.path}: {self.manifest.get('scenario')}, model {self.model}>"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        """Arrays and tables that were read remain valid; further access raises RunError."""
        self._file.close()

    def check_open(self):
        """RunError if the run was closed."""
        self._file.check_open()

    def read(self, dataset):
        """All values of a dataset of run.h5; RunError if it is damaged."""
        return self._file.read(dataset)

    def number(self, owner, name, otherwise, dtype=float):
        """The attribute `name` of a group or dataset of run.h5, a number of type `dtype`; `otherwise` if there is none."""
        return self._file.number(owner, name, otherwise, dtype)

    @property
    def name(self):
        """The folder's own name."""
        return self.path.resolve().name

    @_read_once
    def manifest(self):
        """The content of /manifest, with `options`, `datasets` and `start` decoded."""
        group = self._file["manifest"]
        manifest = {key: _plain(value) for key, value in group.attrs.items()}
        manifest |= {name: self._file.text(group[name]) for name in group.names()}
        for name in ("options", "datasets", "start"):
            try:
                manifest[name] = json.loads(manifest.get(name, "{}"))
            except json.JSONDecodeError as error:
                raise RunError(f"{self.path}: the {name} in /manifest are not JSON ({error})") from None
        return manifest

    def describe(self, dataset):
        """(units, description) of a dataset of run.h5, such as "series/heat" or "frames/000003/spins"; units are empty for
        numbers without unit. RunError for a dataset that the run does not describe, as in runs of older versions."""
        for pattern, entry in self.manifest["datasets"].items():
            if fnmatch.fnmatchcase(dataset.lstrip("/"), pattern):
                return entry["units"], entry["description"]
        raise RunError(f"{self.path}: run.h5 does not describe {dataset}; docs/reference/file-format.md has the datasets")

    @_read_once
    def options(self):
        """Option name → value; units are in `manifest["options"]`."""
        return {name: entry["value"] if isinstance(entry, dict) else entry
                for name, entry in self.manifest["options"].items()}

    @property
    def counts_packings(self):
        """Whether the time of the run is the number of its packings, as of pack and of quasistatic shear."""
        return self.scenario == "pack" or (self.scenario == "shear" and self.options.get("shear_rate") is None)

    @property
    def scenario(self):
        return self.manifest.get("scenario", "")

    @property
    def model(self):
        return self.manifest.get("model", "")

    @property
    def droplets(self):
        """True if lengths are in <R> and forces in the unit of f0, not in sigma_avg and rho g sigma_avg^D."""
        return self.model == "bubble" and self.scenario not in ("pack", "shear")

    @property
    def dim(self):
        return int(self.manifest.get("dim", 2))

    @_read_once
    def summary(self):
        """summary.json as a dict; empty if the run has not ended."""
        if self._summary_text is None:
            return {}
        return decoded_json(self.path / "summary.json", self._summary_text)

    @_read_once
    def parameters(self):
        """Parameter name → value: the options; values in summary.json override them."""
        listed = self.summary.get("parameters", {})
        return self.options | {k: v["value"] if isinstance(v, dict) else v for k, v in listed.items()}

    @_read_once
    def _terms(self):
        """Parameter name → the term that reads it, or None if the model does not read it. Empty for runs of older
        versions."""
        listed = self.manifest["options"] | self.summary.get("parameters", {})
        return {k: v["term"] for k, v in listed.items() if isinstance(v, dict) and "term" in v}

    @property
    def read_parameters(self):
        """Names of the parameters that the terms of the run's model read; empty for runs of older versions."""
        return [name for name, term in self._terms.items() if term is not None]

    @property
    def unread_parameters(self):
        """Names of the parameters that other models read; empty for runs of older versions."""
        return [name for name, term in self._terms.items() if term is None]

    def measured(self, name):
        """(value, error) of a quantity in summary.json; NaN if it is unknown, or belongs to another kind of run (QUANTITIES).
        Where averages have no error, the attribute no_error of the result has the reason. RunError for a name that no summary has, and for a value that is not a number."""
        if self.summary and name not in self.summary and name not in QUANTITIES:
            raise RunError(f"{self.path}: there is no quantity '{name}' in summary.json; {_suggestion(name, self.summary)}")
        entry = self.summary.get(name)
        if not isinstance(entry, dict):
            entry = {"value": entry}
        try:
            return Measured(*(float("nan") if entry.get(k) is None else float(entry[k]) for k in ("value", "error")),
                            entry.get("no_error"))
        except (TypeError, ValueError):
            raise RunError(f"{self.path}: '{name}' in summary.json is not a number; read run.summary['{name}']") from None

    @_read_once
    def topology(self):
        group = self._file["topology"]
        return Topology(**{name: self.read(group[name]) for name in Topology.__dataclass_fields__
                           if name in group or name not in ("faces", "face_offset")})

    @_read_once
    def geometry(self):
        group = self._file["geometry"]
        attrs = {key: _plain(value) for key, value in group.attrs.items()}
        lengths = {k: float(attrs.get(k, np.nan)) for k in ("W", "w", "angle")}
        segments = self.read(group["segments"]).reshape(-1, 4)
        radius = self.read(group["radius"]) if "radius" in group else np.zeros(len(segments))
        box = self.read(group["box"]).reshape(2, -1) if "box" in group else None
        kind = self._file.text(group["kind"]) if "kind" in group else attrs.get("kind", "")
        return Geometry(segments, radius, **lengths, kind=kind, box=box)

    @property
    def reinserts(self):
        """Whether particles that leave are reinserted at the upper end."""
        return self.scenario == "hopper" and self.options.get("flow", "continuous") == "continuous"

    @property
    def frames(self):
        return Frames(self, self._frame_names)

    @_read_once
    def _frame_names(self):
        """Names of the complete frames; frames that the program has not finished are at the end."""
        names = list(self._file.frames)
        while names and not self._whole(names[-1]):
            names.pop()
        return names

    def _whole(self, name):
        try:
            return all(d in self._file[f"frames/{name}"] for d in _FRAME_DATASETS)
        except RunError:
            return True  # damaged: reading it raises an error

    def frame_group(self, name):
        """The HDF5 group of a frame."""
        return self._file[f"frames/{name}"]

    @_read_once
    def frame_times(self):
        """[frames] times in t0."""
        return np.array([self.number(self.frame_group(n), "time", np.nan) for n in self._frame_names], dtype=float)

    def frame(self, index):
        """Frame by index; the RunError names the range of frames."""
        try:
            return self.frames[index]
        except IndexError:
            count = len(self.frames)
            raise RunError(f"{self.path}: no frame {index}, the run has {count} (0 … {count - 1}, "
                           "or negative from the end)") from None

    @_read_once
    def _series_arrays(self):
        group = self._file["series"]
        arrays = {name: self.read(group[name]) for name in group.names()}
        if "time" not in arrays:
            raise RunError(f"{self.path}: /series has no time")
        rows = min(len(data) for data in arrays.values())
        if "members" in group.attrs and any(len(data) > rows for data in arrays.values()):  # others write without commits
            raise self._file.damaged("/series", "its columns have different numbers of rows")
        return {name: data[:rows] for name, data in arrays.items()}

    @_read_once
    def series(self):
        """Scalar time series as a DataFrame, one row per sample; the time is in the column `time`."""
        scalars = {name: values for name, values in self._series_arrays.items() if values.ndim == 1}
        first = scalars.pop("time")
        return pd.DataFrame({"time": first, **scalars})

    @property
    def vector_series(self):
        """Name → [T, …] of the time series with several values per sample."""
        return {name: values for name, values in self._series_arrays.items() if values.ndim > 1}

    @_read_once
    def events(self):
        """Name → array of /events, for example breaking and forming bonds of a raft; empty if there are none."""
        if "events" not in self._file:
            return {}
        group = self._file["events"]
        return {name: self.read(group[name]) for name in group.names()}

    @_read_once
    def profile(self):
        """Axis profile of all samples."""
        arrays = self._series_arrays
        if "profile_momentum" not in arrays or "series_axes" not in self._file:
            raise RunError(f"{self.path}: the run has no axis profile")
        return Profile(arrays["time"], self.read(self._file["series_axes/profile_height"]), arrays["profile_momentum"],
                       arrays["profile_weight"])

    @_read_once
    def mode_energies(self):
        """The ModeEnergies of packings; of runs with -modes and -mode_amplitude."""
        arrays = self._series_arrays
        if "mode_energies" not in arrays or "series_axes" not in self._file:
            raise RunError(f"{self.path}: the run has no energies along modes: run pack with -modes and -mode_amplitude")
        amplitude = self.read(self._file["series_axes/mode_amplitude"])
        energy, contacts = (arrays[name].reshape(len(arrays["time"]), -1, len(amplitude))
                            for name in ("mode_energies", "mode_contact_energies"))
        return ModeEnergies(amplitude, energy, contacts)

    def report(self, path=None, limit=5.0):
        """Writes a page for browsers with results, charts and a player of the frames (report.html in the folder of the run, or
        `path`) of at most `limit` MB. Returns its path. Raises RunError for damaged data, OutputError."""
        from .report import write_report  # imports SciPy
        return write_report(self, path, limit)

    def draw(self, frame=-1, color=None, axes=None):
        """Draws a frame (its number, or a Frame) with matplotlib: walls, and particles coloured by speed (default), contacts
        (default for packings), size, area or shape; on `axes`, by default of a new figure. Returns the axes. Errors: RunError."""
        from .plotting import draw_frame  # imports matplotlib
        return draw_frame(self, frame, color, axes)

    @property
    def steady_start(self):
        """Time from which the run counts as steady, None if summary.json does not say."""
        value, _ = self.measured("steady_start")
        return None if np.isnan(value) else value
