#!/usr/bin/python3
"""Draws frames of a raft, or of a clog, with its bonds: blue under tension, red under compression, the stronger the wider."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection

from pliant import Run, plotting, script
from pliant.scenarios import of_scenario

TENSION, COMPRESSION = plotting.COLORS[0], "#CC2020"


def draw(axes, run, frame, largest, box):
    """One frame; `largest` is the force of the widest line."""
    plotting.add_disks(axes, frame.centres[frame.active], run.topology.sigma[frame.active], facecolors=plotting.PALE,
                       edgecolors="0.65", linewidths=0.5, zorder=1)
    bonds = frame.contacts.query("wall < 0")
    first, second = (frame.centres[bonds[p]] for p in ("particle_1", "particle_2"))
    ends = np.stack([first, first + run.geometry.nearest_image(second - first)], axis=1)
    # The force on the first droplet, along the normal towards it: a push is positive.
    push = (bonds[["fx", "fy"]].to_numpy() * bonds[["nx", "ny"]].to_numpy()).sum(1)
    axes.add_collection(LineCollection(ends, colors=np.where(push < 0, TENSION, COMPRESSION),
                                       linewidths=0.4 + 3 * np.minimum(np.abs(push) / largest, 1), zorder=2))
    axes.add_collection(LineCollection(plotting.wall_lines(run, frame), colors=plotting.WALL, linewidths=2.5))
    axes.set(xlim=box[:2], ylim=box[2:], aspect="equal", title=plotting.time_label(run, frame))
    axes.axis("off")


def main():
    parser = script.parser(__doc__, "raft_snapshot.py runs/raft --frames 0 10 20 -o raft.png", "raft.png")
    parser.add_argument("run", help="run folder of scenario raft or clog")
    parser.add_argument("--frames", type=int, nargs="+", default=[-1], metavar="K",
                        help="frame numbers, negative from the end (default: -1)")
    arguments = script.arguments(parser)
    run = of_scenario(Run(arguments.run), "raft", "clog")
    frames = [run.frame(k) for k in arguments.frames]
    largest = max(frame.contacts.query("wall < 0")["force"].to_numpy().max(initial=0) for frame in frames) or 1
    corners = np.concatenate([frame.wall_segments.reshape(-1, 2) for frame in frames])
    box = (corners[:, 0].min() - 0.3, corners[:, 0].max() + 0.3, corners[:, 1].min(), corners[:, 1].max())
    height = 5.0
    width = max(2.4, height * (box[1] - box[0]) / (box[3] - box[2]))
    scale = min(1, plotting.PAGE / (width * len(frames)))
    figure, axes = plt.subplots(1, len(frames), figsize=(scale * width * len(frames), scale * height + 0.9), squeeze=False,
                                layout="constrained")
    for ax, frame in zip(axes[0], frames):
        draw(ax, run, frame, largest, box)
    figure.legend(handles=[plt.Line2D([], [], color=c, lw=3, label=label)
                           for c, label in ((TENSION, "tension"), (COMPRESSION, "compression"))], loc="lower center", ncols=2)
    strip = 0.35 / figure.get_figheight()  # for the legend
    figure.set_layout_engine("constrained", rect=(0, strip, 1, 1 - strip))
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
