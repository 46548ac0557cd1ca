#!/usr/bin/python3
"""Time series of a hopper: crossed area, flow rate, kinetic energy, energy budget, contacts, height of the filling. Time series of a vibrated container: height of the centre of mass, energy of fluctuations, energy budget, contacts.

The budget, of runs with inertia: since the start, work of reinsertion or of the walls, heat, and change of the energy, which is work - heat. Grey: the flow has ended. The flow rate is drawn in pieces of the time before that."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt
import numpy as np

from pliant import Run, RunError
from pliant import plotting, script
from pliant.flow import flow_end, flow_rate
from pliant.follow import states
from pliant.scenarios import of_scenario


def draw_budget(axis, series):
    """Work, heat and change of the energy since the start."""
    energy = series["kinetic_energy"] + series["potential_energy"] + series["gravity_energy"]
    for k, (label, values) in enumerate((("work", series["work"]), ("heat", series["heat"]), ("change", energy - energy.iloc[0]))):
        axis.plot(series["time"], values, color=plotting.COLORS[k], lw=1, label=label)
    axis.legend(ncols=3, loc="best")


def draw(run, bins, output):
    """The figure of one run, with the flow rate in so many pieces."""
    series, d = of_scenario(run, "hopper", "vibrate").series, run.dim
    if len(series) < 2:
        raise RunError(f"{run.path}: {len(series)} samples are too few for a time series (smaller -sample_interval?)")
    volume, energy = "area" if d == 2 else "volume", "\n" + rf"[$\rho g\sigma_{{avg}}^{d + 1}$]"
    budget, contacts = ("heat", "energy budget" + energy), ("contact_pairs", "touching\npairs")
    flows = run.scenario == "hopper"
    if flows:
        panels = [("crossed_area", rf"crossed {volume}" + "\n" + rf"[$\sigma_{{avg}}^{d}$]"),
                  (None, "flow rate $Q$\n" + rf"[$\sigma_{{avg}}^{d}/t_0$]"), ("kinetic_energy", "kinetic energy" + energy),
                  budget, contacts, ("top_height", "top height\n" + r"[$\sigma_{avg}$]")]
    else:
        panels = [("mean_height", "mean height\n" + r"[$\sigma_{avg}$]"), ("fluctuation_energy", "energy of\nfluctuations" + energy),
                  budget, contacts]
    if not {"work", "gravity_energy"} <= set(series):  # no energy audit, or an older version
        panels = [panel for panel in panels if panel[0] != "heat"]
    missing = [name for name, _ in panels if name and name not in series]
    if missing:
        raise RunError(f"{run.path}: /series has no {', '.join(missing)}")
    time = series["time"].to_numpy()
    ended = flow_end(series) if flows else None
    flow = slice(None) if ended is None else time <= ended
    # After a clog Q is 0 by definition, not an average over the flow before it.
    averaged = run.steady_start if ended is None else None

    figure, axes = plt.subplots(len(panels), 1, figsize=(7.0, 1.52 * len(panels)), sharex=True, layout="constrained")
    for i, (axis, (name, label)) in enumerate(zip(axes, panels)):
        color = plotting.COLORS[i]
        if name == "heat":
            draw_budget(axis, series)
        elif name:
            axis.plot(time, series[name], color=color, lw=1)
        elif np.count_nonzero(time[flow]) > 0:
            edges, rate = flow_rate(time[flow], series["crossed_area"].to_numpy()[flow], min(bins, len(time[flow]) - 1))
            axis.stairs(rate, edges, baseline=None, color=color, lw=1.1)
            Q, error = run.measured("Q")
            if averaged is not None and np.isfinite(Q):
                axis.plot([averaged, time[-1]], [Q, Q], color="black", lw=1.1,
                          label=f"$Q$ = {script.with_error(Q, error)}")
                if np.isfinite(error):
                    axis.fill_between([averaged, time[-1]], Q - error, Q + error, color="black", alpha=0.2, lw=0)
                axis.legend(loc="lower right")
            axis.set_ylim(min(0, rate.min() * 1.05), None)
        axis.set_ylabel(label)
        if averaged is not None:
            axis.axvline(averaged, color="0.4", lw=1, ls="--")
        if ended is not None:
            axis.axvspan(ended, time[-1], color="0.92", lw=0, zorder=0)
    mark, text = (averaged, "steady state" if run.summary.get("steady") else "averaged, not steady") \
        if ended is None else (ended, f"no flow ({run.summary.get('status', 'unfinished')})")
    if mark is not None:
        late = mark > 0.7 * time[-1] + 0.3 * time[0]  # then to the left of the mark
        axes[0].annotate(text, (mark, 0), xycoords=("data", "axes fraction"), xytext=(-4 if late else 4, 3),
                         textcoords="offset points", va="bottom", ha="right" if late else "left", color="0.3",
                         fontsize=8.5)
    if ended is not None:
        print(f"{run.path}: the flow ended at t = {ended:g} t0, the run at t = {time[-1]:g} t0")
    axes[-1].set(xlabel=r"time  $t/t_0$", xlim=(time[0], time[-1]))
    figure.align_ylabels(axes)
    plotting.save(figure, output)


def main():
    parser = script.parser(__doc__, "series.py runs/hopper -o series.png", "series.png")
    parser.add_argument("run", help="folder of a run of hopper or vibrate")
    parser.add_argument("--bins", type=int, default=60, help="pieces of the flow rate's average (default: 60)")
    parser.add_argument("--follow", type=float, metavar="S", help="draw again every S seconds until the run ends")
    arguments = script.arguments(parser)
    if arguments.bins < 1:
        raise RunError(f"--bins is {arguments.bins}: at least 1")
    if arguments.follow is None:
        return draw(Run(arguments.run), arguments.bins, arguments.output)
    for run, writing in states(arguments.run, arguments.follow):
        if writing and len(run.series) < 2:
            script.remark(f"{run.path}: {len(run.series)} samples so far")
        else:
            draw(run, arguments.bins, arguments.output)


if __name__ == "__main__":
    script.run(main)
