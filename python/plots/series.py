#!/usr/bin/python3
"""Time series of a run: crossed area, flow rate, kinetic energy, contacts, height of the filling."""

import sys
from pathlib import Path

# In place of this folder, whose profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first: it says what this Python lacks

import matplotlib.pyplot as plt
import numpy as np

from pliant import Run, RunError
from pliant import plotting, script


def flow_rate(time, crossed, bins):
    """Mean flow rate in `bins` equal pieces of the run: edges [bins+1], rates [bins]."""
    edges = np.linspace(time[0], time[-1], bins + 1)
    return edges, np.diff(np.interp(edges, time, crossed)) / np.diff(edges)


def main():
    parser = script.parser(__doc__, "series.py runs/hopper -o series.png", "series.png")
    parser.add_argument("run", help="run folder")
    parser.add_argument("--bins", type=int, default=60, help="pieces of the flow rate's average (default: 60)")
    arguments = script.arguments(parser)
    run = Run(arguments.run)
    series, d = run.series, run.dim
    if arguments.bins < 1:
        raise RunError(f"--bins is {arguments.bins}: at least 1")
    if len(series) < 2:
        raise RunError(f"{run.path}: {len(series)} samples are too few for a time series (smaller -sample_interval?)")
    volume = "area" if d == 2 else "volume"
    panels = [("crossed_area", rf"crossed {volume}" + "\n" + rf"[$\sigma_{{avg}}^{d}$]"),
              (None, "flow rate $Q$\n" + rf"[$\sigma_{{avg}}^{d}/t_0$]"),
              ("kinetic_energy", "kinetic energy\n" + rf"[$\rho g\sigma_{{avg}}^{d + 1}$]"),
              ("contact_pairs", "touching\npairs"), ("top_height", "top height\n" + r"[$\sigma_{avg}$]")]
    missing = [name for name, _ in panels if name and name not in series]
    if missing:
        raise RunError(f"{run.path}: /series has no {', '.join(missing)}")

    figure, axes = plt.subplots(len(panels), 1, figsize=(7.0, 7.6), sharex=True, layout="constrained")
    for i, (axis, (name, label)) in enumerate(zip(axes, panels)):
        color = plotting.COLORS[i]
        if name:
            axis.plot(series["time"], series[name], color=color, lw=1)
        else:
            bins = min(arguments.bins, len(series) - 1)
            edges, rate = flow_rate(series["time"].to_numpy(), series["crossed_area"].to_numpy(), bins)
            axis.stairs(rate, edges, baseline=None, color=color, lw=1.1)
            Q, error = run.measured("Q")
            if np.isfinite(Q):
                start = run.steady_start if run.steady_start is not None else edges[0]
                axis.plot([start, edges[-1]], [Q, Q], color="black", lw=1.1,
                          label=f"$Q$ = {script.with_error(Q, error)}")
                if np.isfinite(error):
                    axis.fill_between([start, edges[-1]], Q - error, Q + error, color="black", alpha=0.2, lw=0)
                axis.legend(loc="lower right")
            axis.set_ylim(min(0, rate.min() * 1.05), None)
        axis.set_ylabel(label)
        if run.steady_start is not None:
            axis.axvline(run.steady_start, color="0.4", lw=1, ls="--")
    if run.steady_start is not None:
        axes[0].annotate("steady state", (run.steady_start, 1), xycoords=("data", "axes fraction"), xytext=(4, -2),
                         textcoords="offset points", va="top", color="0.3", fontsize=8.5)
    axes[-1].set(xlabel=r"time  $t/t_0$", xlim=(series["time"].iloc[0], series["time"].iloc[-1]))
    figure.align_ylabels(axes)
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
