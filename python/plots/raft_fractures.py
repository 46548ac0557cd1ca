#!/usr/bin/python3
"""Fractures of many rafts: excess peaks against phi, peaks against delta, competing fractures against N, q/p and tilt.

Runs that differ in nothing but the seed are averaged; bars are standard errors.
"""

import sys
from pathlib import Path

# In place of this folder, whose profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first: it says what this Python lacks

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from pliant import load_runs, plotting, raft, script

#: name of the figure → (column of the table, its label, what is averaged, its label)
FIGURES = {
    "phi": ("phi", r"fraction of small droplets  $\phi$", "excess", "excess peaks  $\\Delta N$"),
    "delta": ("delta", r"polydispersity  $\delta$", "peaks", "peaks"),
    "size": ("inverse_size", "$N^{-1/2}$", "competing", "fraction of competing fractures"),
    "aspect": ("aspect", "$q/p$", "competing", "fraction of competing fractures"),
    "tilt": ("tilt", "tilt  [degrees]", "competing", "fraction of competing fractures"),
}


def polydispersity(phi, small, delta):
    """Standard deviation of the radii over their mean, of both kinds together [T 2.41]."""
    mean = 1 - phi + phi * small
    return np.sqrt((1 - phi + phi * small**2) * (1 + delta**2) - mean**2) / mean


def table(runs):
    """One row per run."""
    rows = []
    for run in runs:
        curve, o = raft.Compression.of(run), run.parameters
        reductions = curve.reductions()
        rows.append({"n": curve.n, "rows": curve.rows, "phi": o["small_fraction"], "tilt": o["tilt"],
                     "delta": round(polydispersity(o["small_fraction"], o["small_radius"], o["delta"]), 12),
                     "inverse_size": curve.n**-0.5, "aspect": curve.n / curve.rows**2, "peaks": len(curve.peaks()),
                     "excess": len(curve.peaks()) - (curve.rows - 1),
                     "competing": raft.competing_fraction(reductions)[0]})
    return pd.DataFrame(rows)


def main():
    parser = script.parser(__doc__, "raft_fractures.py size runs/square-* -o competing.png", "raft_fractures.png")
    parser.add_argument("figure", choices=FIGURES, help="what to draw")
    parser.add_argument("run", nargs="+", help="run folders, or folders of runs")
    arguments = script.arguments(parser)
    x, x_label, y, y_label = FIGURES[arguments.figure]
    data = table(load_runs(arguments.run))
    settings = list(dict.fromkeys([x, "n", "rows", "phi", "delta", "tilt"]))
    means = data.groupby(settings)[y].agg(["mean", "sem", "count"]).reset_index()
    by_size = arguments.figure in ("phi", "delta", "tilt")

    figure, axes = plt.subplots(figsize=(5.6, 4.0), layout="constrained")
    for (label, group), marker, color in zip(means.groupby("n") if by_size else [(None, means)],
                                             plotting.MARKERS * 9, plotting.COLORS * 9):
        name = f"$N = {label}$" if by_size else None
        axes.errorbar(group[x], group["mean"], group["sem"].fillna(0), fmt=marker, color=color, capsize=2, label=name)
        if arguments.figure == "phi" and (group["mean"] * group[x] * (1 - group[x])).sum() > 0:
            peak, error = raft.fit_excess(group[x], group["mean"])
            phi = np.linspace(0, 1, 200)
            axes.plot(phi, raft.excess_fractures(phi, peak), color=color, lw=1)
            print(f"{name}: peak of the excess {script.with_error(peak, error)}")
    axes.set(xlabel=x_label, ylabel=y_label)
    axes.set_ylim(bottom=min(0, axes.get_ylim()[0]))
    if by_size:
        axes.legend()
    print(script.markdown([*settings, y, "error", "runs"],
                          [[f"{r[c]:.4g}" for c in settings] + [f"{r['mean']:.4g}", f"{r['sem']:.2g}", int(r["count"])]
                           for _, r in means.iterrows()]))
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
