"""A simulation as drawings see it: a run, and its frame of the present state."""

import functools

import numpy as np

from .run import Geometry, Topology


def _face_offset(topology):
    """[N+1] first face of each particle, if there are faces."""
    if "faces" not in topology:
        return None
    return np.searchsorted(topology["faces"][:, 0], topology["offset"]).astype(np.int32)


class SimulationRun:
    """What drawings read of a Run."""

    scenario = "simulation"
    path = "simulation"
    counts_packings = False

    def __init__(self, sim, model, topology, walls, box):
        self.dim, self.model = sim.dim, model
        self.droplets = model == "bubble"
        self.topology = Topology(topology["offset"], topology["sigma"], topology["a0"], topology["l0"], topology["mass"],
                                 np.repeat(topology["diameter"], np.diff(topology["offset"])), topology.get("faces"),
                                 _face_offset(topology))
        self.geometry = Geometry(np.reshape(walls["drawn"], (-1, 4)), np.array(walls["drawn_radius"], dtype=float), np.nan,
                                 np.nan, np.nan, self.scenario, box)
        self.parameters = sim.options


class SimulationFrame:
    """What drawings read of a Frame."""

    def __init__(self, sim, run):
        self.run, self.time = run, sim.t
        self.centres, self.particle_velocities = sim.centres, sim.centre_velocities
        self.positions = sim.positions.copy()
        self.polygons = np.split(self.positions, run.topology.offset[1:-1])
        self.volume = None if run.topology.faces is None else sim.volumes
        self.active = np.ones(len(sim), dtype=bool)
        self.wall_segments = run.geometry.segments
        self._contacts, self._particles = sim.contacts, sim.particles

    @property
    def contacts(self):
        return self._contacts

    @property
    def speeds(self):
        return np.linalg.norm(self.particle_velocities, axis=1)

    @property
    def touching(self):
        from .analysis import coordination
        return coordination(self._particles(), walls=False)

    @functools.cached_property
    def area(self):
        return np.array([np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2 for x, y in (p.T for p in self.polygons)])

    @functools.cached_property
    def perimeter(self):
        return np.array([np.linalg.norm(np.roll(p, -1, axis=0) - p, axis=1).sum() for p in self.polygons])

    @functools.cached_property
    def surface_area(self):
        corners = self.positions[self.run.topology.faces]
        twice = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        return np.add.reduceat(twice, self.run.topology.face_offset[:-1]) / 2

    @property
    def content(self):
        return self.area if self.run.topology.faces is None else self.volume

    @property
    def shape_parameter(self):
        if self.run.topology.faces is not None:
            return self.surface_area**1.5 / (6 * np.sqrt(np.pi) * self.volume)
        return self.perimeter**2 / (4 * np.pi * self.area)
