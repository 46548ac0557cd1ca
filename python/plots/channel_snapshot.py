#!/usr/bin/python3
"""Displacement, non-affine displacement, D2_min and two neighbourhoods of disks in a channel at one time."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt
import numpy as np

from pliant import channel_analysis as channel, plotting, script, tracks
from pliant import channel_figures as figures


def main():
    parser = script.parser(__doc__, "channel_snapshot.py runs/T4 --push 4 -o snapshot.png", "channel_snapshot.png")
    figures.add_arguments(parser, many=False)
    parser.add_argument("--push", type=int, metavar="N", help="push (default: the last)")
    parser.add_argument("--travel", type=float, metavar="X",
                        help="travel of the plunger at the start of the displacements, in cm (default: in the middle)")
    arguments = script.arguments(parser)
    (_, result), = figures.results(arguments.path)
    given = result["choices"]
    choices = figures.choices_of(result)
    run = tracks.load(arguments.path[0], **given.get("table", {}))
    shot = channel.snapshot(run, choices, arguments.push, arguments.travel)

    figure, panels = plt.subplots(2, 2, figsize=(plotting.PAGE, 7.8), layout="constrained")
    mean_radius, d2 = result["mean_radius"], figures.d2(arguments)
    left_over = shot["shift"] - shot["mean"]
    for axes, values, name, arrows, colors in (
            (panels[0, 0], np.hypot(*shot["shift"].T) / mean_radius, "displacement", shot["shift"], "viridis_r"),
            (panels[0, 1], shot["dr_na"] / mean_radius, "dr_na", left_over, "magma_r"),
            (panels[1, 0], shot[d2] / mean_radius**2, d2, None, "cividis_r")):
        disks = figures.draw_disks(axes, shot["position"], shot["radius"], values, colors)
        if arrows is not None:
            axes.quiver(*shot["position"].T, *arrows.T, angles="xy", scale_units="xy", scale=1, width=0.003,
                        color="black")
        figure.colorbar(disks, ax=axes, label=figures.LABELS[name], extend="max")
    figures.draw_neighbourhoods(panels[1, 1], shot["position"], shot["radius"],
                                [(disk, shot["neighbours"][disk]) for disk in figures.two_neighbourhoods(shot)])
    panels[1, 1].legend(loc="upper right")
    end = shot["travel"] + shot["interval"]
    panels[0, 0].set_title(f"push {shot['push']}, from {shot['travel']:.3g} to {end:.3g} cm")
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
