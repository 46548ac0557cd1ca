"""Configurations with known answers."""

import numpy as np

from pliant.analysis import Particles


def square(side, spacing=1.0, **fields):
    """side² particles of diameter `spacing` on a square lattice in a periodic box."""
    places = spacing * (np.stack(np.meshgrid(*[np.arange(side)] * 2, indexing="ij"), -1).reshape(-1, 2) + 0.25)
    return Particles(places, fields.pop("radii", spacing / 2), box=[side * spacing] * 2, **fields)


def cubic(side, spacing=1.0, **fields):
    places = spacing * (np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3) + 0.25)
    return Particles(places, fields.pop("radii", spacing / 2), box=[side * spacing] * 3, **fields)


def hexagonal(columns, rows, **fields):
    """columns·rows particles of diameter 1 on a hexagonal lattice of distance 1 in a periodic box; rows must be even."""
    place = np.array([(i + row % 2 / 2 + 0.1, (row + 0.2) * np.sqrt(3) / 2) for row in range(rows) for i in range(columns)])
    return Particles(place, 0.5, box=[columns, rows * np.sqrt(3) / 2], **fields)


def random_disks(count, size, seed=1, dim=2, box=True):
    rng = np.random.default_rng(seed)
    return Particles(rng.uniform(0, size, (count, dim)), rng.uniform(0.3, 0.6, count), box=[size] * dim if box else None)
