"""Simulations of soft and deformable particles: the engine of `pliant` as functions and classes, and a reader of its runs.

>>> import pliant
>>> run = pliant.hopper(n=200, hopper_wall_distance=15, hopper_width=5, t_end=20, output="runs/first")
>>> run.measured("Q"), run.frames[-1].centres.shape, run.series["kinetic_energy"].mean()
>>> pliant.Run("runs/first").summary["Q"]["value"]

Units as in the program: lengths in sigma_avg, times in t0 = sqrt(sigma_avg/g), density 1. The engine is the compiled module
`pliant._core`, which is loaded at its first use; the reader does not need it. `pliant.__version__` is the
version of the engine.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from . import requirements

requirements.check()

from .ensemble_run import Ensemble
from .errors import (FolderInUseError, InputError, NumericalError, OutOfMemoryError, OutputError, PliantError,
                     PliantWarning, RunError, UsageError)
from .run import Frame, Frames, Geometry, Profile, Run, Topology
from .sweep import load_runs, load_table, sweep_table

if TYPE_CHECKING:
    from .scenario_calls import channel, clog, evaluate, hopper, pack, raft, shear, vibrate
    from .simulation import (Box, Container, Mesh, Minimum, Moduli, Simulation, Walls, block_average, diameters, flow_rate,
                             regular_polygons, start_up)
    from .together import advance

#: Name → module that needs the engine.
_ENGINE = {**{name: "scenario_calls" for name in ("channel", "clog", "evaluate", "hopper", "pack", "raft", "shear", "vibrate")},
           **{name: "simulation" for name in ("Box", "Container", "Mesh", "Minimum", "Moduli", "Simulation", "Walls", "block_average",
                                              "diameters", "flow_rate", "regular_polygons", "start_up")},
           "advance": "together"}

__all__ = ["Ensemble", "FolderInUseError", "Frame", "Frames", "Geometry", "InputError", "NumericalError", "OutOfMemoryError",
           "OutputError", "PliantError", "PliantWarning", "Profile", "Run", "RunError", "Topology", "UsageError",
           "load_runs", "load_table", "sweep_table", *_ENGINE]


def __getattr__(name):
    if name == "__version__":
        return import_module(".engine", __name__).core.version
    if name not in _ENGINE:
        raise AttributeError(f"module 'pliant' has no attribute {name!r}")
    value = getattr(import_module(f".{_ENGINE[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted({*globals(), *_ENGINE})
