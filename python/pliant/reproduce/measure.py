"""What the figures take from a run: a few numbers, which are kept when the run is gone.

Each function gives a DataFrame of one run. `measured` adds what is known of every run: OF_EVERY_RUN.
"""

import re

import numpy as np
import pandas as pd

from .. import channel, raft, tracks
from ..errors import RunError
from ..flow import axis_velocity
from ..run import Run
from ..sweep import sweep_table

OF_EVERY_RUN = ("row", "seed", "commit", "cpu_seconds")
_FLOW = ["model", "dim", "status", "mu", "zeta", "e_sp", "e_c", "k_l", "k_b", "hopper_angle", "hopper_width",
         "hopper_wall_distance", "t_end"]
_RATES = ["Q", "Q_corrected", "orifice_velocity", "drag_friction_ratio", "c0"]
_CLOG = ["hopper_width", "g", "phi_c", "status", "avalanche_size", "capillary_length"]
_PROFILE = ["mu", "zeta", "e_sp", "hopper_width"]
_CURVE = 300  # samples of a force curve that are kept


def _columns(run, names):
    table = sweep_table([run])
    return {name: table[name][0] if name in table else np.nan for name in names} | {"n": run.topology.particles}


def flows(run):
    """Flow rates and what else summary.json has of a hopper."""
    wanted = [*_FLOW, *(name + end for name in _RATES for end in ("", "_error"))]
    return pd.DataFrame([_columns(run, wanted)])


def profiles(run):
    """Velocity on the axis against the height above the orifice."""
    curve = axis_velocity(run)
    return pd.DataFrame({"height": curve.height, "v": curve.velocity, "v_error": curve.error}).assign(
        **_columns(run, _PROFILE))


def _raft(run):
    options = run.parameters
    return {name: options[name] for name in ("v_wall", "tilt", "small_fraction", "small_radius", "delta")}


def reductions(run):
    """Stiffness and peak of every reduction of rows of a raft."""
    curve = raft.Compression.of(run)
    return curve.reductions().assign(n=curve.n, start_rows=curve.rows, k1=curve.k1, E1=curve.E1, **_raft(run))


def fractures(run):
    """Peaks and competing fractures of a raft."""
    return raft.fractures([run]).assign(**{k: v for k, v in _raft(run).items() if k not in ("delta", "tilt")})


def forces(run):
    """Force curve of a raft, with its stiffness at rest and its highest peak."""
    curve = raft.Compression.of(run)
    every = -(-len(curve.force) // _CURVE)
    slope, error = curve.stiffness_at_zero()
    return pd.DataFrame({"distance": curve.distance[::every], "force": curve.force[::every]}).assign(
        n=curve.n, slope=slope, slope_error=error, F_max=curve.force.max(), **_raft(run))


def clogs(run):
    """How a run of the scenario clog has ended."""
    return pd.DataFrame([_columns(run, _CLOG)])


def _entry(result, name, region):
    """Value and error; NaN for None."""
    return [np.nan if result[name][region][part] is None else float(result[name][region][part]) for part in ("value", "error")]


def _columns_of(result, names, region, end=""):
    """Columns of quantities of the analysis of a channel; D2_min is that per neighbour."""
    found = {}
    for name in names:
        column = name.removesuffix("_per_neighbour") + end
        found[column], found[column + "_error"] = _entry(result, name, region)
    return found


def _channel(run):
    result, = channel.analyse([tracks.load(run.path)])
    return result


def motion(run):
    """Non-affine motion, over an interval and over equal strains, of all cells; rotation in the central square."""
    result = _channel(run)
    names = ("dr_na", "d2_min_per_neighbour")
    return pd.DataFrame([{"polydispersity": result["polydispersity"], "disks": result["disks"]}
                         | _columns_of(result, names, "all") | _columns_of(result["clock"], names, "all", "_clock")
                         | _columns_of(result, ["rotation"], "centre")])


def intervals(run):
    """Non-affine motion in the central square against the interval, and its exponents."""
    result = _channel(run)
    exponents = _columns_of(result, ["exponent_dr_na", "exponent_d2_min"], "centre")
    return pd.DataFrame([{"polydispersity": result["polydispersity"], "relative": round(row["relative"], 6)} | exponents
                         | _columns_of(row, ["dr_na", "d2_min_per_neighbour"], "centre") for row in result["intervals"]])


MEASURES = {f.__name__: f for f in (flows, profiles, reductions, fractures, forces, clogs, motion, intervals)}


def _commit(run):
    found = re.match(r"[0-9a-f]{7,40}(-dirty)?\b", str(run.manifest.get("build", "")))
    return found[0] if found else "unknown"


def measured(measure, row, folder):
    """DataFrame of one finished run. Raises RunError if it cannot be used."""
    with Run(folder) as run:
        try:
            table = MEASURES[measure](run)
        except KeyError as error:
            raise RunError(f"{folder}: has no {error}, which the figure needs") from None
        return table.assign(row=row, seed=int(run.parameters.get("seed", 0)), commit=_commit(run),
                            cpu_seconds=float(run.summary.get("cpu_seconds", np.nan)))
