#!/usr/bin/python3
"""Rotation of disks in a channel against displacement, non-affine displacement and D2_min of the cells."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt
import numpy as np

from pliant import RunError
from pliant import channel_figures as figures
from pliant import plotting, script


def main():
    parser = script.parser(__doc__, "channel_rotation.py runs/bidisperse -o rotation.png", "channel_rotation.png")
    figures.add_arguments(parser, many=False)
    arguments = script.arguments(parser)
    (_, result), = figures.results(arguments.path)
    cells = {name: np.asarray(values, float) for name, values in result["cells"].items()}
    if not np.isfinite(cells["rotation"]).any():
        raise RunError(f"{result['source']}: there are no angles, so no rotation")

    figure, panels = plt.subplots(1, 3, figsize=(plotting.PAGE, 3.4), layout="constrained", sharey=True)
    inside = cells["centre"] > 0
    for axes, quantity in zip(panels, ("displacement", "dr_na", figures.d2(arguments))):
        for mask, color, label in ((~inside, plotting.COLORS[0], "outside"),
                                   (inside, plotting.COLORS[1], "central square")):
            axes.plot(cells[quantity][mask], cells["rotation"][mask], "o", color=color, ms=4, alpha=0.8, mew=0,
                      label=label)
        axes.set(xlabel=figures.LABELS[quantity], xlim=(0, None), ylim=(0, None))
    panels[0].set(ylabel=figures.LABELS["rotation"])
    panels[0].legend()
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
