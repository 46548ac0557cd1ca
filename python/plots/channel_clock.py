#!/usr/bin/python3
"""Interval, strain and D2_min of disks in a channel: for one interval, and by the strain clock."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt
import numpy as np

from pliant import channel_figures as figures
from pliant import plotting, script


def main():
    parser = script.parser(__doc__, "channel_clock.py runs/bidisperse -o clock.png", "channel_clock.png")
    figures.add_arguments(parser, many=False)
    arguments = script.arguments(parser)
    (_, result), = figures.results(arguments.path)
    cells, d2 = result["cells"], figures.d2(arguments)
    # The same in seconds, at the mean speed of the plunger.
    seconds = result["interval"]["time"] / result["interval"]["travel"]
    cells["interval"] = [result["interval"]["time"]] * len(cells["x"])
    cells["clock_interval"] = [seconds * travel for travel in cells["clock"]]

    figure, panels = plt.subplots(2, 3, figsize=(plotting.PAGE, 5.6), layout="constrained")
    columns = ((("interval", "clock_interval"), r"$\Delta t$  [s]", "cividis"),
               (("strain", "clock_strain"), "strain  $|DF|$", "magma"),
               ((d2, f"clock_{d2}"), figures.LABELS[d2], "viridis"))
    for k, (names, label, colors) in enumerate(columns):
        values = np.concatenate([np.asarray(cells[name], float) for name in names])
        values = values[np.isfinite(values)]
        top = np.quantile(values, 0.99) if len(values) else 1.0
        for axes, name in zip(panels[:, k], names):
            mesh = figures.cell_map(axes, result, name, cmap=colors, vmin=0, vmax=top)
        figure.colorbar(mesh, ax=panels[:, k], label=label, extend="max", aspect=40)
    panels[0, 0].set_title("one interval")
    panels[1, 0].set_title(f"$|DF|$ nearest to {result['clock']['df0']:g}")
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
