#!/usr/bin/python3
"""Velocity on the axis against the height above the orifice, averaged over the steady state, with its error.

The profile ends at the top of the filling, where the number density on the axis falls below 0.8 of its largest value:
above, reinserted particles fall freely. If a run has clogged, or emptied, only the time of the flow counts."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt
import numpy as np

from pliant import load_runs
from pliant import plotting, script, symbols
from pliant.flow import axis_velocity
from pliant.scenarios import of_scenario


def main():
    parser = script.parser(__doc__, "profile.py runs/w3 runs/w5 runs/w8 -o profile.png", "profile.png")
    parser.add_argument("run", nargs="+", help="run folders")
    parser.add_argument("--start", type=float, metavar="T0",
                        help="first time used (default: steady_start of summary.json, else the second half of "
                             "the flow; for a discharge, the time in which 20 to 80 %% of the departing particles leave)")
    arguments = script.arguments(parser)
    runs = load_runs(arguments.run)
    for run in runs:
        of_scenario(run, "hopper")
    runs.sort(key=lambda run: run.geometry.w)

    curves = []
    for run in runs:
        curve = axis_velocity(run, arguments.start)
        print(f"{run.path}: averaged from t = {curve.start:g} to {curve.end:g} t0"
              f"{f' ({curve.remark})' if curve.remark else ''}, up to the top of the filling at h = {curve.height[-1]:g}")
        curves.append((curve.height, curve.velocity, curve.error))

    several = len({run.geometry.w for run in runs}) > 1
    figure, axes = plt.subplots(1, 1 + several, figsize=(5.0 + 3.6 * several, 3.9), layout="constrained", squeeze=False,
                                gridspec_kw={"width_ratios": [1.5, 1][: 1 + several]})
    colors = plt.get_cmap("viridis")(np.linspace(0, 0.85, len(runs))) if len(runs) > 1 else [plotting.COLORS[0]]
    labels = (plotting.run_labels(runs) if len(runs) > 1
              else [symbols.parameter_label("hopper_width", runs[0].geometry.w)])
    axis = axes[0, 0]
    for (height, value, error), color, label in zip(curves, colors, labels):
        axis.fill_between(height, value - error, value + error, color=color, alpha=0.25, lw=0)
        axis.plot(height, value, color=color, label=label)
    axis.axvline(0, color="0.6", lw=0.8, ls=":")
    axis.set(xlabel=r"height above the orifice  $h/\sigma_{avg}$",
             ylabel=r"axis velocity along gravity  $v_g$  [$\sigma_{avg}/t_0$]")
    if min((value - np.nan_to_num(error))[np.isfinite(value)].min() for _, value, error in curves) > 0:
        axis.set_ylim(0, None)
    axis.legend()
    if several:
        at_orifice(axes[0, 1], runs, curves, colors)
    plotting.save(figure, arguments.output)


def at_orifice(axis, runs, curves, colors):
    """The velocity at h = 0 against w, with the published slopes for friction (1/2) and drag (-1/2)."""
    w = np.array([run.geometry.w for run in runs])
    value, error = np.array([[np.interp(0, h, v), np.interp(0, h, e)] for h, v, e in curves]).T
    for x, v, e, color in zip(w, value, error, colors):
        plotting.errorbar(axis, x, v, e, fmt="o", color=color, capsize=2.5, zorder=3)
    middle = np.exp(np.log(w).mean()), np.exp(np.log(np.abs(value[value != 0])).mean()) if (value != 0).any() else 1.0
    line = np.geomspace(w.min() / 1.1, w.max() * 1.1, 20)
    for power, style, label in ((0.5, "--", r"$w^{1/2}$ (friction)"), (-0.5, ":", r"$w^{-1/2}$ (drag)")):
        axis.plot(line, middle[1] * (line / middle[0]) ** power, style, color="0.45", lw=1.1, label=label, zorder=1)
    axis.set(xlabel=r"orifice width  $w/\sigma_{avg}$", ylabel=r"$v_g$ at the orifice  [$\sigma_{avg}/t_0$]",
             ylim=(min(0, (value - np.nan_to_num(error)).min() * 1.1), None))
    axis.legend(title="published slopes")


if __name__ == "__main__":
    script.run(main)
