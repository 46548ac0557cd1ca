"""Code shared by the figures of the channel analysis: results by name, labels, maps of cells."""

from dataclasses import asdict, fields
from pathlib import Path

import numpy as np

from . import plotting, pooling
from .analyse_command import load_result
from .channel_analysis import Choices
from .errors import RunError
from .sweep import load_runs

R = r"\langle R\rangle"
LABELS = {"displacement": rf"$|\Delta r|/{R}$", "dr_na": rf"$\Delta r_{{NA}}/{R}$",
          "d2_min_per_neighbour": rf"$D^2_{{min}}/{R}^2$ per neighbour", "d2_min_sum": rf"$D^2_{{min}}/{R}^2$ (sum)",
          "rotation": r"$|\Delta\theta|$  [rad]"}


def add_arguments(parser, many=True):
    parser.add_argument("path", nargs="+" if many else 1, metavar="DIR|TABLE.csv|FILE.json",
                        help="runs analysed by pliant-analyse channel")
    parser.add_argument("--sum", action="store_true", help="D2_min as the sum over neighbours, not per neighbour")


def d2(arguments):
    return "d2_min_sum" if arguments.sum else "d2_min_per_neighbour"


def results(paths):
    """[(name, result)]: names are the names of the folders or files."""
    return [(Path(path).resolve().name.removesuffix(".json").removesuffix(".csv"), load_result(path)) for path in paths]


def choices_of(result):
    """The Choices that a result was made with."""
    names = {f.name for f in fields(Choices)}
    return Choices(**{name: tuple(value) if isinstance(value, list) else value
                      for name, value in result["choices"].items() if name in names})


def interval_text(result):
    return rf"$\Delta t$ = {result['interval']['time']:.3g} s ({result['interval']['travel']:.3g} cm of travel)"


def cell_map(axes, result, name, **options):
    """Draws a column of the result's cells as a map; returns the mesh."""
    cells, width = result["cells"], result["choices"]["cell"]
    at = [np.rint(np.asarray(cells[k]) / width - 0.5).astype(int) for k in "xy"]
    if not len(at[0]):
        raise RunError(f"{result['source']}: no cell has enough samples (see min_count of the analysis)")
    low = [a.min() for a in at]
    grid = np.full([np.ptp(a) + 1 for a in at], np.nan)
    grid[at[0] - low[0], at[1] - low[1]] = cells[name]
    edges = [(l + np.arange(n + 1)) * width for l, n in zip(low, grid.shape)]
    mesh = axes.pcolormesh(*edges, grid.T, rasterized=True, **options)
    axes.set(aspect="equal", xlabel="$x$  [cm]", ylabel="$y$  [cm]")
    return mesh


def draw_field(axes, cells, travel, width):
    """Mean displacement as arrows; a displacement `travel` of the plunger is as long as a cell. cells: columns x, y,
    mean_x, mean_y. Returns the arrows."""
    x, y, u, v = (np.asarray(cells[name], float) for name in ("x", "y", "mean_x", "mean_y"))
    arrows = axes.quiver(x, y, u, v, np.hypot(u, v), cmap="viridis", pivot="mid", angles="xy", scale_units="xy",
                         scale=travel / width, width=0.005)
    axes.quiverkey(arrows, 0.72, 0.9, travel, f"the plunger's {travel:.3g} cm", coordinates="axes", labelpos="N")
    axes.set(aspect="equal", xlabel="$x$  [cm]", ylabel="$y$  [cm]")
    return arrows


def draw_disks(axes, position, radius, values, colors):
    """Disks at [n, 2] coloured by values [n], grey for NaN; returns the mappable of the colour bar."""
    disks = plotting.add_disks(axes, position, 2 * np.asarray(radius), cmap=colors, edgecolors="0.3", linewidths=0.4)
    disks.set_array(np.ma.masked_invalid(values))
    known = np.asarray(values)[np.isfinite(values)]
    disks.set_clim(0, (np.quantile(known, 0.98) if len(known) else 0) or 1)
    disks.cmap.set_bad("0.85")
    low, high = (position - radius[:, None]).min(0), (position + radius[:, None]).max(0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="$x$  [cm]", ylabel="$y$  [cm]")
    return disks


def two_neighbourhoods(shot):
    """Indices of a largest and of a smallest disk of a `channel.snapshot` whose neighbourhoods are apart, if there are
    such; those nearest to the middle of all."""
    away = np.hypot(*(shot["position"] - shot["position"].mean(0)).T)
    order, radius = np.argsort(away, kind="stable"), shot["radius"]
    large = next(i for i in order if radius[i] > 0.999 * radius.max())
    taken = {large, *shot["neighbours"][large]}
    small = [i for i in order if radius[i] < 1.001 * radius.min() and i != large] or [large]
    return large, next((i for i in small if not taken & {i, *shot["neighbours"][i]}), small[0])


def draw_neighbourhoods(axes, position, radius, marks):
    """All disks in white, and neighbours in colour; marks: indices of (a disk, its neighbours) for the largest, the smallest."""
    draw_disks(axes, position, radius, np.zeros(len(radius)), "Greys")
    for (disk, neighbours), color, size in zip(marks, plotting.COLORS[4:6], ("largest", "smallest")):
        for chosen, face in ((neighbours, color), ([disk], plotting.COLORS[3])):
            plotting.add_disks(axes, position[chosen], 2 * radius[chosen], facecolor=face, edgecolor="0.3", lw=0.4)
        axes.plot([], [], "o", color=color, label=f"neighbours of a {size} disk")


def draw_square(axes, result):
    """The central square of the averages."""
    side = result["choices"]["centre"]
    axes.plot([0, side, side, 0, 0], [0, 0, side, side, 0], "--", color="0.35", lw=0.9)


def entries(rows, name, region):
    """(values, errors) of a quantity in rows of a result."""
    return tuple(np.array([row[name][region][part] for row in rows], float) for part in ("value", "error"))


def distinct(paths):
    """The paths of runs, tables and analyses that one figure averages, each run once. Raises RunError for runs that differ in more
    than the sizes of their disks, and for analyses with different choices."""
    paths = pooling.distinct_paths(paths)
    folders = [path for path in paths if (Path(path) / "run.h5").exists()]
    if folders:
        runs, table = pooling.distinct_runs(load_runs(folders), "channel")
        pooling.check(table, "channel", pooling.DISKS)
        kept = {run.path for run in runs}
        paths = [path for path in paths if path not in folders or Path(path) in kept]
    analyses = [(path, choices_of(load_result(path))) for path in paths]
    for path, choices in analyses[1:]:
        first, own = asdict(analyses[0][1]), asdict(choices)
        if name := next((name for name in own if own[name] != first[name]), None):
            raise RunError(f"{analyses[0][0]} and {path}: their analyses differ in --{name.replace('_', '-')} ({first[name]} and "
                           f"{own[name]}); repeat one of them by pliant-analyse channel")
    return paths


def by_polydispersity(named, pick):
    """Rows delta, value, error, runs, sorted by delta: runs of one size distribution, which differ in their start, are
    one point with the standard error of their scatter. pick(result) → {"value", "error"}."""
    groups = {}
    for _, result in named:
        groups.setdefault(round(result["polydispersity"], 3), []).append(pick(result))
    rows = []
    for delta, found in sorted(groups.items()):
        values = np.array([entry["value"] for entry in found])
        error = found[0]["error"] if len(found) == 1 else values.std(ddof=1) / np.sqrt(len(found))
        rows.append((delta, values.mean(), error, len(found)))
    return np.array(rows, float).T
