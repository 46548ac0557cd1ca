#!/usr/bin/python3
"""How much disks of each size add to the non-affine motion next to them, against their size."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt

from pliant import channel_figures as figures
from pliant import plotting, script


def main():
    parser = script.parser(__doc__, "channel_peaks.py runs/T* -o peaks.png", "channel_peaks.png")
    figures.add_arguments(parser)
    parser.add_argument("--region", choices=("all", "centre"), default="all")
    arguments = script.arguments(parser)

    figure, panels = plt.subplots(1, 2, figsize=(plotting.PAGE, 3.9), layout="constrained")
    for i, (name, result) in enumerate(figures.results(arguments.path)):
        rows = result["distances"]["sizes"]
        x = [row["relative_radius"] for row in rows]
        for axes, quantity in zip(panels, ("dr_na", figures.d2(arguments))):
            peaks = [{quantity: {arguments.region: row[quantity][arguments.region]["peak"]}} for row in rows]
            plotting.errorbar(axes, x, *figures.entries(peaks, quantity, arguments.region), capsize=2.5, elinewidth=0.9,
                              linestyle="", **plotting.symbol(i),
                              label=rf"{name}, $\delta$ = {result['polydispersity']:.2f}")
            axes.set(xlabel=rf"$R/{figures.R}$", ylabel=f"peak less mean of  {figures.LABELS[quantity]}")
    for axes in panels:
        axes.axhline(0, color="0.7", lw=0.8, zorder=0)
    panels[0].legend()
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
