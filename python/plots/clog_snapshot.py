#!/usr/bin/python3
"""Draws the end of a run of the scenario clog: the arch red, droplets that only cohesion holds yellow, the rest blue."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import numpy as np

from pliant import Run, RunError
from pliant import plotting, script
from pliant.scenarios import of_scenario

COLORS = {"arch": "#D55E00", "attached": "#F0E442", "rest": "#0072B2"}  # [T Fig. 4.1a]


def colors(run):
    """[N] colour of each droplet at the end of the run."""
    if "arch" not in run.summary:
        raise RunError(f"{run.path}: no arch in its summary.json (it has not ended: raft_snapshot.py draws its frames)")
    result = np.full(run.topology.particles, "none", dtype=object)
    for name, color in COLORS.items():
        result[run.summary[name]] = color
    return list(result)


def main():
    parser = script.parser(__doc__, "clog_snapshot.py runs/clog -o clog.png", "clog_snapshot.png")
    parser.add_argument("run", help="run folder")
    arguments = script.arguments(parser)
    run = of_scenario(Run(arguments.run), "clog")
    painted = colors(run)
    frame = run.frame(-1)
    figure, axes = plotting.panel_figure([run], [plotting.view(run, [frame])], height=5.2)
    axes[0].set_title(f"$w/d$ = {run.parameters['hopper_width']:g},  {run.summary.get('status', '')} after "
                      f"{run.measured('avalanche_size')[0]:g} droplets")
    plotting.draw_walls(axes[0], run, frame)
    for name, color in COLORS.items():
        axes[0].plot([], [], "o", color=color, label={"rest": "the rest"}.get(name, name))
    axes[0].legend(loc="lower right")
    plotting.draw_particles(axes[0], run, frame, painted)
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
