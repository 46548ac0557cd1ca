#!/usr/bin/python3
"""A packing in its periodic box: the network of contact forces, or a vibrational mode."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection

from pliant import Run, RunError
from pliant import plotting, script
from pliant.run import lattice, nearest_image
from pliant.scenarios import of_scenario
from pliant.scene import network

MARGIN = 0.8  # of the view around the box


def images(frame):
    """[9, 2] shifts of a particle to its images in and around the box, the box itself first."""
    first, second = lattice(frame.box[1], frame.tilt)
    return np.array([row * second + (n - np.round(row * second[0] / first[0])) * first for row in (0, -1, 1) for n in (0, -1, 1)])


def in_view(places, frame):
    low, high = frame.box[0] - MARGIN, frame.box[0] + frame.box[1] + MARGIN
    return ((places >= low) & (places <= high)).all(-1)


def draw_background(ax, run, frame):
    """The box, and all particles and images in the view. Returns the points per unit of length."""
    (x, y), (width, height) = frame.box
    ax.add_patch(plt.Rectangle((x, y), width, height, fill=False, edgecolor="0.35", linewidth=0.8, linestyle="--", zorder=4))
    _, scale = plotting.draw_particles(ax, run, frame, plotting.PALE, edge_shade=0.85)
    face, edge = "#F4F4F4", "#E0E0E0"
    for shift in images(frame)[1:]:
        centres = frame.centres + shift
        near = np.flatnonzero(in_view(centres, frame) & frame.active)
        if run.topology.deformable:
            widths = np.maximum(run.topology.particle_diameter[near] * scale, 0.25)
            ax.add_collection(PolyCollection([frame.polygons[m] + shift for m in near], facecolors=face, edgecolors=edge,
                                             linewidths=widths, joinstyle="round", zorder=1), autolim=False)
        else:
            line = min(0.6, 0.12 * scale)
            plotting.add_disks(ax, centres[near], run.topology.sigma[near] - line / scale, False, facecolors=face,
                               edgecolors=edge, linewidths=line, zorder=1)
    return scale


def draw_forces(figure, ax, run, frame):
    """Lines between the centres of touching particles, as wide as their force."""
    pairs = network(run, frame)
    if not len(pairs):
        raise RunError(f"{run.path}: no contacts in packing {frame.time:g}: take another --frame")
    first, second = pairs["particle_1"].to_numpy(int), pairs["particle_2"].to_numpy(int)
    place, force = pairs[["x", "y"]].to_numpy(), np.linalg.norm(pairs[["fx", "fy"]].to_numpy(), axis=1)
    # Each end is the image of the centre that is nearest to the contact.
    ends = [place + nearest_image(frame.centres[one] - place, frame.box[1], frame.tilt) for one in (first, second)]
    order = np.argsort(force, kind="stable")
    lines, force = np.stack(ends, axis=1)[order], force[order]
    drawn = plotting.ForceLines(figure, ax, force, r"contact force  $|f|$  [$\epsilon/\sigma_{avg}$]")
    scale = draw_background(ax, run, frame)
    for shift in images(frame):
        seen = in_view(lines + shift, frame).any(axis=1)
        drawn.draw(ax, lines[seen] + shift, scale, seen)
    return ""


def draw_mode(figure, ax, run, frame, number):
    """Arrows along the displacements of a mode, the longest as long as a particle or two. Returns its frequency as a text."""
    stored = frame.modes.shape[1]
    if not 1 <= number <= stored:
        raise RunError(f"{run.path}: mode {number}, but frames have the modes 1 to {stored}: give another --mode, or run pack "
                       "with more -modes (frames have up to 20)")
    draw_background(ax, run, frame)
    moved = frame.modes[:, number - 1]
    size = np.linalg.norm(moved, axis=1)
    if not size.max() > 0:
        raise RunError(f"{run.path}: packing {frame.time:g} has no mode {number}: take another --frame or --mode")
    longest = 0.7 if run.topology.deformable else 1.5  # in mean diameters
    arrows = ax.quiver(*frame.positions.T, *(longest * moved / size.max()).T, size / size.max(), cmap="viridis_r", clim=(0, 1),
                       angles="xy", scale_units="xy", scale=1, width=0.0035, zorder=3)
    figure.colorbar(arrows, ax=ax, aspect=30, pad=0.02, fraction=0.05, label="displacement / largest").outline.set_linewidth(0.6)
    row = np.argmin(np.abs(run.series["time"].to_numpy() - frame.time))
    omega = run.vector_series["frequencies"][row, number - 1]
    return rf",  mode {number}: $\omega = {omega:.3g}$"


def main():
    parser = script.parser(__doc__, "packing.py runs/packing --mode 3 -o mode.png", "packing.png")
    parser.add_argument("run", help="folder of a 2D run of pack or shear")
    parser.add_argument("--frame", type=int, default=-1, help="frame number, negative from the end (default: -1)")
    parser.add_argument("--mode", type=int, help="draw this mode, 1 is the lowest (needs -modes), instead of the forces")
    arguments = script.arguments(parser)
    run = of_scenario(Run(arguments.run), "pack", "shear")
    if run.dim != 2:
        raise RunError(f"{run.path}: a packing in 3D; this script draws packings in the plane (snapshot.py draws a cut)")
    frame = run.frame(arguments.frame)
    (x, y), (width, height) = frame.box
    figure, (ax,) = plotting.panel_figure([run], [(x - MARGIN, x + width + MARGIN, y - MARGIN, y + height + MARGIN)], height=5.2)
    title = f"{plotting.model_name(run)},  {plotting.time_label(run, frame)}"
    ax.set_title(title)  # before the particles, whose outlines need the final layout
    more = draw_forces(figure, ax, run, frame) if arguments.mode is None else draw_mode(figure, ax, run, frame, arguments.mode)
    ax.set_title(title + more)
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
