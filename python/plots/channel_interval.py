#!/usr/bin/python3
"""Non-affine motion of disks in a channel against the time interval, with power laws."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import NullFormatter

from pliant import channel_figures as figures
from pliant import plotting, script

EXPONENTS = {"dr_na": "exponent_dr_na", "d2_min_per_neighbour": "exponent_d2_min", "d2_min_sum": "exponent_d2_min"}


def main():
    parser = script.parser(__doc__, "channel_interval.py runs/T* -o interval.png", "channel_interval.png")
    figures.add_arguments(parser)
    parser.add_argument("--region", choices=("all", "centre"), default="centre")
    arguments = script.arguments(parser)

    figure, panels = plt.subplots(1, 2, figsize=(plotting.PAGE, 3.9), layout="constrained")
    for i, (name, result) in enumerate(figures.results(arguments.path)):
        rows = result["intervals"]
        x = np.array([row["relative"] for row in rows])
        for axes, quantity in zip(panels, ("dr_na", figures.d2(arguments))):
            value, error = figures.entries(rows, quantity, arguments.region)
            slope = result[EXPONENTS[quantity]][arguments.region]
            color = plotting.color(i)
            plotting.errorbar(axes, x, value, error, linestyle="", capsize=2.5, elinewidth=0.9, **plotting.symbol(i),
                              label=f"{name}: {script.with_error(slope['value'], slope['error'])}")
            ends = result["exponent_fit"]["range"]
            if np.isfinite(slope["value"]) and isinstance(ends, list):
                fitted = (x >= ends[0] * 0.999) & (x <= ends[1] * 1.001) & (value > 0)
                middle = np.exp(np.log(value[fitted]).mean() - slope["value"] * np.log(x[fitted]).mean())
                axes.plot(ends, middle * np.array(ends) ** slope["value"], color=color, lw=1.0)
            axes.set(xscale="log", yscale="log", xlabel=r"$\Delta t/\Delta t_0$", ylabel=figures.LABELS[quantity])
    for axes in panels:
        ticks = [t for t in (0.1, 0.2, 0.5, 1, 2, 5, 10) if axes.get_xlim()[0] <= t <= axes.get_xlim()[1]]
        axes.set_xticks(ticks, labels=[f"{t:g}" for t in ticks])
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.legend(title="exponent")
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
