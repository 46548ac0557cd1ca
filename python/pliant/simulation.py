"""Simulations from arrays: particles, walls, a model of the catalogue, protocols as functions of Python.

>>> import numpy as np, pliant
>>> sim = pliant.Simulation([[0, 1], [0.2, 2.1]], diameters=1, gravity=(0, -1), e_sp=1000, zeta=0.1)
>>> sim.run(0.5)
>>> sim.positions, sim.energies["pair"], sim.contacts

Arrays are numpy's, in the order in which particles were added. Units are free: with diameters, density and gravity of
about 1 they equal the units of the program, and the defaults of the parameters fit.
"""

from __future__ import annotations

import functools
import inspect
import json
import numbers
import os
import re
import types
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from .engine import core
from .errors import InputError, NumericalError, PliantError, PliantWarning, UsageError
from .run import contact_table
from .scenario_calls import arguments, option_lines

if TYPE_CHECKING:
    from .analysis import Particles

_MOTION = ("velocity", "amplitude", "frequency", "phase", "spin", "pivot")


def _real(values, name, cure="give an array of numbers"):
    """The values as a float64 array. InputError for masked arrays and for arrays of other types, which numpy would convert silently."""
    if np.ma.is_masked(values):
        raise InputError(f"{name} has masked numbers; fill them, or leave out their rows")
    try:
        kind = getattr(values, "dtype", None)
        if isinstance(kind, np.dtype) and kind.kind not in "biufO":
            raise TypeError(f"its type is {kind}, not that of real numbers")
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: {error}; {cure}") from None


def _array(values, name, columns=None):
    """Finite or not: the engine checks the numbers. columns: of an array [n, columns]; None: [n]."""
    array = np.ascontiguousarray(_real(values, name))
    shape = "[n]" if columns is None else f"[n, {columns}]"
    if array.ndim != (1 if columns is None else 2) or (columns is not None and array.shape[1] != columns):
        raise InputError(f"{name} has the shape {array.shape}; give an array {shape}")
    return array


def _each(values, name, count):
    """One number for each of `count` particles, from one or as many."""
    array = _real(values, name, f"give a number, or one for each of the {count} particles")
    if array.shape not in ((), (1,), (count,)):
        raise InputError(f"{name} has the shape {array.shape}; give a number, or one for each of the {count} particles")
    return np.ascontiguousarray(np.broadcast_to(array, (count,)))


def _read_only(array):
    """An array whose changes would be lost."""
    array.flags.writeable = False
    return array


class _Fixed:
    """Base of classes whose attributes are all known: others would be ignored."""

    _cure = ""
    _free: tuple[str, ...] = ()

    def __reduce_ex__(self, protocol):
        """Copies would share the data of the engine, and a file cannot hold them."""
        raise TypeError(f"a {type(self).__name__} can neither be copied nor pickled; {self._cure_of_copies()}")

    def _cure_of_copies(self):
        return "make another one by the same calls"

    def __getattr__(self, name):
        if name in ("_core", "_callbacks"):
            raise UsageError(f"this {type(self).__name__} was not initialised; call super().__init__(…) in a class derived from it")
        raise AttributeError(f"{type(self).__name__} has no attribute {name}")

    def __setattr__(self, name, value):
        known = getattr(type(self), name, None)
        if name.startswith("_") or (known is not None and not callable(known)) or name in self._free:
            super().__setattr__(name, value)
            return
        kind = "a method" if callable(known) else "no attribute that can be set"
        raise AttributeError(f"{name} is {kind} of {type(self).__name__}; {self._cure_of(name)}")

    def _cure_of(self, name):
        return self._cure


_OPTION = re.compile(r"(?<![^\s('])-(?!inf\b|nan\b|help\b)([A-Za-z]\w*)")


def _keywords(text):
    """A message of the engine, which names options as on the command line, with keywords."""
    return _OPTION.sub(r"\1", text.replace("-help lists all options", "help(pliant.Simulation) lists them"))


def _as_keywords(function):
    """Messages of errors name keywords instead of options."""
    @functools.wraps(function)
    def call(*args, **keywords):
        try:
            return function(*args, **keywords)
        except PliantError as error:
            error.args = (_keywords(str(error)), *error.args[1:])
            raise

    return call


def _vector(values, name):
    try:
        if isinstance(values, (str, bytes)):
            raise TypeError(f"{values!r} is a text")
        return [float(value) for value in values]
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: {error}; give a number for each direction") from None


def _number(value, name):
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        raise InputError(f"{name}: {value!r} is not a number")
    return float(value)


def _area(polygon):
    """Signed area of vertices [V, 2]."""
    x, y = polygon.T
    return np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2


def _sixfold(corners):
    """Six times the signed volumes [F] of tetrahedra from the origin to triangles [F, 3, 3]."""
    return np.einsum("fk,fk->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))


def _volume(vertices, faces):
    """Signed volume of a surface."""
    return float(np.sum(_sixfold((vertices - vertices[:1])[faces])) / 6)


def _optional(value, name):
    return None if value is None else _number(value, name)


def _integer(value, name, most=2**31 - 1):
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Integral):
        raise InputError(f"{name}: {value!r} is not an integer")
    if abs(value) > most:
        raise InputError(f"{name} is {value}; give a number of at most {most}")
    return int(value)


def _intervals(frames, samples, checkpoints):
    return core.OutputIntervals(_optional(frames, "frame_interval"), _optional(samples, "sample_interval"),
                                _optional(checkpoints, "checkpoint_interval"))


def _options_of(words):
    """The options in arguments of a command line, as arguments() makes them."""
    options, name = {}, None
    for word in words:
        if word[:1] == "-" and word[1:2].isalpha():
            name = word[1:]
            options[name] = True
        else:
            try:
                options[name] = json.loads(word)
            except ValueError:
                options[name] = word
    return options


def _absolute(folder):
    """The simulation stays in its folder when the program changes its working directory."""
    path = os.fspath(folder)
    return os.path.abspath(path) if path else path


def _motion(motion):
    for name in motion:
        if name not in _MOTION:
            raise InputError(f"{name} is no part of a motion; these are {', '.join(_MOTION)}")
    amplitude, spin = _vector(motion.get("amplitude", ()), "amplitude"), motion.get("spin", ())
    if amplitude and "frequency" not in motion:
        raise InputError("a wall with an amplitude but without a frequency never moves; give frequency, too")
    return (_vector(motion.get("velocity", ()), "velocity"), amplitude,
            _number(motion.get("frequency", 0.0), "frequency"), _number(motion.get("phase", 0.0), "phase"),
            [float(spin)] if isinstance(spin, numbers.Real) else _vector(spin, "spin"),
            _vector(motion.get("pivot", ()), "pivot"))


class Box(_Fixed):
    """A periodic box: lengths [D], infinite (or None) in open directions; origin [D]. A Box is constant; only
    Simulation.minimize(pressure=…) changes the box of a simulation."""

    _cure = "make another Box(lengths, origin)"

    def __init__(self, lengths: Sequence[float | None], origin: Sequence[float] | None = None):
        self._lengths = tuple(np.inf if value is None else _number(value, "lengths") for value in lengths)
        self._origin = (0.0,) * len(self._lengths) if origin is None else tuple(_vector(origin, "origin"))

    @property
    def lengths(self) -> tuple[float, ...]:
        """[D] lengths of the sides, infinite in open directions."""
        return self._lengths

    @property
    def origin(self) -> tuple[float, ...]:
        """[D] the corner with the least coordinates."""
        return self._origin

    @classmethod
    def filled(cls, diameters: ArrayLike, fraction: float | None = None, dim: int = 2) -> Box:
        """A square (3D: cubic) box of which disks (spheres) of these diameters would fill a fraction of the area (volume), by
        default 0.75 (0.5)."""
        sizes = np.asarray(_vector(np.atleast_1d(diameters), "diameters"))
        if _integer(dim, "dim") not in (2, 3):
            raise InputError(f"dim is {dim}, but must be 2 or 3")
        if not (sizes.size and np.all(np.isfinite(sizes)) and np.all(sizes > 0)):
            raise InputError("diameters must be positive and finite, at least one")
        if fraction is None:
            fraction = 0.75 if dim == 2 else 0.5
        if not 0 < _number(fraction, "fraction") < np.inf:
            raise InputError(f"fraction is {fraction}, but must be positive and finite")
        content = np.pi / 4 * np.sum(sizes**2) if dim == 2 else np.pi / 6 * np.sum(sizes**3)
        return cls([float((content / fraction)**(1 / dim))] * dim)

    def pack(self, diameters: ArrayLike, seed: int = 1, n_vertices: int = 0, shape_parameter: float = 0.0,
             mesh: Mesh | None = None) -> Any:
        """Positions of particles at random places in the box, pushed apart until they do not overlap: [N, D], or with n_vertices
        a list of N regular polygons, in 3D icospheres, or with a mesh of N copies of it. Errors: InputError for a box that is open
        in a direction or narrower than a particle; NumericalError if overlaps remain, in a box that is too small."""
        shape = _mesh_of(mesh)
        x = core.pack_box(self.origin, self.lengths, _vector(np.atleast_1d(diameters), "diameters"),
                          _integer(n_vertices, "n_vertices"), _number(shape_parameter, "shape_parameter"), shape, _seed(seed))
        return _each_particle(x, n_vertices, mesh)

    def __reduce_ex__(self, protocol):
        return Box, (self._lengths, self._origin)

    def __repr__(self):
        return f"Box({list(self.lengths)}, origin={list(self.origin)})"


class Mesh(_Fixed):
    """A closed surface of triangles: the faces, and the shape at rest in any size, of deformable particles in 3D.

    vertices: [n, 3]; faces: [m, 3] numbers of vertices, counter-clockwise as seen from outside. Errors: InputError for a surface
    that is open, inverted, in several parts, with holes through it (Euler number other than 2), or that crosses itself.
    """

    _cure = "make another Mesh"

    @_as_keywords
    def __init__(self, vertices: ArrayLike, faces: ArrayLike):
        triangles = np.asarray(faces)
        if triangles.dtype.kind not in "iu":
            raise InputError("faces are no integers; give numbers of vertices [m, 3]")
        if triangles.size and np.abs(triangles.astype(float)).max() >= 2**31:
            raise InputError("faces has numbers beyond 2^31; give numbers of vertices [m, 3]")
        self._core = core.Mesh(_array(vertices, "vertices", 3), np.ascontiguousarray(triangles, dtype=np.int32))

    def __reduce_ex__(self, protocol):
        return Mesh, (np.array(self.vertices), np.array(self.faces))

    @classmethod
    @_as_keywords
    def icosphere(cls, n_vertices: int = 42) -> Mesh:
        """The nearly round surface of 12, 42, 162 or 642 vertices with which runs of the hopper start; its volume is pi/6."""
        self = cls.__new__(cls)
        self._core = core.Mesh.icosphere(_integer(n_vertices, "n_vertices"))
        return self

    @classmethod
    @_as_keywords
    def read(cls, file: str | os.PathLike) -> Mesh:
        """The surface of an OFF or OBJ file."""
        self = cls.__new__(cls)
        self._core = core.Mesh.read(os.fspath(file))
        return self

    @property
    def vertices(self) -> np.ndarray:
        """[n, 3]; a copy, read-only."""
        return _read_only(self._core.vertices)

    @property
    def faces(self) -> np.ndarray:
        """[m, 3] numbers of vertices; a copy, read-only."""
        return _read_only(self._core.faces)

    @property
    def volume(self) -> float:
        return self._core.volume

    @property
    def area(self) -> float:
        return self._core.area

    @property
    def shape_parameter(self) -> float:
        """area^(3/2)/(6 sqrt(pi) volume): 1 for a sphere, else larger."""
        return float(self.area**1.5 / (6 * np.sqrt(np.pi) * self.volume))

    def placed(self, centres: ArrayLike, diameters: ArrayLike = 1.0, rotations: ArrayLike | None = None) -> list[np.ndarray]:
        """Copies [n, 3] of the vertices, with the volumes of spheres of these diameters, their means at centres [N, 3], turned by
        rotations [N, 3, 3]."""
        places = _array(centres, "centres", 3)
        sizes = _each(diameters, "diameters", len(places)) * np.cbrt(np.pi / 6 / self.volume)
        turns = np.broadcast_to(np.eye(3), (len(places), 3, 3)) if rotations is None else np.asarray(rotations, dtype=float)
        if turns.shape != (len(places), 3, 3):
            raise InputError(f"rotations has the shape {turns.shape}; give a matrix for each particle, ({len(places)}, 3, 3)")
        shape = self.vertices - self.vertices.mean(axis=0)
        return [centre + size * shape @ turn.T for centre, size, turn in zip(places, sizes, turns)]

    def __repr__(self):
        return f"<Mesh of {len(self.vertices)} vertices and {len(self.faces)} faces>"


def _mesh_of(mesh):
    if mesh is not None and not isinstance(mesh, Mesh):
        raise InputError(f"mesh: {mesh!r} is not a Mesh; give pliant.Mesh(vertices, faces), Mesh.icosphere(42) or Mesh.read(file)")
    return mesh and mesh._core


class Container(_Fixed):
    """A hopper, with obstacles: its walls, and a dense packing in it.

    width: width of the orifice, which is centred at the origin; wall_distance: distance of the vertical walls; angle:
    angle of the sloped walls to gravity, in degrees. obstacles: ("disk", centre, radius) or ("polygon", corners), inside the
    container; they may touch walls, but not overlap them or each other. In 3D these are meridians (ρ, z).
    Simulation(…, walls=container) has the walls and the obstacles.
    """

    _cure = "make another Container"

    @_as_keywords
    def __init__(self, width: float, wall_distance: float, angle: float = 90.0, obstacles: Iterable[tuple] = ()):
        self._core = core.Container.hopper(_number(wall_distance, "wall_distance"), _number(width, "width"),
                                           _number(angle, "angle"), _obstacles(obstacles))

    @classmethod
    @_as_keywords
    def outline(cls, left: ArrayLike, right: ArrayLike, obstacles: Iterable[tuple] = ()) -> Container:
        """Two polylines [n, 2], each from an end of the orifice, at y = 0, up to where the wall continues vertically."""
        self = cls.__new__(cls)
        self._core = core.Container.outline(_array(left, "left", 2), _array(right, "right", 2), _obstacles(obstacles))
        return self

    def pack(self, diameters: ArrayLike, dim: int = 2, fraction: float = 0.8, seed: int = 1, n_vertices: int = 0,
             shape_parameter: float = 0.0, mesh: Mesh | None = None) -> Any:
        """Positions of particles that fill it without overlaps, as runs of the hopper start: [N, dim], or with n_vertices a
        list of N polygons, in 3D icospheres, or with a mesh of N copies of it. Errors: NumericalError if they do not fit."""
        shape = _mesh_of(mesh)
        x = core.pack_container(self._core, _integer(dim, "dim"), _vector(np.atleast_1d(diameters), "diameters"),
                                _integer(n_vertices, "n_vertices"), _number(shape_parameter, "shape_parameter"), shape,
                                _number(fraction, "fraction"), _seed(seed))
        return _each_particle(x, n_vertices, mesh)

    def inside(self, point: Sequence[float], dim: int = 2) -> bool:
        """Whether a point (x, y), in 3D (ρ, z), is above the orifice, between the walls and in no obstacle."""
        x, y = _vector(point, "point")
        return core.Container.inside(self._core, dim, x, y)

    @property
    def inflow(self) -> tuple[float, float]:
        """Least and largest x between the vertical walls."""
        return self._core.inflow


def _each_particle(x, n_vertices, mesh):
    """Points [N · n, D] as a list of N particles, if these have several points."""
    count = n_vertices if mesh is None else len(mesh.vertices)
    return np.split(x, len(x) // count) if count else x


def _obstacles(obstacles):
    result = []
    for entry in obstacles:
        if not isinstance(entry, (tuple, list)) or not entry or entry[0] not in ("disk", "polygon"):
            raise InputError(f"obstacle {entry!r} is neither (\"disk\", centre, radius) nor (\"polygon\", corners)")
        if entry[0] == "disk":
            if len(entry) != 3:
                raise InputError(f"obstacle {entry!r}: a disk has a centre and a radius")
            result.append(("disk", _vector(entry[1], "centre"), _number(entry[2], "radius")))
        else:
            if len(entry) != 2:
                raise InputError(f"obstacle {entry!r}: a polygon has corners")
            result.append(("polygon", _array(entry[1], "corners", 2)))
    return result


def _seed(seed):
    seed = _integer(seed, "seed", 2**63 - 1)
    if not 0 <= seed < 2**63:
        raise InputError(f"seed is {seed}; give one from 0 to 2^63 - 1")
    return seed


class Walls(_Fixed):
    """Walls around or between particles. Each method adds one rigid body and returns its number.

    A body moves by velocity [D], by an oscillation amplitude [D] · (sin(frequency · t + phase) - sin(phase)), and by a spin
    about a pivot [D]; Simulation.move_wall changes this. t counts from the start of the simulation, after move_wall from the
    call. In 3D lines, polygons and disks are meridians (ρ, z) of surfaces of
    revolution about the z axis.
    """

    _cure = "give motions to the method that adds a wall, or to Simulation.move_wall"

    def __init__(self, dim: int = 2):
        self._core = core.Walls(_integer(dim, "dim"))

    @property
    def dim(self) -> int:
        return self._core.dim

    def __len__(self):
        """Number of bodies."""
        return self._core.bodies

    def line(self, points: ArrayLike, **motion) -> int:
        """Segments between consecutive points [n, 2]; particles touch both sides. Friction starts again at corners."""
        return self._core.polyline(_array(points, "points", 2), _motion(motion))

    def segment(self, a: Sequence[float], b: Sequence[float], **motion) -> int:
        """One straight wall."""
        return self.line([_vector(a, "a"), _vector(b, "b")], **motion)

    def polygon(self, corners: ArrayLike, **motion) -> int:
        """A closed outline with corners [n, 2]; particles touch both sides. Friction starts again at corners."""
        return self._core.polygon(_array(corners, "corners", 2), _motion(motion))

    def disk(self, centre: Sequence[float], radius: float, **motion) -> int:
        """A disk; in 3D a ring, or a sphere on the axis."""
        return self._core.disk(_vector(centre, "centre"), _number(radius, "radius"), _motion(motion))

    def half_space(self, point: Sequence[float], normal: Sequence[float], **motion) -> int:
        """A solid behind the plane through a point; the normal [D] points out of it."""
        return self._core.half_space(_vector(point, "point"), _vector(normal, "normal"), _motion(motion))

    def container(self, container: Container) -> int:
        """The walls and obstacles of a container."""
        if not isinstance(container, Container):
            raise InputError(f"container: {container!r} is not a Container")
        return self._core.container(container._core)


def diameters(n: int, kind: str = "bidisperse", ratio: float = 1.4, fraction: float = 0.5, deviation: float = 0.1,
              seed: int = 1) -> np.ndarray:
    """n diameters with mean 1, as runs draw them. kind: bidisperse (ratio, fraction of large ones), normal (deviation), mono."""
    return np.array(core.diameters(_integer(n, "n"), str(kind), _number(ratio, "ratio"), _number(fraction, "fraction"),
                                   _number(deviation, "deviation"), _seed(seed)))


def regular_polygons(centres: ArrayLike, diameters: ArrayLike, n_vertices: int, angles: ArrayLike = 0.0) -> list[np.ndarray]:
    """Regular polygons with the areas of disks of these diameters, about centres [N, 2]."""
    places = _array(centres, "centres", 2)
    count = len(places)
    x = core.regular_polygons(places, list(_each(diameters, "diameters", count)), _integer(n_vertices, "n_vertices"),
                              list(_each(angles, "angles", count)))
    return np.split(x, count) if count else []


class Minimum:
    """Result of Simulation.minimize().

    converged: whether max_force is at most force_tolerance; with a pressure, also whether the box has it. reason: why it
    ended. iterations, evaluations: of FIRE, and of forces. max_force: largest component of a force on a point. energy: of
    the model, gravity included. stress: [D, D]; pressure: -trace(stress)/D.
    """

    def __init__(self, values):
        self.converged: bool = values["converged"]
        self.reason: str = values["reason"]
        self.iterations: int = values["iterations"]
        self.evaluations: int = values["evaluations"]
        self.max_force: float = values["max_force"]
        self.energy: float = values["energy"]
        #: [D, D], tension positive, without kinetic part; None unless the box is periodic in all directions.
        self.stress: np.ndarray | None = values["stress"]

    @property
    def pressure(self) -> float | None:
        """-trace of the stress over the dimension."""
        return None if self.stress is None else float(-np.trace(self.stress) / len(self.stress))

    def __repr__(self):
        return (f"Minimum(converged={self.converged}, energy={self.energy:.6g}, max_force={self.max_force:.3g}, "
                f"iterations={self.iterations})")


class Moduli:
    """Result of Simulation.moduli(), in units of force over length^(D-1).

    bulk: -V dp/dV. shear: mean over all directions of shear. shear_xy: against simple shear, displacements along x that grow
    with y. stiffness: [3, 3] (3D: [6, 6]) change of the stress by strains, in the order xx, yy, xy (xx, yy, zz, yz, xz, xy),
    shear strains counted twice. stress: [D, D], tension positive; pressure: -trace(stress)/D. max_force: largest component of
    a force on a point. rattlers: particles that their contacts cannot hold, which are left out; contacts: number without them.
    """

    def __init__(self, values):
        self.bulk: float = values["bulk"]
        self.shear: float = values["shear"]
        self.shear_xy: float = values["shear_xy"]
        self.stiffness: np.ndarray = values["stiffness"]
        self.stress: np.ndarray = values["stress"]
        self.max_force: float = values["max_force"]
        self.rattlers: np.ndarray = np.array(values["rattlers"], dtype=int)
        self.contacts: int = values["contacts"]

    @property
    def pressure(self) -> float:
        """-trace of the stress over the dimension."""
        return float(-np.trace(self.stress) / len(self.stress))

    def __repr__(self):
        return (f"Moduli(bulk={self.bulk:.6g}, shear={self.shear:.6g}, pressure={self.pressure:.6g}, "
                f"rattlers={len(self.rattlers)})")


class Simulation(_Fixed):
    """Particles in motion, with inertia or without.

    positions: [N, D] centres of disks (D = 2) or spheres (D = 3), with diameters; or polygons: a list of arrays [n, 2] of
    vertices, counter-clockwise, with rest areas a0 and rest edge lengths l0 (by default those that they have) and the
    diameter of vertices, or width of edges, as diameters (by default l0; smooth: 0.1 l0); or, in 3D, surfaces: a list of arrays
    [n, 3] of vertices, with a mesh for all or for each: their faces and their shape at rest, with the rest volumes a0 (by default
    those that they have), rest areas and lengths of shape_parameter (by default those of the mesh), and the
    diameter of vertices, or width of edges and faces, as of polygons; l0 is the mean rest length of edges. mass: of each particle, by default
    density · area (volume), of droplets density · radius³. velocities: as positions. walls: Walls, or a Container; box: Box, or lengths [D]; gravity: [D].

    model: sp (soft), disk (frictional, rotating), rough, smooth or shape (polygons, surfaces), bubble (droplets). integrator: verlet,
    or the name of a type of PETSc TS (rk, cvode, arkimex, alpha2 …) with its options as keywords (ts_rtol=1e-6). Further
    keywords are the parameters of the model and of the integration, listed below.

    Droplets, and other particles with dynamics="overdamped", have no inertia: velocities follow from the balance of forces
    and drag, therefore they cannot be given or written, and the integrator is rk unless another method is named.

    output: folder of a run (run.h5, run.xdmf, summary.json), which Run, pliant-report and ParaView read. frame_interval and
    sample_interval: times between frames and between samples (energies); without them write_frame() and write_sample() write
    them. The first and the last state (of close()) are always written. Particles can then neither be added nor removed.
    checkpoint_interval: wall seconds between checkpoints (300), from which Simulation.restart(folder) continues; save() and
    close() write checkpoints, too.

    Errors: InputError for arguments, also where particles overlap so that a force has no direction; NumericalError in runs,
    after which the simulation keeps the state of the failure.
    """

    #: A function (positions, velocities, t) → forces [points, D] that acts in addition to the model; None: none does.
    force: Callable[[np.ndarray, np.ndarray, float], ArrayLike] | None = None
    _free = ("force",)

    def _cure_of_copies(self):
        return "save() and Simulation.restart(folder) continue a simulation elsewhere, and particles() is a copy of its state"

    def _cure_of(self, name):
        if name in inspect.signature(Simulation).parameters:
            return f"for another {name} make another Simulation"
        return f"parameters of the model change by sim.set({name}=…)"

    @_as_keywords
    def __init__(self, positions: ArrayLike | None = None, diameters: ArrayLike | None = None, *,
                 polygons: Iterable[ArrayLike] | None = None, surfaces: Iterable[ArrayLike] | None = None,
                 mesh: Mesh | Sequence[Mesh] | None = None, shape_parameter: float = 0.0, a0: ArrayLike | None = None,
                 l0: ArrayLike | None = None, velocities: ArrayLike | None = None, mass: ArrayLike | None = None,
                 density: float = 1.0, walls: Walls | Container | None = None, box: Box | Sequence[float] | None = None,
                 gravity: Sequence[float] | None = None, model: str | None = None, integrator: str | None = None,
                 output: str | os.PathLike | None = None, frame_interval: float | None = None,
                 sample_interval: float | None = None, checkpoint_interval: float | None = None, **options: Any):
        self._model = model if model is not None else "sp" if positions is not None else "rough"
        if integrator is None:
            integrator = "rk" if self._model == "bubble" or options.get("dynamics") == "overdamped" else "verlet"
        self._options: dict[str, Any] = {"model": self._model, **_integrator(integrator), **options}
        self._callbacks: list[tuple[Callable[[Simulation], Any], float | None]] = []
        self.force = None
        if positions is not None:
            try:
                self._dim = int(np.asarray(positions).shape[1])
            except (IndexError, ValueError):
                raise InputError("positions has not the shape [N, 2] or [N, 3]") from None
        else:
            self._dim = 2 if surfaces is None else 3
        particles = self._particles(positions, diameters, polygons, surfaces, mesh, shape_parameter, a0, l0, velocities, mass,
                                    density)
        if isinstance(walls, Container):
            container, walls = walls, Walls(self._dim)
            walls.container(container)
        walls = Walls(self._dim) if walls is None else walls
        if not isinstance(walls, Walls):
            raise InputError(f"walls: {walls!r} is neither Walls nor a Container")
        if box is not None and not isinstance(box, Box):
            box = Box(box)
        weight = [0.0] * self._dim if gravity is None else _vector(gravity, "gravity")
        self._core = core.Simulation(self._dim, particles, walls._core, box.origin if box else [],
                                     box.lengths if box else [], weight, arguments(self._options))
        if velocities is not None and not self._inertial:
            self._core.close()
            raise InputError("velocities of particles without inertia follow from the forces; leave velocities out")
        if output is not None:
            self._core.open_output(_absolute(output), _intervals(frame_interval, sample_interval, checkpoint_interval))
        elif (frame_interval, sample_interval, checkpoint_interval) != (None, None, None):
            self._core.close()
            raise InputError("frame_interval, sample_interval and checkpoint_interval need output, the folder of the run; "
                             "give it, too")

    @classmethod
    def restart(cls, folder: str | os.PathLike, *, frame_interval: float | None = None,
                sample_interval: float | None = None, checkpoint_interval: float | None = None) -> Simulation:
        """The simulation of the folder `output` as it was at its last checkpoint; it continues in this folder.

        The checkpoint has particles, contact histories, walls with their motions, parameters (also those of set()), and the
        state of the integrator; with velocity Verlet the motion is the same, bit for bit, as without the restart. Callbacks
        and the force function belong to the program: give them again. Frames and samples after the checkpoint are dropped.
        Intervals may be given anew. Errors: InputError if the folder has no checkpoint of a Simulation, FolderInUseError.
        """
        self = cls.__new__(cls)
        self._core = core.restart_simulation(_absolute(folder),
                                             _intervals(frame_interval, sample_interval, checkpoint_interval))
        description = json.loads(self._core.description())
        self._dim = description["dim"]
        self._options = _options_of(description["arguments"])
        self._model = self._options["model"]
        self._callbacks = []
        self.force = None
        return self

    def __repr__(self):
        if self.closed:
            return "<Simulation, closed>"
        return f"<Simulation of {len(self)} particles ({self._model}, {self._dim}D) at t = {self.t:g}>"

    def __len__(self):
        """Number of particles."""
        return len(self.ids)

    def __enter__(self):
        return self

    def __exit__(self, kind, error, _):
        if error is not None and not (isinstance(error, SystemExit) and not error.code):
            self._interrupted(error)
        self.close()

    def _interrupted(self, error):
        """summary.json names the exception."""
        if not self.closed:
            text = " ".join(str(error).split())
            self._core.interrupt(f"{type(error).__name__}: {text}" if text else type(error).__name__)

    def _particles(self, positions, diameters, polygons, surfaces, mesh, shape_parameter, a0, l0, velocities, mass, density):
        if sum(given is not None for given in (positions, polygons, surfaces)) != 1:
            raise InputError("give positions and diameters, polygons, or surfaces and a mesh")
        meshes = []
        if surfaces is None and (mesh is not None or shape_parameter != 0):
            raise InputError("mesh and shape_parameter belong to surfaces; leave them out, or give surfaces")
        if surfaces is not None:
            if l0 is not None:
                raise InputError("l0 follows from the mesh of surfaces; leave it out, and scale by a0 or shape_parameter")
            vertices = [_array(surface, f"surfaces[{k}]", 3) for k, surface in enumerate(surfaces)]
            if not vertices:
                raise InputError("there are no surfaces; give at least one")
            shapes = list(mesh) if isinstance(mesh, (list, tuple)) else [mesh] * len(vertices)
            if len(shapes) != len(vertices) or None in shapes:
                raise InputError(f"surfaces need a mesh, or one for each of the {len(vertices)}, with their faces")
            meshes = [_mesh_of(shape) for shape in shapes]
            for k, (surface, shape) in enumerate(zip(vertices, shapes)):
                if len(surface) != len(shape.vertices):
                    raise InputError(f"surfaces[{k}] has {len(surface)} vertices, but its mesh has {len(shape.vertices)}; give the mesh "
                                     "with the faces of this surface")
            x = np.concatenate(vertices)
            count = np.array([len(surface) for surface in vertices], dtype=np.int32)
            if a0 is None:
                a0 = [_volume(surface, shape.faces) for surface, shape in zip(vertices, shapes)]
                for k, volume in enumerate(a0):
                    if not volume > 0:
                        raise InputError(f"surfaces[{k}] has the signed volume {volume:g}; give its vertices in the order of the mesh, "
                                         "not inverted")
            a0 = _each(a0, "a0", len(count))
            shape_parameter = _number(shape_parameter, "shape_parameter")
            relative = {shape: shape.relative_rest_length(shape_parameter) for shape in set(meshes)}
            l0 = np.cbrt(a0) * [relative[shape] for shape in meshes]
            if diameters is None:
                diameters = 0.1 * l0 if self._model == "smooth" else l0
            width = _each(diameters, "diameters", len(count))
        elif polygons is None:
            if a0 is not None or l0 is not None:
                raise InputError("a0 and l0 belong to polygons; leave them out, or give polygons")
            if diameters is None:
                raise InputError("diameters are missing; give a number, or one for each particle")
            x = _array(positions, "positions", self._dim)
            count = np.ones(len(x), dtype=np.int32)
            width = _each(diameters, "diameters", len(x))
            a0 = np.pi * width**2 / 4 if self._dim == 2 else np.pi * width**3 / 6
            l0 = np.zeros(len(x))
        else:
            outlines = [_array(polygon, f"polygons[{k}]", 2) for k, polygon in enumerate(polygons)]
            if not outlines:
                raise InputError("there are no polygons; give at least one")
            x = np.concatenate(outlines)
            count = np.array([len(outline) for outline in outlines], dtype=np.int32)
            edges = [np.roll(outline, -1, axis=0) - outline for outline in outlines]
            if a0 is None:
                a0 = [_area(outline) for outline in outlines]
            if l0 is None:
                l0 = [np.linalg.norm(edge, axis=1).mean() for edge in edges]
            a0, l0 = _each(a0, "a0", len(count)), _each(l0, "l0", len(count))
            if diameters is None:
                diameters = 0.1 * l0 if self._model == "smooth" else l0
            width = _each(diameters, "diameters", len(count))
        v = np.zeros_like(x) if velocities is None else _array(velocities, "velocities", self._dim)
        if v.shape != x.shape:
            raise InputError(f"velocities has the shape {v.shape}; give one for each point, {x.shape}")
        if mass is None:
            if not 0 < _number(density, "density") < np.inf:
                raise InputError(f"density is {density}, but must be positive and finite")
            mass = density * ((width / 2)**3 if self._model == "bubble" else np.asarray(a0))
        return core.ParticleArrays(count, x, v, _each(mass, "mass", len(count)), width, a0, l0, meshes, float(shape_parameter))

    # --- Motion

    @_as_keywords
    def run(self, t: float | None = None, callback: Callable[[Simulation], Any] | None = None, every: float | None = None,
            until: float | None = None) -> None:
        """Runs for the time t, or until a time; with verlet, for the nearest number of steps.

        callback(self) is called after every accepted step, or once per interval `every`, at the first step that ends at or
        after each multiple of it. It may change the arrays, call set, move_wall, add, remove and stop, and read everything.
        Its exceptions end the run and arrive here; so does KeyboardInterrupt. The state is then that of the last step.
        """
        if (t is None) == (until is None):
            raise InputError("give run() either the time t that it lasts, or until, the time of its end")
        if until is not None and not np.isfinite(_number(until, "until")):
            raise InputError(f"run(until={until:g}): the time must be finite; give one after t = {self.t:g}")
        if until is not None and until <= self.t:
            raise InputError(f"run(until={until:g}): the simulation is at t = {self.t:g} already; give a later time")
        self._run(_number(t, "t") if until is None else until - self.t, -1, callback, every)

    @_as_keywords
    def step(self, n: int = 1, callback: Callable[[Simulation], Any] | None = None) -> None:
        """Takes n steps."""
        self._run(None, _integer(n, "n", 2**63 - 1), callback, None)

    def _run(self, t, n, callback, every):
        calls = list(self._callbacks)
        if callback is not None:
            calls.append((callback, every))
        elif every is not None:
            raise InputError("every is the interval of a callback, which is missing")
        for function, interval in calls:
            if not callable(function):
                raise InputError(f"callback: {function!r} cannot be called")
            if interval is not None:
                _number(interval, "every")
        if self.force is not None and not callable(self.force):
            raise InputError(f"force: {self.force!r} cannot be called")
        try:
            core.run(self._core, t, n, [(functools.partial(function, self), interval) for function, interval in calls], self.force)
        except BaseException as error:
            self._interrupted(error)
            raise
        self._core.interrupt("")
        if warning := self._core.take_warning():
            warnings.warn(_keywords(warning), PliantWarning, stacklevel=4)

    def every(self, interval: float | None = None) -> Callable[[Callable], Callable]:
        """Decorator: the function is called in all runs from now on, once per interval, or after every step."""
        if interval is not None:
            _number(interval, "interval")

        def add(function):
            self._callbacks.append((function, interval))
            return function
        return add

    def forget(self, function: Callable) -> None:
        """Ends the calls of every()."""
        self._callbacks = [entry for entry in self._callbacks if entry[0] is not function]

    def stop(self) -> None:
        """For callbacks: the run ends after this step."""
        self._core.stop()

    @_as_keywords
    def minimize(self, force_tolerance: float = 1e-8, max_iterations: int = 100000, pressure: float | None = None,
                 must_converge: bool = True) -> Minimum:
        """Moves the particles to a minimum of the energy, at rest, until no component of a force is larger than
        force_tolerance: by FIRE; polygons in a periodic box near the minimum by L-BFGS. Drag and friction, which have no energy,
        are left out. Refuses a force function, which has no energy, either.

        pressure: the box, which must be periodic in all directions and without walls, grows or shrinks without change of shape
        until its pressure has this value; `box` is then the new one. Errors: InputError; NumericalError where the box grows
        without end, outlines cross or a particle ends within a wall. Both leave the simulation as it was. Also
        NumericalError if max_iterations do not suffice, unless must_converge is False: then the result has
        `converged` = False. In both cases the simulation has the positions and the box of the last iteration."""
        if self.force is not None:
            raise InputError("minimize() with a force function, which has no energy; set force = None, or "
                             "run() with drag (zeta) until the particles rest")
        minimum = Minimum(self._core.minimize(_number(force_tolerance, "force_tolerance"),
                                              _integer(max_iterations, "max_iterations", 2**63 - 1), _optional(pressure, "pressure")))
        if must_converge and not minimum.converged:
            raise NumericalError(f"minimize() has not converged: {minimum.reason}, above force_tolerance {force_tolerance:g}; call it "
                                 "again to continue, raise max_iterations or force_tolerance, or accept it with must_converge=False")
        return minimum

    def moduli(self, contact_threshold: float = 1e-5) -> Moduli:
        """Elastic moduli of the packing at rest, as pliant.pack(moduli=True) measures them: of all particles but the rattlers,
        from the Hessian and the pre-stress. Nothing changes. Contacts whose force is below contact_threshold times the typical
        force, sum(f^2)/sum(f), do not count.

        Errors: InputError for a box that is not periodic in all directions, walls, a force function, a model with rotation, and
        a packing that is not at equilibrium: call minimize() with a force_tolerance of 1e-9 of a contact force, or less.
        NumericalError for a packing without stiffness, or that is unstable."""
        if self.force is not None:
            raise InputError("moduli() with a force function, which has no second derivatives; set force = None")
        return Moduli(self._core.moduli(_number(contact_threshold, "contact_threshold")))

    # --- Changes

    @_as_keywords
    def set(self, **changes: Any) -> None:
        """Changes parameters of the model, or dt: sim.set(e_sp=200). A step that was chosen automatically follows."""
        if "model" in changes or "integrator" in changes:
            raise InputError("model and integrator are fixed; make another Simulation")
        options = {**self._options, **changes}
        self._core.configure(arguments(options))
        self._options = options

    @property
    def options(self) -> Mapping[str, Any]:
        """The options as they were given, also by set(); read-only."""
        return types.MappingProxyType(dict(self._options))

    def add(self, positions: ArrayLike | None = None, diameters: ArrayLike | None = None, *,
            polygons: Iterable[ArrayLike] | None = None, surfaces: Iterable[ArrayLike] | None = None,
            mesh: Mesh | Sequence[Mesh] | None = None, shape_parameter: float = 0.0, a0: ArrayLike | None = None,
            l0: ArrayLike | None = None, velocities: ArrayLike | None = None, mass: ArrayLike | None = None,
            density: float = 1.0) -> None:
        """Adds particles, with the arguments of Simulation; in a callback, after it has returned. Then all arrays are
        new: arrays that Python holds keep the old state."""
        if velocities is not None and not self._inertial:
            raise InputError("velocities of particles without inertia follow from the forces; leave velocities out")
        self._core.add(self._particles(positions, diameters, polygons, surfaces, mesh, shape_parameter, a0, l0, velocities, mass,
                                       density))

    def remove(self, ids: ArrayLike) -> None:
        """Removes particles, given by their ids; otherwise as add()."""
        try:
            numbers_ = np.atleast_1d(np.asarray(ids))
            if numbers_.size and numbers_.dtype.kind not in "iu":
                raise ValueError(f"{ids!r} are no integers")
            self._core.remove([int(k) for k in numbers_.ravel()])
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"ids: {error}") from None

    def move_wall(self, body: int, **motion: Any) -> None:
        """From now on a body of the walls moves so, as of Walls; without arguments it stands still."""
        self._core.move_wall(_integer(body, "body"), _motion(motion))

    # --- Output

    @property
    def output(self) -> str | None:
        """The folder of the run."""
        return self._core.output

    def save(self) -> None:
        """Writes a checkpoint of the present state, from which restart() continues; in a callback, after the step."""
        self._core.save()

    @property
    def called_functions(self) -> bool:
        """Whether the run has called callbacks or a force function, also before a restart; then `python3 -m pliant` refuses to
        continue it. True after a restart from a checkpoint of a version before 2026-11-28."""
        return self._core.called_functions

    def write_frame(self) -> None:
        """Writes a frame of the present state to run.h5; also in callbacks."""
        self._core.write_frame()

    def write_sample(self) -> None:
        """Adds a row with the present energies to the series in run.h5; also in callbacks."""
        self._core.write_sample()

    def close(self) -> None:
        """Writes a checkpoint, the last frame and summary.json if there is an output folder, and frees the engine's memory;
        arrays that Python holds stay. Later uses raise UsageError."""
        self._core.close()

    @property
    def closed(self) -> bool:
        return self._core.closed

    # --- State

    @property
    def dim(self) -> int:
        return self._dim

    @property
    def box(self) -> Box | None:
        """The present periodic box; None without one."""
        box = self._core.box()
        return None if box is None else Box(box[1], box[0])

    @property
    def t(self) -> float:
        """Time."""
        return self._core.t

    @property
    def steps(self) -> int:
        """Accepted steps."""
        return self._core.steps

    @property
    def dt(self) -> float:
        """Length of the next step."""
        return self._core.dt

    @property
    def counters(self) -> dict[str, Any]:
        """integrator, dt_critical, force_evaluations, list_rebuilds, skin."""
        return self._core.counters()

    def _get(self, name):
        return self._core.array(name).view()  # a view cannot be resized

    def _set(self, name, values):
        array = self._core.array(name)
        numbers_ = _real(values, name)
        try:
            array[...] = numbers_
        except ValueError as error:
            raise InputError(f"{name}: {error}") from None

    @property
    def positions(self) -> np.ndarray:
        """[points, D] of centres, or vertices. The array shows the present state after each run and in callbacks; numbers
        written to it become the state. The array keeps its address until particles are added or removed."""
        return self._get("positions")

    @positions.setter
    def positions(self, values: ArrayLike) -> None:
        self._set("positions", values)

    @property
    def velocities(self) -> np.ndarray:
        """[points, D], as positions. Without inertia: of the present forces, including the force function during a run; the
        array is read-only."""
        view = self._get("velocities")
        if not self._inertial:
            view.flags.writeable = False
        return view

    @velocities.setter
    def velocities(self, values: ArrayLike) -> None:
        if not self._inertial:
            raise InputError("velocities of particles without inertia follow from the forces; change positions or walls")
        self._set("velocities", values)

    @property
    def angles(self) -> np.ndarray:
        """[N, 1], in 3D [N, 3], of particles that rotate, as positions."""
        return self._get("angles")

    @angles.setter
    def angles(self, values: ArrayLike) -> None:
        self._set("angles", values)

    @property
    def spins(self) -> np.ndarray:
        """[N, 1], in 3D [N, 3], of particles that rotate, as positions."""
        return self._get("spins")

    @spins.setter
    def spins(self, values: ArrayLike) -> None:
        self._set("spins", values)

    @property
    def ids(self) -> np.ndarray:
        """[N] numbers of the particles, which stay theirs when others are removed."""
        return _read_only(self._core.topology()["ids"])

    @property
    def offsets(self) -> np.ndarray:
        """[N + 1] points of particle k are offsets[k] … offsets[k + 1] - 1."""
        return _read_only(self._core.topology()["offset"])

    @property
    def diameters(self) -> np.ndarray:
        """[N] contact diameters of the points; a copy, read-only."""
        return _read_only(self._core.topology()["diameter"])

    @property
    def masses(self) -> np.ndarray:
        """[N] masses of the particles; a copy, read-only."""
        return _read_only(self._core.topology()["mass"])

    @property
    def centres(self) -> np.ndarray:
        """[N, D] means of the points; a copy, read-only: write to positions."""
        return _read_only(self._mean(self.positions))

    @property
    def centre_velocities(self) -> np.ndarray:
        """[N, D] means of the points; a copy, read-only: write to velocities."""
        return _read_only(self._mean(self.velocities))

    def _mean(self, values):
        offsets = self.offsets
        return np.add.reduceat(values, offsets[:-1], axis=0) / np.diff(offsets)[:, None]

    @property
    def polygons(self) -> list[np.ndarray]:
        """Views of the vertices [n, 2] of each particle, in positions."""
        return np.split(self.positions, self.offsets[1:-1])

    @property
    def surfaces(self) -> list[np.ndarray]:
        """Views of the vertices [n, 3] of each particle in 3D, in positions."""
        return np.split(self.positions, self.offsets[1:-1])

    @property
    def faces(self) -> np.ndarray:
        """[F, 3] rows of positions at the corners of all faces of surfaces, counter-clockwise from outside; a copy, read-only.
        Errors: UsageError for other particles."""
        topology = self._core.topology()
        if "faces" not in topology:
            raise UsageError("these particles have no faces; closed surfaces have")
        return _read_only(topology["faces"])

    @property
    def volumes(self) -> np.ndarray:
        """[N] signed volumes inside surfaces; a copy, read-only. Errors: UsageError for other particles."""
        faces = self.faces
        x = self.positions - self.centres[np.searchsorted(self.offsets, np.arange(len(self.positions)), side="right") - 1]
        owner = np.searchsorted(self.offsets, faces[:, 0], side="right") - 1
        return _read_only(np.bincount(owner, _sixfold(x[faces]), len(self)) / 6)

    @property
    def images(self) -> np.ndarray:
        """[N, D] by how many lengths of the periodic box each particle was wrapped into it; a copy, read-only."""
        return _read_only(self._core.images())

    # --- Forces and energies of the present state

    @property
    def energies(self) -> dict[str, float]:
        """Energy of each term of the model, and "kinetic" with inertia. Gravity counts from the origin. "disk_contact",
        "disk_wall_contact", "sphere_contact" and "sphere_wall_contact" are the energies of the tangential springs."""
        return self._core.energies()

    @property
    def work(self) -> float:
        """Work on the particles since the start: of moving walls, of the force function, and of all changes from outside, which
        are written arrays, changed parameters, particles added or removed, and minimize(). The energies have changed by
        work - dissipated."""
        return self._core.work_and_heat()[0]

    @property
    def dissipated(self) -> float:
        """Energy that drag, friction and damping have dissipated since the start."""
        return self._core.work_and_heat()[1]

    @property
    def _inertial(self):
        return self._core.inertial

    @property
    def forces(self) -> np.ndarray:
        """[points, D] total forces of the model; without inertia the forces that drag and friction balance. A copy,
        read-only: sim.force adds forces."""
        return _read_only(self._core.forces()["total"])

    @property
    def term_forces(self) -> dict[str, np.ndarray]:
        """[points, D] forces of each term."""
        forces = self._core.forces()
        forces.pop("total")
        return forces

    @property
    def contacts(self) -> pd.DataFrame:
        """One row per contact, with the columns of Frame.contacts: particle_1 and particle_2 are rows of arrays."""
        tables = []
        for kind, columns in self._core.contacts().items():
            first, other = columns["particles"].T
            none = np.full(len(first), -1, dtype=np.int32)
            second, wall = (other, none) if kind == "particles" else (none, other)
            tables.append(contact_table(first, second, wall, columns["position"], columns["normal"],
                                        columns["overlap"][:, 0], columns["force"], columns["friction"]))
        return pd.concat(tables, ignore_index=True)

    def particles(self) -> Particles:
        """Centres, velocities, sizes and contacts now, as pliant.analysis takes them; its functions also take the simulation
        itself: pliant.analysis.mean_stress(sim)."""
        from .analysis.particles import Particles, with_contacts
        topology = self._core.topology()
        areas, box = topology["a0"], self.box
        deformable = np.any(np.diff(self.offsets) > 1)
        if deformable:
            areas = self.volumes if self._dim == 3 else [_area(polygon) for polygon in self.polygons]
        particles = Particles(self.centres, radii=topology["sigma"] / 2, velocities=self.centre_velocities, masses=self.masses,
                              volumes=areas, box=None if box is None else np.array([box.origin, box.lengths]), ids=self.ids,
                              time=self.t)
        return with_contacts(particles, self.contacts, (self.positions, self.offsets) if deformable else None)

    def draw(self, color: str = "speed", axes: Any = None) -> Any:
        """Draws particles and walls now, as Run.draw draws a frame: coloured by speed, contacts, size, area or shape, on
        `axes`, by default of a new figure of matplotlib. Returns the axes. Errors: RunError."""
        from .plotting import draw_frame
        from .simulation_view import SimulationFrame, SimulationRun
        box = self.box
        run = SimulationRun(self, self._model, self._core.topology(), self._core.walls(),
                            box and np.array([box.origin, box.lengths]))
        return draw_frame(run, SimulationFrame(self, run), color, axes)

    @property
    def wall_forces(self) -> np.ndarray:
        """[walls, D] forces of the particles on each segment and half-space of the walls."""
        return _read_only(self._core.wall_forces())

    @property
    def wall_segments(self) -> np.ndarray:
        """[S, 4] x1 y1 x2 y2 of the segments of the walls now; disks have their centre twice, and wall_radius."""
        return _read_only(np.array(self._core.walls()["segments"], dtype=float).reshape(-1, 4))

    @property
    def wall_radius(self) -> np.ndarray:
        """[S] radius of disks; 0 for segments."""
        return _read_only(np.array(self._core.walls()["radius"], dtype=float))

    def hessian(self, petsc: bool = False) -> Any:
        """Second derivatives of the potential energy, scipy.sparse.csr_matrix [points · D, points · D]; petsc: a Mat of petsc4py
        instead. Errors: InputError for models with rotation."""
        from scipy.sparse import coo_matrix
        rows, columns, values, size = self._core.hessian()
        matrix = coo_matrix((values, (rows, columns)), shape=(size, size)).tocsr()
        if not petsc:
            return matrix
        from petsc4py import PETSc
        return PETSc.Mat().createAIJ(matrix.shape, csr=(matrix.indptr, matrix.indices, matrix.data), comm=PETSc.COMM_SELF)


def _integrator(name):
    if not isinstance(name, str):
        raise InputError(f"integrator: {name!r} is not a name; give verlet, or a type of PETSc TS")
    return {"integrator": "verlet"} if name == "verlet" else {"integrator": "ts", "ts_type": name}


def _document():
    table = [entry for entry in core.simulation_options() if entry["name"] not in ("model", "integrator")]
    lines = option_lines(table, "    ")
    Simulation.__doc__ = (Simulation.__doc__ or "").rstrip() + "\n" + "\n".join(lines) + "\n"


_document()


def block_average(series: ArrayLike) -> dict[str, float]:
    """Mean and standard error of a correlated series, by blocks, as the program finds them. NaN where there is no error."""
    return core.block_average(_array(series, "series"))


def flow_rate(time: ArrayLike, crossed: ArrayLike) -> tuple[float, float]:
    """Flow rate and its standard error from a cumulative quantity at times, as the program finds Q in the steady state.

    All samples count: leave out the start-up. A PliantWarning says so where the rate changes significantly, or where fewer
    than 51 samples cannot show whether it does."""
    rate = core.flow_rate(_array(time, "time"), _array(crossed, "crossed"))
    if rate["change"]:
        warnings.warn(f"flow_rate(): not known to be the rate of a steady state: {rate['change']}", PliantWarning, stacklevel=2)
    return rate["value"], rate["error"]


def start_up(series: ArrayLike) -> int:
    """Number of samples at the front that belong to the start-up (MSER-5)."""
    return core.start_up(_array(series, "series"))


__all__ = ["Box", "Container", "Mesh", "Minimum", "Moduli", "Simulation", "Walls", "block_average", "diameters", "flow_rate",
           "regular_polygons", "start_up"]
