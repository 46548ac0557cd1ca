"""Reads the folders that `pliant` writes: frames, contacts, time series, measured quantities.

>>> from pliant import Run
>>> run = Run("runs/hopper")
>>> run.summary["Q"]["value"], run.frames[-1].centres.shape, run.series["kinetic_energy"].mean()

Units as in the program: lengths in sigma_avg, times in t0 = sqrt(sigma_avg/g), density 1.
"""

from . import requirements

requirements.check()

from .errors import OutputError, PliantError, RunError
from .run import Frame, Frames, Geometry, Profile, Run, Topology
from .sweep import load_runs, load_table, sweep_table

__all__ = ["Frame", "Frames", "Geometry", "OutputError", "PliantError", "Profile", "Run", "RunError", "Topology",
           "load_runs", "load_table", "sweep_table"]
