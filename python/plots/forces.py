#!/usr/bin/python3
"""The network of contact forces in one frame: lines between the centres of touching particles."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import numpy as np

from pliant import Run, RunError
from pliant import plotting, script
from pliant.scenarios import of_scenario
from pliant.scene import network


def pair_forces(run, frame):
    """Lines [F, 2, 2] in the plane of view and magnitudes [F] of the non-zero forces of scene.network, weak forces first. A line
    to a wall ends at the contact."""
    axes = "xyz"[: run.dim]
    total = network(run, frame)
    first, second = total["particle_1"].to_numpy(int), total["particle_2"].to_numpy(int)
    contact = total[list(axes)].to_numpy()
    force = np.linalg.norm(total[[f"f{a}" for a in axes]].to_numpy(), axis=1)
    ends = [np.where((index < 0)[:, None], contact, frame.centres[index]) for index in (first, second)]
    lines = np.stack([ends[0], ends[0] + run.geometry.nearest_image(ends[1] - ends[0])], axis=1)
    if run.dim == 3:  # a slice of one diameter to either side of the axis
        inside = (np.abs(lines[:, :, 1]) < 1).all(axis=1)
        lines, force = lines[inside], force[inside]
    order = np.argsort(force, kind="stable")  # strong forces on top
    order = order[force[order] > 0]
    return lines[order][:, :, [0, -1]], force[order]


def main():
    parser = script.parser(__doc__, "forces.py runs/hopper --frame -1 -o forces.png", "forces.png")
    parser.add_argument("run", help="run folder")
    parser.add_argument("--frame", type=int, default=-1, help="frame number, negative from the end (default: -1)")
    parser.add_argument("--max-height", type=float, help="cut the view at this height, in sigma_avg")
    arguments = script.arguments(parser)
    run = of_scenario(Run(arguments.run), "hopper")
    frame = run.frame(arguments.frame)
    lines, force = pair_forces(run, frame)
    if not len(force):
        raise RunError(f"{run.path}: no forces between particles at t = {frame.time:g} t0 (another --frame?)")

    box = plotting.view(run, [frame])
    if arguments.max_height is not None:
        box = (*box[:3], max(min(box[3], arguments.max_height), box[2] + 1))
    figure, (ax,) = plotting.panel_figure([run], [box])
    ax.set_title(f"{plotting.model_name(run)},  {plotting.time_label(run, frame)}")
    plotting.draw_walls(ax, run, frame)
    drawn = plotting.ForceLines(figure, ax, force, rf"contact force  $|f|$  [$\rho g\sigma_{{avg}}^{run.dim}$]")
    _, scale = plotting.draw_particles(ax, run, frame, plotting.PALE, edge_shade=0.9)
    drawn.draw(ax, lines, scale)
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
