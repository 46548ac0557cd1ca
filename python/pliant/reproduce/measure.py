"""Results that figures take from a run: a few numbers, stored after the run is deleted.

Each function gives a DataFrame of one run. `measured` adds the columns of every run: OF_EVERY_RUN.
"""

import re

import numpy as np
import pandas as pd

from .. import channel_analysis as channel, channel_figures, raft_analysis as raft, tracks
from ..analyse_command import read_result, result_path, write_result
from ..errors import RunError
from ..flow import axis_velocity
from ..run import Run
from ..sweep import sweep_table
from ..symbols import parameters, reads

OF_EVERY_RUN = ("row", "seed", "commit", "cpu_seconds")
_HOPPER = ["model", "dim", "status", "hopper_angle", "hopper_angle_left", "hopper_width", "hopper_wall_distance", "t_end",
           "count", "reinsertion_gap", *parameters("hopper")]
#: Options in which protocols of soft particles differ, and the deformation of particles.
_READING = ["removal_depth", "reinsertion_lateral_speed", "pack_fraction", "max_overlap", "steady", "steady_start"]
_RATES = ["Q", "Q_corrected", "orifice_velocity", "drag_friction_ratio", "c0"]
_CLOG = ["hopper_width", "g", "phi_c", "status", "avalanche_size", "capillary_length"]
_PROFILE = ["hopper_width", "dim"]
#: Options that set the sizes of disks.
DISTRIBUTION = ("distribution", "radii", "counts")
#: Further options that a table of channel runs may vary.
CHANNEL_OPTIONS = ("area_fraction", *parameters("channel"), "plunger_speed", "retract_speed", "stiffness", "dt")
#: Options of packings that figures distinguish; `fraction`, of the start, is `start_fraction`.
_PACKING = ["model", "dim", "path", "start_pressure", "size_distribution", "n_vertices", "shape_parameter", "k_b"]
#: Results of a packing.
_PACKED = ["pressure", "fraction", "rim_fraction", "contacts", "touching_pairs", "backbone", "coordination", "shear_modulus"]
_FLOWING = ["model", "dim", "shear_rate", "zeta", *(name + end for name in ("flow_stress", "flow_pressure") for end in ("", "_error"))]
_STIFF = 0.2  #: part of the amplitudes at which the exponents of stiff modes are measured
NEIGHBOURS = (11, 15, 20)  #: in D2_min, which [T] tried
_CURVE = 300  # number of samples of a stored force curve


def _columns(run, names):
    table = sweep_table([run])
    return {name: table[name][0] if name in table else np.nan for name in names} | {"n": run.topology.particles}


def flows(run):
    """Flow rates and the other results in summary.json of a hopper."""
    wanted = [*_HOPPER, "edge_width", *(name + end for name in _RATES for end in ("", "_error"))]
    return pd.DataFrame([_columns(run, wanted)])


def readings(run):
    """Flow rates, with the options that distinguish interpretations of [H]; dt is NaN where the program chose it."""
    wanted = [*_HOPPER, *_READING, *(name + end for name in _RATES for end in ("", "_error"))]
    return pd.DataFrame([_columns(run, wanted) | {"dt": run.parameters.get("dt") or np.nan}])


def profiles(run):
    """Velocity on the axis against the height above the orifice."""
    curve = axis_velocity(run)
    return pd.DataFrame({"height": curve.height, "v": curve.velocity, "v_error": curve.error}).assign(
        **_columns(run, [*_PROFILE, *(name for name in parameters("hopper") if reads(run.parameters["model"], name))]))


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
    """Force curve of a raft, with its stiffness at rest, its highest peak and its lowest force."""
    curve = raft.Compression.of(run)
    every = -(-len(curve.force) // _CURVE)
    slope, error = curve.stiffness_at_zero()
    return pd.DataFrame({"distance": curve.distance[::every], "force": curve.force[::every]}).assign(
        n=curve.n, slope=slope, slope_error=error, F_max=curve.force.max(),
        F_min=curve.force.min(), **_raft(run))


def clogs(run):
    """How a run of the scenario clog has ended."""
    return pd.DataFrame([_columns(run, _CLOG)])


def packings(run):
    """Fraction, contacts and shear modulus of each packing."""
    series = run.series[run.series["time"] > 0]
    found = pd.DataFrame({name: series[name] if name in series else np.nan for name in _PACKED})
    return found.assign(start_fraction=run.parameters["fraction"], **_columns(run, _PACKING))


def packing_modes(run):
    """Contacts and modes of each packing. With energies along modes also, of the modes without stiffness and of the stiff ones: their
    median energy against the amplitude, and, in the row without amplitude, the medians of the exponents, of the coefficient of the
    quadratic part and of the crossover, and the share of modes that have an exponent."""
    options, series = run.parameters, run.series
    free = 3 if options["k_b"] > 0 else options["n_vertices"] - 1
    counts = series[["pressure", "backbone", "contacts", "zero_modes"]].assign(
        missing=free * series["backbone"] - 1 - series["contacts"], pre_stress=options["pre_stress"], **_columns(run, _PACKING))
    if "mode_energies" not in run.vector_series:
        return counts[series["time"] > 0]
    along, tables = run.mode_energies, []
    crossover = along.crossover  # NaN of stiff modes
    small = along.amplitude <= _STIFF * along.amplitude[-1]
    exponents = {"no stiffness": along.exponents(along.above_crossover), "stiff": along.exponents(np.broadcast_to(small, along.energy.shape))}
    for packing in np.flatnonzero(series["time"] > 0):
        first = run.dim + int(max(counts["missing"][packing], 0))
        last = int(np.isfinite(along.energy[packing, :, 0]).sum())
        for kind, modes in (("no stiffness", slice(run.dim, first)), ("stiff", slice(first, last))):
            energy = along.energy[packing, modes]
            if not len(energy):
                continue
            own = exponents[kind][packing, modes]
            known = np.isfinite(own)
            whole = {"exponent": np.median(own[known]) if known.any() else np.nan, "with_exponent": known.mean(),
                     "quadratic": np.median(along.quadratic[packing, modes]),
                     "crossover": np.median(crossover[packing, modes])}
            curve = pd.DataFrame({"amplitude": [np.nan, *along.amplitude], "energy": [np.nan, *np.median(energy, 0)]})
            tables.append(curve.assign(kind=kind, **counts.iloc[packing], **{name: [value] + [np.nan] * len(along.amplitude)
                                                                              for name, value in whole.items()}))
    return pd.concat(tables, ignore_index=True)


def shear_flows(run):
    """Stress and pressure of a steady shear flow; NaN if it is not steady."""
    return pd.DataFrame([_columns(run, _FLOWING) | {"fraction": run.parameters["fraction"]}])


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
    """The analysis in the run's folder, if it has the default choices and belongs to the present state of the run; else a new
    analysis, which is stored there."""
    path = result_path(run.path)
    if path.exists():
        result = read_result(path)
        if result["run"] == tracks.state_of(run) and channel_figures.choices_of(result) == channel.Choices():
            return result
    result, = channel.analyse([tracks.load(run.path)])
    write_result(path, result)
    return result


def _distribution(run, result):
    options = run.parameters
    name = options.get("distribution", "")
    if options.get("radii"):
        name = f"{options['radii']} as {options.get('counts')}"
    return {"distribution": name, "polydispersity": result["polydispersity"]}


def _pushing(run):
    """Mean force on the pushing plunger over the disks' weight, without the first two pushes."""
    if not {"push", "plunger_force"} <= run.vector_series.keys() | set(run.series):
        return np.nan
    late = run.series["push"].to_numpy() >= channel.Choices().skip_pushes
    force = run.vector_series["plunger_force"][late].max(1)
    return float(force.mean()) / run.measured("weight")[0] if late.any() else np.nan


def motion(run):
    """Non-affine motion, over an interval and over equal strains, of all cells; exponents and rotation in the central
    square; the options of the run."""
    result = _channel(run)
    names = ("dr_na", "d2_min_per_neighbour")
    options = {name: run.parameters.get(name, np.nan) for name in CHANNEL_OPTIONS}
    if options["mu_plunger_dynamic"] == options["mu_wall_dynamic"]:
        options["mu_plunger_dynamic"] = np.nan  # as the coefficient of walls, with which it changes
    return pd.DataFrame([_distribution(run, result) | {"disks": result["disks"]} | options
                         | _columns_of(result, names, "all") | _columns_of(result["clock"], names, "all", "_clock")
                         | _columns_of(result, ["exponent_dr_na", "exponent_d2_min", "rotation"], "centre")
                         | {"force": _pushing(run), "largest_overlap": run.summary.get("largest_overlap", np.nan),
                            "jammed": len(run.summary.get("jammed_pushes", []))}])


def intervals(run):
    """Non-affine motion in the central square against the interval, and its exponents."""
    result = _channel(run)
    exponents = _columns_of(result, ["exponent_dr_na", "exponent_d2_min"], "centre")
    return pd.DataFrame([_distribution(run, result) | {"relative": round(row["relative"], 6)} | exponents
                         | _columns_of(row, ["dr_na", "d2_min_per_neighbour"], "centre") for row in result["intervals"]])


def sizes(run):
    """Non-affine motion of each size, of all cells, its ratio to the motion of all disks in the same cells, and the motion that
    disks of the size add to their neighbours."""
    result = _channel(run)
    names = ("dr_na", "d2_min_per_neighbour")
    rows = []
    for size, near in zip(result["sizes"], result["distances"]["sizes"]):
        peaks = {"peak_" + name: {"all": near[name]["all"]["peak"]} for name in names}
        rows.append(_distribution(run, result) | {k: size[k] for k in ("radius", "relative_radius", "disks")}
                    | _columns_of(size, (*names, *("relative_" + name for name in names)), "all")
                    | _columns_of(peaks, peaks, "all"))
    return pd.DataFrame(rows)


def distances(run):
    """Non-affine motion against the distance from a disk of each size."""
    result = _channel(run)
    parts = []
    for near in result["distances"]["sizes"]:
        part = {"radius": near["radius"], "relative_radius": near["relative_radius"],
                "distance": result["distances"]["distance"], "count": near["dr_na"]["all"]["count"]}
        for name in ("dr_na", "d2_min_per_neighbour"):
            column = name.removesuffix("_per_neighbour")
            part[column], part[column + "_error"] = near[name]["all"]["value"], near[name]["all"]["error"]
        parts.append(pd.DataFrame(part))
    return pd.concat(parts, ignore_index=True).assign(**_distribution(run, result))


def neighbours(run):
    """Non-affine motion of all cells with 11, 15 and 20 neighbours in D2_min."""
    read, rows = tracks.load(run.path), []
    for number in NEIGHBOURS:
        result, = channel.analyse([read], channel.Choices(neighbours=number))
        names = ("d2_min_per_neighbour", "dr_na")
        found = _columns_of(result, names, "all") | _columns_of(result["clock"], names, "all", "_clock")
        rows.append(_distribution(run, result) | {"neighbours": number} | found)
    return pd.DataFrame(rows)


_CELLS = {"x": "x", "y": "y", "centre": "centre", "count": "count", "mean_x": "mean_x", "mean_y": "mean_y",
          "strain": "strain", "displacement": "displacement", "dr_na": "dr_na", "d2_min_per_neighbour": "d2_min",
          "rotation": "rotation", "clock": "clock", "clock_strain": "clock_strain",
          "clock_d2_min_per_neighbour": "clock_d2_min"}


def cells(run):
    """Mean displacement, strain, non-affine motion and rotation in each cell."""
    result = _channel(run)
    return pd.DataFrame({column: result["cells"][name] for name, column in _CELLS.items()}).assign(
        width=result["choices"]["cell"], travel=result["interval"]["travel"], time=result["interval"]["time"],
        **_distribution(run, result))


def snapshots(run):
    """Motion of every disk in the middle of the last push; the neighbours of a largest and of a smallest disk."""
    read = tracks.load(run.path)
    shot = channel.snapshot(read, channel.Choices())
    radius, near = shot["radius"], {}
    for name, disk in zip(("largest", "smallest"), channel_figures.two_neighbourhoods(shot)):
        # 2: the disk itself, 1: a neighbour
        near[name] = np.zeros(len(radius), int)
        near[name][shot["neighbours"][disk]], near[name][disk] = 1, 2
    vectors = {name + axis: shot[key][:, i] for key, name in (("position", ""), ("shift", "d"), ("mean", "mean_"))
               for i, axis in enumerate("xy")}
    kept = read.without(channel.Choices().skip_pushes)
    return pd.DataFrame({**vectors, "radius": radius, "dr_na": shot["dr_na"] / kept.mean_radius,
                         "d2_min": shot["d2_min_per_neighbour"] / kept.mean_radius**2, **near}).assign(
        mean_radius=kept.mean_radius, push=shot["push"], start=shot["travel"], travel=shot["interval"],
        **_distribution(run, {"polydispersity": kept.polydispersity}))


MEASURES = {f.__name__: f for f in (flows, readings, profiles, reductions, fractures, forces, clogs, packings, packing_modes, shear_flows,
                                    motion, intervals, sizes, distances, neighbours, cells, snapshots)}


def _commit(run):
    found = re.match(r"[0-9a-f]{7,40}(-dirty)?\b", str(run.manifest.get("build", "")))
    return found[0] if found else "unknown"


def _kept_digits(column):
    """Numbers rounded as in a CSV file, so that new and stored runs give equal results."""
    return [float(f"{x:.6g}") for x in column] if column.dtype.kind == "f" else column


def measured(measure, row, folder):
    """DataFrame of one finished run, numbers to six digits. Raises RunError if it cannot be used."""
    with Run(folder) as run:
        try:
            table = MEASURES[measure](run)
        except KeyError as error:
            raise RunError(f"{folder}: has no {error}, which the figure needs") from None
        return table.apply(_kept_digits).assign(row=row, seed=int(run.parameters.get("seed", 0)), commit=_commit(run),
                            cpu_seconds=float(run.summary.get("cpu_seconds", np.nan)))
