#!/usr/bin/python3
"""Makes an mp4 movie of the frames of a run; needs ffmpeg."""

import sys
from pathlib import Path

# In place of this folder, whose profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first: it says what this Python lacks

import subprocess

import numpy as np
from matplotlib.animation import FFMpegWriter

from pliant import OutputError, Run, RunError
from pliant import plotting, script
from pliant.plotting import QUANTITIES


def main():
    parser = script.parser(__doc__, "movie.py runs/hopper --fps 25 --color speed -o hopper.mp4", "movie.mp4")
    parser.add_argument("run", help="run folder")
    parser.add_argument("--fps", type=float, default=25, help="frames per second (default: 25)")
    parser.add_argument("--every", type=int, default=1, help="use every n-th frame (default: 1)")
    parser.add_argument("--color", choices=QUANTITIES, default="speed", help="what the colour shows (default: speed)")
    parser.add_argument("--dpi", type=float, default=130, help="resolution (default: 130)")
    arguments = script.arguments(parser)
    for name in ("fps", "every", "dpi"):
        if not getattr(arguments, name) > 0:
            raise RunError(f"--{name} is {getattr(arguments, name)}: it must be positive")
    if not FFMpegWriter.isAvailable():
        raise OutputError("ffmpeg is not installed (Debian: apt install ffmpeg); "
                          "without it snapshot.py draws single frames")
    run = Run(arguments.run)
    frames = run.frames[:: arguments.every]
    if not frames:
        run.frame(0)  # says why there are none

    # One scale and one view for the whole movie, from a dozen frames spread over it.
    sample = frames[:: max(len(frames) // 12, 1)] + [frames[-1]]
    cmap, norm, extend = plotting.color_scale(
        arguments.color, [plotting.particle_values(run, f, arguments.color)[f.active] for f in sample])
    box = plotting.view(run, sample)
    figure, (ax,) = plotting.panel_figure([run], [box])
    plotting.draw_walls(ax, run)
    plotting.add_color_bar(figure, ax, arguments.color, cmap, norm, extend)
    title = ax.set_title("t")
    figure.set_dpi(arguments.dpi)
    # yuv420p wants even numbers of pixels; half a pixel more is safe against rounding down.
    figure.set_size_inches([(2 * np.ceil(size * arguments.dpi / 2) + 0.5) / arguments.dpi
                            for size in figure.get_size_inches()])
    artist, scale = plotting.draw_particles(ax, run, frames[0], cmap(norm(
        plotting.particle_values(run, frames[0], arguments.color))))
    figure.set_layout_engine("none")  # the layout stays as it is: nothing may jump between frames

    writer = FFMpegWriter(fps=arguments.fps, codec="libx264",
                          extra_args=["-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart"])
    try:
        with writer.saving(figure, str(arguments.output), arguments.dpi):
            for i, frame in enumerate(frames):
                artist.remove()
                colors = cmap(norm(plotting.particle_values(run, frame, arguments.color)))
                artist, _ = plotting.draw_particles(ax, run, frame, colors, scale=scale)
                title.set_text(f"{plotting.MODEL_NAMES.get(run.model, run.model)},  $t = {frame.time:.2f}\\ t_0$")
                writer.grab_frame()
                if sys.stderr.isatty() or i + 1 == len(frames):
                    print(f"\rframe {i + 1} of {len(frames)}", end="", file=sys.stderr, flush=True)
            print(file=sys.stderr)
    except (OSError, subprocess.CalledProcessError) as error:
        raise OutputError(f"{arguments.output}: ffmpeg could not write it ({str(error).splitlines()[0]})") from None
    print(f"wrote {arguments.output}")


if __name__ == "__main__":
    script.run(main)
