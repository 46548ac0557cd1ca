#!/usr/bin/python3
"""Mean displacement field of disks in a channel, and its strain, as arrows and a map."""

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
    parser = script.parser(__doc__, "channel_field.py runs/bidisperse -o field.png", "channel_field.png")
    figures.add_arguments(parser, many=False)
    arguments = script.arguments(parser)
    (_, result), = figures.results(arguments.path)
    cells = {name: np.asarray(values) for name, values in result["cells"].items()}

    figure, (left, right) = plt.subplots(1, 2, figsize=(plotting.PAGE, 4.1), layout="constrained")
    travel = result["interval"]["travel"]
    arrows = figures.draw_field(left, cells, travel, result["choices"]["cell"])
    left.set(title=figures.interval_text(result))
    figure.colorbar(arrows, ax=left, label=r"mean displacement  $|\Delta r_{mean}|$  [cm]")
    mesh = figures.cell_map(right, result, "strain", cmap="magma")
    figure.colorbar(mesh, ax=right, label="strain  $|DF|$")
    for axes in (left, right):
        figures.draw_square(axes, result)
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
