#!/usr/bin/python3
"""Numbers of disks of each size of runs in a channel."""

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
    parser = script.parser(__doc__, "channel_histogram.py runs/C1 runs/C2 runs/C3 -o C.png", "channel_histogram.png")
    figures.add_arguments(parser)
    arguments = script.arguments(parser)
    named = figures.results(arguments.path)

    figure, axes = plt.subplots(figsize=(6.2, 3.8), layout="constrained")
    radii = np.unique([round(row["radius"], 4) for _, result in named for row in result["sizes"]])
    width = 0.8 * (np.diff(radii).min() if len(radii) > 1 else radii[0]) / len(named)
    for i, (name, result) in enumerate(named):
        x = np.array([row["radius"] for row in result["sizes"]]) + width * (i - (len(named) - 1) / 2)
        axes.bar(x, [row["disks"] for row in result["sizes"]], width, color=plotting.color(i),
                 label=rf"{name}, $\delta$ = {result['polydispersity']:.2f}")
    axes.set(xlabel="$R$  [cm]", ylabel="disks")
    axes.legend()
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
