#!/usr/bin/python3
"""Draws one frame of a run, or of several runs side by side."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

from pliant import RunError, load_runs
from pliant import plotting, script
from pliant.plotting import QUANTITIES


def main():
    parser = script.parser(__doc__, "snapshot.py runs/soft runs/rough runs/smooth --panels --color speed -o models.png",
                           "snapshot.png")
    parser.add_argument("run", nargs="+", help="run folder; several with --panels")
    parser.add_argument("--panels", action="store_true", help="draw several runs side by side")
    parser.add_argument("--frame", type=int, default=-1, help="frame number, negative from the end (default: -1)")
    parser.add_argument("--color", choices=QUANTITIES, help="quantity shown by the colour (default: speed; packings: contacts)")
    parser.add_argument("--max-height", type=float, help="cut the view at this height, in the unit of the axis")
    arguments = script.arguments(parser)
    runs = load_runs(arguments.run)
    if len(runs) > 1 and not arguments.panels:
        raise RunError(f"{len(runs)} runs given (add --panels to draw them side by side)")
    if len({plotting.length_unit(run) for run in runs}) > 1:
        raise RunError("hoppers, droplets and channels have different units: draw them in separate pictures")

    color = arguments.color or plotting.usual_quantity(runs[0])
    frames = [run.frame(arguments.frame) for run in runs]
    boxes = [plotting.view(run, [frame]) for run, frame in zip(runs, frames)]
    if arguments.max_height is not None:
        boxes = [(*box[:3], max(min(box[3], arguments.max_height), box[2] + 1)) for box in boxes]
    values = [plotting.particle_values(run, frame, color) for run, frame in zip(runs, frames)]
    cmap, norm, extend = plotting.color_scale(color, [v[f.active] for v, f in zip(values, frames)])

    figure, axes = plotting.panel_figure(runs, boxes)
    labels = plotting.run_labels(runs) if len(runs) > 1 else [plotting.model_name(runs[0])]
    for ax, run, frame, label in zip(axes, runs, frames, labels):
        ax.set_title((f"{label}\n" if len(runs) > 1 else f"{label},  ") + plotting.time_label(run, frame))
        plotting.draw_walls(ax, run, frame)
    plotting.add_color_bar(figure, list(axes), runs[0], color, cmap, norm, extend)
    for ax, run, frame, value in zip(axes, runs, frames, values):
        plotting.draw_particles(ax, run, frame, cmap(norm(value)))
    plotting.save(figure, arguments.output)


if __name__ == "__main__":
    script.run(main)
