#!/usr/bin/python3
"""Non-affine motion and rotation of disks in a channel against the polydispersity of many runs."""

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
    parser = script.parser(__doc__, "channel_polydispersity.py runs/* -o polydispersity.png",
                           "channel_polydispersity.png")
    figures.add_arguments(parser)
    parser.add_argument("--region", choices=("all", "centre"), default="all",
                        help="of the non-affine motion; rotation is measured in the central square")
    parser.add_argument("--clock", action="store_true", help="displacements over intervals of the strain clock")
    arguments = script.arguments(parser)
    named = figures.results(figures.distinct(arguments.path))

    figure, panels = plt.subplots(1, 3, figsize=(plotting.PAGE, 3.4), layout="constrained")
    for axes, quantity in zip(panels, ("dr_na", figures.d2(arguments), "rotation")):
        region = "centre" if quantity == "rotation" else arguments.region
        delta, value, error, _ = figures.by_polydispersity(
            named, lambda result: (result["clock"] if arguments.clock else result)[quantity][region])
        plotting.errorbar(axes, delta, value, error, fmt="o", capsize=2.5, elinewidth=0.9)
        good = np.isfinite(value)
        if np.ptp(delta[good]) > 0 if good.any() else False:
            slope, intercept = np.polyfit(delta[good], value[good], 1)
            axes.plot(delta[good], slope * delta[good] + intercept, "--", color="0.4",
                      label=rf"${slope:.3g}\,\delta {intercept:+.3g}$")
            axes.legend()
            print(f"{quantity} ({region}): slope {slope:.3g}, intercept {intercept:.3g}, mean {value[good].mean():.4g}")
        axes.set(xlabel=r"polydispersity  $\delta$", ylabel=figures.LABELS[quantity])
        axes.set_ylim(bottom=0)
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
