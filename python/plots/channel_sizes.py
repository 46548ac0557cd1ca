#!/usr/bin/python3
"""Non-affine motion of disks in a channel against their size."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt

from pliant import channel_figures as figures
from pliant import plotting, script


def main():
    parser = script.parser(__doc__, "channel_sizes.py runs/T* -o sizes.png", "channel_sizes.png")
    figures.add_arguments(parser)
    parser.add_argument("--region", choices=("all", "centre"), default="all")
    arguments = script.arguments(parser)

    figure, panels = plt.subplots(1, 2, figsize=(plotting.PAGE, 3.9), layout="constrained")
    for i, (name, result) in enumerate(figures.results(arguments.path)):
        rows = result["sizes"]
        x = [row["relative_radius"] for row in rows]
        for axes, quantity in zip(panels, ("dr_na", figures.d2(arguments))):
            plotting.errorbar(axes, x, *figures.entries(rows, quantity, arguments.region), capsize=2.5, elinewidth=0.9,
                              **plotting.symbol(i), label=rf"{name}, $\delta$ = {result['polydispersity']:.2f}")
            axes.set(xlabel=rf"$R/{figures.R}$", ylabel=figures.LABELS[quantity])
    for axes in panels:
        axes.set_ylim(bottom=0)
    panels[0].legend()
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
