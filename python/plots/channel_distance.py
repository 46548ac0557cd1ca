#!/usr/bin/python3
"""Non-affine motion of disks in a channel against the distance from a disk of given size."""

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
    parser = script.parser(__doc__, "channel_distance.py runs/T4 -o distance.png", "channel_distance.png")
    figures.add_arguments(parser, many=False)
    parser.add_argument("--region", choices=("all", "centre"), default="all")
    arguments = script.arguments(parser)
    (_, result), = figures.results(arguments.path)
    distance = np.asarray(result["distances"]["distance"])
    rows = result["distances"]["sizes"]

    figure, panels = plt.subplots(1, 2, figsize=(plotting.PAGE, 3.9), layout="constrained")
    for axes, quantity in zip(panels, ("dr_na", figures.d2(arguments))):
        counts = np.array([row[quantity][arguments.region]["count"] for row in rows])
        for i, (row, count) in enumerate(zip(rows, counts)):
            entry = row[quantity][arguments.region]
            value, error = np.asarray(entry["value"]), np.nan_to_num(entry["error"])
            color = plotting.color(i)
            axes.plot(distance, value, color=color, label=f"from disks of $R$ = {row['radius']:.4g} cm")
            axes.fill_between(distance, value - error, value + error, color=color, alpha=0.2, lw=0)
        values = np.nan_to_num([row[quantity][arguments.region]["value"] for row in rows])
        if counts.sum():
            axes.axhline((values * counts).sum() / counts.sum(), ls="--", color="0.5", lw=0.9, label="mean")
        axes.set(xlabel="distance of the surfaces  [cm]", ylabel=figures.LABELS[quantity], xlim=(0, None))
    panels[0].legend()
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
