"""Particles and contacts of one moment, as all functions of `pliant.analysis` take them.

Lengths are in the unit of the run (sigma_avg, or <R> for droplets), the others follow from it (docs/reference/file-format.md).
"""

import warnings
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..errors import PliantWarning
from ..run import Frame, lattice, nearest_image


def box_of(box, dim):
    """[2, D] origin and lengths, infinite in open directions, of a box given like this or by its lengths [D]; None stays."""
    if box is None:
        return None
    box = np.asarray(box, float)
    if box.shape == (dim,):
        box = np.stack([np.zeros(dim), box])
    if box.shape != (2, dim) or not (box[1] > 0).all():
        raise ValueError(f"box is {box.tolist()}; give the {dim} positive lengths of the periodic box, inf in open "
                         "directions, or [origin, lengths]")
    return box


def _tilt_of(tilt, box, dim):
    """[D(D - 1)/2] tilt factors; None for an upright box."""
    if tilt is None:
        return None
    tilt = np.atleast_1d(np.asarray(tilt, float))
    if tilt.shape != (dim * (dim - 1) // 2,) or not np.isfinite(tilt).all():
        raise ValueError(f"tilt is {tilt.tolist()}; give the tilt factors of the box, in {dim}D {dim * (dim - 1) // 2}")
    if not tilt.any():
        return None
    if box is None or not np.isfinite(box[1]).all():
        raise ValueError(f"tilt is {tilt.tolist()}, but the box is not periodic in all directions; give box=")
    return tilt


def _array(name, values, shape, dtype=float, finite=True):
    """The values as an array of this shape, in which None is any length."""
    values = np.asarray(values, dtype)
    if values.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, values.shape)):
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise ValueError(f"{name} has the shape {list(values.shape)}; give an array [{wanted}]")
    if finite and values.dtype.kind == "f" and not np.isfinite(values).all():
        row = int(np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(1))[0])
        raise ValueError(f"{name} of row {row} is {values[row]}; leave out rows without numbers")
    return values


@dataclass(frozen=True)
class Particles:
    """Centres of N particles in D dimensions, and their optional properties: an analysis that needs a missing one raises
    ValueError. `Particles.of(frame)` takes them from a run."""

    positions: np.ndarray            #: [N, D] centres
    radii: np.ndarray | None = None  #: [N]; a number gives all the same
    box: np.ndarray | None = None    #: [2, D] origin and lengths of a periodic box, or its lengths [D]; inf where open
    tilt: np.ndarray | None = None   #: [D(D - 1)/2] tilt factors of a periodic box, xy; 3D: xy, xz, yz; default: upright
    velocities: np.ndarray | None = None  #: [N, D]
    masses: np.ndarray | None = None      #: [N]
    volumes: np.ndarray | None = None     #: [N] areas (3D: volumes); default: disks or spheres
    active: np.ndarray | None = None      #: [N] bool; False: absent, left out everywhere; default: all present
    pairs: np.ndarray | None = None   #: [C, 2] particles of each contact; the second is -1 for a wall
    forces: np.ndarray | None = None  #: [C, D] force on the first particle
    points: np.ndarray | None = None  #: [C, D] contact points; default (pairs): on the line of centres, by radii
    walls: np.ndarray | None = None   #: [C] number of the wall, -1 for pairs
    ids: np.ndarray | None = None     #: [N] numbers of the particles, by which two moments are compared; default: their rows
    time: float = np.nan
    reinsertions: np.ndarray | None = None  #: [N] how often each particle was reinserted: a displacement across one is NaN
    shear_rate: float | None = None  #: rate of steady shear: the flow is shear_rate · (y - y of the box's origin) along x
    arms: np.ndarray | None = None    #: [C, 2, D] about the vectors from the contact point to both centres, in small periodic boxes

    def __post_init__(self):
        positions = np.asarray(self.positions, float)
        if positions.ndim != 2 or positions.shape[1] not in (2, 3):
            raise ValueError(f"positions has the shape {list(positions.shape)}; give an array [N, 2] or [N, 3]")
        count, dim = positions.shape
        active = np.ones(count, bool) if self.active is None else _array("active", self.active, (count,), bool)
        if not np.isfinite(positions[active]).all():
            row = int(np.flatnonzero(active & ~np.isfinite(positions).all(1))[0])
            raise ValueError(f"particle {row} is at {positions[row]}; set active[{row}] = False for absent particles")
        box = box_of(self.box, dim)
        given = {"positions": positions, "active": active, "box": box, "tilt": _tilt_of(self.tilt, box, dim)}
        if self.shear_rate is not None and (not np.isfinite(self.shear_rate) or (self.shear_rate and box is None)):
            raise ValueError(f"shear_rate is {self.shear_rate:g}; give the finite rate of a periodic box, and box=")
        radii = np.full(count, self.radii, float) if np.ndim(self.radii) == 0 and self.radii is not None else self.radii
        shapes = {"radii": (radii, (count,)), "velocities": (self.velocities, (count, dim)),
                  "masses": (self.masses, (count,)), "volumes": (self.volumes, (count,)),
                  "forces": (self.forces, (None, dim)), "points": (self.points, (None, dim)),
                  "arms": (self.arms, (None, 2, dim))}
        of_contacts = ("forces", "points", "arms")
        given |= {name: _array(name, values, shape, finite=name in of_contacts)
                  for name, (values, shape) in shapes.items() if values is not None}
        for name in ("radii", "masses", "volumes"):
            wrong = active & ~(given[name] > 0) if name in given else np.zeros(count, bool)
            if wrong.any():
                row = int(np.argmax(wrong))
                raise ValueError(f"{name} of particle {row} is {given[name][row]:g}; it must be positive")
        if self.pairs is not None:
            pairs = _array("pairs", np.asarray(self.pairs, np.int64).reshape(-1, 2), (None, 2), np.int64)
            low, high = (pairs.min(0), pairs.max()) if len(pairs) else ((0, 0), -1)
            if low[0] < 0 or low[1] < -1 or high >= count:
                raise ValueError(f"pairs has particles from {int(min(low))} to {high}; number them from 0 to {count - 1}, "
                                 "and write -1 for a wall in the second column")
            given["pairs"] = pairs
            for name in of_contacts:
                if name in given and len(given[name]) != len(pairs):
                    raise ValueError(f"{name} has {len(given[name])} rows and pairs {len(pairs)}; give one row per contact")
            if self.walls is not None:
                given["walls"] = _array("walls", self.walls, (len(pairs),), np.int64)
        if self.ids is not None:
            given["ids"] = _array("ids", self.ids, (count,), np.int64)
            found, number = np.unique(given["ids"], return_counts=True)
            if (number > 1).any():
                raise ValueError(f"the id {found[number > 1][0]} occurs {number.max()} times in ids; give each particle its own")
        if self.reinsertions is not None:
            given["reinsertions"] = _array("reinsertions", self.reinsertions, (count,), np.int64)
        for name, values in given.items():  # None: of an open box, or an upright one
            object.__setattr__(self, name, values)

    @classmethod
    def of(cls, source, *needed, **given):
        """Particles of a Frame, a Simulation, an array of positions [N, D], or of Particles, with the properties `given` (box, …).
        `needed` are names of fields that must not be missing: ValueError, for a Frame the RunError of the frame. Properties that
        are None are not given."""
        given = {name: value for name, value in given.items() if value is not None}
        if isinstance(source, Frame):
            particles = _of_frame(source, needed, given)
        elif isinstance(source, cls) or callable(getattr(source, "particles", None)):  # of a Simulation
            source = source if isinstance(source, cls) else source.particles()
            particles = replace(source, **given) if given else source
        else:
            particles = cls(source, **given)
        for name in needed:
            if getattr(particles, name) is None:
                raise ValueError(f"the particles have no {name}; give Particles(positions, {name}=…), or a frame of a run")
        return particles

    @property
    def dim(self):
        return self.positions.shape[1]

    def in_order(self, ids):
        """Positions, reinsertions and box of the particles with these ids [M]; those that are not here are absent."""
        row = {k: i for i, k in enumerate(self.ids)}
        rows = np.array([row.get(k, -1) for k in ids], int)
        there = rows >= 0
        positions = np.full((len(ids), self.dim), np.nan)
        positions[there] = self.positions[rows[there]]
        active = there & np.append(self.active, False)[rows]
        jumps = None if self.reinsertions is None else np.append(self.reinsertions, 0)[rows]
        return Particles(positions, box=self.box, tilt=self.tilt, active=active, ids=ids, time=self.time, reinsertions=jumps)

    @property
    def count(self):
        """N, the absent particles included."""
        return len(self.positions)

    @cached_property
    def bodies(self):
        """[N] volumes (areas in 2D), given or of disks or spheres."""
        if self.volumes is not None:
            return self.volumes
        if self.radii is None:
            raise ValueError("the particles have neither volumes nor radii; give Particles(positions, radii=…)")
        return np.pi * self.radii**2 if self.dim == 2 else 4 / 3 * np.pi * self.radii**3

    @cached_property
    def period(self):
        """[D] lengths of the periodic box, inf in open directions."""
        return np.full(self.dim, np.inf) if self.box is None else self.box[1]

    @cached_property
    def lattice(self):
        """[D, D] edges of the periodic box, one per row; zero in open directions."""
        return lattice(self.period, self.tilt)

    @cached_property
    def half_lattice(self):
        """Half the length of the shortest vector from a place to its image: within this distance a particle has one image."""
        if self.tilt is None:
            return self.period.min() / 2
        # The shortest edge is an upper bound. No shorter vector is longer along any axis.
        longest = np.linalg.norm(self.lattice, axis=1).min()
        most = np.ceil(longest / self.period).astype(int)
        lengths = [longest]
        for n in np.ndindex(*(2 * most[1:] + 1)):
            vector = (np.array(n) - most[1:]) @ self.lattice[1:]
            vector = vector - np.round(vector[0] / self.period[0]) * self.lattice[0]
            if np.linalg.norm(vector) > 1e-12 * longest:
                lengths.append(np.linalg.norm(vector))
        return min(*lengths, self.period[0]) / 2

    def upright(self, analysis):
        """ValueError for a tilted box, of which `analysis` knows no images."""
        if self.tilt is not None:
            raise ValueError(f"{analysis}: the box is tilted by {self.tilt.tolist()}; take a frame of a box without shear")

    def nearest_image(self, difference):
        """The shortest of the periodic images of vectors [..., D]."""
        return nearest_image(difference, self.period, self.tilt)

    def relative(self, first, second):
        """[…, D] nearest image of the vectors from the particles `first` to the particles `second`."""
        return self.nearest_image(self.positions[second] - self.positions[first])

    def fluctuations(self, analysis):
        """[N, D] velocities relative to the flow of steady shear, without shear relative to the velocity of the centre of mass.
        ValueError for a tilted box whose shear rate is unknown, with the name of the `analysis`."""
        if self.tilt is not None and self.shear_rate is None:
            raise ValueError(f"{analysis}: the box is tilted, and the flow in its velocities is unknown; give shear_rate=, 0 for a box that "
                             "does not shear, or use kinetic=False")
        if self.shear_rate:
            return self.velocities - self.shear_rate * (self.positions[:, 1:2] - self.box[0, 1]) * np.eye(self.dim)[0]
        mass = self.masses[self.active]
        return self.velocities - mass @ self.velocities[self.active] / mass.sum()

    @cached_property
    def branches(self):
        """([C, D], [C, D]) vectors from the contact point to the centre of the first particle, and of the second; zero for a
        wall. In a periodic box to the images that touch: the nearest ones of `arms`, by default of the contact point (without
        points, of the other centre). ValueError where several images are as near as a contact can be."""
        first, second = self.pairs.T
        pair = second >= 0
        wall = ~pair[:, None]
        if self.points is None:
            if not pair.all():
                raise ValueError(f"contact {int(np.argmin(pair))} is with a wall and has no place; give points= [C, D]")
            share = 0.5 if self.radii is None else (self.radii[first] / (self.radii[first] + self.radii[second]))[:, None]
            near = 0.0 if self.arms is None else self.arms[:, 0] - self.arms[:, 1]
            if self.arms is None:
                self._check_images(first, second, 0 if self.radii is None else self.radii[first] + self.radii[second], "points")
            between = near + self.nearest_image(self.positions[first] - self.positions[second] - near)
            return between * share, between * (share - 1)
        if self.arms is None and self.radii is not None:
            self._check_images(first, second, np.maximum(self.radii[first], np.where(pair, self.radii[second], 0)), "arms")
        near = np.zeros((2, *self.points.shape)) if self.arms is None else self.arms.swapaxes(0, 1)
        one, other = (arm + self.nearest_image(self.positions[of] - self.points - arm) for arm, of in zip(near, (first, second)))
        return one, np.where(wall, 0.0, other)

    def _check_images(self, first, second, reach, missing):
        """ValueError for contacts that reach farther than half the periodic box, or from a particle to its own image."""
        far = (reach > self.half_lattice) | ((first == second) & (self.points is None))
        if far.any():
            k = int(np.argmax(far))
            raise ValueError(f"particles {first[k]} and {second[k]} touch, and several of their periodic images are near enough (half the "
                             f"shortest lattice vector is {self.half_lattice:g}); give {missing}=, or use a frame or a larger box")

    @cached_property
    def touching(self):
        """([K, 2] touching pairs of particles, [C'] row of each contact in them, [C'] sign, [K, D] vectors from the second to the
        first): each pair once for each image that touches, lower number first, however many points touch. C': contacts without
        walls; the sign is -1 where the second particle of the contact is the first of the pair."""
        inner = self.pairs[:, 1] >= 0
        first, second = self.pairs[inner].T
        if np.isfinite(self.period).any() and len(first):
            one, other = (replace(self, pairs=self.pairs[inner], forces=None, walls=None, **{
                name: None if values is None else values[inner] for name, values in (("points", self.points), ("arms", self.arms))})
                if not inner.all() else self).branches
            apart = one - other - self.positions[first] + self.positions[second]
            edges = self.lattice + np.diag(np.where(np.isfinite(self.period), 0.0, 1.0))
            image = np.round(np.linalg.solve(edges.T, apart.T).T).astype(int)
        else:
            image = np.zeros((len(first), self.dim), int)
        # A contact with its own image is the same one seen from either side.
        leading = np.take_along_axis(image, np.argmax(image != 0, axis=1)[:, None], 1)[:, 0]
        swapped = (first > second) | ((first == second) & (leading < 0))
        sign = np.where(swapped, -1, 1)
        keys = np.c_[np.minimum(first, second), np.maximum(first, second), sign[:, None] * image]
        keys, row = np.unique(keys, axis=0, return_inverse=True)
        pairs = keys[:, :2]
        vectors = self.positions[pairs[:, 0]] - self.positions[pairs[:, 1]] + keys[:, 2:] @ self.lattice
        return pairs, row.ravel(), sign, vectors


def with_contacts(particles, table, outlines=None):
    """The Particles with the contacts of a table with the columns of Frame.contacts. outlines: (points [P, D], offset [N+1]) of
    polygons or surfaces, None for disks and spheres."""
    axes = "xyz"[:particles.dim]
    pairs, points = table[["particle_1", "particle_2"]].to_numpy(), table[list(axes)].to_numpy()
    normal = table[["n" + axis for axis in axes]].to_numpy()
    if outlines is None:
        arms = np.stack([normal * particles.radii[pairs[:, 0], None], -normal * particles.radii[pairs[:, 1], None]], 1)
    else:
        arms = _arms(particles, pairs, points, normal, *outlines)
    return replace(particles, pairs=pairs, walls=table["wall"].to_numpy(), forces=table[["f" + axis for axis in axes]].to_numpy(),
                   points=points, arms=arms)


def _arms(particles, pairs, points, normal, vertices, offset):
    """[C, 2, D] vectors from contacts to the centres, by way of the nearest vertex on this side of the contact; zero where half the
    box is longer than they can be."""
    result = np.zeros((len(pairs), 2, particles.dim))
    if not np.isfinite(particles.half_lattice):
        return result
    outward = vertices - np.repeat(particles.positions, np.diff(offset), axis=0)
    reach = np.sqrt(np.maximum.reduceat((outward**2).sum(1), offset[:-1]))
    for side, (of, sign) in enumerate(zip(pairs.T, (1, -1))):
        # The contact is less than half the reach outside of the vertices: their contact diameter is shorter.
        for k in np.flatnonzero((of >= 0) & (1.5 * reach[of] >= particles.half_lattice)):
            own = slice(offset[of[k]], offset[of[k] + 1])
            apart = particles.nearest_image(vertices[own] - points[k])
            nearest = np.argmin(np.where(sign * (apart @ normal[k]) > 0, (apart**2).sum(1), np.inf))
            result[k, side] = apart[nearest] - outward[own][nearest]
    return result


def _of_frame(frame, needed, given):
    """Particles of a frame: fields that every frame has, and those that are needed."""
    run = frame.run
    topology = run.topology
    deformable = topology.deformable
    values = {"positions": frame.centres, "active": frame.active, "radii": topology.sigma / 2, "masses": topology.mass,
              "volumes": frame.content if deformable and frame.has("area" if run.dim == 2 else "volume") else topology.a0,
              "box": frame.box, "tilt": frame.tilt, "shear_rate": run.options.get("shear_rate") or 0.0,
              "time": frame.time, "reinsertions": frame.reinsertions if frame.has("reinsertions") else None}
    if "velocities" in needed:
        values["velocities"] = frame.particle_velocities
    particles = Particles(**values | given)
    if {"pairs", "forces", "points", "walls"} & set(needed) and "pairs" not in given:
        particles = with_contacts(particles, frame.contacts, (frame.positions, topology.offset) if deformable else None)
        if "forces" in needed and frame.elastic_contacts and (run.model == "disk" or (run.parameters.get("mu") or 0) > 0):
            warnings.warn(f"{run.path}: an older version of the program wrote this frame, at time {frame.time:g}; forces between "
                          "particles are elastic, without friction. Repeat the run to include friction", PliantWarning,
                          stacklevel=3)
    return particles
